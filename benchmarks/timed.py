"""A companion that records the processor time of its ticks in the air."""

import numpy as np

from companion.pdps.flight.state import FLYING_PHASES
from companion.safety.health.lateness import TICK_S
from companion.ticks import Inputs, Outputs
from sitl.bench import accuracy


class TimedApp(accuracy.TimedApp):
    """An App that records the processor time of each tick in the air, s."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.took_s: list[float] = []

    def step(self, now_s: float, inputs: Inputs) -> Outputs:
        output = super().step(now_s, inputs)
        if self.flight.phase in FLYING_PHASES:
            self.took_s.append(self.update_s[-1])
        return output

    @property
    def flown_s(self) -> float:
        """Time in the air."""
        return len(self.took_s) * TICK_S

    @property
    def ms_per_s(self) -> float:
        """Processor time for each second in the air, ms."""
        return 1000 * float(np.mean(self.took_s)) / TICK_S

    def tick_ms(self, percent: float) -> float:
        """The quantile of a tick in the air, ms."""
        return 1000 * float(np.percentile(self.took_s, percent))
