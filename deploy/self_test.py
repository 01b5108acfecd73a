"""Loads and runs the parts that a flight needs, once, as root: compiles and checks them."""

import sys
import tempfile
from pathlib import Path

from companion.app import App
from companion.commands import calibrate, check
from companion.config.settings import Config
from companion.core.messages import FloorPlan, WallSegment
from companion.export.map_files import save
from companion.link.transports.transport import make_codec
from companion.run import resume

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
    loaded = all((check, calibrate, resume, periphery.SPI, serial.Serial, smbus2.SMBus))
    sys.exit(f"not written: {missing}" if missing or not loaded else 0)
