"""Reads glTF 2.0, text or binary: the triangles of its scene, without materials.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import base64
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from companion.core.arrays import Array, Indices
from companion.core.textfile import decoded, parsed_json
from sitl.world.importers.formats import MeshError, Part, fan, strip

MAGIC, VERSION = b"glTF", 2
"""First bytes of a GLB file, and the supported version (glTF 2.0, GLB file format)."""
CHUNK_JSON, CHUNK_BIN = 0x4E4F534A, 0x004E4942
"""Chunk types: `JSON` and `BIN` in ASCII, little-endian (glTF 2.0, GLB file format)."""
KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""NumPy type by accessor.componentType (glTF 2.0)."""
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
"""Number of components by accessor.type (glTF 2.0); matrices are not read."""
POINTS_AND_LINES = (0, 1, 2, 3)
"""Values of primitive.mode without triangles: points, lines, line loops and strips (glTF 2.0)."""
TRIANGLES, STRIP, FAN = 4, 5, 6
"""Values of primitive.mode with triangles (glTF 2.0)."""
MAX_VALUES = 50_000_000
"""Largest number of values in an accessor. Chosen."""

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
INSTANCES, HIDDEN = "EXT_mesh_gpu_instancing", "KHR_node_visibility"
READ = {"KHR_mesh_quantization", INSTANCES, HIDDEN}
HARMLESS = (
    *("KHR_materials_", "KHR_texture_", "KHR_lights_", "KHR_animation_", "KHR_xmp", "KHR_audio"),
    *("EXT_texture_", "EXT_lights_", "EXT_mesh_features", "EXT_mesh_manifold"),
    *("EXT_instance_features", "EXT_structural_metadata", "EXT_feature_metadata"),
    *("ADOBE_materials_", "AGI_", "CESIUM_primitive_outline", "FB_ngon_encoding", "GODOT_"),
    *("MPEG_texture_", "MSFT_lod", "MSFT_packing_", "MSFT_texture_", "NV_materials_"),
)
"""Prefixes of extensions that change colours, lights or properties, but no triangle."""
WITHOUT = {
    DRACO: " (in Blender: without Compression; with gltf-transform: copy)",
    **dict.fromkeys(MESHOPT, " (with gltfpack: without -c; with gltf-transform: copy)"),
}
"""Remedies for unsupported compression, by extension."""

Record = dict[str, Any]


def read_gltf(data: bytes, path: Path) -> Iterator[Part]:
    """Read the triangles of every node, y up.

    Raises:
        MeshError: the file is damaged, or needs an extension that is not supported.
    """
    text, binary = _chunks(data) if data.startswith(MAGIC) else (data, None)
    document = parsed_json(decoded(text))
    if not isinstance(document, dict) or "asset" not in document:
        raise MeshError("does not begin like glTF: it is damaged, or of another format")
    version = str(dict(document["asset"]).get("version", VERSION))
    if version.partition(".")[0] != str(VERSION):
        raise _of_version(version)
    for name in document.get("extensionsRequired", ()):
        if name not in READ and not name.startswith(HARMLESS):
            raise _needs(name)
    yield from _Document(document, binary, path.parent).parts()


def _needs(extension: str) -> MeshError:
    return MeshError(
        f"needs the extension {extension}, which is not supported; "
        f"export it without{WITHOUT.get(extension, '')}"
    )


def _of_version(version: object) -> MeshError:
    return MeshError(f"is glTF of version {version}; export it as version {VERSION}")


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """JSON and buffer of a binary file."""
    _, version, length = struct.unpack_from("<4sII", data)
    if version != VERSION:
        raise _of_version(version)
    if length > len(data):
        raise MeshError(f"declares {length} bytes and holds {len(data)}: it is cut short")
    at, found = 12, dict[int, bytes]()
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if CHUNK_JSON not in found:
        raise MeshError("has no JSON chunk: it is damaged")
    return found[CHUNK_JSON], found.get(CHUNK_BIN)


class _Document:
    """One file and the files beside it."""

    def __init__(self, document: Record, binary: bytes | None, folder: Path) -> None:
        self._document = document
        self._binary = binary
        self._folder = folder
        self._buffers: dict[int, bytes] = {}
        self._meshes: dict[int, list[Part]] = {}

    def parts(self) -> Iterator[Part]:
        """Every mesh at its place in the scene."""
        waiting = [(node, np.eye(4)) for node in self._roots()]
        seen = set[int]()
        while waiting:
            number, above = waiting.pop()
            if number in seen:
                raise MeshError(f"node {number} is below two others, or below itself")
            seen.add(number)
            node = self._entry("nodes", number)
            if not _extension(node, HIDDEN).get("visible", True):
                continue
            place = above @ _transform(node)
            if "mesh" in node:
                yield from self._placed(node, place)
            waiting += [(child, place) for child in node.get("children", ())]

    def _roots(self) -> list[int]:
        if self._document.get("scenes"):
            scene = self._entry("scenes", self._document.get("scene", 0))
            return list(scene.get("nodes", ()))
        nodes = self._document.get("nodes", ())
        below = {child for node in nodes for child in node.get("children", ())}
        return [number for number in range(len(nodes)) if number not in below]

    def _placed(self, node: Record, place: Array) -> Iterator[Part]:
        if "skin" in node:
            raise MeshError(
                f"node {node.get('name', '')!r} is deformed by a skin, which is not supported; "
                "apply it, or leave it out"
            )
        for instance in self._instances(node):
            turned = place @ instance
            for vertices, faces in self._mesh(node):
                yield Part(vertices @ turned[:3, :3].T + turned[:3, 3], faces)

    def _instances(self, node: Record) -> Iterator[Array]:
        attributes = _extension(node, INSTANCES).get("attributes", {})
        columns = {
            key: self._values(attributes[name])
            for key, name in (
                ("translation", "TRANSLATION"),
                ("rotation", "ROTATION"),
                ("scale", "SCALE"),
            )
            if name in attributes
        }
        if not columns:
            yield np.eye(4)
            return
        counts = {len(values) for values in columns.values()}
        if len(counts) > 1:
            raise MeshError("has instances with different numbers of places, turns and scales")
        for number in range(counts.pop()):
            yield _transform({key: values[number] for key, values in columns.items()})

    def _mesh(self, node: Record) -> list[Part]:
        number = node["mesh"]
        weights = node.get("weights")
        if weights is None and number in self._meshes:
            return self._meshes[number]
        mesh = self._entry("meshes", number)
        shape = mesh.get("weights", ()) if weights is None else weights
        parts = [
            self._primitive(primitive, shape)
            for primitive in mesh["primitives"]
            if primitive.get("mode", TRIANGLES) not in POINTS_AND_LINES
        ]
        if weights is None:
            self._meshes[number] = parts
        return parts

    def _primitive(self, primitive: Record, weights: Sequence[float]) -> Part:
        attributes = primitive["attributes"]
        if "POSITION" not in attributes:
            raise MeshError("has triangles without POSITION")
        is_packed = bool(_extension(primitive, DRACO))
        if is_packed and "bufferView" not in self._entry("accessors", attributes["POSITION"]):
            raise _needs(DRACO)
        vertices = self._values(attributes["POSITION"])
        for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
            if weight and "POSITION" in target:
                vertices = vertices + weight * self._values(target["POSITION"])
        numbers: Indices = np.arange(len(vertices))
        if "indices" in primitive:
            numbers = self._values(primitive["indices"])[:, 0].astype(np.int64)
        mode = primitive.get("mode", TRIANGLES)
        if mode == TRIANGLES and len(numbers) % 3:
            raise MeshError(f"has triangles of {len(numbers)} corners in all: it is damaged")
        if mode not in {TRIANGLES, STRIP, FAN}:
            raise MeshError(f"has a primitive of unknown mode {mode}")
        faces = {STRIP: strip, FAN: fan}.get(mode, lambda n: n.reshape(-1, 3))(numbers)
        return Part(vertices, faces)

    def _values(self, number: int) -> Array:
        """Values of an accessor, (count, width), normalized."""
        accessor = self._entry("accessors", number)
        kind = np.dtype(KINDS[accessor["componentType"]])
        shape = _whole(accessor, "count"), WIDTHS[accessor["type"]]
        if shape[0] > MAX_VALUES:
            raise MeshError(f"accessor {number} declares {shape[0]} values, which are too many")
        values = np.zeros(shape, kind)
        if "bufferView" in accessor:
            values = self._array(accessor, kind, shape).copy()
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            count = _whole(sparse, "count")
            where = np.dtype(KINDS[sparse["indices"]["componentType"]])
            places = self._array(sparse["indices"], where, (count, 1))[:, 0]
            values[places] = self._array(sparse["values"], kind, (count, shape[1]))
        if not accessor.get("normalized", False) or kind.kind == "f":
            return values.astype(float)
        share: Array = np.maximum(values / np.iinfo(kind).max, -1.0)
        return share

    def _array(
        self, record: Record, kind: np.dtype[Any], shape: tuple[int, int]
    ) -> NDArray[np.generic]:
        view = self._entry("bufferViews", record["bufferView"])
        size = kind.itemsize * shape[1]
        stride = _whole(view, "byteStride") or size
        begin, length = _whole(view, "byteOffset"), _whole(view, "byteLength")
        offset = _whole(record, "byteOffset")
        data = self._buffer(view)
        is_inside = begin + length <= len(data)
        if shape[0] and not (is_inside and offset + (shape[0] - 1) * stride + size <= length):
            raise MeshError("has values beyond the end of its data: it is damaged or cut short")
        strides = stride, kind.itemsize
        return np.ndarray(shape, kind, data, begin + offset if shape[0] else 0, strides)

    def _buffer(self, view: Record) -> bytes:
        number = view["buffer"]
        if number in self._buffers:
            return self._buffers[number]
        buffer = self._entry("buffers", number)
        uri = buffer.get("uri")
        if uri is not None:
            data = self._of_uri(uri)
        elif number == 0 and self._binary is not None:
            data = self._binary
        else:
            packed = next((name for name in MESHOPT if _extension(view, name)), None)
            raise _needs(packed) if packed else MeshError(f"buffer {number} has no data")
        if len(data) < _whole(buffer, "byteLength"):
            raise MeshError(
                f"buffer {number} should have {buffer['byteLength']} bytes and has {len(data)}: "
                "it is cut short"
            )
        self._buffers[number] = data
        return data

    def _of_uri(self, uri: str) -> bytes:
        kind, comma, text = uri.partition(",")
        if kind.lower().startswith("data:") and comma:
            data = unquote_to_bytes(text)
            return _decoded(data) if kind.lower().endswith(";base64") else data
        beside = self._folder / unquote(uri)
        try:
            return beside.read_bytes()
        except OSError as error:
            raise MeshError(f"{beside.name} beside it: {error.strerror}") from error

    def _entry(self, group: str, number: object) -> Record:
        entries = self._document.get(group, ())
        if not isinstance(number, int) or not 0 <= number < len(entries):
            raise MeshError(f"has no {group} {number}: it is damaged")
        entry: Record = entries[number]
        return entry


def _decoded(text: bytes) -> bytes:
    """Bytes of a text in Base64, in either of its two alphabets."""
    return base64.b64decode(text.translate(bytes.maketrans(b"-_", b"+/")))


def _extension(record: Record, name: str) -> Record:
    found: Record = record.get("extensions", {}).get(name, {})
    return found


def _whole(record: Record, key: str) -> int:
    number = record.get(key, 0)
    if not isinstance(number, int) or number < 0:
        raise MeshError(f"{key} = {number!r}: should be a whole number")
    return number


def _transform(node: Record) -> Array:
    """Transform of a node or an instance, (4, 4)."""
    if "matrix" in node:
        columns: Array = np.array(node["matrix"], dtype=float).reshape(4, 4)
        return columns.T
    quaternion = np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), dtype=float)
    x, y, z, w = quaternion / (np.linalg.norm(quaternion) or 1.0)  # integers are rounded
    transform = np.eye(4)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    transform[:3, :3] = turn * np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=float)
    transform[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return transform
