"""Loads and does what a flight will need, once, as root: so it is compiled, and known to work."""

import sys
import tempfile
from pathlib import Path

from companion import calibrate_cli, check_cli, recovery
from companion.app import App
from companion.config import Config
from companion.link.transport import make_codec
from companion.mapping.files import save
from companion.messages import FloorPlan, WallSegment

if __name__ == "__main__":
    import periphery
    import serial
    import smbus2

    App(Config())
    make_codec(1, 191)
    walls = (WallSegment((0.0, 0.0), (0.0, 4.0), 0.01, 100),)
    with tempfile.TemporaryDirectory() as folder:
        files = save(FloorPlan(walls), Path(folder))
        missing = [str(file) for file in files if not file.stat().st_size]
    loaded = all((check_cli, calibrate_cli, recovery, periphery.SPI, serial.Serial, smbus2.SMBus))
    sys.exit(f"not written: {missing}" if missing or not loaded else 0)
