"""Surveys of a building that changes: `python -m benchmarks.survey.changes [--seeds 20]`.

After the first flight a cupboard stands elsewhere, and the door between two rooms is shut. Each
seed draws the rooms, the cupboard's places, and the flights. Prints whether the three changes are
listed, what else is, the scores of the joint map against the changed building, and collisions.
"""

import argparse
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from companion.config import settings
from companion.core.frames import Vector2, frd_to_ned
from companion.survey.merge import Merged
from sitl.bench.engine import attempted, with_a_bar
from sitl.running.sorties import Sorties
from sitl.sensors.beam import RAY
from sitl.simulation.simulation import Setup
from sitl.world.format import Box, Start, Walls, World

BATTERY_S, SORTIES = 110.0, 3
"""Time of a battery, s, and most flights. Chosen: one flight sees the first room and the door."""
NEAR_M = 0.6
"""Largest distance of a listed change from a true one, m. Chosen: half a door."""
FRONT_M, CUPBOARD_M = 0.6, 1.4
"""Depth and width of the cupboard, m."""


@dataclass(frozen=True)
class Building:
    """Two rooms with a door in their partition, and a cupboard at the south wall of the first."""

    length_m: float
    width_m: float
    partition_m: float
    """North of the partition."""
    door_m: float
    """East of the door's middle."""
    door_width_m: float
    cupboards_m: tuple[float, float]
    """East of the cupboard before and after."""
    pad: Vector2
    heading_deg: float

    @classmethod
    def drawn(cls, seed: int) -> "Building":
        """Draw one."""
        draw = random.Random(seed)
        width_m, partition_m = draw.uniform(5.5, 7.0), draw.uniform(4.0, 5.5)
        first_m = draw.uniform(0.6, 1.2)
        return cls(
            draw.uniform(10.0, 13.0),
            width_m,
            partition_m,
            draw.uniform(2.0, width_m - 2.0),
            draw.uniform(1.0, 1.3),
            (first_m, first_m + CUPBOARD_M + draw.uniform(0.8, width_m - 2 * CUPBOARD_M - 2.4)),
            (partition_m / 2 + draw.uniform(0.0, 0.3), width_m / 2 + draw.uniform(-0.3, 0.3)),
            draw.uniform(0.0, 360.0),
        )

    @property
    def jambs_m(self) -> Vector2:
        """East of the door's sides."""
        return self.door_m - self.door_width_m / 2, self.door_m + self.door_width_m / 2

    @property
    def changed(self) -> tuple[tuple[bool, Vector2], ...]:
        """Whether each change is new, and the middle of what has changed."""
        before, after = ((FRONT_M, east_m + CUPBOARD_M / 2) for east_m in self.cupboards_m)
        return (False, before), (True, after), (True, (self.partition_m, self.door_m))

    def world(self, *, is_changed: bool) -> World:
        """The building before or after the change."""
        north_m, east_m = self.length_m, self.width_m
        near_m, far_m = self.partition_m - 0.05, self.partition_m + 0.05
        walls = [
            Walls(points=((0, 0), (north_m, 0), (north_m, east_m), (0, east_m)), closed=True),
            *(
                Walls(points=((near_m, end), (near_m, jamb), (far_m, jamb), (far_m, end)))
                for end, jamb in zip((0.0, east_m), self.jambs_m, strict=True)
            ),
        ]
        if is_changed:
            walls.append(Walls(points=tuple((self.partition_m, jamb) for jamb in self.jambs_m)))
        at_m = self.cupboards_m[is_changed]
        return World(
            name="two rooms",
            height_m=2.6,
            walls=tuple(walls),
            boxes=(Box(corner=(0.0, at_m), size=(FRONT_M, CUPBOARD_M), top_m=2.0),),
            starts=(Start(name="pad", position=self.pad, heading_deg=self.heading_deg),),
        )

    def listed(self, merged: Merged) -> tuple[int, int]:
        """Number of true changes that are listed, and number of other changes."""
        found = []
        for change in merged.changes:
            ends = [
                frd_to_ned(*end, math.radians(self.heading_deg))
                for end in (change.start_ne_m, change.end_ne_m)
            ]
            north_m, east_m = (self.pad[i] + (ends[0][i] + ends[1][i]) / 2 for i in (0, 1))
            found.append((change.is_new, (north_m, east_m)))
        told = [any(_is(each, *one) for one in found) for each in self.changed]
        others = [one for one in found if not any(_is(each, *one) for each in self.changed)]
        return sum(told), len(others)


def _is(change: tuple[bool, Vector2], is_new: bool, at: Vector2) -> bool:
    """A listed change belongs to a true one: the sides of a cupboard change, too."""
    return change[0] == is_new and math.dist(at, change[1]) < NEAR_M + CUPBOARD_M / 2


def fly(seed: int) -> dict[str, Any]:
    """Fly a survey; an exception becomes a row of the results."""
    return attempted(seed, _fly, lost)


def _fly(seed: int) -> dict[str, Any]:
    building = Building.drawn(seed)
    config = settings.load(None, {"mission.kind": "building", "mission.time_limit_s": BATTERY_S})
    before, after = (building.world(is_changed=changed) for changed in (False, True))
    setup = Setup(
        before, "two rooms", seed, config.sensors, "ardupilot", {}, RAY, battery_s=BATTERY_S
    )
    sorties = list(
        Sorties(setup, config, lambda _: None, tell=lambda _: None, then=after).fly(SORTIES)
    )
    last = sorties[-1]
    told, others = building.listed(last.merged)
    return {
        "seed": seed,
        "flights": len(sorties),
        "told": told,
        "others": others,
        "left_out": len(last.merged.left_out),
        "collisions": last.joint["collisions"],
        "coverage": last.joint["coverage"],
        "false_walls": last.joint["false_walls"],
        "walls_cm": last.joint["wall_error_aligned_cm"],
        "off_pad_m": last.joint["return_m"],
    }


def lost(seed: int, why: str) -> dict[str, Any]:
    """The row of a survey without a result."""
    return {"seed": seed, "lost": why}


def table(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Markdown rows."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    yield "| " + " | ".join(names) + " |"
    yield "|---" * len(names) + "|"
    for row in rows:
        yield "| " + " | ".join(str(row.get(name, "–")) for name in names) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="surveys, default 20")
    seeds = range(1, parser.parse_args().seeds + 1)
    rows = with_a_bar(list(seeds), lambda row: f"seed {row['seed']}", fly, lost)
    print(*table(rows), sep="\n")


if __name__ == "__main__":
    main()
