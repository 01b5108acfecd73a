"""Sends ranges, phases and faults to the autopilot and its ground stations.

The autopilot's obstacle avoidance and terrain following use the ranges. They are sent as
DISTANCE_SENSOR (132) with the orientation of each beam, or as OBSTACLE_DISTANCE (330) for the
horizontal beams and DISTANCE_SENSOR for up and down. Stale and failed sensors are not sent: the
autopilot discards a range after 0.5 s without an update.
"""

import math
import unicodedata
from collections.abc import Iterator, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.messages import Beam, RangeModel, RangeReading, RangeScan, RangeState
from companion.link.transports.transport import Message

PERIOD_S = 0.1
"""Period of the range messages, s. Chosen."""
ORIENTATIONS: dict[Beam, int] = {
    Beam.FRONT: mavlink.MAV_SENSOR_ROTATION_NONE,
    Beam.RIGHT: mavlink.MAV_SENSOR_ROTATION_YAW_90,
    Beam.BACK: mavlink.MAV_SENSOR_ROTATION_YAW_180,
    Beam.LEFT: mavlink.MAV_SENSOR_ROTATION_YAW_270,
    Beam.UP: mavlink.MAV_SENSOR_ROTATION_PITCH_90,
    Beam.DOWN: mavlink.MAV_SENSOR_ROTATION_PITCH_270,
}
"""MAV_SENSOR_ORIENTATION of each beam."""
SECTORS, SECTOR_DEG = 72, 5
"""Number and width of the sectors of OBSTACLE_DISTANCE (330); width in degrees."""
SECTOR_OF = {Beam.FRONT: 0, Beam.RIGHT: 18, Beam.BACK: 36, Beam.LEFT: 54}
"""Sector of each horizontal beam, clockwise from the front."""
UNKNOWN_SECTOR = 65535
"""Value of an unknown sector in OBSTACLE_DISTANCE (330)."""
MAX_COVARIANCE_CM2, UNKNOWN_COVARIANCE = 254, 255
"""Maximum variance in DISTANCE_SENSOR (132), cm², and the value for an unknown one."""
TEXT_BYTES = 50
"""Length of the text field in STATUSTEXT (253), bytes."""


class Reports:
    """Creates the report messages that are due; the link sends them."""

    def __init__(self, config: LinkConfig, models: Mapping[Beam, RangeModel]) -> None:
        self._config = config
        self._models = models
        self._sent_s = -math.inf
        self._activity = self._trouble = self._notice = ""
        self._text_id = 0

    def due(
        self, now_s: float, scan: RangeScan, activity: str, trouble: str, notice: str = ""
    ) -> list[Message]:
        """Messages for this tick: ranges ten times per second, and each new text."""
        messages: list[Message] = []
        if self._config.tell_ranges != "none" and now_s - self._sent_s >= PERIOD_S - 1e-6:
            self._sent_s = now_s
            messages += self._ranges(round(now_s * 1000), scan)
        if self._config.tell_texts:
            messages += self._texts(activity, trouble, notice)
        return messages

    def _texts(self, activity: str, trouble: str, notice: str) -> Iterator[Message]:
        """STATUSTEXT (253): phase as INFO, fault as WARNING, notice to the pilot as NOTICE."""
        if notice and notice != self._notice:
            yield from self._text(mavlink.MAV_SEVERITY_NOTICE, f"PDPS: {notice}")
        if trouble and trouble != self._trouble:
            yield from self._text(mavlink.MAV_SEVERITY_WARNING, f"PDPS: {activity}: {trouble}")
        elif activity != self._activity:
            yield from self._text(mavlink.MAV_SEVERITY_INFO, f"PDPS: {activity}")
        self._activity, self._trouble, self._notice = activity, trouble, notice

    def _text(self, severity: int, text: str) -> Iterator[Message]:
        data = _ascii(text)
        chunks = [data[at : at + TEXT_BYTES] for at in range(0, len(data), TEXT_BYTES)]
        if len(chunks) > 1:
            self._text_id = self._text_id % 65535 + 1
            chunks += [b""] if len(chunks[-1]) == TEXT_BYTES else []  # a short chunk ends the text
        for sequence, chunk in enumerate(chunks):
            text_id = self._text_id if len(chunks) > 1 else 0
            yield mavlink.MAVLink_statustext_message(severity, chunk, text_id, sequence)

    def _ranges(self, time_ms: int, scan: RangeScan) -> Iterator[Message]:
        sent = {beam: r for beam, r in scan.readings.items() if r.is_alive and beam in self._models}
        if self._config.tell_ranges == "obstacle_distance":
            around = {beam: r for beam, r in sent.items() if beam in SECTOR_OF}
            sent = {beam: r for beam, r in sent.items() if beam not in SECTOR_OF}
            if around:
                yield self._obstacles(time_ms, around)
        for beam, reading in sent.items():
            yield self._distance(time_ms, beam, reading)

    def _distance(self, time_ms: int, beam: Beam, reading: RangeReading) -> Message:
        least_cm, most_cm = self._bounds_cm(beam)
        covariance = UNKNOWN_COVARIANCE
        if reading.is_distance and reading.variance_m2 * 1e4 <= MAX_COVARIANCE_CM2:
            covariance = max(1, round(reading.variance_m2 * 1e4))
        return mavlink.MAVLink_distance_sensor_message(
            time_ms % 2**32,
            *(least_cm, most_cm, _distance_cm(reading, least_cm, most_cm)),
            mavlink.MAV_DISTANCE_SENSOR_INFRARED,
            list(ORIENTATIONS).index(beam),
            ORIENTATIONS[beam],
            covariance,
        )

    def _obstacles(self, time_ms: int, around: Mapping[Beam, RangeReading]) -> Message:
        """OBSTACLE_DISTANCE (330) with one sector per beam; the sectors between are unknown."""
        bounds_cm = [self._bounds_cm(beam) for beam in around]
        least_cm, most_cm = min(b[0] for b in bounds_cm), max(b[1] for b in bounds_cm)
        sectors = [UNKNOWN_SECTOR] * SECTORS
        for beam, reading in around.items():
            distance_cm = _distance_cm(reading, least_cm, most_cm)
            if reading.state is RangeState.TOO_NEAR:
                distance_cm = self._bounds_cm(beam)[0]  # below the minimum it would be ignored
            sectors[SECTOR_OF[beam]] = distance_cm
        return mavlink.MAVLink_obstacle_distance_message(
            time_ms * 1000,
            mavlink.MAV_DISTANCE_SENSOR_INFRARED,
            sectors,
            SECTOR_DEG,
            least_cm,
            most_cm,
            float(SECTOR_DEG),
            0.0,
            mavlink.MAV_FRAME_BODY_FRD,
        )

    def _bounds_cm(self, beam: Beam) -> tuple[int, int]:
        model = self._models[beam]
        return round(100 * model.min_m), round(100 * model.max_m)


IN_ASCII = {
    "°": " deg",
    "±": "+/-",
    "×": "x",
    "…": "...",
    "–": "-",
    "—": "-",
    "µ": "u",
    "σ": "sigma",
}
"""ASCII replacements of the symbols in texts."""


def _ascii(text: str) -> bytes:
    """Convert to ASCII for ground stations: accents are dropped, other characters become "?"."""
    text = text.replace(" °", "°")
    for symbol, words in IN_ASCII.items():
        text = text.replace(symbol, words)
    plain = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return plain.encode("ascii", "replace")


def _distance_cm(reading: RangeReading, least_cm: int, most_cm: int) -> int:
    """Distance in cm; above the maximum for no detection, below the minimum for TOO_NEAR."""
    if reading.state is RangeState.TOO_NEAR:
        return max(least_cm - 1, 0)
    if reading.state is RangeState.NOTHING:
        return most_cm + 1
    return min(max(round(100 * reading.distance_m), least_cm), most_cm)
