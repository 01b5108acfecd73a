"""Runs the SLAM programs of MRPT on a rawlog, as a user would: Debian's `mrpt-apps`.

`rbpf-slam` is a Rao-Blackwellized particle filter over occupancy grids, the algorithm of GMapping
(Grisetti 2007). `icp-slam` matches each scan with a point map. Settings that depend on the scene
are chosen for rooms of some metres; all others are MRPT's own defaults.
"""

import os
import shutil
import subprocess
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.core.arrays import Array

PROGRAMS = "rbpf-slam", "icp-slam"
LIMIT_S = 1800.0
"""Time after which a program is given up, s."""
COMMON = """
[MappingApplication]
rawlog_offset = 0
logOutput_dir = {out}
LOG_FREQUENCY = 100000
SAVE_3D_SCENE = false
SAVE_MAP_IMAGES = false
SAVE_POSE_LOG = false
CAMERA_3DSCENE_FOLLOWS_ROBOT = false
SHOW_PROGRESS_IN_WINDOW = false
SHOW_PROGRESS_3D_REAL_TIME = false
RANDOM_SEED = 1
insertionLinDistance = 0.3
gasGrid_count = 0
landmarksMap_count = 0
beaconMap_count = 0
likelihoodMapSelection = -1
"""
RBPF = (
    COMMON
    + """
insertionAngDistance_deg = 10
localizeLinDistance = 0.1
localizeAngDistance_deg = 5
PF_algorithm = 2
adaptiveSampleSize = 0
sampleSize = 30
resamplingMethod = 0
BETA = 0.5
occupancyGrid_count = 1
pointsMap_count = 0
pfOptimalProposal_mapSelection = 0
ICP_algorithm = 0
maxIterations = 60
thresholdDist = 0.4
thresholdAng_DEG = 5
ALFA = 0.5
smallestThresholdDist = 0.05
onlyClosestCorrespondences = 1
[MappingApplication_occupancyGrid_00_creationOpts]
resolution = 0.05
[MappingApplication_occupancyGrid_00_insertOpts]
maxDistanceInsertion = 12
considerInvalidRangesAsFreeSpace = 0
maxOccupancyUpdateCertainty = 0.6
[MappingApplication_occupancyGrid_00_likelihoodOpts]
likelihoodMethod = 4
LF_decimation = 5
LF_stdHit = 0.2
LF_maxCorrsDistance = 0.3
LF_zHit = 0.999
LF_zRandom = 0.001
LF_maxRange = 12
LF_alternateAverageMethod = 0
"""
)
"""30 particles and a grid of 5 cm are GMapping's own defaults."""
ICP = (
    COMMON
    + """
insertionAngDistance = 10
localizationLinDistance = 0.1
localizationAngDistance = 5
minICPgoodnessToAccept = 0.4
matchAgainstTheGrid = 0
occupancyGrid_count = 0
pointsMap_count = 1
[MappingApplication_pointsMap_00_insertOpts]
minDistBetweenLaserPoints = 0.05
fuseWithExisting = false
isPlanarMap = 1
[ICP]
maxIterations = 80
minAbsStep_trans = 1e-6
minAbsStep_rot = 1e-6
thresholdDist = 0.3
thresholdAng_DEG = 5
ALFA = 0.8
smallestThresholdDist = 0.05
onlyClosestCorrespondences = true
onlyUniqueRobust = false
ICP_algorithm = icpClassic
corresponding_points_decimation = 1
"""
)


@dataclass(frozen=True, slots=True)
class Program:
    """A program with its settings."""

    title: str
    name: str
    settings: str


SPARSE = {
    "PF_algorithm = 2": "PF_algorithm = 0",
    "sampleSize = 30": "sampleSize = 100",
    "localizeLinDistance = 0.1": "localizeLinDistance = 0.05",
    "localizeAngDistance_deg = 5": "localizeAngDistance_deg = 3",
}
"""Settings for scans that cannot be matched: particles are drawn by odometry alone, more of them,
and weighted more often. With four beams this gave a quarter of the error of scan matching."""


def _sparse(settings: str) -> str:
    for usual, other in SPARSE.items():
        settings = settings.replace(usual, other)
    return settings


RBPF_SLAM = Program("MRPT rbpf-slam", "rbpf-slam", RBPF)
RBPF_BY_ODOMETRY = Program("MRPT rbpf-slam, no scan matching", "rbpf-slam", _sparse(RBPF))
ICP_SLAM = Program("MRPT icp-slam", "icp-slam", ICP)


@dataclass(frozen=True, slots=True)
class Estimated:
    """What a program made of a flight."""

    poses: Array
    """(k, 3): north, east, yaw at each keyframe, in the take-off frame."""
    cpu_s: float
    memory_mb: float


class PeerError(Exception):
    """A program is missing, or ended without a path; the message says which and why."""


def missing() -> str:
    """The remedy if a program is missing; empty if all are there."""
    lacking = [name for name in PROGRAMS if shutil.which(name) is None]
    return f"{', '.join(lacking)} missing; on Debian: apt install mrpt-apps" if lacking else ""


def estimated(program: Program, log: Path, keyframes: int) -> Estimated:
    """Run a program on a rawlog of this many scans.

    Raises:
        PeerError: a program failed.
    """
    out = log.with_suffix("." + program.title.replace(" ", "_"))
    config = log.with_name(out.name + ".ini")
    config.write_text(program.settings.format(out=out))
    cpu_s = _run([program.name, str(config), str(log)])
    memory_mb = np.loadtxt(out / "log_MemoryUsage.txt", ndmin=2)[:, 1].max() / 1e6
    path = np.loadtxt(out / "log_estimated_path.txt", ndmin=2)
    poses = path[:, (1, 2, 4 if path.shape[1] > 5 else 3)] * (1, -1, -1)
    if len(poses) != keyframes:
        raise PeerError(f"{program.title}: {len(poses)} poses for {keyframes} scans, in {out}")
    return Estimated(poses, cpu_s, memory_mb)


def _run(command: list[str]) -> float:
    """Processor time of a command, s."""
    with tempfile.TemporaryFile("w+") as output:
        started = subprocess.Popen(command, stdout=output, stderr=output)
        limit = threading.Timer(LIMIT_S, started.kill)
        limit.start()
        _, status, used = os.wait4(started.pid, 0)
        limit.cancel()
        started.returncode = os.waitstatus_to_exitcode(status)
        if started.returncode:
            output.seek(0)
            told = " ".join(output.read().split())[-200:]
            raise PeerError(f"{command[0]}: exit status {started.returncode}: {told}")
    return used.ru_utime + used.ru_stime
