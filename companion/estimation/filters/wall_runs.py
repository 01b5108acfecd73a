"""Detects straight pieces of wall in the stream of one beam's hits.

As the drone moves or turns, the hits of one beam move along a wall. A run collects hits as long as
they fit one line. The line is returned when hits leave it, or when it is long enough to determine
the wall's direction. Hits are stored in the dead-reckoned frame, which drifts slowly and never
jumps, so a correction of the pose cannot bend a run.
"""

import math
from dataclasses import replace

from companion.core.frames import Vector2, wrap_rad
from companion.core.values import value
from companion.estimation.smoothing.odometry_model import WANDER_S

MAX_INCIDENCE_RAD = math.radians(65)
"""Maximum incidence of a beam on a wall that the filters use, rad. Chosen. The smoothing uses up to
70° (`gating.py`), because its walls are more exact."""


@value
class Line:
    """A straight piece of wall: {p : p·n = offset}, n = (cos, sin) of `normal_rad`.

    `normal_rad` points from the drone to the wall. The sigmas are those of the fit alone; the
    offset's applies at the hits' centre. `length_m` is that of a uniform row of hits with the same
    variance.
    """

    normal_rad: float
    offset_m: float
    normal_sigma_rad: float
    offset_sigma_m: float
    centre: Vector2
    length_m: float
    misfit: float
    """χ² of the hits about the line per degree of freedom; about 1 for a wall."""
    mean_time_s: float
    mean_yaw_rad: float
    """Heading of the drone in the middle of the run, in the frame of the hits."""


@value
class RunHit:
    """One hit of a beam with the drone's position and heading at that moment, in one frame."""

    time_s: float
    position: Vector2
    variance_m2: float
    viewpoint: Vector2
    yaw_rad: float
    wander_m: float = 0.0
    """Sigma of the odometry's wander (`odometry_model.py`)."""


@value
class _Moments:
    """Weighted sums over hits. Adding a hit costs the same for any length of run."""

    weight: float = 0.0
    x: float = 0.0
    y: float = 0.0
    xx: float = 0.0
    xy: float = 0.0
    yy: float = 0.0
    time: float = 0.0
    yaw: float = 0.0
    hits: int = 0

    def with_hit(self, hit: "RunHit") -> "_Moments":
        (x, y), weight = hit.position, 1 / (hit.variance_m2 + hit.wander_m**2)
        return _Moments(
            self.weight + weight,
            self.x + weight * x,
            self.y + weight * y,
            self.xx + weight * x * x,
            self.xy + weight * x * y,
            self.yy + weight * y * y,
            self.time + weight * hit.time_s,
            self.yaw + weight * hit.yaw_rad,
            self.hits + 1,
        )


NO_HITS = _Moments()


def fit_line(moments: _Moments, viewpoint: Vector2) -> Line | None:
    """Fit a line by total least squares; None if the hits have no direction."""
    weight = moments.weight
    x, y = moments.x / weight, moments.y / weight
    var_xx = moments.xx / weight - x * x
    var_yy = moments.yy / weight - y * y
    var_xy = moments.xy / weight - x * y
    along_rad = 0.5 * math.atan2(2 * var_xy, var_xx - var_yy)
    spread = 0.5 * (var_xx + var_yy) + math.hypot(0.5 * (var_xx - var_yy), var_xy)
    if spread <= 0:
        return None
    thickness = max(var_xx + var_yy - spread, 0.0)
    normal_rad = along_rad + math.pi / 2
    cos_n, sin_n = math.cos(normal_rad), math.sin(normal_rad)
    offset_m = x * cos_n + y * sin_n
    if offset_m < viewpoint[0] * cos_n + viewpoint[1] * sin_n:
        normal_rad, offset_m = normal_rad - math.pi, -offset_m
    return Line(
        normal_rad,
        offset_m,
        normal_sigma_rad=1 / math.sqrt(weight * spread),
        offset_sigma_m=1 / math.sqrt(weight),
        centre=(x, y),
        length_m=math.sqrt(12 * spread),
        misfit=weight * thickness / (moments.hits - 2),
        mean_time_s=moments.time / weight,
        mean_yaw_rad=moments.yaw / weight,
    )


def _wandering(line: Line, wander_m: float, lasted_s: float) -> Line:
    """The line with the odometry's wander added to its sigmas.

    In a short run the wander tilts the line like a random walk: variance of the slope 6/5·q/T over
    time T. In a long run it acts like independent errors every 2·τ: 12·σ²·2τ/T³.
    """
    tilt = min(2.4 * lasted_s / WANDER_S, 24 * WANDER_S / max(lasted_s, WANDER_S))
    shift = min(1.0, 2 * WANDER_S / max(lasted_s, WANDER_S))
    return replace(
        line,
        normal_sigma_rad=math.hypot(
            line.normal_sigma_rad, wander_m * math.sqrt(tilt) / line.length_m
        ),
        offset_sigma_m=math.hypot(line.offset_sigma_m, wander_m * math.sqrt(shift)),
    )


class WallRun:
    """The growing run of one beam."""

    MIN_HITS = 8
    """Least hits of a line. Chosen."""
    MIN_LENGTH_M = 0.8
    """Least length of a finished line, m. Chosen."""
    FULL_LENGTH_M = 2.5
    """A run of this length is finished, m. Chosen."""
    MAX_NORMAL_SIGMA_RAD = math.radians(4)
    """Largest sigma of the direction of a finished line, rad. Chosen."""
    MAX_MISFIT = 1.8
    """Largest χ² per degree of freedom. A run around a corner exceeds it. Chosen."""
    MISFIT_SIGMAS = 3.0
    """A hit this many sigmas off the line does not fit it. Chosen."""
    MISFITS_TO_END = 2
    """Consecutive hits off the line that end the run. Chosen."""

    def __init__(self) -> None:
        self._moments = NO_HITS
        self._line: Line | None = None
        self._viewpoint: Vector2 = (0.0, 0.0)
        self._began_s = self._last_s = 0.0
        self._wander_m = 0.0
        self._misfits: list[RunHit] = []

    def add(self, hit: RunHit) -> Line | None:
        """Add a hit; returns the line if this hit finishes one."""
        if self._line is not None and not self._fits(self._line, hit):
            self._misfits.append(hit)
            return self._restart() if len(self._misfits) >= self.MISFITS_TO_END else None
        self._misfits.clear()
        self._take(hit)
        if self._line is not None and self._line.length_m >= self.FULL_LENGTH_M:
            return self.end()
        return None

    def end(self) -> Line | None:
        """End the run, as when the beam has no return; returns its line if it passes the limits."""
        line, self._line, self._moments = self._line, None, NO_HITS
        self._misfits.clear()
        if line is None or line.length_m < self.MIN_LENGTH_M:
            return None
        line = _wandering(line, self._wander_m, self._last_s - self._began_s)
        sure = line.normal_sigma_rad < self.MAX_NORMAL_SIGMA_RAD
        straight = line.misfit < self.MAX_MISFIT
        return line if sure and straight and self._is_faced(line) else None

    def _is_faced(self, line: Line) -> bool:
        """False for a row of hits along the beam: that is range noise, not a wall."""
        north, east = (c - v for c, v in zip(line.centre, self._viewpoint, strict=True))
        bearing_rad = math.atan2(east, north)
        return abs(wrap_rad(bearing_rad - line.normal_rad)) < MAX_INCIDENCE_RAD

    def _restart(self) -> Line | None:
        misfits = self._misfits.copy()
        finished = self.end()
        for hit in misfits:
            self._take(hit)
        return finished

    def _take(self, hit: RunHit) -> None:
        self._viewpoint = hit.viewpoint
        if not self._moments.hits:
            self._began_s = hit.time_s
        self._last_s, self._wander_m = hit.time_s, hit.wander_m
        self._moments = self._moments.with_hit(hit)
        if self._moments.hits >= self.MIN_HITS:
            self._line = fit_line(self._moments, hit.viewpoint)

    def _fits(self, line: Line, hit: RunHit) -> bool:
        x, y = hit.position
        across = x * math.cos(line.normal_rad) + y * math.sin(line.normal_rad) - line.offset_m
        along = math.dist(hit.position, line.centre)
        sigma = math.hypot(
            math.sqrt(hit.variance_m2 + hit.wander_m**2),
            line.offset_sigma_m,
            along * line.normal_sigma_rad,
        )
        return abs(across) <= self.MISFIT_SIGMAS * sigma
