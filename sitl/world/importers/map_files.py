"""Reads the files of a ROS map, a YAML file and an image, as cells."""

import math
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from companion.core.arrays import Mask
from companion.core.textfile import NotTextError, read_text, reason
from sitl.core.errors import error_line
from sitl.world.format import Metres, WorldError
from sitl.world.known import Raster
from sitl.world.plan import OUTSIDE_M

MAX_YAML_BYTES = 65_536
"""Largest YAML file, bytes. Chosen."""
MAX_CELLS_A_SIDE = 8000
"""Largest width or height of the image, cells. Chosen."""
MAX_SUM = 3 * 255
"""Sum of a white cell's red, green and blue."""

Sums = NDArray[np.uint16]
Share = Annotated[float, Field(ge=0, le=1)]


class _Record(BaseModel):
    """Content of the YAML file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    image: str = Field(min_length=1)
    resolution: float = Field(gt=0, le=1)
    origin: tuple[Metres, Metres, Annotated[float, Field(ge=-7, le=7)]]
    negate: bool
    occupied_thresh: Share
    free_thresh: Share
    mode: Literal["trinary", "scale", "raw"] = "trinary"

    @model_validator(mode="after")
    def _leaves_no_cell_both(self) -> "_Record":
        if self.free_thresh > self.occupied_thresh:
            raise ValueError("free_thresh should not be above occupied_thresh")
        return self


@dataclass(frozen=True, slots=True)
class Grid:
    """Occupied and free cells and their place; all other cells are unknown."""

    occupied: Mask
    free: Mask
    raster: Raster


def read_map(path: Path) -> Grid:
    """Read a map's cells.

    Raises:
        WorldError: a file cannot be read or is invalid.
    """
    return _grid(path, _read_record(path))


def _read_record(path: Path) -> _Record:
    try:
        if path.stat().st_size > MAX_YAML_BYTES:
            raise WorldError(f"{path}: not a map's YAML file: longer than {MAX_YAML_BYTES} bytes")
        content = _parse(read_text(path))
        if not isinstance(content, dict):
            raise WorldError(f"{path}: not a map: image, resolution, origin, ... are needed")
        return _Record.model_validate(content)
    except (OSError, NotTextError) as error:
        raise WorldError(f"{path}: {reason(error)}") from error
    except yaml.YAMLError as error:
        raise WorldError(f"{path}: not YAML: {error}") from error
    except ValidationError as error:
        raise WorldError(f"{path}: {error_line(error)}") from error


def _parse(text: str) -> Any:
    """Parse YAML. For a wrong number or tag the parser raises various Python errors.

    A key that occurs twice is refused: of two values map_server takes the first, PyYAML the last.
    """
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        keys = (
            [str(key.value) for key, _ in root.value] if isinstance(root, yaml.MappingNode) else []
        )
        if twice := sorted({key for key in keys if keys.count(key) > 1}):
            raise yaml.YAMLError(f"the key {twice[0]!r} occurs {keys.count(twice[0])} times")
        return yaml.safe_load(text)
    except (ValueError, LookupError, AttributeError, TypeError, RecursionError) as error:
        raise yaml.YAMLError(str(error)) from error


def _grid(path: Path, record: _Record) -> Grid:
    sums, is_opaque = _read_picture(path, record.image)
    every = np.arange(MAX_SUM + 1)
    percent = every // 3 if record.mode == "raw" else every / MAX_SUM * 100
    if record.mode != "raw" and not record.negate:
        percent = 100 - percent
    known = percent <= 100
    occupied = (known & (percent > 100 * record.occupied_thresh))[sums] & is_opaque
    free = (known & (percent < 100 * record.free_thresh))[sums] & is_opaque
    raster = Raster(record.resolution, record.origin)
    return _cropped(Grid(np.flipud(occupied), np.flipud(free), raster))


def _cropped(grid: Grid) -> Grid:
    """The grid without the unknown around it, except the margin that a drone may enter."""
    margin = 1 + math.ceil(OUTSIDE_M / grid.raster.cell_m)
    known = grid.occupied | grid.free
    spans = []
    for axis in (1, 0):
        at = np.flatnonzero(known.any(axis=axis))
        spans.append((int(at[0]), int(at[-1]) + 1) if len(at) else (0, 1))
    (south, north), (west, east) = spans
    occupied, free = (
        np.pad(cells[south:north, west:east], margin) for cells in (grid.occupied, grid.free)
    )
    return Grid(occupied, free, replace(grid.raster, first=(west - margin, south - margin)))


def _read_picture(path: Path, name: str) -> tuple[Sums, Mask]:
    """Sum of each cell's colours (black is 0), and the opaque cells; rows from the top."""
    try:
        with (path.parent / name).open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            image = Image.open(file, formats=("PPM", "PNG"))
            if max(image.size) > MAX_CELLS_A_SIDE:
                raise WorldError(
                    f"{path}: image = {name}: {image.width} × {image.height} cells are "
                    f"too many, {MAX_CELLS_A_SIDE} a side at most; cut out a part, or coarsen it"
                )
            if image.mode == "F":
                raise UnidentifiedImageError
            return _sums(image)
    except WorldError:
        raise
    except UnidentifiedImageError as error:
        raise WorldError(
            f"{path}: image = {name}: neither PGM nor PNG; save it as PNG in an image editor"
        ) from error
    except Exception as error:  # decoders raise any exception on a damaged image
        raise WorldError(f"{path}: image = {name}: {reason(error)}") from error


def _sums(image: Image.Image) -> tuple[Sums, Mask]:
    """Sum of red, green and blue; Pillow's own grey weights them by perception."""
    hidden = image.info.get("transparency")
    if image.mode.startswith("I"):  # 16 bits
        wide: NDArray[np.int32] = np.asarray(image).astype(np.int32)
        is_opaque: Mask = wide != (hidden if isinstance(hidden, int) else -1)
        return np.uint16(3) * (wide >> 8).astype(np.uint16), is_opaque
    if hidden is not None or "A" in image.getbands() or image.mode == "P":
        *colours, alpha = (np.asarray(band) for band in image.convert("RGBA").split())
        return np.sum(colours, axis=0, dtype=np.uint16), alpha == 255
    bands = image.convert("RGB" if image.mode == "RGB" else "L").split()
    sums: Sums = np.zeros((image.height, image.width), dtype=np.uint16)
    for band in bands:
        sums += np.asarray(band) * np.uint16(3 // len(bands))
    return sums, np.ones(sums.shape, dtype=bool)
