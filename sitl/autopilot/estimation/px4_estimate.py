"""What PX4 tells of its estimator, as Ekf::get_ekf_soln_status() has it."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.firmware import EstimatorHealth

SETTLED: int = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_VERT_ABS
    | mavlink.ESTIMATOR_POS_VERT_AGL
)
POSITION: int = mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_POS_HORIZ_REL
"""Of a position, one does not come without the other."""
AT_REST: int = mavlink.ESTIMATOR_CONST_POS_MODE
"""Since 1.16 that bit also says that the vehicle stands, however good its position is."""


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
