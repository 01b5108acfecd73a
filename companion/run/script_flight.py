"""Flies in a thread by the orders of a script, and waits for what they lead to."""

import math
import threading
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from queue import Empty, SimpleQueue

from companion.app import App
from companion.config.settings import Config
from companion.core.errors import FlightEndedError, NotCompletedError
from companion.core.messages import HOLD, FloorPlan, Setpoint
from companion.export.map_files import save
from companion.pdps.flight.order import Order, Target, Task
from companion.pdps.flight.orders import REPLACED
from companion.pdps.flight.state import FINAL_PHASES, UNARMED_PHASES, FlightState, Phase
from companion.run.hardware import open_rig
from companion.run.loop import ControlLoop
from companion.run.telemetry import Subscriptions
from companion.team.radio import new_instance
from companion.ticks import Inputs, Outputs, Progress

LOOK_S = 0.2
"""Period of the checks while the script waits, s. Chosen."""
DEADMAN_S = 1.0
"""Time of the flight for which the drone keeps a velocity that the script does not renew, s.
Chosen: PX4's own timeout of setpoints (COM_OF_LOSS_T)."""


class OrderedFlight:
    """One flight, in a thread. Each method may be called from any thread of the script."""

    def __init__(
        self,
        config: Config,
        out: Path | None,
        tell: Callable[[str], None],
        *,
        skip_rehearsal: bool = False,
    ) -> None:
        self._config = config
        self._skip_rehearsal = skip_rehearsal
        self._out = out
        self._tell = tell
        self.app = App(config, instance=new_instance())
        self.telemetry = Subscriptions()
        self.latest: Outputs | None = None
        """Outputs of the last tick."""
        self._order = Order()
        self._ordering = threading.Lock()
        self._unawaited = 0
        """Number of the velocity for which no call waits; 0 without one."""
        self._is_to_land = False
        self._plan: FloorPlan | None = None
        self._error: BaseException | None = None
        self._asked: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._ticked = threading.Condition()
        self._thread = threading.Thread(target=self._fly, name="control loop", daemon=True)

    @property
    def state(self) -> FlightState:
        """State of the flight at the last tick."""
        return self.app.flight

    @property
    def now_s(self) -> float:
        """Time of the flight at the last tick, s."""
        return self.latest.scan.time_s if self.latest else 0.0

    def begin(self) -> None:
        """Start the control loop and wait for the autopilot.

        Raises:
            CompanionError: link or sensors cannot be opened, or no autopilot responds.
        """
        self._thread.start()
        flight = self._wait(lambda flight: flight.phase is not Phase.CONNECT)
        if flight.phase in FINAL_PHASES:
            raise FlightEndedError(flight.ending)

    def end(self, error: BaseException | None = None) -> None:
        """Land at the current position if in flight, and wait for the end of the control loop.

        `error`: an error of the script, in place of one of the flight.
        """
        self._is_to_land = True
        while self._thread.is_alive():
            self._thread.join(LOOK_S)  # Ctrl-C gets through in between
        if self._error is not None and error is None:
            raise self._error

    def plan(self) -> FloorPlan:
        """Current map; after landing, the final one."""
        asked: Future[FloorPlan] = Future()
        self._asked.put(lambda: asked.set_result(self.app.floor_plan()))
        while not asked.done() and self._thread.is_alive():
            with self._ticked:
                self._ticked.wait_for(asked.done, LOOK_S)
        if self._error is not None:
            raise self._error
        return asked.result() if self._plan is None else self._plan

    # Orders

    def do(
        self,
        task: Task,
        mission: str = "",
        *,
        target: Target | None = None,
        until_s: float = math.inf,
    ) -> None:
        """Give an order, and wait until the drone hovers after it."""
        self._require_air(task)
        self._wait_for(self._ask(task, mission, target=target, until_s=until_s), _is_done)

    def fly_velocity(self, velocity: Setpoint, seconds: float) -> None:
        """Order a velocity again and again, so that the drone stops if the script does."""
        self._require_air(Task.FLY_VELOCITY)
        until_s = self.now_s + seconds
        number: int | None = None
        while (now_s := self.now_s) < until_s:
            valid_s = min(now_s + DEADMAN_S, until_s)
            number = self._ask(Task.FLY_VELOCITY, velocity=velocity, until_s=valid_s, renews=number)
            self._wait_for(number, _is_obeyed)
        if number is not None:
            self._wait_for(number, _is_done)

    def keep_velocity(self, velocity: Setpoint) -> None:
        """Order a velocity for `DEADMAN_S`, without waiting."""
        self._require_air(Task.FLY_VELOCITY)
        flight, before = self.state, self._unawaited
        self._unawaited = 0
        if flight.obeyed == before and flight.undone not in ("", REPLACED):
            raise NotCompletedError(flight.undone)
        until_s = self.now_s + DEADMAN_S
        self._unawaited = self._ask(Task.FLY_VELOCITY, velocity=velocity, until_s=until_s)

    def stop(self) -> None:
        """Order the drone to hover, without waiting."""
        self._ask(Task.WAIT)

    def land(self) -> None:
        """Order the landing, and wait for the end of the flight."""
        self._require_air(Task.LAND)
        number = self._ask(Task.LAND)
        flight = self._wait(
            lambda flight: flight.phase in FINAL_PHASES or self._never_begins(flight, number)
        )
        if flight.phase not in FINAL_PHASES:
            raise NotCompletedError(REPLACED)
        self._thread.join()
        if self._error is not None:
            raise self._error
        if not flight.completed:
            raise FlightEndedError(flight.ending)

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
        """Refuse an order that would never be executed.

        Raises:
            FlightEndedError: the flight has ended.
            NotCompletedError: the drone has not taken off.
        """
        if self._error is not None:
            raise self._error
        if self.state.phase in FINAL_PHASES:
            raise FlightEndedError(self.state.ending)
        if task is not Task.TAKE_OFF and self.state.phase in UNARMED_PHASES:
            raise NotCompletedError(f"cannot {task.value} on the ground: take_off() comes first")

    def _wait_for(self, number: int, is_so: Callable[[FlightState, int], bool]) -> None:
        """Wait for what an order leads to.

        Raises:
            NotCompletedError: another order replaced it, or the flight did not complete it.
        """

        def is_settled(flight: FlightState) -> bool:
            is_replaced = flight.obeyed > number or self._never_begins(flight, number)
            return is_so(flight, number) or is_replaced

        flight = self._wait(is_settled)
        if flight.obeyed != number or flight.undone:
            raise NotCompletedError(flight.undone or REPLACED)

    def _never_begins(self, flight: FlightState, number: int) -> bool:
        """True if a newer order has replaced an order before the flight took it."""
        return flight.obeyed < number < self._order.number

    def _wait(self, is_so: Callable[[FlightState], bool]) -> FlightState:
        """Wait until the condition is met, and return the state in which it is.

        Raises:
            FlightEndedError: the flight has ended before.
        """

        def settled() -> FlightState | None:
            flight = self.state
            has_ended = flight.phase in FINAL_PHASES or not self._thread.is_alive()
            return flight if is_so(flight) or has_ended else None

        with self._ticked:
            while (flight := self._ticked.wait_for(settled, LOOK_S)) is None:
                continue  # Ctrl-C gets through in between
        if self._error is not None:
            raise self._error
        if not is_so(flight):
            raise FlightEndedError(flight.ending)
        return flight

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
        with open_rig(self._config, self._out, self._tell, skip_rehearsal=self._skip_rehearsal) as (
            rig,
            recorder,
        ):

            def record(now_s: float, inputs: Inputs, outputs: Outputs) -> None:
                recorder.tick(now_s, inputs, outputs)
                self.telemetry.publish(inputs, outputs)
                self.tick(outputs)

            try:
                ControlLoop(
                    self.app,
                    rig,
                    _nobody_at_a_terminal,
                    lambda: self._is_to_land,
                    record,
                    orders=lambda: self._order,
                ).run()
            finally:
                self._plan = self.app.final_floor_plan()
                recorder.close(self._plan)
                if self._out is not None:
                    save(self._plan, self._out, self.app.flight.unfinished)

    def tick(self, outputs: Outputs) -> None:
        """Take the outputs of a tick."""
        while True:
            try:
                self._asked.get_nowait()()
            except Empty:
                break
        with self._ticked:
            self.latest = outputs
            self._ticked.notify_all()


def _is_done(flight: FlightState, number: int) -> bool:
    return flight.obeyed == number and flight.phase is Phase.HOVER


def _is_obeyed(flight: FlightState, number: int) -> bool:
    return flight.obeyed == number


def _nobody_at_a_terminal(progress: Progress) -> None:
    """Ignore the progress: a script reads the state it needs."""
