"""A simulated flight as data for any SLAM program: odometry, a LIDAR's scans, and our beams.

All are given at the keyframes of the companion's record, every 0.2 s. The LIDAR's scans are taken
at one instant; those of a real one are distorted by motion.
"""

import math
import tempfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from benchmarks.measured import peak_of_children_mb
from companion.config import settings as configuration
from companion.core.arrays import Array
from companion.core.messages import FloorPlan
from companion.estimation.smoothing.flight_record import FrameColumn, HitColumn
from companion.estimation.smoothing.range_noise import BEAMS
from sitl.bench.accuracy import TimedApp
from sitl.bench.references import (
    Recorded,
    TruePoses,
    dead_reckoned,
    ideal,
    range_m,
    to_local,
)
from sitl.campaign.flight import CampaignFlight
from sitl.running.processes import fly_in_two_processes
from sitl.simulation.lockstep import fly_in_lockstep
from sitl.simulation.record import TruthRecord
from sitl.simulation.simulation import Setup
from sitl.world.format import Segment
from sitl.world.loading import load_world
from sitl.world.plan import wall_surfaces

LIDAR_BEAMS, LIDAR_MAX_M, LIDAR_SIGMA_M = 360, 12.0, 0.01
"""Beams, range, m, and sigma of a LIDAR. Chosen: the range of common small ones; the noise does not
grow with the distance, which favours the others."""


@dataclass(frozen=True)
class PeerFlight:
    """One flight: its data for others, its truth, and our own result."""

    world: str
    seed: int
    surfaces: tuple[Segment, ...]
    truth: TruthRecord
    recorded: Recorded
    plan: FloorPlan
    """Our own map and path."""
    cpu_s: float
    """Processor time of the companion in flight, s, without the map after landing."""
    times_s: Array
    """(k,)."""
    lidar_m: Array
    """(k, 360): ranges, clockwise from the nose; infinite without an obstacle in range."""
    clean_m: Array
    """(k, 360): the same without noise."""

    @property
    def air_s(self) -> float:
        """Time from the first keyframe to the last, s."""
        return float(self.times_s[-1] - self.times_s[0])

    @cached_property
    def odometry(self) -> FloorPlan:
        """Walls and path by odometry and gyro alone."""
        return dead_reckoned(self.recorded, self.plan)

    @cached_property
    def ideal(self) -> FloorPlan:
        """Walls and path of the ideal solver."""
        return ideal(self.recorded, self.truth, self.surfaces)

    @cached_property
    def beams_m(self) -> Array:
        """(k, b): last range of each level beam, from the drone's centre; infinite without one."""
        hits, units = self.recorded.record.hits, self.recorded.models.ranges
        beams_m = np.full((len(self.times_s), len(BEAMS)), np.inf)
        beam, frame = hits[:, HitColumn.BEAM].astype(int), hits[:, HitColumn.FRAME].astype(int)
        beams_m[frame, beam] = hits[:, HitColumn.DISTANCE_M] + units.offset_m[beam]
        return beams_m


def fly(world: str, seed: int, mission: str) -> PeerFlight:
    """Fly one mission with the reference noise."""
    settings = configuration.load(None, {"mission.kind": mission})
    setup = Setup(load_world(world), world, seed, settings.sensors)
    apps: list[TimedApp] = []

    def make_app(config: configuration.Config) -> TimedApp:
        apps.append(TimedApp(config))
        return apps[0]

    app, simulation = fly_in_lockstep(setup, settings, lambda _: None, make_app=make_app)
    assert app.estimator is not None
    plan = app.final_floor_plan()
    record = app.estimator.record
    times_s = record.frames[:, FrameColumn.TIME_S].copy()
    surfaces = tuple(wall_surfaces(setup.world, settings.mission.height_m))
    poses = TruePoses.at(simulation.record, times_s).poses
    local = to_local(np.array(surfaces).reshape(-1, 2), simulation.record).reshape(-1, 2, 2)
    clean_m = scans(local, poses)
    noise_m = np.random.default_rng(seed).normal(0.0, LIDAR_SIGMA_M, clean_m.shape)
    return PeerFlight(
        world,
        seed,
        surfaces,
        simulation.record,
        Recorded(record, app.estimator.models),
        plan,
        sum(apps[0].update_s),
        times_s,
        clean_m + noise_m,
        clean_m,
    )


def companion_mb(world: str, seed: int, mission: str) -> float:
    """Peak memory of the companion in such a flight and its map, MB; call it in a new process.

    The companion is the larger one of the flight's two processes.
    """
    job = CampaignFlight({"world": world, "seed": seed, "mission": mission}).job()
    _, settings, _ = job.prepared()
    with tempfile.TemporaryDirectory() as folder:
        arguments = [*job.options.arguments(), "--speed=1000"]
        fly_in_two_processes(arguments, settings, Path(folder), quiet=True)
    return peak_of_children_mb()


def scans(surfaces: Array, poses: Array) -> Array:
    """(k, 360): true ranges of the LIDAR at poses (k, 3); infinite without an obstacle in range.

    The surfaces (s, 2, 2) and the poses are in one frame.
    """
    around_rad = np.arange(LIDAR_BEAMS) * math.tau / LIDAR_BEAMS
    bearing_rad = (poses[:, 2:] + around_rad).ravel()
    beams = np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad)])
    eyes = np.repeat(poses[:, :2], LIDAR_BEAMS, axis=0)
    nearest_m = np.full(len(beams), np.inf)
    for start, end in surfaces:
        normal = np.array([start[1] - end[1], end[0] - start[0]]) / math.dist(start, end)
        for side in (normal, -normal):
            nearest_m = np.minimum(nearest_m, range_m(eyes, beams, (start, end), side))
    nearest_m[nearest_m > LIDAR_MAX_M] = np.inf
    return nearest_m.reshape(len(poses), LIDAR_BEAMS)
