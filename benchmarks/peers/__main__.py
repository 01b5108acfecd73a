"""Compares our maps with those of other SLAM programs, from the same simulated flights.

`python -m benchmarks.peers --out DIR [--seeds N]`, ten minutes for each seed on one core. For each
flight it also draws the maps side by side, as figure 15 of the paper does.

Each flight is given to the programs twice: with the scans of a LIDAR of 360 beams, and with our
level beams. All paths are scored by the same code:

    ATE        trajectory error after rigid alignment, RMSE, cm
    map error  scans without noise, up to 5 m, placed at the estimated poses and aligned: mean
               distance to the true walls, cm. So it contains the error of the path alone.
"""

import argparse
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import mean

import numpy as np

from benchmarks.measured import in_own_process
from benchmarks.peers import kiss, mrpt, rawlog
from benchmarks.peers.flight import LIDAR_BEAMS, LIDAR_MAX_M, PeerFlight, companion_mb, fly
from benchmarks.peers.mrpt import Estimated, PeerError
from benchmarks.peers.pictures import map_pictures
from companion.core.arrays import Array
from companion.core.frames import wrap_rad
from companion.core.messages import FloorPlan, Pose
from companion.export.map_files import save_as
from sitl.scoring.score import align, score_trajectory, to_world
from sitl.world.geometry.nearest import NearestWall

WORLDS = {"room_100": "room", "two_room_300": "building", "random_3": "building"}
"""Worlds, and the mission in each."""
EVERY, MAP_RANGE_M = 5, 5.0
"""Every nth scan is scored, up to this range, m: that of the paper's sensors."""


@dataclass(frozen=True, slots=True)
class Scored:
    """The scores of one method in one flight."""

    method: str
    sensors: str
    ate_cm: float
    map_cm: float
    cpu_s: float
    """Processor time for each second of flight."""
    memory_mb: float
    points_ne_m: Array
    """(n, 2): ends of the scored scans, aligned with the world."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for logs and settings")
    parser.add_argument("--seeds", type=int, default=1, help="flights of each world; default 1")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for why in filter(None, (mrpt.missing(), kiss.missing())):
        print(why)
    scores: dict[str, list[Scored]] = {}
    for world, mission in WORLDS.items():
        for seed in range(1, given.seeds + 1):
            began_s = time.monotonic()
            flight = fly(world, seed, mission)
            own_mb = in_own_process(companion_mb, world, seed, mission)
            folder = given.out / f"{world}_{seed}"
            folder.mkdir(exist_ok=True)
            those = list(scored_methods(flight, own_mb, folder))
            save_as(partial(_draw, flight, f"{world}, seed {seed}"), those, folder / "maps.png")
            scores.setdefault(world, []).extend(those)
            print(f"{world} {seed}: {time.monotonic() - began_s:.0f} s", flush=True)
    print(table(scores))


def _draw(flight: PeerFlight, title: str, those: list[Scored], path: Path) -> None:
    panels = [
        (f"{each.method}\n{each.sensors}, {each.map_cm:.1f} cm", each.points_ne_m) for each in those
    ]
    map_pictures(flight.surfaces, panels, title, path)


def scored_methods(flight: PeerFlight, own_mb: float, folder: Path) -> Iterator[Scored]:
    """All methods on one flight; `own_mb`: memory of the companion, MB."""
    yield scored(flight, "odometry and gyro", "none", Estimated(_poses(flight.odometry), 0.0, 0.0))
    yield scored(flight, "ideal solver", "our beams", Estimated(_poses(flight.ideal), 0.0, 0.0))
    own = Estimated(_poses(flight.plan), flight.cpu_s, own_mb)
    yield scored(flight, "this project", "our beams", own)
    odometry = _poses(flight.odometry)
    lidar, beams = folder / "lidar.rawlog", folder / "beams.rawlog"
    rawlog.write_lidar(lidar, flight.times_s, odometry, flight.lidar_m, LIDAR_MAX_M)
    most_m = float(flight.recorded.models.ranges.max_m.max())
    rawlog.write_beams(beams, flight.times_s, odometry, flight.beams_m, most_m)
    keyframes = len(flight.times_s)
    for sensors, log, programs in (
        ("LIDAR", lidar, (mrpt.RBPF_SLAM, mrpt.ICP_SLAM)),
        ("our beams", beams, (mrpt.RBPF_SLAM, mrpt.RBPF_BY_ODOMETRY, mrpt.ICP_SLAM)),
    ):
        for program in programs if not mrpt.missing() else ():
            run = partial(mrpt.estimated, program, log, keyframes)
            yield from _tried(flight, program.title, sensors, run)
    if not kiss.missing():
        yield from _tried(flight, "KISS-ICP", "LIDAR", partial(kiss.estimated, flight.lidar_m))


def _tried(
    flight: PeerFlight, method: str, sensors: str, run: Callable[[], Estimated]
) -> Iterator[Scored]:
    try:
        yield scored(flight, method, sensors, run())
    except PeerError as error:
        print(f"{flight.world} {flight.seed}, {sensors}: {error}", flush=True)


def _poses(plan: FloorPlan) -> Array:
    return np.array([(pose.north_m, pose.east_m, pose.yaw_rad) for pose in plan.path])


def scored(flight: PeerFlight, method: str, sensors: str, made: Estimated) -> Scored:
    """Score the poses that a method estimated."""
    path = [
        Pose(time_s, north_m, east_m, 0.0, wrap_rad(yaw_rad))
        for time_s, (north_m, east_m, yaw_rad) in zip(
            flight.times_s.tolist(), made.poses.tolist(), strict=True
        )
    ]
    take_off = flight.truth.take_off
    ate_cm = score_trajectory(path, flight.truth.path, take_off).ate_cm
    walls = NearestWall(np.array(flight.surfaces, dtype=float).reshape(-1, 2, 2))
    points = to_world(placed(flight.clean_m[::EVERY], made.poses[::EVERY]), take_off)
    aligned = align(points, walls)
    error_m, _ = walls.query(aligned)
    map_cm, cpu_s = 100 * float(error_m.mean()), made.cpu_s / flight.air_s
    return Scored(method, sensors, ate_cm, map_cm, cpu_s, made.memory_mb, aligned)


def placed(scans_m: Array, poses: Array) -> Array:
    """(n, 2): ends of the beams of scans (k, 360) at poses (k, 3), up to `MAP_RANGE_M`."""
    bearing_rad = poses[:, 2:] + np.arange(LIDAR_BEAMS) * math.tau / LIDAR_BEAMS
    met = scans_m < MAP_RANGE_M
    ends = poses[:, None, :2] + np.where(met, scans_m, 0.0)[..., None] * np.stack(
        [np.cos(bearing_rad), np.sin(bearing_rad)], axis=-1
    )
    met_ne_m: Array = ends[met]
    return met_ne_m


def table(scores: dict[str, list[Scored]]) -> str:
    """A Markdown table: methods by worlds, means over the seeds."""
    methods = dict.fromkeys(
        (each.method, each.sensors) for those in scores.values() for each in those
    )
    head = "".join(f" {world}: ATE, map, cm |" for world in scores)
    lines = [f"| method | sensors |{head} processor, ms/s | memory, MB |"]
    lines.append("|---|---|" + "---|" * (len(scores) + 2))
    for method in methods:
        of_method = [
            [each for each in those if (each.method, each.sensors) == method]
            for those in scores.values()
        ]
        cells = "".join(f" {_errors(those)} |" for those in of_method)
        everything = [each for those in of_method for each in those]
        cpu_ms, memory_mb = (
            1e3 * mean(each.cpu_s for each in everything),
            max(each.memory_mb for each in everything),
        )
        lines.append(
            f"| {method[0]} | {method[1]} |{cells} {_number(cpu_ms)} | {_number(memory_mb)} |"
        )
    return "\n".join(lines)


def _errors(those: list[Scored]) -> str:
    if not those:
        return "no path"
    return ", ".join(
        f"{mean(values):.1f}"
        for values in ([each.ate_cm for each in those], [each.map_cm for each in those])
    )


def _number(value: float) -> str:
    return f"{value:.0f}" if value > 0 else "–"


if __name__ == "__main__":
    main()
