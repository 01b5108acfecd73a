"""Compares velocity steps of the emulated vehicles with those of the real firmwares.

`python -m benchmarks.flight.autopilot_response` prints the table of docs/autopilot.md. The real
steps are recorded: ArduCopter 4.6.3 in its SITL, means of six steps; PX4 1.17.0-beta1 in SIH, means
of two to four. They are estimated velocities on the autopilot's clock.
"""

from sitl.autopilot.core import FIRMWARES
from sitl.autopilot.response import Shaper
from sitl.core.vehicle import Loop

Shares = dict[float, float]
MEASURED: dict[tuple[str, str, float], tuple[Shares, Shares]] = {
    ("ardupilot", "horizontal", 0.8): (
        {0.25: 0.09, 0.5: 0.43, 1.0: 0.88, 1.5: 0.95},
        {0.5: 0.63, 1.0: 0.17, 2.0: 0.08},
    ),
    ("ardupilot", "horizontal", 0.5): (
        {0.25: 0.12, 0.5: 0.49, 1.0: 0.90, 1.5: 0.94},
        {0.5: 0.54, 1.0: 0.13, 2.0: 0.07},
    ),
    ("ardupilot", "horizontal", 0.3): (
        {0.25: 0.19, 0.5: 0.57, 1.0: 0.94, 1.5: 0.97},
        {0.5: 0.50, 1.0: 0.13, 2.0: 0.08},
    ),
    ("ardupilot", "vertical", 0.4): (
        {0.25: 0.21, 0.5: 0.72, 1.0: 1.08, 1.5: 1.05},
        {0.5: 0.28, 1.0: -0.08, 2.0: -0.01},
    ),
    ("ardupilot", "yaw", 0.785): (
        {0.25: 0.39, 0.5: 1.09, 1.0: 1.09, 2.0: 1.01},
        {0.25: 0.63, 0.5: -0.09},
    ),
    ("px4", "horizontal", 0.8): (
        {0.25: 0.08, 0.5: 0.37, 1.0: 0.61, 2.0: 0.78},
        {0.5: 0.45, 1.0: 0.18, 2.0: 0.09},
    ),
    ("px4", "horizontal", 0.5): (
        {0.25: 0.06, 0.5: 0.35, 1.0: 0.59, 2.0: 0.72},
        {0.5: 0.45, 1.0: 0.18, 2.0: 0.08},
    ),
    ("px4", "yaw", 0.5): (
        {0.25: 0.26, 0.5: 0.68, 1.0: 0.89, 2.0: 0.95},
        {0.25: 0.65, 0.5: 0.28, 1.0: 0.07},
    ),
}
"""Share reached, by time after the step and after its end, s; by firmware, axis and size (m/s,
rad/s)."""
HOLD_S, AFTER_S = 4, 3


def emulated(kind: str, axis: str, size: float) -> list[float]:
    """Share of a step every 10 ms: `HOLD_S` of it, then `AFTER_S` of zero."""
    response = FIRMWARES[kind]().response
    shaper = Shaper(getattr(response, axis))
    loop = Loop(getattr(response.airframe, axis))
    asked = [size] * (100 * HOLD_S) + [0.0] * (100 * AFTER_S)
    return [loop.step(shaper.step(value)) / size for value in asked]


def compared(kind: str, axis: str, size: float) -> list[tuple[str, float, float]]:
    """(time, real, emulated) of one step."""
    share = emulated(kind, axis, size)
    rises, falls = MEASURED[kind, axis, size]
    rows = [(f"{s:g} s", real, share[round(100 * s) - 1]) for s, real in rises.items()]
    end = 100 * HOLD_S
    rows += [(f"stop +{s:g} s", real, share[end + round(100 * s) - 1]) for s, real in falls.items()]
    return rows


def main() -> None:
    print("| firmware, axis, step | real / emulated share, after the step and after its end |")
    print("|---|---|")
    for kind, axis, size in MEASURED:
        cells = ", ".join(f"{when} {a:.2f}/{b:.2f}" for when, a, b in compared(kind, axis, size))
        print(f"| {kind}, {axis}, {size:g} | {cells} |")


if __name__ == "__main__":
    main()
