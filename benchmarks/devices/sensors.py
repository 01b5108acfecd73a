"""Measures the simulated sensors: `python -m benchmarks.devices.sensors`.

Prints the tables of docs/sensors.md: the Sharp's voltage and spread over distance, the figures of
the time-of-flight sensors, a reading over an edge by beam width, losses by incidence, and the
gyro's drift.
"""

import math
import statistics
from collections.abc import Iterator
from random import Random

from companion.drivers.chips.sharp import GP2Y0A710K0F
from companion.drivers.chips.time_of_flight import SERIAL_KINDS, VL53L1X
from sitl.core.noise import stream
from sitl.sensors.beam import BeamPhysics, LightBeam
from sitl.sensors.lsm9ds1 import draw_warming
from sitl.sensors.sharp import PHYSICS, SharpUnit
from sitl.sensors.time_of_flight import TOF_PHYSICS, TofUnit
from sitl.world.format import World
from sitl.world.geometry.model import Hit, WorldModel

REFRESHES = 4000
CHIPS = 200
MODELS = {"vl53l1x": VL53L1X, **SERIAL_KINDS}
"""The drivers' measurement models of the time-of-flight sensors."""
PILLAR_M, WALL_M = 2.0, 5.0
STEPPED = World.model_validate(
    {
        "name": "a pillar before a wall",
        "height_m": 2.6,
        "walls": [{"points": [(0, 0), (6, 0), (6, 6), (0, 6)], "closed": True}],
        "boxes": [{"corner": (3, 3), "size": (1, 3), "top_m": 2.6}],
        "starts": [{"name": "here", "position": (1, 3)}],
    }
)


def sharp() -> Iterator[str]:
    physics = PHYSICS["gp2y0a710k0f"]
    yield "distance    volts    σ by the driver    σ measured"
    for distance_m in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0):

        def still(time_s: float, at_m: float = distance_m) -> float:
            return at_m

        unit = SharpUnit(physics, still, Random(1))
        volts = [unit.volts(0.05 * i) for i in range(REFRESHES)]
        readings = (GP2Y0A710K0F.reading(v) for v in volts)
        spread_m = statistics.stdev(r.distance_m for r in readings if r.is_distance)
        assumed_cm, spread_cm = 100 * GP2Y0A710K0F.sigma_m(distance_m), 100 * spread_m
        mean_v = statistics.mean(volts)
        yield f"{distance_m:5.1f} m {mean_v:9.2f} {assumed_cm:12.1f} cm {spread_cm:12.1f} cm"


def time_of_flight() -> Iterator[str]:
    yield "sensor      range, m     σ at 1 m, 3 m: assumed, measured every    age"
    for name, physics in TOF_PHYSICS.items():
        model = MODELS[name]
        spreads = []
        for distance_m in (1.0, 3.0):

            def still(time_s: float, at_m: float = distance_m) -> float:
                return at_m

            units = [TofUnit(physics, still, Random(seed)) for seed in range(1000)]
            measured_m = [unit.distance_m(1.0) for unit in units]
            spread_m = statistics.stdev(m for m in measured_m if m is not None)
            spreads.append(f"{100 * model.sigma_m(distance_m):.1f}, {100 * spread_m:.1f} cm")
        yield (
            f"{name:10s} {model.min_m:5.2f} to {model.max_m:4.1f}   {'; '.join(spreads)}"
            f"   {1000 * physics.period_s:.0f} ms   {1000 * model.mean_age_s:.1f} ms"
        )


def edge() -> Iterator[str]:
    hits = WorldModel(STEPPED).hits
    aside_cm = (-8, -6, -4, -2, 0, 2, 4, 6, 8)
    yield f"pillar at {PILLAR_M} m before a wall at {WALL_M} m; the axis passes its edge by, cm"
    yield "width " + "".join(f"{at:8d}" for at in aside_cm)
    for width_deg in (0.0, 1.0, 2.0, 5.0):
        beam = LightBeam(BeamPhysics(width_deg=width_deg), hits, 1, "front")
        readings = [
            beam.range_m((1.0, 3.0 + 0.01 * at, -1.3), (1.0, 0.0, 0.0), 8.0) for at in aside_cm
        ]
        yield f"{width_deg:4.0f}° " + "".join(f"{m or math.nan:7.2f} m"[1:] for m in readings)


def incidence() -> Iterator[str]:
    yield "incidence   returned with steep_deg = 60"
    for incidence_deg in (0, 60, 65, 70, 75, 80, 85):
        hit = Hit(2.0, math.cos(math.radians(incidence_deg)))
        beam = LightBeam(BeamPhysics(steep_deg=60), lambda *_, hit=hit: [hit], 1, "front")
        returned = sum(
            beam.range_m((0, 0, 0), (1, 0, 0), 8.0) is not None for _ in range(REFRESHES)
        )
        yield f"{incidence_deg:8d}° {returned / REFRESHES:10.0%}"


def gyro() -> Iterator[str]:
    chips = [draw_warming(stream(seed, "gyro temperature")) for seed in range(CHIPS)]
    yield "after    chip's temperature    drift since power-on, rms"
    for time_s in (10, 60, 120, 300, 600):
        drift_deg_s = math.degrees(math.hypot(*(c.bias_rad_s(time_s) for c in chips)))
        temperature_deg_c = chips[0].temperature_deg_c(time_s)
        rms_deg_s = drift_deg_s / math.sqrt(CHIPS)
        yield f"{time_s:4d} s {temperature_deg_c:14.1f} °C {rms_deg_s:18.3f} °/s"


def main() -> None:
    for table in (sharp, time_of_flight, edge, incidence, gyro):
        print(*table(), "", sep="\n")


if __name__ == "__main__":
    main()
