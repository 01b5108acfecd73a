"""Parameter files of deploy/, for tests of them and of drones that have loaded them."""

from pathlib import Path

from sitl.autopilot.parameters.table import load_table

DEPLOY = Path(__file__).parents[1] / "deploy"
FILES = {"ardupilot": DEPLOY / "ardupilot.parm", "px4": DEPLOY / "px4.params"}
"""File by autopilot."""


def deployed(autopilot: str) -> dict[str, float]:
    """All values of an autopilot's file."""
    lines = FILES[autopilot].read_text().splitlines()
    words = [line.split() for line in lines if line and not line.startswith("#")]
    return {w[-3] if len(w) == 5 else w[0]: float(w[-2] if len(w) == 5 else w[1]) for w in words}


def loaded(autopilot: str) -> dict[str, float]:
    """Those of the values that the emulated autopilot knows; it has no serial ports."""
    table = load_table(autopilot)
    return {name: value for name, value in deployed(autopilot).items() if name in table}
