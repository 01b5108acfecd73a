"""Load of the sent and requested messages against the baud rate of the link."""

from collections.abc import Mapping
from typing import Any

import pytest

from companion.bringup.findings import CheckResult
from companion.bringup.self_test import Examination
from companion.config.settings import Config
from companion.core.errors import ConfigError
from companion.link.link_budget import budget_error, link_budget
from companion.link.transports.transport import direct_pair
from companion.run.hardware import open_rig
from tests.contract.bench import make_bench


def config(baud: int, sensors: Mapping[str, Any] | None = None, **link: Any) -> Config:
    url = f"serial:/dev/ttyAMA0:{baud}"
    return Config.model_validate({"link": {"url": url, **link}, "sensors": sensors or {}})


def test_budget_counts_sent_messages_as_packed() -> None:
    sent = link_budget(config(57600, send_pose=True, tell_ranges="distance_sensor")).sent
    assert set(sent) == {
        *("HEARTBEAT", "SET_POSITION_TARGET_LOCAL_NED", "ODOMETRY", "DISTANCE_SENSOR")
    }
    assert sent["HEARTBEAT"] == pytest.approx(21.0)
    assert sent["SET_POSITION_TARGET_LOCAL_NED"] == pytest.approx(20 * 65.0)
    assert sent["ODOMETRY"] > 4 * 200


def test_signed_frames_are_longer() -> None:
    plain = link_budget(config(57600))
    signed = link_budget(config(57600, signing_key="signing.key"))
    assert signed.sent["HEARTBEAT"] == pytest.approx(plain.sent["HEARTBEAT"] + 13)
    assert signed.asked_for["ATTITUDE"] == pytest.approx(plain.asked_for["ATTITUDE"] + 25 * 13)


@pytest.mark.parametrize(
    ("baud", "link", "remedies"),
    [
        (
            57600,
            {"send_pose": True},
            ("link.send_pose = true", "baud rate to", "send_pose = false"),
        ),
        (
            19200,
            {"tell_ranges": "distance_sensor"},
            ('link.tell_ranges = "distance_sensor"', 'set link.tell_ranges = "none"'),
        ),
        (9600, {}, ("ttyAMA0:9600", "B/s of 960", "raise the baud rate to")),
    ],
)
def test_excessive_load_is_refused_at_start_and_by_check(
    baud: int, link: Mapping[str, Any], remedies: tuple[str, ...]
) -> None:
    settings = config(baud, **link)
    with pytest.raises(ConfigError) as refused, open_rig(settings, None, pytest.fail):
        pass
    bench = make_bench("gp2y0a710k0f")
    findings = Examination(settings, direct_pair()[1], bench.bus).step(bench.passes(0.05))
    (complaint,) = (finding for finding in findings if finding.part == "baud rate")
    assert complaint.verdict is CheckResult.BAD
    for words in (f"link.url = serial:/dev/ttyAMA0:{baud}", *remedies):
        assert words in str(refused.value)
        assert words in complaint.remedy


def test_budget_includes_the_requested_streams() -> None:
    beams = {
        beam: {"kind": "autopilot", "max_m": 5.0}
        for beam in ("front", "left", "right", "up", "down")
    }
    complaint = budget_error(config(57600, {"ranges": beams, "gyro": "autopilot"}))
    assert "asks the autopilot for" in complaint
    assert "DISTANCE_SENSOR" in complaint
    assert budget_error(config(115200, {"ranges": beams, "gyro": "autopilot"})) == ""


@pytest.mark.parametrize("baud", [57600, 115200, 921600])
def test_the_default_messages_fit_usual_baud_rates(baud: int) -> None:
    assert budget_error(config(baud)) == ""


def test_a_link_without_a_baud_rate_has_no_limit() -> None:
    assert budget_error(Config.model_validate({"link": {"send_pose": True}})) == ""
