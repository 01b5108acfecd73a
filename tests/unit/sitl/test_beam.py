"""Tests of beam physics: width, losses at steep incidence, dropouts, and the paper's shift."""

import math
import statistics
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import Vector3
from sitl.sensors.beam import (
    RAY,
    BeamError,
    BeamPhysics,
    LightBeam,
    beam_physics,
    load_beam_physics,
)
from sitl.world.format import World
from sitl.world.geometry.model import Hit, WorldModel
from tests.examples import examples

NORTH = (1.0, 0.0, 0.0)
REACH_M = 8.0
STEPPED = World.model_validate(
    {
        "name": "a pillar before a wall",
        "height_m": 2.6,
        "walls": [{"points": [(0, 0), (6, 0), (6, 6), (0, 6)], "closed": True}],
        "boxes": [{"corner": (3, 3), "size": (1, 3), "top_m": 2.6}],
        "starts": [{"name": "here", "position": (1, 3)}],
    }
)
"""North of (1, x) there is a pillar at 2 m where x > 3, and a wall at 5 m where x < 3."""
MODEL = WorldModel(STEPPED)
EVERYTHING = BeamPhysics(width_deg=3, steep_deg=50, dropout=0.1, shift_m=0.02)


def light_beam(seed: int = 1, name: str = "front", **physics: float) -> LightBeam:
    return LightBeam(BeamPhysics(**physics), MODEL.hits, seed, name)


def reading(beam: LightBeam, east_m: float = 4.5, direction: Vector3 = NORTH) -> float | None:
    return beam.range_m((1.0, east_m, -1.3), direction, REACH_M)


def readings(beam: LightBeam, count: int) -> list[float | None]:
    return [reading(beam) for _ in range(count)]


@settings(max_examples=examples(100))
@given(st.floats(0.1, 2.9), st.floats(0.1, 5.9), st.floats(-math.pi, math.pi), st.floats(-1, 1))
def test_without_physics_a_beam_is_a_ray(
    north_m: float, east_m: float, bearing_rad: float, climb_rad: float
) -> None:
    level = math.cos(climb_rad)
    direction = level * math.cos(bearing_rad), level * math.sin(bearing_rad), math.sin(climb_rad)
    origin = (north_m, east_m, -1.3)
    found = LightBeam(RAY, MODEL.hits, 1, "front").range_m(origin, direction, REACH_M)
    assert found == pytest.approx(MODEL.range_m(origin, direction, REACH_M), abs=1e-9)


def test_a_spot_on_a_flat_wall_gives_the_range_of_a_ray() -> None:
    assert reading(light_beam(width_deg=2)) == pytest.approx(2.0, rel=1e-3)


def test_a_spot_across_an_edge_gives_an_intermediate_range() -> None:
    beam = light_beam(width_deg=3)
    split = reading(beam, east_m=2.98)
    assert split is not None
    assert 2.1 < split < 4.9


@given(st.floats(2.8, 3.2), st.floats(2.8, 3.2))
def test_the_range_decreases_with_the_share_of_the_spot_on_the_pillar(
    a_m: float, b_m: float
) -> None:
    beam = light_beam(width_deg=3)
    less, more = (reading(beam, east_m) for east_m in sorted((a_m, b_m)))
    assert less is not None
    assert more is not None
    assert 2.0 - 1e-3 <= more <= less + 1e-2
    assert less <= 5.0 + 1e-2


def test_rays_without_a_return_do_not_affect_the_range() -> None:
    def half_open(
        origin: Vector3, rays: Sequence[Vector3], most_m: float, half_angle_rad: float
    ) -> list[Hit | None]:
        return [Hit(2.0, 1.0) if ray[1] > 0 else None for ray in rays]

    beam = LightBeam(BeamPhysics(width_deg=3), half_open, 1, "front")
    assert reading(beam) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("incidence_deg", "returned"), [(0, 1.0), (59, 1.0), (75, 0.5), (84, 0.2), (89.999, 0.0)]
)
def test_returns_become_rarer_at_steep_incidence(incidence_deg: float, returned: float) -> None:
    hit = Hit(2.0, math.cos(math.radians(incidence_deg)))
    beam = LightBeam(BeamPhysics(steep_deg=60), lambda *_: [hit], 1, "front")
    seen = [r for r in readings(beam, 2000) if r is not None]
    assert len(seen) / 2000 == pytest.approx(returned, abs=0.04)
    assert seen == pytest.approx([2.0] * len(seen))


def test_dropouts_occur_at_the_configured_rate() -> None:
    lost = readings(light_beam(dropout=0.1), 4000).count(None)
    assert lost / 4000 == pytest.approx(0.1, abs=0.015)


def test_the_papers_noise_shifts_the_sensor_along_every_axis() -> None:
    origins = []

    def watched(
        origin: Vector3, rays: Sequence[Vector3], most_m: float, half_angle_rad: float
    ) -> list[Hit | None]:
        origins.append(origin)
        return MODEL.hits(origin, rays, most_m, half_angle_rad)

    beam = LightBeam(BeamPhysics(shift_m=0.05), watched, 1, "front")
    seen = [r for r in readings(beam, 3000) if r is not None]
    assert statistics.mean(seen) == pytest.approx(2.0, abs=0.005)
    assert statistics.stdev(seen) == pytest.approx(0.05, rel=0.06)
    for axis, place_m in zip(zip(*origins, strict=True), (1.0, 4.5, -1.3), strict=True):
        assert statistics.mean(axis) == pytest.approx(place_m, abs=0.005)
        assert statistics.stdev(axis) == pytest.approx(0.05, rel=0.06)


def test_dropouts_do_not_change_the_random_shifts() -> None:
    shaken = readings(light_beam(shift_m=0.05), 500)
    dropping_too = readings(light_beam(shift_m=0.05, dropout=0.3), 500)
    pairs = [(a, b) for a, b in zip(shaken, dropping_too, strict=True) if b is not None]
    assert 250 < len(pairs) < 450
    assert all(a == b for a, b in pairs)


def test_seed_and_beam_name_determine_the_readings() -> None:
    physics = EVERYTHING.model_dump()
    first = readings(light_beam(1, "front", **physics), 50)
    assert first == readings(light_beam(1, "front", **physics), 50)
    assert first != readings(light_beam(1, "left", **physics), 50)
    assert first != readings(light_beam(2, "front", **physics), 50)


def test_a_file_sets_the_keys_that_it_contains(tmp_path: Path) -> None:
    path = tmp_path / "spot.toml"
    path.write_text("width_deg = 2\ndropout = 0.01\n")
    assert load_beam_physics(path) == BeamPhysics(width_deg=2, dropout=0.01)
    assert beam_physics({}, "nothing") == RAY


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("dropout = 2", "dropout = 2: should be less than or equal to 1"),
        ("width_deg = -1", "width_deg = -1: should be greater than or equal to 0"),
        ("shift_m = nan", "shift_m = nan: should be a finite number"),
        ("steep_deg = 'very'", "steep_deg = 'very': should be a valid number"),
        ("width = 2", "width = 2: no such key"),
        ("width_deg = ", "not TOML"),
    ],
)
def test_bad_physics_is_refused_in_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(BeamError) as refused:
        load_beam_physics(path)
    assert f"{path}: {complaint}" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_missing_file_is_named_in_the_error(tmp_path: Path) -> None:
    with pytest.raises(BeamError, match=r"none\.toml: No such file"):
        load_beam_physics(tmp_path / "none.toml")
