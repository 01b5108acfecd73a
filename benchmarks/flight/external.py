"""Scores flights with a real autopilot.

Command: `python -m benchmarks.flight.external WORLD:SEED:FOLDER ...`.

A FOLDER has `truth.json` of `sitl run --truth` and, in `out`, the files of `companion fly`
(docs/external.md). Prints the rows of docs/external.md. For docs/autopilot.md it also prints how
far the reported motion agrees with the true one, and how far LAND moves the drone.
"""

import argparse
import math
from pathlib import Path

import numpy as np

from companion.core.arrays import Array
from companion.recording.reader import Recording, read
from sitl.commands.score import scored
from sitl.running.options import Autopilot, FlightOptions
from sitl.simulation.record import TruthRecord

PROFILE = "gp2y0a710k0f"
LAGS_S = (0.2, 1.0, 3.0, 8.0, 20.0)
"""Time intervals over which displacements are compared, s."""
STEP_S = 0.05
MAX_LATE_S = 0.3
"""Largest latency searched, s."""
LATE_OVER_S = 1.0
"""Time interval of the displacements from which the latency is estimated, s."""


def row(world: str, seed: int, folder: Path) -> str:
    options = FlightOptions(world, seed, PROFILE, Autopilot.ARDUPILOT.value)
    report = scored(options, folder / "out" / "map.json", folder / "truth.json")
    percent = round(100 * float(report["coverage"] or 0))
    return (
        f"| {world}, {seed} | {report['flight_time_s']:.0f} s "
        f"| {report['wall_error_aligned_cm']:.1f} cm | {percent} % "
        f"| {report['ate_cm']:.1f} cm | {report['clearance_m']:.2f} m "
        f"| {report['return_m']:.2f} m | collisions: {report['collisions']}"
    )


def _displacements(
    times_s: Array, states: tuple[Array, Array, Array], lag_s: float, late_s: float = 0.0
) -> Array:
    """(n, 2): displacement over the lag in the body frame; `states` are times, places, yaws."""
    at_s, places_m, yaws_rad = states
    begin, end = (
        np.column_stack([np.interp(times_s + by_s, at_s, axis) for axis in places_m.T])
        for by_s in (late_s, late_s + lag_s)
    )
    yaw_rad = np.interp(times_s, at_s, yaws_rad)
    turned = ((end - begin) @ [1, 1j]) * np.exp(-1j * yaw_rad)
    return np.column_stack([turned.real, turned.imag])


def reported_on_true(recording: Recording, truth: TruthRecord) -> str:
    """Latency of the reported motion, its error, and its scale over several lags."""
    messages = [t.inputs.telemetry.odometry for t in recording.ticks]
    odometry = [o for o in messages if o is not None]
    reported_states = (
        np.array([o.time_s for o in odometry]),
        np.array([o.position_ned_m[:2] for o in odometry]),
        np.unwrap([o.yaw_rad for o in odometry]),
    )
    true_states = (
        np.array([s.time_s for s in truth.path]),
        np.array([s.position_ned_m[:2] for s in truth.path]),
        np.unwrap([s.yaw_rad for s in truth.path]),
    )
    moved_m = np.array([o.velocity_ned_m_s[:2] for o in odometry])[:-1]
    moved_m = moved_m * np.diff(reported_states[0])[:, None]
    by_velocity = (
        reported_states[0],
        np.vstack([np.zeros(2), moved_m.cumsum(axis=0)]),
        reported_states[2],
    )
    airborne_s = [s.time_s for s in truth.path if s.position_ned_m[2] < -0.3]
    times_s = np.arange(airborne_s[0], airborne_s[-1] - LAGS_S[-1], STEP_S)

    def compared(
        lag_s: float, late_s: float, states: tuple[Array, Array, Array] = reported_states
    ) -> tuple[float, float]:
        """The scale, and the rms residual, m."""
        true_m = _displacements(times_s, true_states, lag_s)
        reported_m = _displacements(times_s, states, lag_s, late_s)
        scale = float((reported_m * true_m).sum() / (true_m**2).sum())
        return scale, float(np.sqrt(((reported_m - scale * true_m) ** 2).sum(axis=1).mean()))

    late_s = min(np.arange(0, MAX_LATE_S, 0.01), key=lambda s: compared(LATE_OVER_S, s)[1])
    scales = [f"{lag_s:g} s {compared(lag_s, late_s)[0]:.3f}" for lag_s in LAGS_S]
    place_m, velocity_m = (
        compared(LATE_OVER_S, late_s, states)[1] for states in (reported_states, by_velocity)
    )
    over = f"off by {100 * place_m:.1f} cm over {LATE_OVER_S:g} s"
    over += f", by its velocity {100 * velocity_m:.1f} cm"
    return f"reported {late_s:.2f} s late, {over}; reported / true over {', '.join(scales)}"


def landing(recording: Recording, truth: TruthRecord) -> str:
    """Horizontal displacement from the LAND command to the ground, as text."""
    asked_s = [phase.time_s for phase in recording.phases if phase.phase == "LAND"]
    if not asked_s:
        return "not landed by LAND"
    begin = min(truth.path, key=lambda s: abs(s.time_s - asked_s[0])).position_ned_m
    moved_m = math.dist(begin[:2], truth.path[-1].position_ned_m[:2])
    return f"LAND moved it {moved_m:.2f} m sideways from {-begin[2]:.2f} m up"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("flights", nargs="+", metavar="WORLD:SEED:FOLDER")
    for flight in parser.parse_args().flights:
        world, seed, place = flight.split(":", 2)
        folder = Path(place)
        recording = read(max((folder / "out").glob("*.mcap")))
        truth = TruthRecord.load(folder / "truth.json")
        print(row(world, int(seed), folder))
        print(f"  {reported_on_true(recording, truth)}")
        print(f"  {landing(recording, truth)}", flush=True)


if __name__ == "__main__":
    main()
