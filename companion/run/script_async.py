"""Flies step by step from a coroutine; see docs/scripts.md.

    async with connect_async("drone.toml") as drone:
        await drone.take_off()
        await drone.fly_to(2.0, 0.0)

Each step is that of `Drone`, in a thread. A step whose task is cancelled is stopped: the drone
hovers. The drone lands when the context ends, for any reason.
"""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import ParamSpec, TypeVar

from companion.core.errors import CompanionError
from companion.core.messages import Beam, FloorPlan, Pose, RangeReading
from companion.run.script import Drone, connect
from companion.run.telemetry import Subscriptions
from companion.team.teammate import Heard

P = ParamSpec("P")
T = TypeVar("T")


def connect_async(
    config: str | Path | None = None,
    *,
    link: str | None = None,
    bus: str | None = None,
    out: str | Path | None = None,
    settings: Mapping[str, object] | None = None,
    tell: Callable[[str], None] = print,
    skip_rehearsal: bool = False,
) -> "AsyncDrone":
    """Create a drone, to be used as an asynchronous context manager.

    Arguments and errors are those of `connect`.
    """
    drone = connect(
        config,
        link=link,
        bus=bus,
        out=out,
        settings=settings,
        tell=tell,
        skip_rehearsal=skip_rehearsal,
    )
    return AsyncDrone(drone)


class AsyncDrone:
    """One flight. Names, arguments and errors are those of `Drone`.

    The drone hovers when the task of a step is cancelled, also by `asyncio.timeout`. A landing and
    a take-off continue.
    """

    def __init__(self, drone: Drone) -> None:
        self._drone = drone

    async def __aenter__(self) -> "AsyncDrone":
        """Start the control loop and wait for the autopilot; see `Drone`."""
        try:
            await _in_thread(self._drone.__enter__)
        except asyncio.CancelledError:
            with suppress(CompanionError):
                await _to_the_end(lambda: self._drone.__exit__(None, None, None))
            raise
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Land at the current position if in flight. A cancellation waits for the landing."""
        await _to_the_end(lambda: self._drone.__exit__(kind, error, trace))

    # Steps

    async def take_off(self) -> None:
        """See `Drone.take_off`."""
        await self._do(self._drone.take_off)

    async def scan_room(self) -> None:
        """See `Drone.scan_room`."""
        await self._do(self._drone.scan_room)

    async def explore(self, mission: str = "building") -> None:
        """See `Drone.explore`."""
        await self._do(self._drone.explore, mission)

    async def fly_to(
        self,
        north_m: float,
        east_m: float,
        *,
        height_m: float | None = None,
        yaw_rad: float | None = None,
        timeout_s: float | None = None,
    ) -> None:
        """See `Drone.fly_to`."""
        await self._do(
            self._drone.fly_to,
            north_m,
            east_m,
            height_m=height_m,
            yaw_rad=yaw_rad,
            timeout_s=timeout_s,
        )

    async def fly_velocity(
        self,
        forward_m_s: float = 0.0,
        right_m_s: float = 0.0,
        down_m_s: float = 0.0,
        yaw_rate_rad_s: float = 0.0,
        *,
        seconds: float | None = None,
    ) -> None:
        """See `Drone.fly_velocity`."""
        velocity = forward_m_s, right_m_s, down_m_s, yaw_rate_rad_s
        await self._do(self._drone.fly_velocity, *velocity, seconds=seconds)

    async def stop(self) -> None:
        """See `Drone.stop`."""
        self._drone.stop()

    async def go_home(self) -> None:
        """See `Drone.go_home`."""
        await self._do(self._drone.go_home)

    async def land(self) -> None:
        """See `Drone.land`."""
        await self._do(self._drone.land)

    # State and map

    @property
    def telemetry(self) -> Subscriptions:
        """Subscriptions, to be read with `async for`."""
        return self._drone.telemetry

    @property
    def activity(self) -> str:
        """See `Drone.activity`."""
        return self._drone.activity

    @property
    def pose(self) -> Pose | None:
        """See `Drone.pose`."""
        return self._drone.pose

    @property
    def teammates(self) -> tuple[Heard, ...]:
        """See `Drone.teammates`."""
        return self._drone.teammates

    @property
    def readings(self) -> Mapping[Beam, RangeReading]:
        """See `Drone.readings`."""
        return self._drone.readings

    async def map(self) -> FloorPlan:
        """See `Drone.map`."""
        return await _in_thread(self._drone.map)

    async def export(self, path: str | Path) -> None:
        """See `Drone.export`."""
        await _in_thread(self._drone.export, path)

    async def _do(self, step: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        try:
            await _in_thread(step, *args, **kwargs)
        except asyncio.CancelledError:
            self._drone.stop()
            raise


async def _in_thread(call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Result of a call in a thread, which a cancellation leaves to itself."""
    running = asyncio.ensure_future(asyncio.to_thread(call, *args, **kwargs))
    running.add_done_callback(_retrieve)
    await asyncio.wait([running])
    return running.result()


def _retrieve(done: "asyncio.Future[T]") -> None:
    """Take the error of a call that nobody waits for any more; asyncio would report it."""
    if not done.cancelled():
        done.exception()


async def _to_the_end(call: Callable[[], None]) -> None:
    """Wait for a call in a thread; a cancellation takes effect afterwards."""
    running = asyncio.ensure_future(asyncio.to_thread(call))
    cancelled: asyncio.CancelledError | None = None
    while not running.done():
        try:
            await asyncio.wait([running])
        except asyncio.CancelledError as error:
            cancelled = error
    running.result()
    if cancelled is not None:
        raise cancelled
