"""Tests of the parameter protocols: ArduCopter 4.6.3 as measured, PX4 1.17 as in its source."""

import math
import struct
import zlib
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import make_codec
from sitl.autopilot.core import FIRMWARES
from sitl.autopilot.parameters.table import INTEGER_BITS, ParameterError, load_table
from tests.unit.sitl.autopilot.client import Client, as_float

INT8, INT32, REAL32 = (
    mavlink.MAV_PARAM_TYPE_INT8,
    mavlink.MAV_PARAM_TYPE_INT32,
    mavlink.MAV_PARAM_TYPE_REAL32,
)
UINT32 = mavlink.MAV_PARAM_TYPE_UINT32
NAMES = sorted({*load_table("ardupilot"), *load_table("px4"), "_HASH_CHECK", "NO_SUCH"})


def wire_bits(message: Any) -> int:
    bits: int = struct.unpack("<I", struct.pack("<f", message.param_value))[0]
    return bits


@pytest.fixture
def ardupilot() -> Client:
    return Client()


@pytest.fixture
def px4() -> Client:
    return Client("px4")


# Available parameters


@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_the_parameter_tables_are_sorted_and_valid(firmware: str) -> None:
    table = load_table(firmware)
    assert len(table) > 400
    assert list(table) == sorted(table)
    for name, parameter in table.items():
        assert len(name) <= 16
        assert parameter.fitted(parameter.default) == pytest.approx(parameter.default)
        assert parameter.least <= parameter.most


def test_px4_has_only_two_types_and_ardupilot_four() -> None:
    assert {p.kind for p in load_table("px4").values()} == {INT32, REAL32}
    assert {p.kind for p in load_table("ardupilot").values()} == {*INTEGER_BITS, REAL32}


@pytest.mark.parametrize("firmware", list(FIRMWARES))
def test_the_vehicle_is_configured_to_fly_without_gps(firmware: str) -> None:
    client, configured = Client(firmware), FIRMWARES[firmware]().configured
    client.lists()
    answers = {m.param_id: m for m in client.waits(1) if m.get_type() == "PARAM_VALUE"}
    for name, value in configured.items():
        bytewise = firmware == "px4"
        assert answers[name].param_value == (as_float("<i", int(value)) if bytewise else value)


def test_an_unknown_parameter_is_refused_at_the_start() -> None:
    with pytest.raises(ParameterError, match="no parameter GUID_TIMEOU; did you mean GUID_TIMEOUT"):
        Client(parameters={"GUID_TIMEOU": 1})


# Lists


@pytest.mark.parametrize("firmware", list(FIRMWARES))
def test_a_parameter_list_is_streamed_completely(firmware: str) -> None:
    client = Client(firmware)
    client.lists()
    answers = [m for m in client.waits(1) if m.get_type() == "PARAM_VALUE"]
    answers = [m for m in answers if m.param_id != "_HASH_CHECK"]
    assert [m.param_index for m in answers] == list(range(answers[0].param_count))
    assert len({m.param_id for m in answers}) == len(answers)


def test_ardupilot_sends_16_parameters_in_10_ms(ardupilot: Client) -> None:
    ardupilot.lists()
    assert [m.param_index for m in ardupilot.waits(0.02)] == list(range(32))


def test_a_second_list_request_restarts_the_list(ardupilot: Client) -> None:
    ardupilot.lists()
    ardupilot.waits(0.05)
    ardupilot.lists()
    assert ardupilot.waits(0.01)[0].param_index == 0


def test_px4_sends_its_hash_first_but_not_in_a_restarted_list(px4: Client) -> None:
    px4.lists()
    first = [m.param_id for m in px4.waits(0.01) if m.get_type() == "PARAM_VALUE"]
    assert (first[0], len(first)) == ("_HASH_CHECK", 20)
    px4.lists()
    again = [m for m in px4.waits(0.01) if m.get_type() == "PARAM_VALUE"]
    assert again[0].param_index == 0


def test_px4_stops_a_list_when_the_client_knows_the_hash(px4: Client) -> None:
    px4.lists()
    px4.waits(0.01)
    assert px4.sets("_HASH_CHECK", 0.0, UINT32) == []
    assert "PARAM_VALUE" not in [m.get_type() for m in px4.waits(0.5)]


# Reading


def test_parameters_are_read_by_name_and_by_index(ardupilot: Client) -> None:
    (by_name,) = ardupilot.reads("RNGFND1_ORIENT")
    assert (by_name.param_value, by_name.param_type, by_name.param_index) == (25, INT8, 65535)
    (by_index,) = ardupilot.reads(index=3)
    assert by_index.param_index == 3
    assert ardupilot.reads(by_index.param_id)[0].param_value == by_index.param_value


def test_px4_returns_the_index_for_a_read_by_name(px4: Client) -> None:
    (answers,) = px4.reads("COM_OF_LOSS_T")
    assert px4.reads(index=answers.param_index)[0].param_id == "COM_OF_LOSS_T"


@pytest.mark.parametrize("firmware", list(FIRMWARES))
def test_unknown_parameters_are_not_answered(firmware: str) -> None:
    client = Client(firmware)
    assert client.reads("NO_SUCH") == []
    assert client.reads(index=5000) == []
    assert client.sets("NO_SUCH", 1.0) == []


def test_names_of_16_characters_are_complete(ardupilot: Client, px4: Client) -> None:
    for client in (ardupilot, px4):
        client.lists()
        names = {m.param_id for m in client.waits(1) if m.get_type() == "PARAM_VALUE"}
        longest = max(names, key=len)
        assert len(longest) == 16
        (answers,) = client.reads(longest)
        assert answers.param_id == longest
        assert b"\0" not in answers._param_id_raw


def test_px4_reports_a_hash_over_names_and_values(px4: Client) -> None:
    (answers,) = px4.reads("_HASH_CHECK")
    assert (answers.param_type, answers.param_index) == (UINT32, 65535)
    px4.lists()
    data = b"".join(
        m.param_id.encode() + struct.pack("<f", m.param_value)
        for m in px4.waits(1)
        if m.get_type() == "PARAM_VALUE" and m.param_id != "_HASH_CHECK"
    )
    assert wire_bits(answers) == zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF
    px4.sets("COM_OF_LOSS_T", 0.25)
    assert wire_bits(px4.reads("_HASH_CHECK")[0]) != wire_bits(answers)


# Setting


def test_ardupilot_accepts_any_type_and_reports_the_true_one(ardupilot: Client) -> None:
    (answers,) = ardupilot.sets("GUID_TIMEOUT", 0.5, INT8)
    assert (answers.param_value, answers.param_type, answers.param_index) == (0.5, REAL32, 65535)


@pytest.mark.parametrize(
    ("value", "kept"),
    [(7, 7), (2.995, 3), (2.7, 2), (-2.7, -2), (300, 127), (-1e30, -128)],
)
def test_ardupilot_converts_a_value_to_the_parameter_type(
    ardupilot: Client, value: float, kept: float
) -> None:
    assert ardupilot.sets("AVOID_BEHAVE", value)[0].param_value == kept
    assert ardupilot.reads("AVOID_BEHAVE")[0].param_value == kept


def test_ardupilot_does_not_enforce_the_documented_range(ardupilot: Client) -> None:
    assert ardupilot.sets("GUID_TIMEOUT", 60.0)[0].param_value == 60.0


@pytest.mark.parametrize("firmware", list(FIRMWARES))
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_non_finite_values_are_not_answered(firmware: str, value: float) -> None:
    client = Client(firmware)
    name = {"ardupilot": "GUID_TIMEOUT", "px4": "COM_OF_LOSS_T"}[firmware]
    before = client.reads(name)[0].param_value
    assert client.sets(name, value) == []
    assert client.reads(name)[0].param_value == before


@pytest.mark.parametrize("value", [4, -1, 2**31 - 1, -(2**31)])
def test_px4_encodes_integers_bytewise(px4: Client, value: int) -> None:
    (answers,) = px4.sets("COM_OBL_RC_ACT", as_float("<i", value), INT32)
    assert struct.pack("<I", wire_bits(answers)) == struct.pack("<i", value)


def test_px4_does_not_answer_a_wrong_type(px4: Client) -> None:
    assert px4.sets("COM_OBL_RC_ACT", 4.0, REAL32) == []
    assert px4.sets("COM_OF_LOSS_T", 0.25, INT32) == []
    assert px4.reads("COM_OF_LOSS_T")[0].param_value == 1.0


@given(
    name=st.sampled_from(NAMES),
    bits=st.integers(0, 2**32 - 1),
    kind=st.integers(0, 255),
)
@example(name="COM_OBL_RC_ACT", bits=0x7F7FFFFF, kind=INT32)
@example(name="COM_OBL_RC_ACT", bits=0x7F7FFFFF, kind=REAL32)
@example(name="SYSID_THISMAV", bits=0x7F7FFFFF, kind=UINT32)
def test_setting_any_value_raises_no_error(name: str, bits: int, kind: int) -> None:
    message = mavlink.MAVLink_param_set_message(1, 1, name.encode(), as_float("<I", bits), kind)
    for client in CLIENTS:
        client.sends(message)
        for answers in client.reads(name):
            assert answers.pack(make_codec(1, 1))


CLIENTS = tuple(Client(firmware) for firmware in FIRMWARES)
"""Shared by all examples: the values that one example sets persist in the next."""


# System id


@pytest.mark.parametrize(
    ("firmware", "name"), [("ardupilot", "SYSID_THISMAV"), ("px4", "MAV_SYS_ID")]
)
def test_the_system_id_changes_only_with_a_restart(firmware: str, name: str) -> None:
    client = Client(firmware)
    kind = load_table(firmware)[name].kind
    bytewise = firmware == "px4"
    assert client.sets(name, as_float("<i", 9) if bytewise else 9.0, kind)
    assert client.autopilot.system_id == 1
    assert client.reads(name)
    restarted = Client(firmware, parameters={name: 9})
    assert restarted.autopilot.system_id == 9
    assert restarted.reads(name) == []  # the request is for system 1


def test_a_watch_receives_the_values_that_are_set() -> None:
    answers: dict[str, float] = {}
    client = Client(watch=answers.__setitem__)
    client.sets("GUID_TIMEOUT", 0.5)
    client.sets("AVOID_BEHAVE", 300.0)
    client.sets("NO_SUCH", 1.0)
    assert answers == {"GUID_TIMEOUT": 0.5, "AVOID_BEHAVE": 127}
