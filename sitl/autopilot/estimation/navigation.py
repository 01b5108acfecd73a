"""Combines the estimator with its inputs: the vehicle's sensors and external messages."""

import math
from dataclasses import replace

from sitl.autopilot.estimation.estimator import REFERENCE_NOISE, AutopilotEstimator, OdometryNoise
from sitl.autopilot.estimation.external_messages import ExternalMessages
from sitl.autopilot.firmware import EmulatedFirmware, EstimatorHealth, ParameterValues, Sources
from sitl.core.truth import TrueState

SOURCES_STEPS = 10
"""Steps between two reads of the parameters."""
AT_REST_S = 1.0
"""After this time on the ground the vehicle is at rest, s (PX4, LandDetector.cpp)."""


class Navigation:
    """The estimator with the sources that the parameters select."""

    def __init__(
        self,
        start: TrueState,
        seed: int,
        firmware: EmulatedFirmware,
        parameters: ParameterValues,
        noise: OdometryNoise = REFERENCE_NOISE,
    ) -> None:
        self._is = firmware
        self._parameters = parameters
        self._steps = 0
        self.estimator = AutopilotEstimator(start, seed, noise, firmware.response.estimate)
        self.outside = ExternalMessages(firmware.pose_messages)
        self.sources = firmware.sources(parameters)
        self.origin: tuple[int, int, int] | None = None
        """SET_GPS_GLOBAL_ORIGIN (48): degrees times 1e7, mm."""
        self.time_s = 0.0
        self._flow_lost_s: float | None = None
        self._floor_m = start.position_ned_m[2]
        self._moved_s = -math.inf
        """Time at which the vehicle was last in the air, s."""

    def lose_flow(self, *, lost: bool) -> None:
        """A fault for tests: the floor shows no texture."""
        self._flow_lost_s = self.time_s if lost else None
        self.sources = self._read_sources()

    def restart(self) -> None:
        """Reset as after power-on."""
        self.origin = None
        self.estimator.restart()

    def update(self, truth: TrueState) -> None:
        """Process one step of true motion."""
        if self._steps % SOURCES_STEPS == 0:
            self.sources = self._read_sources()
        self._steps += 1
        self.time_s = truth.time_s
        if truth.position_ned_m[2] < self._floor_m:
            self._moved_s = self.time_s
        self.estimator.update(truth, self.sources, self.outside.take_pose())

    def _read_sources(self) -> Sources:
        sources = self._is.sources(self._parameters)
        return sources if self._flow_lost_s is None else replace(sources, flow=False)

    @property
    def unaided_s(self) -> float:
        """Time without any motion input, s; infinite if there was none."""
        if self.sources.flow:
            return 0.0
        if self.sources.needs_outside:
            return self.outside_age_s
        return 0.0 if self._flow_lost_s is None else self.time_s - self._flow_lost_s

    @property
    def outside_age_s(self) -> float:
        return self.outside.pose_age_s(self.time_s)

    @property
    def has_position(self) -> bool:
        if not self.estimator.has_settled or (self._is.position_needs_origin and not self.origin):
            return False
        if self.sources.flow:
            return True
        return self.sources.needs_outside and self.outside_age_s <= self._is.outside_lost_s

    @property
    def health(self) -> EstimatorHealth:
        return EstimatorHealth(
            self.estimator.has_settled,
            self.has_position,
            self.sources,
            self.outside_age_s,
            is_at_rest=self.time_s - self._moved_s > AT_REST_S,
            has_origin=self.origin is not None,
        )

    @property
    def has_external_pose(self) -> bool:
        """A recent external pose is available; SYS_STATUS calls this vision."""
        return math.isfinite(self.outside_age_s) and self.outside_age_s <= 1.0
