"""Runs KISS-ICP on a LIDAR's scans: `pip install kiss-icp`. It uses no odometry."""

import math
import time
from importlib.util import find_spec

import numpy as np

from benchmarks.peers.mrpt import Estimated
from companion.core.arrays import Array

MAX_RANGE_M, VOXEL_M = 12.0, 0.5
"""Range of the LIDAR, m, and size of its voxels, m. With 0.1, a hundredth of the range as by
default, and with 0.25, its path leaves the room."""


def missing() -> str:
    """The remedy if the package is missing; empty if it is there."""
    return "" if find_spec("kiss_icp") else "kiss-icp is missing: pip install kiss-icp"


def estimated(lidar_m: Array) -> Estimated:
    """The path by scans (k, 360), clockwise from the nose."""
    from kiss_icp.config import KISSConfig  # noqa: PLC0415 - optional
    from kiss_icp.kiss_icp import KissICP  # noqa: PLC0415

    config = KISSConfig()
    config.data.max_range, config.data.min_range, config.data.deskew = MAX_RANGE_M, 0.1, False
    config.mapping.voxel_size = VOXEL_M
    odometry = KissICP(config)
    bearing_rad = np.arange(lidar_m.shape[1]) * math.tau / lidar_m.shape[1]
    unit = np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad), np.zeros(len(bearing_rad))])
    poses, began_s = [], time.process_time()
    for ranges_m in lidar_m:
        met = np.isfinite(ranges_m)
        odometry.register_frame(ranges_m[met, None] * unit[met], np.empty(0))
        pose = odometry.last_pose
        poses.append((pose[0, 3], pose[1, 3], math.atan2(pose[1, 0], pose[0, 0])))
    cpu_s = time.process_time() - began_s
    return Estimated(np.array(poses), cpu_s, math.nan)
