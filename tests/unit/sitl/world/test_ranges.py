"""Tests that ranges are exact and no ray is lost, with hundreds and thousands of triangles."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from benchmarks.devices.ranges import hall
from companion.core.arrays import Array
from companion.core.frames import Vector3
from sitl.world.format import World
from sitl.world.geometry.mesh import obstacle_mesh
from sitl.world.geometry.model import WorldModel
from sitl.world.geometry.triangles import Mesh
from sitl.world.loading import load_world

REACH_M = 12.0
RAYS, AIMED_RAYS = 3400, 1400
EXACT_M = 1e-9
EDGE_TOLERANCE = 1e-9
WORLDS = ["hall of 5000", "office", "exterior"]
BATCH = 200


@dataclass(frozen=True)
class Range:
    """A world with its model, and rays for tests."""

    mesh: Mesh
    model: WorldModel
    rng: np.random.Generator

    def origins(self, count: int) -> Array:
        """Random points, farther than the maximum range from every edge of the floor."""
        low, high = self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)
        shrink = np.array((REACH_M, REACH_M, 0))
        return self.rng.uniform(low + shrink, high - shrink, (count, 3))

    def found(self, origins: Array, directions: Array) -> Array:
        """Ranges by the model; NaN without a hit."""
        pairs = zip(origins.tolist(), directions.tolist(), strict=True)
        ranges = (self.model.range_m(as_vector(o), as_vector(d), REACH_M) for o, d in pairs)
        return np.array([np.nan if range_m is None else range_m for range_m in ranges])


def as_vector(values: list[float]) -> Vector3:
    x, y, z = values
    return x, y, z


@cache
def in_world(name: str) -> Range:
    world: World = hall(5000) if name == "hall of 5000" else load_world(name)
    return Range(with_floor(obstacle_mesh(world)), WorldModel(world), np.random.default_rng(4))


def with_floor(obstacles: Mesh) -> Mesh:
    """The mesh with the floor as two triangles that every ray in range hits."""
    count = len(obstacles.vertices)
    south, west, _ = obstacles.vertices.min(axis=0) - REACH_M
    north, east, _ = obstacles.vertices.max(axis=0) + REACH_M
    corners = [(south, west, 0.0), (north, west, 0.0), (north, east, 0.0), (south, east, 0.0)]
    faces = np.array([(0, 1, 2), (0, 2, 3)]) + count
    return Mesh(
        np.concatenate([obstacles.vertices, np.array(corners)]),
        np.concatenate([obstacles.faces, faces]),
    )


def true_ranges(mesh: Mesh, origins: Array, directions: Array) -> Array:
    """Ranges by brute force over all rays and triangles; NaN without a hit in range.

    With the plane's normal n the distance is (n·a - n·o) / n·d. A point p of the plane is inside
    the triangle if u = U·(p - a) and v = V·(p - a) satisfy u ≥ 0, v ≥ 0 and u + v ≤ 1. (U, V) is
    the dual basis of the edges.
    """
    a, b, c = (mesh.vertices[corner] for corner in mesh.faces.T)
    e1, e2 = b - a, c - a
    n = np.cross(e1, e2)
    area2 = (n * n).sum(axis=1, keepdims=True)
    along_e1, along_e2 = np.cross(e2, n) / area2, np.cross(n, e1) / area2
    nearest = []
    for start in range(0, len(origins), BATCH):
        o, d = origins[start : start + BATCH], directions[start : start + BATCH]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = ((n * a).sum(axis=1) - o @ n.T) / (d @ n.T)
            u = o @ along_e1.T + distance * (d @ along_e1.T) - (along_e1 * a).sum(axis=1)
            v = o @ along_e2.T + distance * (d @ along_e2.T) - (along_e2 * a).sum(axis=1)
            inside = (np.minimum(u, v) >= -EDGE_TOLERANCE) & (u + v <= 1 + EDGE_TOLERANCE)
            hits = inside & (distance >= 0) & (distance <= REACH_M)
        nearest.append(np.where(hits, distance, np.inf).min(axis=1))
    ranges = np.concatenate(nearest)
    return np.where(np.isinf(ranges), np.nan, ranges)


def unit(vectors: Array) -> Array:
    lengths: Array = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / lengths


@pytest.mark.parametrize("name", WORLDS)
def test_random_rays_are_exact(name: str) -> None:
    place = in_world(name)
    origins, directions = place.origins(RAYS), unit(place.rng.normal(size=(RAYS, 3)))
    expected = true_ranges(place.mesh, origins, directions)
    found = place.found(origins, directions)
    assert np.isfinite(expected).mean() > 0.5
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT_M)


@pytest.mark.parametrize("name", WORLDS)
def test_horizontal_and_vertical_rays_are_exact(name: str) -> None:
    """The rays are along the axes of the walls, the usual directions of a drone's beams."""
    place = in_world(name)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    origins, directions = place.origins(RAYS // 10), place.rng.choice(axes, RAYS // 10)
    expected = true_ranges(place.mesh, origins, directions)
    np.testing.assert_allclose(place.found(origins, directions), expected, rtol=0, atol=EXACT_M)


def aimed_at(place: Range, targets: Array) -> tuple[Array, Array, Array]:
    """Rays to points at up to 9/10 of the maximum range: origins, directions, distances."""
    away = place.rng.uniform(0.3, 0.9 * REACH_M, (len(targets), 1))
    origins = targets + away * unit(place.rng.normal(size=targets.shape))
    return origins, unit(targets - origins), np.linalg.norm(targets - origins, axis=1)


def edges_and_vertices(place: Range) -> Array:
    """Points of the mesh: half are corners of triangles, half are on edges."""
    triangles = place.mesh.vertices[place.rng.choice(place.mesh.faces, AIMED_RAYS)]
    first, second = triangles[:, 0], triangles[:, 1]
    share = place.rng.uniform(0, 1, (AIMED_RAYS, 1))
    share[::2] = 0
    points: Array = first + share * (second - first)
    return points


@pytest.mark.parametrize("name", WORLDS)
def test_no_ray_at_an_edge_or_vertex_is_lost(name: str) -> None:
    place = in_world(name)
    origins, directions, aimed_m = aimed_at(place, edges_and_vertices(place))
    found = place.found(origins, directions)
    expected = true_ranges(place.mesh, origins, directions)
    assert (found <= aimed_m + EXACT_M).all()  # false for NaN: no hit
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT_M)
    unobstructed = expected > aimed_m - EXACT_M
    assert unobstructed.sum() > 100
    np.testing.assert_allclose(found[unobstructed], aimed_m[unobstructed], rtol=0, atol=EXACT_M)


@pytest.mark.parametrize("name", WORLDS)
def test_a_bundle_of_rays_has_the_same_ranges_as_single_rays(name: str) -> None:
    place = in_world(name)
    half_angle_rad = 0.1
    for origin, axis in zip(place.origins(200), unit(place.rng.normal(size=(200, 3))), strict=True):
        aside = unit(np.cross(axis, place.rng.normal(size=(6, 3))))
        ring = np.cos(half_angle_rad) * axis + np.sin(half_angle_rad) * aside
        rays = [as_vector(ray) for ray in [axis.tolist(), *ring.tolist()]]
        start = as_vector(origin.tolist())
        hits = place.model.hits(start, rays, REACH_M, half_angle_rad)
        alone = [place.model.range_m(start, ray, REACH_M) for ray in rays]
        assert [hit and hit.distance_m for hit in hits] == alone


@pytest.mark.parametrize("name", WORLDS)
def test_an_independent_ray_caster_agrees(name: str) -> None:
    """Compares with Embree, which has single precision: 24 bits for tens of metres."""
    scenes = pytest.importorskip("embreex.rtcore_scene", reason="embreex is for x86_64 only")
    meshes = pytest.importorskip("embreex.mesh_construction")
    place = in_world(name)
    scene = scenes.EmbreeScene()
    meshes.TriangleMesh(
        scene, place.mesh.vertices.astype(np.float32), place.mesh.faces.astype(np.int32)
    )
    origins, directions = place.origins(RAYS), unit(place.rng.normal(size=(RAYS, 3)))
    found = place.found(origins, directions)
    others = scene.run(
        origins.astype(np.float32), directions.astype(np.float32), query="DISTANCE"
    ).astype(float)
    both = np.isfinite(found) & (others <= REACH_M)
    assert (np.isfinite(found) == (others <= REACH_M)).mean() > 0.999
    close = np.isclose(found[both], others[both], rtol=1e-4, atol=1e-4)
    assert close.mean() > 0.999  # single precision may miss at an edge
