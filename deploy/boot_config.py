"""Sets up a Raspberry Pi's buses in config.txt and cmdline.txt, and keeps all other settings.

    boot_config.py BOOT_FOLDER MODEL

config.txt has sections: a line applies only to the models that its section names. It overrides an
earlier line with the same key; comments never apply. Required are I2C at 400 kHz, SPI, and the full
UART on pins 8 and 10 as /dev/ttyAMA0 without a login shell. On a Raspberry Pi 5 and related models
that is uart0. There serial0 is the debug connector, /dev/ttyAMA10, which stays unchanged.
"""

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ALL = "all"
WANTED: tuple[tuple[str, tuple[str, ...]], ...] = (
    (ALL, ("dtparam=i2c_arm=on,i2c_arm_baudrate=400000", "dtparam=spi=on", "enable_uart=1")),
    ("pi02", ("dtoverlay=disable-bt",)),
    ("pi3", ("dtoverlay=disable-bt",)),
    ("pi4", ("dtoverlay=disable-bt",)),
    ("pi5", ("dtparam=uart0=on",)),
)
"""Required lines by section. pi4 is also Compute Module 4 and Pi 400, pi5 Compute Module 5 and
Pi 500."""
IMPLIED = {"i2c": "i2c_arm", "i2c_baudrate": "i2c_arm_baudrate"}
"""Alternative names of parameters."""
MODEL = r"pi\d|cm\d|none$"
"""Sections that name a model, or none."""
PINS = ("ttyAMA0",)
PINS_BEFORE_PI_5 = ("serial0", "ttyAMA0", "ttyS0")


def settings(line: str) -> Iterator[tuple[str, str]]:
    """Keys and values of a line: one per parameter of dtparam, one per overlay of dtoverlay."""
    key, _, value = line.partition("=")
    if key == "dtparam":
        for part in value.split(","):
            name, _, setting = part.partition("=")
            yield f"dtparam {IMPLIED.get(name, name)}", setting or "on"
    elif key == "dtoverlay":
        name, _, parameters = value.partition(",")
        yield f"dtoverlay {name}", parameters
    elif value:
        yield key, value


def in_force(lines: list[str], model: str) -> dict[str, str]:
    """Settings in force on every machine of a model, by the last line of each key.

    A model section replaces the previous one. Other filters, such as [gpio4=1], narrow the lines
    that follow, until [all] resets them.
    """
    of_model, is_narrowed = ALL, False
    found: dict[str, str] = {}
    for line in (line.strip() for line in lines):
        if match := re.fullmatch(r"\[(.+)\]", line):
            if match[1] == ALL:
                is_narrowed = False
            if match[1] == ALL or re.match(MODEL, match[1]):
                of_model = match[1]
            else:
                is_narrowed = True
        elif of_model in (ALL, model) and not is_narrowed and not line.startswith("#"):
            found.update(settings(line))
    return found


def with_buses(text: str) -> str:
    """config.txt with missing settings appended; applying it twice changes nothing."""
    end = "\r\n" if "\r\n" in text else "\n"
    lines = text.splitlines()
    lacking: list[str] = []
    for section, wanted in WANTED:
        there = in_force(lines, section).items()
        missing = [line for line in wanted if not dict(settings(line)).items() <= there]
        if missing:
            lacking += [f"[{section}]", *missing]
    if not lacking:
        return text
    begin = text if not text or text.endswith("\n") else text + end
    return begin + end.join([*lacking, f"[{ALL}]"]) + end


def without_login(text: str, ports: tuple[str, ...]) -> str:
    """cmdline.txt, one line, without a console or debugger on any of the ports."""
    taken = rf"(?<!\S)(?:console|kgdboc)=(?:{'|'.join(ports)})(?:,\S*)?(?!\S)"
    if not re.search(taken, text):
        return text
    rest = re.sub(rf"{taken}[ \t]*", "", text)
    return re.sub(r"[ \t]+(?=\r?\n|$)", "", rest)


def rewrite(path: Path, text: str, new: str) -> None:
    """Replace a file atomically: half a config.txt does not boot."""
    if new == text:
        return
    beside = path.with_name(path.name + ".pdps-new")
    with beside.open("w", encoding="latin-1", newline="") as file:
        file.write(new)
        file.flush()
        os.fsync(file.fileno())
    beside.replace(path)


def read(path: Path) -> str:
    """The file's text, independent of its encoding; empty if there is no such file."""
    if not path.exists():
        return ""
    with path.open(encoding="latin-1", newline="") as file:
        return file.read()


def main(boot: Path, model: str) -> None:
    """Update both files."""
    config, command_line = boot / "config.txt", boot / "cmdline.txt"
    text = read(config)
    rewrite(config, text, with_buses(text))
    is_pi_5 = re.search(r"Raspberry Pi (5\b|500|Compute Module 5)", model) is not None
    text = read(command_line)
    rewrite(command_line, text, without_login(text, PINS if is_pi_5 else PINS_BEFORE_PI_5))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "")
