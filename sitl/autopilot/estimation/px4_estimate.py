"""Builds PX4's estimator status flags, as Ekf::get_ekf_soln_status() does."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.firmware import EstimatorHealth

SETTLED: int = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_VERT_ABS
    | mavlink.ESTIMATOR_POS_VERT_AGL
)
POSITION: int = mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_POS_HORIZ_REL
"""Flags of a position; they are set together."""
AT_REST: int = mavlink.ESTIMATOR_CONST_POS_MODE
"""Since 1.16 this bit also means that the vehicle is at rest, whatever its position accuracy."""


def estimator_flags(health: EstimatorHealth) -> int:
    """ESTIMATOR_STATUS_FLAGS."""
    flags = SETTLED if health.settled else 0
    if health.is_at_rest:
        flags |= AT_REST
    if not health.has_position:
        return flags
    sources = health.sources
    seen = sources.outside_position or sources.outside_velocity
    if seen or not health.is_at_rest:  # flow is not fused on the ground, only expected
        flags |= mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    if health.has_origin:
        flags |= mavlink.ESTIMATOR_POS_HORIZ_ABS
    return flags | POSITION
