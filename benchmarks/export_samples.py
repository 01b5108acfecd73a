"""One sample of each export: `python -m benchmarks.export_samples [--out docs/samples]`.

Flies the paper's room 1 and writes what docs/exports.md and docs/recording.md show. Then
prints the areas that are found in the paper's rooms.
"""

import argparse
import tempfile
from pathlib import Path

from companion.afterwards import Format, export_command, report_command
from companion.export.survey import survey
from sitl.testing import Sitl

WORLDS = (("room_100", 100.0), ("room_200", 200.0), ("room_300", 300.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/samples"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        Sitl(Path(folder)).fly("room_100", record=Path(folder))
        (recorded,) = Path(folder).glob("*.mcap")
        flight = recorded.rename(recorded.with_name("room_100.mcap"))
        export_command(flight, list(Format), options.out)
        report_command(flight, options.out / "room_100.html")
    for world, area_m2 in WORLDS:
        flown = Sitl(Path()).fly(world)
        found = sum(room.area_m2 for room in survey(flown.plan).rooms)
        off = 100 * (found / area_m2 - 1)
        print(f"{world}: {found:.2f} m² of {area_m2:.0f} m², {off:+.2f} %")


if __name__ == "__main__":
    main()
