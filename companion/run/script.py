"""Flies step by step from a Python script; see docs/scripts.md.

    with connect("drone.toml") as drone:
        drone.take_off()
        drone.scan_room()
        drone.export("room.dxf")
        drone.go_home()

The control loop is that of `companion fly`. It runs in a thread, independently of the script. The
drone lands when the context ends, for any reason.
"""

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import NoReturn, TypeVar

from companion.app import App
from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.errors import FlightEndedError, NotCompletedError
from companion.core.messages import (
    HOLD,
    Beam,
    FloorPlan,
    Order,
    Pose,
    RangeReading,
    Setpoint,
    Target,
    Task,
)
from companion.export.map_files import save
from companion.export.write import write
from companion.pdps.flight.orders import REPLACED
from companion.pdps.flight.state import FINAL_PHASES, UNARMED_PHASES, FlightState, Phase
from companion.run.hardware import open_rig
from companion.run.loop import ControlLoop
from companion.run.script_limits import require_target, require_velocity
from companion.run.telemetry import Telemetry
from companion.team.radio import new_instance
from companion.team.teammate import Heard
from companion.ticks import Inputs, Outputs, Progress

T = TypeVar("T")
LOOK_S = 0.2
"""Period of the checks while the script waits, s. Chosen."""
DEADMAN_S = 0.5
"""Time of the flight for which the drone keeps a velocity that the script does not renew, s.
Chosen: ten ticks, in which the drone flies half a metre."""


def connect(
    config: str | Path | None = None,
    *,
    link: str | None = None,
    bus: str | None = None,
    out: str | Path | None = None,
    settings: Mapping[str, object] | None = None,
    tell: Callable[[str], None] = print,
) -> "Drone":
    """Create a drone, to be used as a context manager.

    `config` is the companion's TOML file. `link`, `bus` and `settings`, such as
    {"mission.height_m": 1.0}, override it. `out` is a folder for recording and map. `tell` receives
    warnings.

    Raises:
        ConfigError: the configuration is invalid; one line that names the key and the remedy.
    """
    given = {"link.url": link, "sensors.bus": bus, **(settings or {})}
    overrides = {key: value for key, value in given.items() if value is not None}
    loaded = configuration.load(Path(config) if config else None, overrides)
    return Drone(loaded, Path(out) if out else None, tell)


class Drone:
    """One flight. Every step blocks until it is complete.

    Each step raises FlightEndedError if the flight ends first, by a fault, the pilot, a lost link
    or the time limit; its text is that of `companion fly`. It raises NotCompletedError if the
    flight goes on without the step: if the drone is on the ground, if it turned back for its
    battery or time and hovers over the start, or if another step or `stop` replaced the step.
    """

    def __init__(self, config: Config, out: Path | None, tell: Callable[[str], None]) -> None:
        self._config = config
        self._out = out
        self._tell = tell
        self._app = App(config, instance=new_instance())
        self.telemetry = Telemetry()
        """Subscriptions to pose, readings, battery, activity and walls."""
        self._order = Order()
        self._ordering = threading.Lock()
        self._told = 0
        """Number of the last order of which the script knows that it was not completed."""
        self._is_to_land = False
        self._latest: Outputs | None = None
        self._plan: FloorPlan | None = None
        self._error: BaseException | None = None
        self._asked: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._ticked = threading.Condition()
        self._thread = threading.Thread(target=self._fly, name="control loop", daemon=True)

    def __enter__(self) -> "Drone":
        """Start the control loop and wait for the autopilot.

        Raises:
            CompanionError: link or sensors cannot be opened, or no autopilot responds.
        """
        self._thread.start()
        self._wait(lambda flight: flight.phase is not Phase.CONNECT)
        if self._flight.phase in FINAL_PHASES:
            raise FlightEndedError(self._flight.ending)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Land at the current position if in flight; Ctrl-C leaves the landing to the autopilot."""
        self._is_to_land = True
        while self._thread.is_alive():
            self._thread.join(LOOK_S)
        if self._error is not None and error is None:
            raise self._error

    # Steps

    def take_off(self) -> None:
        """Take off to `mission.height_m`, after the gyro's calibration and a valid estimate."""
        self._do(Task.TAKE_OFF)

    def scan_room(self) -> None:
        """Scan the current room with PDPS; ends when the outline of the room is closed."""
        self._do(Task.SCAN, "room")

    def explore(self, mission: str = "building") -> None:
        """Map all that is reachable, with mission "building", "exterior" or "layers".

        docs/missions.md describes the missions.

        Raises:
            ValueError: another mission.
        """
        if mission not in ("building", "exterior", "layers"):
            raise ValueError(f"mission = {mission!r}: should be building, exterior or layers")
        self._do(Task.SCAN, mission)

    def fly_to(
        self,
        north_m: float,
        east_m: float,
        *,
        height_m: float | None = None,
        yaw_rad: float | None = None,
        timeout_s: float | None = None,
    ) -> None:
        """Fly to a place through measured free space, round all obstacles, and hover there.

        The place is in the frame of the map: local NED from the take-off place, north along the
        nose at take-off. The drone travels at the height of the map, `mission.height_m`. Over the
        place it climbs or descends to `height_m`, above the take-off point, and turns to `yaw_rad`,
        clockwise from north. If it knows no path, it looks all round once. `timeout_s` is in
        seconds of the flight.

        Raises:
            NotCompletedError: the place is not free, not reachable or not reached in time; the text
                names the reason and the remedy.
            ValueError: a height or another value is out of its limits.
        """
        target = Target((north_m, east_m), height_m, yaw_rad)
        require_target(target, timeout_s)
        until_s = math.inf if timeout_s is None else self._now_s + timeout_s
        self._do(Task.FLY_TO, target=target, until_s=until_s)

    def fly_velocity(
        self,
        forward_m_s: float = 0.0,
        right_m_s: float = 0.0,
        down_m_s: float = 0.0,
        yaw_rate_rad_s: float = 0.0,
        *,
        seconds: float | None = None,
    ) -> None:
        """Fly at a velocity in the body frame (FRD), and hover after `seconds` of the flight.

        Without `seconds` it returns at once. Then the drone keeps the velocity for `DEADMAN_S`, or
        until the next step: call it again in time. The velocity guard limits every setpoint, so the
        drone may be slower. Off the height of the map it flies level at no more than 0.2 m/s.
        `yaw_rate_rad_s` is clockwise.

        Raises:
            NotCompletedError: the guard has refused the velocity for a second. Without `seconds`,
                the next call raises it.
            ValueError: the velocity is above `mission.speed_m_s`, `mission.turn_rate_deg_s` or
                0.4 m/s up or down, or `seconds` is not positive.
        """
        velocity = Setpoint(forward_m_s, right_m_s, down_m_s, yaw_rate_rad_s)
        require_velocity(velocity, seconds, self._config.mission)
        self._require_air(Task.FLY_VELOCITY)
        if seconds is not None:
            self._fly_velocity(velocity, self._now_s + seconds)
            return
        flight = self._flight
        if flight.undone and flight.obeyed > self._told:
            self._fail(flight)
        self._ask(Task.FLY_VELOCITY, velocity=velocity, until_s=self._now_s + DEADMAN_S)

    def stop(self) -> None:
        """End the present step: the drone hovers, and the step raises NotCompletedError.

        It is for another thread, and returns at once. A landing, a take-off, and the return with
        the battery or time that is left continue.
        """
        self._ask(Task.WAIT)

    def go_home(self) -> None:
        """Fly to the take-off point through free space."""
        self._do(Task.HOME)

    def land(self) -> None:
        """Land at the current position, which ends the flight."""
        self._require_air(Task.LAND)
        self._ask(Task.LAND)
        flight = self._wait(lambda flight: flight.phase in FINAL_PHASES)
        self._thread.join()
        if self._error is not None:
            raise self._error
        if not flight.completed:
            raise FlightEndedError(flight.ending)

    # State and map

    @property
    def activity(self) -> str:
        """Current activity as text; after the flight, its result."""
        flight = self._flight
        return flight.ending if flight.phase in FINAL_PHASES else flight.activity

    @property
    def pose(self) -> Pose | None:
        """Current pose, local NED; None before the gyro is calibrated."""
        return self._latest.pose if self._latest else None

    @property
    def teammates(self) -> tuple[Heard, ...]:
        """The other drones of its team that it hears now."""
        team, latest = self._app.team, self._latest
        return team.mates.heard(latest.scan.time_s) if team and latest else ()

    @property
    def readings(self) -> Mapping[Beam, RangeReading]:
        """Latest range readings by beam."""
        return self._latest.scan.readings if self._latest else {}

    def map(self) -> FloorPlan:
        """Current map; after landing, the final map with the whole flight smoothed.

        Before landing, a wall may be in two pieces, or twice in the map a few centimetres apart.
        """
        asked: Future[FloorPlan] = Future()
        self._asked.put(lambda: asked.set_result(self._app.floor_plan()))
        while not asked.done() and self._thread.is_alive():
            with self._ticked:
                self._ticked.wait_for(asked.done, LOOK_S)
        if self._error is not None:
            raise self._error
        return asked.result() if self._plan is None else self._plan

    def export(self, path: str | Path) -> None:
        """Write the map to a file; the suffix selects a format of docs/exports.md, or png.

        Raises:
            ValueError: unknown format.
            MissingExtraError: the library of the format is not installed.
            OutputError: the file cannot be written.
        """
        link = self._config.link
        place = link.place
        write(self.map(), Path(path), Path(path).stem, place)

    # The control loop's thread

    def _fly(self) -> None:
        try:
            self._fly_recorded()
        except BaseException as error:
            self._error = error
        self.telemetry.close()
        with self._ticked:
            self._ticked.notify_all()

    def _fly_recorded(self) -> None:
        with open_rig(self._config, self._out, self._tell) as (rig, recorder):

            def record(now_s: float, inputs: Inputs, outputs: Outputs) -> None:
                recorder.tick(now_s, inputs, outputs)
                self.telemetry.publish(inputs, outputs)
                self._tick(outputs)

            try:
                ControlLoop(
                    self._app,
                    rig,
                    _nobody_at_a_terminal,
                    lambda: self._is_to_land,
                    record,
                    orders=lambda: self._order,
                ).run()
            finally:
                self._plan = self._app.final_floor_plan()
                recorder.close(self._plan)
                if self._out is not None:
                    save(self._plan, self._out)

    def _tick(self, outputs: Outputs) -> None:
        while True:
            try:
                self._asked.get_nowait()()
            except Empty:
                break
        with self._ticked:
            self._latest = outputs
            self._ticked.notify_all()

    @property
    def _flight(self) -> FlightState:
        return self._app.flight

    @property
    def _now_s(self) -> float:
        """Time of the flight at the last tick, s."""
        return self._latest.scan.time_s if self._latest else 0.0

    def _do(
        self,
        task: Task,
        mission: str = "",
        *,
        target: Target | None = None,
        until_s: float = math.inf,
    ) -> None:
        self._require_air(task)
        self._wait_for(self._ask(task, mission, target=target, until_s=until_s), _is_done)

    def _fly_velocity(self, velocity: Setpoint, until_s: float) -> None:
        """Order a velocity again and again, so that the drone stops if the script does."""
        number: int | None = None
        while (now_s := self._now_s) < until_s:
            valid_s = min(now_s + DEADMAN_S, until_s)
            number = self._ask(Task.FLY_VELOCITY, velocity=velocity, until_s=valid_s, renews=number)
            self._wait_for(number, _is_obeyed)
        if number is not None:
            self._wait_for(number, _is_done)

    def _ask(
        self,
        task: Task,
        mission: str = "",
        *,
        target: Target | None = None,
        velocity: Setpoint = HOLD,
        until_s: float = math.inf,
        renews: int | None = None,
    ) -> int:
        """Give an order and return its number. `renews`: number of the order that it continues.

        Raises:
            NotCompletedError: another order has replaced the one to be continued.
        """
        with self._ordering:
            if renews not in (None, self._order.number):
                raise NotCompletedError(REPLACED)
            number, is_renewal = self._order.number + 1, renews is not None
            self._order = Order(number, task, mission, target, velocity, until_s, is_renewal)
            return number

    def _require_air(self, task: Task) -> None:
        if task is not Task.TAKE_OFF and self._flight.phase in UNARMED_PHASES:
            raise NotCompletedError(f"cannot {task.value} on the ground: take_off() comes first")

    def _fail(self, flight: FlightState) -> NoReturn:
        self._told = flight.obeyed
        raise NotCompletedError(flight.undone or REPLACED)

    def _wait_for(self, number: int, is_so: Callable[[FlightState, int], bool]) -> None:
        """Wait for what an order leads to.

        Raises:
            NotCompletedError: another order replaced it, or the flight did not complete it.
        """

        def is_settled(flight: FlightState) -> bool:
            never_begins = flight.obeyed < number < self._order.number
            return is_so(flight, number) or flight.obeyed > number or never_begins

        flight = self._wait(is_settled)
        if flight.obeyed != number or flight.undone:
            self._fail(flight)

    def _wait(self, is_so: Callable[[FlightState], bool]) -> FlightState:
        """Wait until the condition is met, and return the state in which it is.

        Raises:
            FlightEndedError: the flight has ended before.
        """
        met: list[FlightState] = []

        def is_done() -> bool:
            flight = self._flight
            if is_so(flight) or flight.phase in FINAL_PHASES or not self._thread.is_alive():
                met.append(flight)
            return bool(met)

        with self._ticked:
            while not self._ticked.wait_for(is_done, LOOK_S):  # Ctrl-C gets through in between
                continue
        if self._error is not None:
            raise self._error
        if not is_so(met[0]):
            raise FlightEndedError(met[0].ending)
        return met[0]


def _is_done(flight: FlightState, number: int) -> bool:
    return flight.obeyed == number and flight.phase is Phase.HOVER


def _is_obeyed(flight: FlightState, number: int) -> bool:
    return flight.obeyed == number


def _nobody_at_a_terminal(progress: Progress) -> None:
    """Ignore the progress: a script reads the state it needs."""
