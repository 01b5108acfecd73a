"""Records a rehearsal as a flight is recorded, and reads it back."""

import time
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from companion.bringup.findings import CheckResult, Finding
from companion.config.settings import Config
from companion.core.errors import RecordingError
from companion.core.messages import Beam, FloorPlan, RangeReading, RangeScan
from companion.link.link import Telemetry
from companion.link.transports.transport import Transport
from companion.pdps.flight.state import FlightState
from companion.recording.reader import read
from companion.recording.recorder import open_recorder
from companion.ticks import Inputs, Outputs, Progress

PART = "recording"
"""Name of the part in the results."""
REMEDY = "the card is slow, full or defective: use another card or another --out"
"""Remedy if the recording is not complete."""


class TrialRecording:
    """A recording in a folder of its own in `out`, which is removed at the end.

    Raises:
        OSError: the folder cannot be created.
    """

    def __init__(self, out: Path, config: Config) -> None:
        self._is_on = config.recording.enabled
        self._folder = TemporaryDirectory(dir=out, prefix="rehearsal-")
        self._trouble = ""
        self._ticks = 0
        path = Path(self._folder.name)
        self._recorder = open_recorder(path, config, time.time(), self._note)

    def _note(self, trouble: str) -> None:
        self._trouble = self._trouble or trouble

    def tap(self, transport: Transport) -> Transport:
        """Wrap the transport, so that its messages are recorded."""
        return self._recorder.tap(transport)

    def tick(
        self, now_s: float, telemetry: Telemetry, readings: Mapping[Beam, RangeReading]
    ) -> None:
        """Record one tick."""
        scan = RangeScan(now_s, dict(readings))
        progress = Progress(now_s, "rehearsal", "", tuple)
        outputs = Outputs(None, None, None, progress, FlightState(), scan)
        self._recorder.tick(now_s, Inputs(telemetry, [], scan), outputs)
        self._ticks += 1

    def finding(self) -> Finding:
        """End the recording, compare it with what was recorded, and remove it."""
        self._recorder.close(FloorPlan())
        try:
            return self._read_back()
        finally:
            self._folder.cleanup()

    def _read_back(self) -> Finding:
        if not self._is_on:
            return Finding(PART, CheckResult.GOOD, "recording.enabled = false")
        try:
            files = sorted(Path(self._folder.name).glob("*.mcap"))
            recording = read(files[0]) if files and not self._trouble else None
        except RecordingError as error:
            return Finding(PART, CheckResult.BAD, str(error), REMEDY)
        if recording is None:
            return Finding(PART, CheckResult.BAD, self._trouble or "no file", REMEDY)
        seen = f"{len(recording.ticks)} of {self._ticks} ticks read back"
        if not recording.is_whole or len(recording.ticks) != self._ticks:
            return Finding(PART, CheckResult.BAD, seen, REMEDY)
        return Finding(PART, CheckResult.GOOD, seen)
