"""Calibrates sensors: `companion calibrate range` and `companion calibrate gyro`."""

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.bringup.calibration_fit import fit, tape_point, turn_gain
from companion.bringup.capture import readings_of, rest_bias_rad_s, suggested_distances_m, turn_rad
from companion.commands.options import BusUrl, LinkUrl, load_settings
from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.errors import ConfigError
from companion.core.messages import Beam
from companion.drivers.models import range_models
from companion.drivers.wires.opening import open_bus
from companion.link.transports.open_link import open_transport
from companion.run.clocks import open_clock
from companion.run.hardware import make_rig
from companion.run.loop import Rig

commands = typer.Typer(
    no_args_is_help=True, help="Calibrate sensors and write the result to the config."
)
Written = Annotated[Path, typer.Option(help="TOML file that is read and updated.")]
DRONE = Path("drone.toml")
"""Default configuration file."""


@commands.command("range")
def calibrate_range(
    beam: Annotated[Beam, typer.Argument(help="Range sensor to calibrate.")],
    config: Written = DRONE,
    link: LinkUrl = None,
    bus: BusUrl = None,
    distances: Annotated[
        str, typer.Option(help="Distances from the sensor's front, m, such as 1.2,1.4,1.7,2,2.5.")
    ] = "",
    seconds: Annotated[
        float, typer.Option(help="Measuring time at each distance, s.", min=1)
    ] = 30.0,
) -> None:
    """Calibrate one range sensor with a tape measure, at three to five distances."""
    console = Console(highlight=False, markup=False)
    settings = _uncalibrated(config, link, bus)
    models = range_models(settings.sensors)
    if beam not in models:
        raise ConfigError(f"{beam.value}: no such sensor; {', '.join(models)} are configured")
    rig = _rig(settings, console)
    distances_m = _metres(distances) or suggested_distances_m(models[beam])
    points = []
    for true_m in distances_m:
        console.input(
            f"put a flat, light board square to {beam.value}, {true_m:.2f} m from its front, "
            "then press Enter"
        )
        points.append(tape_point(true_m, readings_of(rig, beam, seconds)))
        console.print(
            f"  measured {points[-1].measured_m:.3f} m ± {1000 * points[-1].sigma_m:.1f} mm"
        )
    found = fit(points)
    gain, offset_m = found.calibration.gain, found.calibration.offset_m
    console.print(
        f"{beam.value} reads {gain:.4f} (± {100 * found.gain_sigma:.2f} %) × distance "
        f"{1000 * offset_m:+.0f} mm; {1000 * found.residual_m:.1f} mm residual"
    )
    configuration.update(
        config, f"sensors.calibration.{beam.value}", found.calibration.model_dump()
    )
    console.print(f"written to {config}")


@commands.command("gyro")
def calibrate_gyro(
    config: Written = DRONE,
    link: LinkUrl = None,
    bus: BusUrl = None,
    turns: Annotated[int, typer.Option(help="Number of full turns.", min=1, max=10)] = 3,
) -> None:
    """Calibrate the gyro's scale factor with full turns by hand; every flight measures the bias."""
    console = Console(highlight=False, markup=False)
    settings = _uncalibrated(config, link, bus)
    rig = _rig(settings, console)
    console.input("put the drone on a mark, do not touch it, then press Enter")
    bias = rest_bias_rad_s(rig, settings.sensors.rest_s)
    console.print(f"  bias {math.degrees(bias):+.3f} °/s")
    console.print(f"turn it clockwise, seen from above, {turns} times, back onto the mark")
    gain = turn_gain(turn_rad(rig, bias), turns)
    console.print(f"the gyro reads {gain:.4f} × rate")
    configuration.update(config, "sensors.gyro_gain", gain)
    console.print(f"written to {config}")


def _uncalibrated(config: Path, link: str | None, bus: str | None) -> Config:
    """Load the configuration without the calibration of range sensors and gyro."""
    settings = load_settings(config if config.exists() else None, link, bus, None)
    raw = settings.sensors.model_copy(update={"calibration": {}, "gyro_gain": 1.0})
    return settings.model_copy(update={"sensors": raw})


def _rig(settings: Config, console: Console) -> Rig:
    transport = open_transport(settings.link, console.print)
    wires = open_bus(settings.sensors.bus)
    return make_rig(settings, transport, wires, open_clock(settings, transport, console.print))


def _metres(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",")) if text else ()
    except ValueError:
        raise ConfigError(f"--distances {text}: should be metres such as 1.2,1.6,2") from None
