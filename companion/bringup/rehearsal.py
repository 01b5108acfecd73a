"""State machine of the rehearsal: what a flight needs of autopilot and pilot, propellers off.

    PARTS ─► MODE ─► TAKE ─► QUIET ─► GIVE ─► RETURN ─► ARM ─► SILENCE ─► DISARM ─► PASSED
      │       │       │        │       │        │        │        │          │
      └───────┴───────┴────────┴───────┴────────┴────────┘        │          ▼
          timeout, refused, something else changes the mode       └───────► FAILED
                                 │                                           ▲
                                 └── if it is armed by now: ─► DISARM ───────┘

    PARTS    every part is good, and every stream of the link has its rate
    MODE     the autopilot enters our mode
    TAKE     the pilot takes the drone over: his switch leaves our mode
    QUIET    for two seconds nothing takes it back
    GIVE     the pilot gives it back: his switch moves once more
    RETURN   the autopilot enters our mode again
    ARM      the motors turn
    SILENCE  no setpoints: the autopilot reacts as configured
    DISARM   the motors stop

Safety:

- Nothing takes off: no take-off is commanded, and all setpoints have zero velocity.
- In TAKE after the switch, QUIET and GIVE nothing but heartbeats and requests is sent.
- The switch is tried before arming. Both autopilots disarm by themselves ten seconds after arming
  without a take-off, and a person needs longer. The way from the switch to the mode is the same.
- A vehicle that this rehearsal has armed is disarmed in every case, unless the pilot has taken it.
- An interruption leads to DISARM, too.
"""

import enum
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from companion.bringup.findings import CheckResult, Finding
from companion.bringup.link_test import SLOW_REMEDY, stream_rates, unsteady_streams
from companion.bringup.self_test import Examination
from companion.core.messages import HOLD, Command, CommandKind, LandedState, VehicleState

PARTS_TIMEOUT_S = 20.0
"""Longest wait for all parts, s. Chosen: gyro, streams and estimate need up to 8 s."""
MODE_TIMEOUT_S = 10.0
"""Longest wait for the mode, s. Chosen."""
ARM_TIMEOUT_S = 30.0
"""Longest wait for arming, s, as in a flight."""
PILOT_TIMEOUT_S = 60.0
"""Longest wait for the pilot's switch, s. Chosen."""
QUIET_S = 2.0
"""Time in which nothing may take the drone back, s: two HEARTBEATs. Chosen."""
REACTS_S = 2.0
"""Time after the setpoint timeout by which the reaction shows, s: two HEARTBEATs. Chosen."""
DISARM_TIMEOUT_S = 15.0
"""Longest wait for disarming, s: both autopilots disarm by themselves after 10 s."""


class Stage(enum.Enum):
    """States of the diagram above; the value is the part that is tried."""

    PARTS = "parts"
    MODE = "mode"
    TAKE = "switch taken"
    QUIET = "not taken back"
    GIVE = "switch given"
    RETURN = "mode again"
    ARM = "arm"
    SILENCE = "setpoint loss"
    DISARM = "disarm"
    PASSED = "passed"
    FAILED = "failed"


ENDED = frozenset({Stage.PASSED, Stage.FAILED})
"""Final states."""
STREAMING = frozenset({Stage.MODE, Stage.RETURN, Stage.ARM})
"""States in which setpoints of zero velocity are sent, as before a take-off."""
COMMANDS = {
    Stage.MODE: CommandKind.OFFBOARD_MODE,
    Stage.RETURN: CommandKind.OFFBOARD_MODE,
    Stage.ARM: CommandKind.ARM,
    Stage.DISARM: CommandKind.DISARM,
}
"""Command of each state."""


class Rehearsal:
    """One rehearsal. `step` is called at every tick until `is_over`.

    `lines` are the results so far, and `prompt` is what the pilot has to do now. Without a pilot
    nobody takes the drone over: MODE leads to ARM.
    """

    def __init__(
        self, examination: Examination, setpoint_loss_s: float, *, has_pilot: bool = True
    ) -> None:
        self._examination = examination
        self._has_pilot = has_pilot
        self._setpoint_loss_s = setpoint_loss_s
        self.stage = Stage.PARTS
        self._since_s: float | None = None
        self._has_armed = self._failed = self._interrupted = False
        self._taken_mode = ""
        self._findings: Sequence[Finding] = ()
        self.lines: list[Finding] = []
        self.prompt = ""

    @property
    def is_over(self) -> bool:
        return self.stage in ENDED

    @property
    def has_passed(self) -> bool:
        return self.stage is Stage.PASSED

    def interrupt(self) -> None:
        """End the rehearsal as soon as the motors stand."""
        self._interrupted = True

    def step(self, now_s: float) -> None:
        """Run one tick at `now_s`."""
        self._since_s = now_s if self._since_s is None else self._since_s
        vehicle, age_s = self._examination.listen(now_s), now_s - self._since_s
        if self._interrupted and self.stage is not Stage.DISARM:
            self._fail(now_s, "interrupted", "start the rehearsal again")
        else:
            self._STEPS[self.stage](self, now_s, vehicle, age_s)
        setpoint = HOLD if self.stage in STREAMING else None
        self._findings = self._examination.examine(now_s, setpoint, self._command(vehicle))

    def _command(self, vehicle: VehicleState) -> Command | None:
        """The stage's command, directly after a HEARTBEAT; a mode is also asked for in between."""
        kind = COMMANDS.get(self.stage)
        asks_mode = kind is CommandKind.OFFBOARD_MODE and not vehicle.is_silent
        return Command(kind) if kind and (asks_mode or vehicle.is_mode_recent) else None

    # Transitions

    def _pass(self, now_s: float, seen: str, then: Stage, remedy: str = "") -> None:
        self.lines.append(Finding(self.stage.value, CheckResult.GOOD, seen, remedy))
        self._go(now_s, then)

    def _fail(self, now_s: float, seen: str, remedy: str) -> None:
        self.lines.append(Finding(self.stage.value, CheckResult.BAD, seen, remedy))
        self._failed = True
        self._go(now_s, Stage.DISARM if self._has_armed else Stage.FAILED)

    def _hand_over(self, now_s: float, vehicle: VehicleState) -> None:
        """End without a command: somebody else has control."""
        self._failed = True
        remedy = "nothing more is sent: disarm it by the transmitter, then start again"
        seen = f"handed over: mode changed to {vehicle.mode}"
        self.lines.append(Finding(self.stage.value, CheckResult.BAD, seen, remedy))
        self._go(now_s, Stage.FAILED)

    def _go(self, now_s: float, stage: Stage) -> None:
        self.stage, self._since_s = stage, now_s
        self._has_armed |= stage is Stage.ARM  # its command takes effect later
        self.prompt = self._prompt_of(stage)

    def _prompt_of(self, stage: Stage) -> str:
        if stage is Stage.TAKE:
            mode = self._examination.telemetry.vehicle.mode
            return f"pilot: take the drone over now: mode switch from {mode} to {self._holding}"
        if stage is Stage.GIVE:
            return "pilot: give the drone back now: mode switch to where it was"
        return ""

    @property
    def _holding_modes(self) -> tuple[str, ...]:
        firmware = self._examination.link.firmware
        return firmware.holding_modes if firmware else ()

    @property
    def _holding(self) -> str:
        return " or ".join(self._holding_modes)

    # The stages

    def _parts(self, now_s: float, vehicle: VehicleState, age_s: float) -> None:
        streams, findings = self._examination.link.streams, self._findings
        bad = [f for f in findings if f.verdict is not CheckResult.GOOD]
        unsteady = unsteady_streams(streams)
        if streams and findings and not bad and not unsteady:
            rates = Finding("link rate", CheckResult.GOOD, stream_rates(streams))
            self.lines += [*findings, rates]
            self._go(now_s, Stage.MODE)
        elif age_s > PARTS_TIMEOUT_S:
            self.lines += [f for f in findings if f.verdict is CheckResult.GOOD]
            self.lines += [Finding(f.part, CheckResult.BAD, f.seen, f.remedy) for f in bad]
            if unsteady:
                seen = f"no steady {unsteady}"
                self.lines.append(Finding("link rate", CheckResult.BAD, seen, SLOW_REMEDY))
            self._failed = True
            self._go(now_s, Stage.FAILED)

    def _mode(self, now_s: float, vehicle: VehicleState, age_s: float) -> None:
        if vehicle.armed:
            remedy = "disarm it; another program or the pilot has armed it"
            self._fail(now_s, "the vehicle is armed already", remedy)
        elif vehicle.in_offboard_mode:
            takes = self.stage is Stage.MODE and self._has_pilot
            then = Stage.TAKE if takes else Stage.ARM
            self._pass(now_s, f"{vehicle.mode} after {age_s:.1f} s", then)
            if not self._has_pilot:
                seen = "by nobody: preflight.transmitter = false"
                self.lines.append(Finding(Stage.TAKE.value, CheckResult.GOOD, seen))
        elif age_s > MODE_TIMEOUT_S:
            remedy = "the autopilot refuses the mode, or the pilot's switch sets it back"
            self._fail(now_s, _refused(vehicle), remedy)

    def _take(self, now_s: float, vehicle: VehicleState, age_s: float) -> None:
        if not vehicle.in_offboard_mode:
            self._taken_mode = vehicle.mode
            if vehicle.mode in self._holding_modes:
                self._pass(now_s, f"{vehicle.mode} after {age_s:.0f} s", Stage.QUIET)
            else:
                remedy = f"in it the drone does not hold its height: {self._holding} there"
                self._fail(now_s, f"the switch leads to {vehicle.mode}", remedy)
        elif age_s > PILOT_TIMEOUT_S:
            remedy = (
                "without the switch the pilot cannot stop the drone: ArduPilot FLTMODE_CH and "
                "FLTMODE1 to 6, PX4 RC_MAP_FLTMODE and COM_FLTMODE1 to 6"
            )
            self._fail(now_s, f"no change of mode in {PILOT_TIMEOUT_S:.0f} s", remedy)

    def _quiet(self, now_s: float, vehicle: VehicleState, age_s: float) -> None:
        if vehicle.in_offboard_mode:
            remedy = "another program sets the mode: end it; only the pilot may give the drone back"
            self._fail(now_s, f"{vehicle.mode} again after {age_s:.1f} s", remedy)
        elif age_s > QUIET_S:
            self._pass(now_s, f"{vehicle.mode} stayed for {QUIET_S:.0f} s", Stage.GIVE)

    def _give(self, now_s: float, vehicle: VehicleState, age_s: float) -> None:
        if vehicle.mode != self._taken_mode:
            self._pass(now_s, f"{vehicle.mode} after {age_s:.0f} s", Stage.RETURN)
        elif age_s > PILOT_TIMEOUT_S:
            remedy = "the switch must have two positions with different modes"
            self._fail(now_s, f"{vehicle.mode} for {PILOT_TIMEOUT_S:.0f} s", remedy)

    def _arm(self, now_s: float, vehicle: VehicleState, age_s: float) -> None:
        if not vehicle.in_offboard_mode or vehicle.left_offboard:
            self._hand_over(now_s, vehicle)
        elif vehicle.landed_state is not LandedState.ON_GROUND:
            remedy = "it must stand still on the ground; are the propellers off?"
            self._fail(now_s, f"it reports {vehicle.landed_state.name}", remedy)
        elif vehicle.armed:
            self._pass(now_s, f"armed after {age_s:.1f} s", Stage.SILENCE)
        elif age_s > ARM_TIMEOUT_S:
            remedy = "the autopilot's own checks refuse it: see its ground station"
            self._fail(now_s, _refused(vehicle), remedy)

    def _silence(self, now_s: float, vehicle: VehicleState, age_s: float) -> None:
        firmware = self._examination.link.firmware
        lands = firmware is not None and firmware.lands_on_setpoint_loss
        if lands and (vehicle.mode == "LAND" or not vehicle.armed):
            self._motors_on()
            self._pass(now_s, f"{vehicle.mode} {age_s:.1f} s after the last one", Stage.DISARM)
        elif not lands and not vehicle.in_offboard_mode:
            self._hand_over(now_s, vehicle)
        elif age_s > self._setpoint_loss_s + REACTS_S and lands:
            remedy = "does another program send setpoints? COM_OBL_RC_ACT should be 4"
            self._fail(now_s, f"still {vehicle.mode} after {age_s:.1f} s", remedy)
        elif age_s > self._setpoint_loss_s + REACTS_S:
            seen = f"GUID_TIMEOUT {self._setpoint_loss_s:g} s is set; it stays in {vehicle.mode}"
            self._motors_on()
            note = "on the ground it shows no reaction; in flight it brakes after this time"
            self._pass(now_s, seen, Stage.DISARM, note)

    def _motors_on(self) -> None:
        """Result of the parts while the motors draw current and shake the sensors."""
        bad = [f for f in self._findings if f.verdict is CheckResult.BAD]
        self._failed |= bool(bad)
        remedy = "it worked before: its supply and its wires do not stand the motors"
        self.lines += [
            Finding(f.part, CheckResult.BAD, f"motors on: {f.seen}", remedy) for f in bad
        ]
        if not bad:
            self.lines.append(Finding("motors on", CheckResult.GOOD, "all parts answer"))

    def _disarm(self, now_s: float, vehicle: VehicleState, age_s: float) -> None:
        if not vehicle.armed and vehicle.mode_age_s < age_s:  # by a HEARTBEAT since the last stage
            self._pass(
                now_s, f"after {age_s:.1f} s", Stage.FAILED if self._failed else Stage.PASSED
            )
        elif vehicle.armed and not vehicle.in_offboard_mode and vehicle.mode != "LAND":
            self._hand_over(now_s, vehicle)
        elif age_s > DISARM_TIMEOUT_S:
            remedy = "disarm it by the transmitter, and keep away from the motors"
            self.lines.append(Finding("disarm", CheckResult.BAD, _refused(vehicle), remedy))
            self._failed = True
            self._go(now_s, Stage.FAILED)

    _STEPS: ClassVar[Mapping[Stage, Callable[["Rehearsal", float, VehicleState, float], None]]] = {
        Stage.PARTS: _parts,
        Stage.MODE: _mode,
        Stage.TAKE: _take,
        Stage.QUIET: _quiet,
        Stage.GIVE: _give,
        Stage.RETURN: _mode,
        Stage.ARM: _arm,
        Stage.SILENCE: _silence,
        Stage.DISARM: _disarm,
    }


def _refused(vehicle: VehicleState) -> str:
    return vehicle.refusal or f"no reaction: {vehicle.mode}, {'armed' if vehicle.armed else 'safe'}"
