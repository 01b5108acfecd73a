"""Checks the sensors' connections and rejects conflicting ones.

On I2C every chip answers to its address. Chips on the bus itself are always connected. Of the chips
behind a TCA9548A only those of the selected branch are connected.
"""

from collections.abc import Collection, Iterator, Mapping

from companion.config.range_sensors import (
    AutopilotRange,
    RangeSensor,
    SharpOnAds1115,
    SharpOnMcp3008,
    TfminiSensor,
    Vl53l1xSensor,
)
from companion.core.messages import Beam


def check_places(sensors: Mapping[Beam, RangeSensor], gyro_address: int | None) -> None:
    """Check that all sensors can be read; `gyro_address` is that of a gyro on the same bus.

    Raises:
        ValueError: one line with two conflicting sensors and the remedy.
    """
    _check_inputs(sensors)
    _check_references(sensors)
    _check_addresses(sensors, gyro_address)


def mux_addresses(sensors: Collection[RangeSensor]) -> list[int]:
    """Addresses of all multiplexers."""
    found = {s.mux_address for s in sensors if isinstance(s, Vl53l1xSensor)}
    return sorted(address for address in found if address is not None)


def _check_inputs(sensors: Mapping[Beam, RangeSensor]) -> None:
    users: dict[tuple[object, ...], Beam] = {}
    for beam, sensor in sensors.items():
        if (where := _place(sensor)) and users.setdefault(where, beam) is not beam:
            raise ValueError(
                f"{users[where].value} and {beam.value} are wired to the same place; "
                "give each an address, channel or port of its own"
            )


def _place(sensor: RangeSensor) -> tuple[object, ...]:
    """Connection that no two sensors can share; empty for the autopilot's, which differ by beam."""
    match sensor:
        case SharpOnAds1115():
            return "ADS1115", sensor.address, sensor.channel
        case SharpOnMcp3008():
            return "MCP3008", sensor.device, sensor.channel
        case Vl53l1xSensor():
            channel = sensor.mux_channel if sensor.mux_address is not None else None
            return "VL53L1X", sensor.address, sensor.mux_address, channel
        case TfminiSensor():
            return "port", sensor.port
        case AutopilotRange():
            return ()


def _check_references(sensors: Mapping[Beam, RangeSensor]) -> None:
    references_v: dict[str, tuple[Beam, float]] = {}
    for beam, sensor in sensors.items():
        if not isinstance(sensor, SharpOnMcp3008):
            continue
        other, volts = references_v.setdefault(sensor.device, (beam, sensor.reference_v))
        if volts != sensor.reference_v:
            raise ValueError(
                f"ranges.{other.value}.reference_v = {volts:g} and ranges.{beam.value}.reference_v "
                f"= {sensor.reference_v:g} differ, but {sensor.device} is one chip"
            )


def _check_addresses(sensors: Mapping[Beam, RangeSensor], gyro_address: int | None) -> None:
    on_bus: dict[int, str] = {}
    for address, chip in _chips_on_bus(sensors, gyro_address):
        if on_bus.setdefault(address, chip) != chip:
            raise ValueError(_both_answer(on_bus[address], chip, address))
    for beam, sensor in sensors.items():
        if isinstance(sensor, Vl53l1xSensor) and sensor.mux_address is not None:
            chip = f"{beam.value} behind 0x{sensor.mux_address:02x}"
            if other := on_bus.get(sensor.address):
                raise ValueError(_both_answer(other, chip, sensor.address))


def _chips_on_bus(
    sensors: Mapping[Beam, RangeSensor], gyro_address: int | None
) -> Iterator[tuple[int, str]]:
    """Address and name of all chips that are always connected."""
    if gyro_address is not None:
        yield gyro_address, "the gyro"
    for beam, sensor in sensors.items():
        match sensor:
            case SharpOnAds1115():
                yield sensor.address, f"the ADS1115 at 0x{sensor.address:02x}"
            case Vl53l1xSensor(mux_address=None):
                yield sensor.address, beam.value
            case _:
                pass
    for address in mux_addresses(sensors.values()):
        yield address, f"the multiplexer at 0x{address:02x}"


def _both_answer(one: str, other: str, address: int) -> str:
    return (
        f"{one} and {other} would both answer at I2C address 0x{address:02x}; "
        "put each VL53L1X behind a multiplexer, or give it an address that is free"
    )
