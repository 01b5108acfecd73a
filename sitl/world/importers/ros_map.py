"""Maps of ROS map_server: a YAML file beside a picture (PGM or PNG) of the cells.

Dark cells are walls, light ones free, those between unknown. As in ROS, x is east and y north, and
`origin` is x, y and yaw of the picture's lower left corner. Maps have no heights, so walls go to a
ceiling at 2.6 m. A cell that is partly transparent is unknown, in every mode.
"""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from companion.frames import Vector2
from companion.textfile import NotTextError, read_text
from sitl.errors import complaint
from sitl.world.format import LEAST_LENGTH_M, Metres, Segment, World, WorldError
from sitl.world.importers import CEILING_M, FARTHEST_M, MOST_WALLS
from sitl.world.importers.contours import Cells, outlines, roughness, straightened
from sitl.world.importers.starts import free_starts
from sitl.world.polylines import Points, legs

MOST_YAML_BYTES = 65_536
MOST_CELLS_A_SIDE = 8000
MOST_EDGES = 400_000
"""Of cells, along walls; a building has some ten thousand, noise has millions."""
MOST_OUTLINES = 20_000
SAME_TO_DIGITS = 6
MOST_SUM = 3 * 255
"""Of a white cell's red, green and blue."""

Sums = NDArray[np.uint16]
Share = Annotated[float, Field(ge=0, le=1)]


class _Record(BaseModel):
    """The YAML file."""

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
class _Grid:
    """Cells by row, northwards, and column, eastwards, and where they lie."""

    occupied: Cells
    free: Cells
    record: _Record

    def to_plan(self, corners: Points) -> Points:
        """(column, row) of cells' corners to (north, east) in metres."""
        x_m, y_m, yaw_rad = self.record.origin
        right, up = self.record.resolution * corners.T
        east = x_m + math.cos(yaw_rad) * right - math.sin(yaw_rad) * up
        north = y_m + math.sin(yaw_rad) * right + math.cos(yaw_rad) * up
        return np.column_stack([north, east])

    def is_free(self, place: Vector2) -> bool:
        """The cell at a place (north, east) is known to be free."""
        x_m, y_m, yaw_rad = self.record.origin
        north, east = place[0] - y_m, place[1] - x_m
        right = math.cos(yaw_rad) * east + math.sin(yaw_rad) * north
        up = math.cos(yaw_rad) * north - math.sin(yaw_rad) * east
        row, column = (math.floor(along / self.record.resolution) for along in (up, right))
        rows, columns = self.free.shape
        return 0 <= row < rows and 0 <= column < columns and bool(self.free[row, column])


def load_ros_map(path: Path, tell: Callable[[str], None]) -> World:
    """Read a map.

    Raises:
        WorldError: nothing can be made of it; one line that says why.
    """
    record = _read_record(path)
    grid = _grid(path, record)
    segments = _walls(path, grid, tell)
    return World.model_validate(
        {
            "name": path.stem,
            "height_m": CEILING_M,
            "walls": [{"points": segment} for segment in segments],
            "starts": free_starts(segments, str(path), grid.is_free),
        }
    )


def _read_record(path: Path) -> _Record:
    try:
        if path.stat().st_size > MOST_YAML_BYTES:
            raise WorldError(f"{path}: not a map's YAML file: longer than {MOST_YAML_BYTES} bytes")
        content = _parse(read_text(path))
        if not isinstance(content, dict):
            raise WorldError(f"{path}: not a map: image, resolution, origin, ... are needed")
        return _Record.model_validate(content)
    except (OSError, NotTextError) as error:
        raise WorldError(f"{path}: {error}") from error
    except yaml.YAMLError as error:
        raise WorldError(f"{path}: not YAML: {error}") from error
    except ValidationError as error:
        raise WorldError(f"{path}: {complaint(error)}") from error


def _parse(text: str) -> Any:
    """YAML; the parser answers a wrong number or tag with any of Python's own errors."""
    try:
        return yaml.safe_load(text)
    except (ValueError, LookupError, AttributeError, TypeError, RecursionError) as error:
        raise yaml.YAMLError(str(error)) from error


def _grid(path: Path, record: _Record) -> _Grid:
    sums, is_opaque = _read_picture(path, path.parent / record.image)
    every = np.arange(MOST_SUM + 1)
    percent = every // 3 if record.mode == "raw" else every / MOST_SUM * 100
    if record.mode != "raw" and not record.negate:
        percent = 100 - percent
    known = percent <= 100
    occupied = (known & (percent > 100 * record.occupied_thresh))[sums] & is_opaque
    free = (known & (percent < 100 * record.free_thresh))[sums] & is_opaque
    return _Grid(np.flipud(occupied), np.flipud(free), record)


def _read_picture(path: Path, picture: Path) -> tuple[Sums, Cells]:
    """Sums of each cell's colours, black is 0, and which cells are opaque; rows from the top."""
    try:
        with picture.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            image = Image.open(file, formats=("PPM", "PNG"))
            if max(image.size) > MOST_CELLS_A_SIDE:
                raise WorldError(
                    f"{path}: image = {picture.name}: {image.width} × {image.height} cells are "
                    f"too many, {MOST_CELLS_A_SIDE} a side at most; cut out a part, or coarsen it"
                )
            return _sums(image)
    except WorldError:
        raise
    except Exception as error:  # on a damaged picture the decoders raise whatever comes to hand
        raise WorldError(f"{path}: image = {picture.name}: {error}") from error


def _sums(image: Image.Image) -> tuple[Sums, Cells]:
    """Red, green and blue added up: Pillow's own greys weigh them as the eye does."""
    hidden = image.info.get("transparency")
    if image.mode.startswith("I"):  # 16 bits
        wide: NDArray[np.int32] = np.asarray(image).astype(np.int32)
        is_opaque: Cells = wide != (hidden if isinstance(hidden, int) else -1)
        return np.uint16(3) * (wide >> 8).astype(np.uint16), is_opaque
    if hidden is not None or "A" in image.getbands() or image.mode == "P":
        *colours, alpha = (np.asarray(band) for band in image.convert("RGBA").split())
        return np.sum(colours, axis=0, dtype=np.uint16), alpha == 255
    bands = image.convert("RGB" if image.mode == "RGB" else "L").split()
    sums: Sums = np.zeros((image.height, image.width), dtype=np.uint16)
    for band in bands:
        sums += np.asarray(band) * np.uint16(3 // len(bands))
    return sums, np.ones(sums.shape, dtype=bool)


def _walls(path: Path, grid: _Grid, tell: Callable[[str], None]) -> list[Segment]:
    """The outlines of the occupied cells in metres, each piece once."""
    if not grid.occupied.any():
        raise WorldError(f"{path}: no cell is a wall; see negate, occupied_thresh and mode")
    is_noise = roughness(grid.occupied) > MOST_EDGES
    rough = [] if is_noise else outlines(grid.occupied)
    if is_noise or len(rough) > MOST_OUTLINES:
        raise WorldError(
            f"{path}: more than {MOST_OUTLINES} separate walls, or {MOST_EDGES} edges of cells; "
            "take out single cells, or see occupied_thresh"
        )
    lines = [grid.to_plan(straightened(line)).round(SAME_TO_DIGITS) for line in rough]
    pieces = [leg for line in lines for leg in legs(line)]
    long = [piece for piece in pieces if math.dist(*piece) > LEAST_LENGTH_M]
    segments = list({frozenset(piece): piece for piece in long}.values())
    if len(segments) < len(pieces):
        tell(f"left out {len(pieces) - len(segments)} of {len(pieces)} walls: repeated or tiny")
    farthest_m = max((abs(x) for piece in segments for point in piece for x in point), default=0)
    if farthest_m > FARTHEST_M:
        raise WorldError(f"{path}: reaches {farthest_m:.0f} m; {FARTHEST_M:g} m at most")
    if not 0 < len(segments) <= MOST_WALLS:
        raise WorldError(f"{path}: {len(segments)} walls; there must be 1 to {MOST_WALLS}")
    return segments
