"""Tests that glTF files are read completely or rejected with a remedy."""

import base64
import json
import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.world.loading import load_world
from tests.unit.sitl.world.room_files import (
    LENGTH_M,
    OUTER,
    ROOM,
    Wall,
    corners,
    length_m,
    obj,
    plan,
    refusal,
)

Array = NDArray[Any]


class Gltf:
    """A glTF file built by hand."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": []}],
            **{key: [] for key in ("nodes", "meshes", "accessors", "bufferViews")},
        }
        self.blob = b""

    def view(self, data: bytes, **more: Any) -> int:
        record = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **more}
        self.blob += data + b"\0" * (-len(data) % 4)
        self.document["bufferViews"].append(record)
        return len(self.document["bufferViews"]) - 1

    def accessor(self, values: Array, kind: int, **more: Any) -> int:
        """Add an accessor of (n, width) values in their binary form."""
        names = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
        record = {"componentType": kind, "count": len(values), "type": names[values.shape[1]]}
        self.document["accessors"].append(
            {**record, "bufferView": self.view(values.tobytes()), **more}
        )
        return len(self.document["accessors"]) - 1

    def node(self, primitive: dict[str, Any], **more: Any) -> None:
        self.document["meshes"].append({"primitives": [primitive]})
        self.document["nodes"].append({"mesh": len(self.document["meshes"]) - 1, **more})
        self.document["scenes"][0]["nodes"].append(len(self.document["nodes"]) - 1)

    def wall(self, wall: Wall, **more: Any) -> None:
        at = self.accessor(y_up(wall).astype("<f4"), 5126)
        indices = self.accessor(np.array([[0, 1, 2, 0, 2, 3]], "<u2").T, 5123)
        self.node({"attributes": {"POSITION": at}, "indices": indices}, **more)

    def needs(self, *extensions: str) -> None:
        self.document["extensionsUsed"] = self.document["extensionsRequired"] = list(extensions)

    def save(self, path: Path) -> Path:
        length = {"byteLength": len(self.blob)}
        if path.suffix == ".gltf":
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.blob).decode()
            self.document["buffers"] = [{**length, "uri": uri}]
            path.write_text(json.dumps(self.document), encoding="utf-8-sig")
            return path
        self.document["buffers"] = [length]
        text = json.dumps(self.document).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I", len(text)) + b"JSON" + text
        chunks += struct.pack("<I", len(self.blob)) + b"BIN\0" + self.blob
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
        return path


def y_up(wall: Wall) -> Array:
    return np.array([(x, z, -y) for x, y, z in corners(wall)])


def gltf(walls: Sequence[Wall] = ROOM) -> Gltf:
    made = Gltf()
    for wall in walls:
        made.wall(wall)
    return made


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_gltf_gives_the_same_room(
    tmp_path: Path, truth: list[tuple[float, ...]], suffix: str
) -> None:
    assert plan(load_world(str(gltf().save(tmp_path / f"room{suffix}")))) == truth


@pytest.mark.parametrize(("kind", "code"), [("i1", 5120), ("u1", 5121), ("i2", 5122), ("u2", 5123)])
def test_gltf_normalised_integers_are_scaled_by_their_maximum(
    tmp_path: Path, truth: list[tuple[float, ...]], kind: str, code: int
) -> None:
    most = np.iinfo(kind).max
    made = Gltf()
    for wall in ROOM:
        share = y_up(wall) / 10 + (0 if kind[0] == "i" else np.array([0, 0, 1.0]))
        padded = np.column_stack([np.round(share * most), np.zeros(4)]).astype(f"<{kind}")
        at = made.accessor(padded[:, :3], code, normalized=True)
        made.document["bufferViews"][-1] = {
            **made.document["bufferViews"][made.view(padded.tobytes())],
            "byteStride": padded.itemsize * 4,
        }
        made.document["accessors"][at]["bufferView"] = len(made.document["bufferViews"]) - 1
        indices = made.accessor(np.array([[0, 1, 2, 0, 2, 3]], "<u1").T, 5121)
        back = [0, 0, 0] if kind[0] == "i" else [0, 0, -10]
        place = {"scale": [10, 10, 10], "translation": back}
        made.node({"attributes": {"POSITION": at}, "indices": indices}, **place)
    made.needs("KHR_mesh_quantization")
    world = load_world(str(made.save(tmp_path / "room.glb")))
    found = np.array(plan(world))
    assert found.shape == np.array(truth).shape
    assert length_m(world) == pytest.approx(LENGTH_M, abs=0.3 if most < 300 else 0.01)


def test_gltf_instances_are_placed_by_their_transforms(tmp_path: Path) -> None:
    """One partition appears at each instance, rotated and scaled, and nowhere else."""
    made = gltf(OUTER)
    half = math.sqrt(0.5)
    attributes = {
        "TRANSLATION": made.accessor(np.array([(2, 0, 0), (4, 0, 0), (8, 0, -4)], "<f4"), 5126),
        "ROTATION": made.accessor(
            np.array([(0, 0, 0, 1), (0, 0, 0, 1), (0, half, 0, half)], "<f4"), 5126
        ),
        "SCALE": made.accessor(np.array([(1, 1, 1), (1, 1, 1.5), (1, 1, 0.5)], "<f4"), 5126),
    }
    made.wall((0, 0, 0, 2), extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    made.needs("EXT_mesh_gpu_instancing")
    walls = [*OUTER, (2, 0, 2, 2), (4, 0, 4, 3), (8, 4, 7, 4)]
    path = tmp_path / "same.obj"
    path.write_text(obj([walls], back=False))
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == plan(load_world(str(path)))


def test_gltf_sparse_values_replace_the_base_values(
    tmp_path: Path, truth: list[tuple[float, ...]]
) -> None:
    made = gltf(ROOM[:-1])
    wrong, right = y_up(ROOM[-1]), y_up(ROOM[-1])
    wrong[[1, 2]] = 99
    at = made.accessor(wrong.astype("<f4"), 5126)
    made.document["accessors"][at]["sparse"] = {
        "count": 2,
        "indices": {
            "bufferView": made.view(np.array([1, 2], "<u2").tobytes()),
            "componentType": 5123,
        },
        "values": {"bufferView": made.view(right[[1, 2]].astype("<f4").tobytes())},
    }
    indices = made.accessor(np.array([[0, 1, 2, 0, 2, 3]], "<u2").T, 5123)
    made.node({"attributes": {"POSITION": at}, "indices": indices})
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == truth


@pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
def test_gltf_strips_and_fans_are_triangulated(
    tmp_path: Path, truth: list[tuple[float, ...]], mode: int, order: list[int]
) -> None:
    made = Gltf()
    for wall in ROOM:
        at = made.accessor(y_up(wall)[order].astype("<f4"), 5126)
        made.node({"attributes": {"POSITION": at}, "mode": mode})
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == truth


@pytest.mark.parametrize(
    ("extension", "remedy"),
    [
        ("KHR_draco_mesh_compression", "Compression"),
        ("EXT_meshopt_compression", "gltfpack"),
        ("KHR_meshopt_compression", "gltfpack"),
        ("EXT_of_the_future", "export it without"),
    ],
)
def test_gltf_extensions_that_change_triangles_are_refused_by_name(
    tmp_path: Path, extension: str, remedy: str
) -> None:
    made = gltf()
    made.needs("KHR_mesh_quantization", extension)
    reports = refusal(made.save(tmp_path / "room.glb"))
    assert extension in reports
    assert remedy in reports


@pytest.mark.parametrize(
    "extension",
    ["KHR_texture_transform", "KHR_texture_basisu", "EXT_texture_webp", "KHR_materials_unlit"],
)
def test_gltf_extensions_that_only_change_colours_are_ignored(
    tmp_path: Path, truth: list[tuple[float, ...]], extension: str
) -> None:
    made = gltf()
    made.needs(extension)
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == truth


def test_gltf_with_one_compressed_wall_is_refused(tmp_path: Path) -> None:
    """The file does not list the extension as required."""
    made = gltf()
    primitive = made.document["meshes"][-1]["primitives"][0]
    del made.document["accessors"][primitive["attributes"]["POSITION"]]["bufferView"]
    packed = {"bufferView": made.view(b"DRACO"), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": packed}
    assert "KHR_draco_mesh_compression" in refusal(made.save(tmp_path / "room.glb"))


def test_gltf_hidden_nodes_and_other_scenes_are_ignored(
    tmp_path: Path, truth: list[tuple[float, ...]]
) -> None:
    made = gltf()
    made.wall((2, 0, 2, 2), extensions={"KHR_node_visibility": {"visible": False}})
    made.wall((1, 0, 1, 2))
    made.document["scenes"] += [{"nodes": [made.document["scenes"][0]["nodes"].pop()]}]
    assert plan(load_world(str(made.save(tmp_path / "room.glb")))) == truth


@pytest.mark.parametrize("cut", [1, 30, 100])
def test_a_truncated_gltf_file_is_refused(tmp_path: Path, cut: int) -> None:
    path = gltf().save(tmp_path / "room.glb")
    path.write_bytes(path.read_bytes()[:-cut])
    assert "cut short" in refusal(path)


def test_gltf_of_another_version_is_refused_by_its_number(tmp_path: Path) -> None:
    made = gltf()
    made.document["asset"] = {"version": "1.0"}
    for name in ("room.gltf", "room.glb"):
        assert "is glTF of version 1.0; export it as version 2" in refusal(
            made.save(tmp_path / name)
        )


def test_gltf_data_in_the_text_may_be_written_in_any_way(
    tmp_path: Path, truth: list[tuple[float, ...]]
) -> None:
    made = gltf()
    path = made.save(tmp_path / "room.gltf")
    for head, text in (
        ("DATA:application/octet-stream;base64", base64.b64encode(made.blob).decode()),
        ("data:;base64", base64.urlsafe_b64encode(made.blob).decode()),
        ("data:application/gltf-buffer;base64", quote(base64.b64encode(made.blob).decode(), "")),
        ("data:application/octet-stream", quote(made.blob)),
    ):
        made.document["buffers"] = [{"byteLength": len(made.blob), "uri": f"{head},{text}"}]
        path.write_text(json.dumps(made.document), encoding="utf-8")
        assert plan(load_world(str(path))) == truth
