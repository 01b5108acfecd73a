"""Writes one sample of each export.

Command: `python -m benchmarks.pictures.export_samples [--out docs/samples]`.

Flies the paper's room 1 and its complex building, and writes the samples of docs/exports.md and
docs/recording.md.
"""

import argparse
import tempfile
from pathlib import Path

from companion.commands.recording import Format, export_command, report_command
from sitl.testing import Sitl


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/samples"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        Sitl(Path(folder)).fly("room_100", record=Path(folder))
        (recorded,) = Path(folder).glob("*.mcap")
        flight = recorded.rename(recorded.with_name("room_100.mcap"))
        flown = [each for each in Format if each.value != "ifc"]
        export_command(flight, flown, options.out, lat_deg=47.3977, lon_deg=8.5456)
        report_command(flight, options.out / "room_100.html")
        flight.unlink()
        Sitl(Path(folder)).fly("complex", mission="building", record=Path(folder))
        (recorded,) = Path(folder).glob("*.mcap")
        building = recorded.rename(recorded.with_name("complex.mcap"))
        export_command(
            building, [Format("svg"), Format("ifc")], options.out, path=False, points=False
        )


if __name__ == "__main__":
    main()
