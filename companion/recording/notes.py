"""Writes human-readable topics, into a file or a live stream: for plots, 3D views and logs."""

from collections.abc import Sequence
from typing import Protocol

from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import Message
from msgspec import json

from companion.core.messages import Beam, GyroSample, VehicleState, WallSegment
from companion.pdps.flight.state import FlightState, Phase
from companion.recording import foxglove, topics
from companion.recording.topics import PhaseRecord, VehicleRecord
from companion.ticks import Inputs, Outputs

NUMBERS_PERIOD_S = 0.1
"""Interval of the topics for plots, s. Chosen."""
SCENE_PERIOD_S = 0.2
"""Interval of the topics for 3D views, s. Chosen: each message costs some ten microseconds."""
STATE_PERIOD_S = 1.0
"""Interval of repeated messages about the phase and the vehicle, s. Chosen."""


class Sink(Protocol):
    """Takes encoded messages: a file, or a live stream."""

    def add(self, topic: str, time_s: float, data: bytes) -> None: ...


class Notes:
    """Writes ticks to the topics of one sink."""

    def __init__(self, sink: Sink, mount_offset_m: float) -> None:
        self._sink = sink
        self._mount_offset_m = mount_offset_m
        self._gyro: list[GyroSample] = []
        self._failures: dict[Beam, str] = {}
        """State of each beam that gives no reading."""
        self._flight: FlightState | None = None
        self._vehicle: VehicleRecord | None = None
        self._numbers_s = self._scene_s = self._phase_s = self._vehicle_s = float("-inf")

    def add(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        self._gyro += inputs.gyro
        if now_s - self._numbers_s >= NUMBERS_PERIOD_S - 1e-6:
            self._numbers_s = now_s
            self._add_numbers(now_s, inputs, outputs)
        if now_s - self._scene_s >= SCENE_PERIOD_S - 1e-6:
            self._scene_s = now_s
            self._add_scene(now_s, inputs, outputs)
        self._add_faults(now_s, inputs, outputs)
        self._add_phase(now_s, outputs.flight)
        self._add_vehicle(now_s, inputs.telemetry.vehicle)

    def add_walls(
        self, now_s: float, walls: Sequence[WallSegment], ceiling_m: float | None = None
    ) -> None:
        self._add(topics.WALLS, now_s, foxglove.walls_scene(now_s, walls, ceiling_m))

    def _add(self, topic: str, now_s: float, message: Message) -> None:
        self._sink.add(topic, now_s, message.SerializeToString())

    def _add_numbers(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        self._sink.add(topics.RANGES, now_s, json.encode(inputs.scan.readings))
        if outputs.pose is not None:
            self._sink.add(topics.ESTIMATE, now_s, json.encode(outputs.pose))
        self._sink.add(topics.GYRO, now_s, json.encode({"samples": self._gyro}))
        self._gyro = []
        if outputs.setpoint is not None:
            self._sink.add(topics.SETPOINT, now_s, json.encode(outputs.setpoint))

    def _add_scene(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        if outputs.pose is not None:
            self._add(topics.POSE, now_s, foxglove.pose_with_covariance(outputs.pose))
            self._add(topics.TF, now_s, foxglove.transform(outputs.pose))
        self._add(topics.SCAN, now_s, foxglove.laser_scan(inputs.scan, self._mount_offset_m))

    def _add_faults(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        flight, last = outputs.flight, self._flight
        if last is not None and flight.trouble != last.trouble:
            level = Log.ERROR if flight.phase is Phase.FAILED else Log.WARNING
            self._log_fault(now_s, "flight", flight.trouble, level, "fault cleared")
        for beam, reading in inputs.scan.readings.items():
            failure = "" if reading.is_alive else reading.state.value
            if failure != self._failures.get(beam, ""):
                self._failures[beam] = failure
                source = f"{beam.value} range sensor"
                self._log_fault(now_s, source, failure, Log.WARNING, "works again")
        for text in inputs.telemetry.texts:
            self._add(topics.AUTOPILOT, now_s, foxglove.log(now_s, Log.INFO, "autopilot", text))

    def _log_fault(
        self, now_s: float, source: str, fault: str, level: Log.Level.ValueType, when_over: str
    ) -> None:
        """Log a new fault, or the end of a fault."""
        entry = (
            foxglove.log(now_s, level, source, fault)
            if fault
            else foxglove.log(now_s, Log.INFO, source, when_over)
        )
        self._add(topics.FAULTS, now_s, entry)

    def _add_phase(self, now_s: float, flight: FlightState) -> None:
        """Record the phase when it changes, and once a second."""
        last, self._flight = self._flight, flight
        is_new = flight is not last and (last is None or _texts(flight) != _texts(last))
        if is_new or now_s - self._phase_s >= STATE_PERIOD_S:
            self._phase_s = now_s
            self._sink.add(topics.PHASE, now_s, json.encode(PhaseRecord(now_s, *_texts(flight))))

    def _add_vehicle(self, now_s: float, state: VehicleState) -> None:
        """Record the autopilot's state when it changes, and once a second."""
        vehicle = VehicleRecord(state.mode, state.armed, state.battery)
        if vehicle != self._vehicle or now_s - self._vehicle_s >= STATE_PERIOD_S:
            self._vehicle, self._vehicle_s = vehicle, now_s
            self._sink.add(topics.VEHICLE, now_s, json.encode(vehicle))


def _texts(flight: FlightState) -> tuple[str, str, str]:
    return flight.phase.name, flight.activity, flight.trouble
