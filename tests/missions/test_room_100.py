"""The first flight: one drone maps the paper's room 1 and comes home."""

import math

import pytest

from companion.messages import FloorPlan
from sitl.record import TruthRecord
from sitl.score import MapScore, score_map, score_trajectory
from sitl.world.loading import load_world
from sitl.world.plan import samples, wall_surfaces
from tests.conftest import Fly


def map_score(world: str, plan: FloorPlan, truth: TruthRecord) -> MapScore:
    surfaces = wall_surfaces(load_world(world), 1.2)
    return score_map(plan, surfaces, samples(surfaces), truth.take_off)


@pytest.mark.parametrize("profile", ["gp2y0a710k0f", "paper"])
@pytest.mark.parametrize("seed", [1, 10])
def test_it_maps_the_room_and_lands_at_home(fly: Fly, profile: str, seed: int) -> None:
    app, simulation = fly("room_100", seed, profile=profile)
    plan, truth = app.final_floor_plan(), simulation.record
    assert app.flight.completed, app.flight.ending
    assert truth.collisions == 0
    assert truth.clearance_m > 0.3
    score = map_score("room_100", plan, truth)
    assert score.coverage >= 0.95
    assert score.wall_error_aligned_cm <= 15
    assert score_trajectory(plan.path, truth.path, truth.take_off).ate_cm <= 15
    assert plan.ceiling_m == pytest.approx(2.6, abs=0.1)
    landed = simulation.autopilot.truth
    assert math.dist(landed.position_ned_m, truth.take_off.position_ned_m) < 0.6


@pytest.mark.parametrize("world", ["room_200", "room_300"])
def test_it_maps_larger_rooms(fly: Fly, world: str) -> None:
    app, simulation = fly(world, 1, profile="paper")
    assert app.flight.completed, app.flight.ending
    score = map_score(world, app.final_floor_plan(), simulation.record)
    assert score.wall_error_aligned_cm <= 15
    assert simulation.record.collisions == 0


def test_the_same_seed_is_the_same_flight_whatever_carries_the_messages(fly: Fly) -> None:
    first, first_sim = fly(seed=5)
    again, again_sim = fly(seed=5)
    as_bytes, bytes_sim = fly(seed=5, transport="bytes")
    assert first_sim.record.path == again_sim.record.path == bytes_sim.record.path
    assert first.final_floor_plan() == again.final_floor_plan() == as_bytes.final_floor_plan()


def test_another_seed_is_another_flight(fly: Fly) -> None:
    _, first = fly(seed=5)
    _, other = fly(seed=6)
    assert first.record.path != other.record.path


def test_a_px4_flies_the_same_mission(fly: Fly) -> None:
    app, simulation = fly(seed=4, autopilot="px4")
    assert app.flight.completed, app.flight.ending
    assert simulation.record.collisions == 0
    score = map_score("room_100", app.final_floor_plan(), simulation.record)
    assert score.coverage >= 0.95
    assert score.wall_error_aligned_cm <= 15
