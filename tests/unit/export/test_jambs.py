"""The width of a doorway, from ranges with noise."""

import math
from dataclasses import replace
from pathlib import Path
from statistics import mean

import numpy as np
import pytest

from companion.core.messages import Beam, FloorPlan, Hit, Pose, WallSegment
from companion.export.plan.jambs import BEARING_RAD, POSE_M, Jambs
from companion.export.plan.labels import Labels
from companion.export.plan.sheet import write_svg
from companion.export.plan.survey import Opening, survey

NOISY_M, RANGE_M = 0.1, 0.03
"""Sigma of a range, m: of a poor sensor, and of a usual one."""


def mapped(
    width_m: float, seed: int, thick_m: float = 0.0, sigma_m: float = NOISY_M
) -> tuple[FloorPlan, Opening]:
    """A wall to the east with a doorway, seen by beams from the south while the drone flies by.

    Slanted beams through the doorway meet the ends of a thick wall. The mapped walls end at the
    last hits, and so does the opening.
    """
    draw = np.random.default_rng(seed)
    hits, path = [], []
    for time_s, east_m in enumerate(np.linspace(-3.0, 3.0, 61).tolist()):
        path.append(Pose(float(time_s), 0.0, east_m, -1.2, 0.0))
        off_m = float(draw.normal(0, POSE_M))
        for bearing_rad in np.linspace(-0.9, 0.9, 19).tolist():
            met_m, side_m = east_m + 1.5 * math.tan(bearing_rad), width_m / 2
            true_m = 1.5 / math.cos(bearing_rad)
            if abs(met_m) < side_m:
                behind_m = east_m + (1.5 + thick_m) * math.tan(bearing_rad)
                if abs(behind_m) < side_m:
                    continue
                true_m = (math.copysign(side_m, behind_m) - east_m) / math.sin(bearing_rad)
            seen_rad = bearing_rad + float(draw.normal(0, BEARING_RAD))
            range_m = true_m + float(draw.normal(0, sigma_m))
            end = range_m * math.cos(seen_rad), east_m + off_m + range_m * math.sin(seen_rad)
            hits.append(Hit(float(time_s), Beam.FRONT, (*end, -1.2), sigma_m**2))
    east_m = np.array([hit.position_ned_m[1] for hit in hits])
    left_m, right_m = float(east_m[east_m < 0].max()), float(east_m[east_m > 0].min())
    walls = (
        WallSegment((1.5, -4.0), (1.5, left_m), 0.01, 200),
        WallSegment((1.5, right_m), (1.5, 4.0), 0.01, 200),
    )
    plan = FloorPlan(walls=walls, hits=tuple(hits), path=tuple(path))
    return plan, Opening((1.5, left_m), (1.5, right_m))


@pytest.mark.parametrize("width_m", [0.8, 1.0, 1.4])
def test_the_noise_of_the_ranges_makes_a_doorway_no_narrower(width_m: float) -> None:
    errors_m, sigmas, raw_m = [], [], []
    for seed in range(20):
        plan, opening = mapped(width_m, seed)
        found = Jambs(plan).measured(opening)
        errors_m.append(found.width_m - width_m)
        sigmas.append(abs(found.width_m - width_m) / found.sigma_m)
        raw_m.append(opening.width_m - width_m)
    assert mean(raw_m) < -0.15
    assert mean(map(abs, errors_m)) < 0.04
    assert sum(each < 2 for each in sigmas) >= 19


@pytest.mark.parametrize("thick_m", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("width_m", [0.8, 1.0, 1.4])
def test_the_ends_of_thick_walls_make_a_doorway_no_narrower(width_m: float, thick_m: float) -> None:
    errors_m = []
    for seed in range(20):
        plan, opening = mapped(width_m, seed, thick_m, RANGE_M)
        errors_m.append(Jambs(plan).measured(opening).width_m - width_m)
    assert mean(map(abs, errors_m)) < 0.04


def test_a_doorway_without_hits_beside_it_stays_as_it_is() -> None:
    plan, opening = mapped(1.0, seed=1)
    assert Jambs(replace(plan, hits=())).measured(opening) == opening


def test_the_sheet_says_how_exact_a_doorway_is(tmp_path: Path) -> None:
    outside = [((-1.5, -4.0), (1.5, -4.0)), ((-1.5, -4.0), (-1.5, 4.0)), ((-1.5, 4.0), (1.5, 4.0))]
    plan, _ = mapped(1.0, seed=1)
    path = *plan.path, *(Pose(100.0 + n, n % 2 * 3.0, 0.0, -1.2, 0.0) for n in range(4))
    walls = *plan.walls, *(WallSegment(*ends, 0.01, 200) for ends in outside)
    found = survey(replace(plan, walls=walls, path=path))
    (opening,) = found.openings
    write_svg(found, tmp_path / "plan.svg", Labels("a flight"))
    text = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    assert f"{opening.width_m:.2f} ± {2 * opening.sigma_m:.2f}" in text
