"""Checks the installation on a drone and measures its size: `python -m benchmarks.devices.deploy`.

Runs shellcheck, `systemd-analyze verify` and `security`. For each Python that a Raspberry Pi may
have, it installs aarch64 wheels of all dependencies and measures them after `deploy/slim.sh`.
Downloads about 130 MB for each; `--python 3.11` does only that one, `--no-wheels` none.
`--extra foxglove` adds the packages of an extra.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
UNITS = ("pdps-companion.service", "pdps-recover.service")
PYTHONS = ("3.11", "3.12", "3.13")
GLIBCS = ("2_28", "2_27", "2_26", "2_24", "2_17")
"""glibc versions of the wheels; Debian 12 has glibc 2.36."""
MAX_EXPOSURE, MAX_MB = 3.0, 250


def lint_scripts() -> str:
    """Output of shellcheck."""
    beside = Path(sys.executable).parent / "shellcheck"
    shellcheck = str(beside) if beside.exists() else "shellcheck"
    scripts = [str(path) for path in sorted(ROOT.glob("*/*.sh"))]
    ended = subprocess.run([shellcheck, *scripts], capture_output=True, text=True, check=False)
    return ended.stdout + ended.stderr


def _units_here(folder: str) -> list[str]:
    """The units with a program that this machine has."""
    for name in UNITS:
        text = (DEPLOY / name).read_text()
        (Path(folder) / name).write_text(re.sub(r"/opt/pdps/venv/bin/companion", "/bin/true", text))
    return [str(Path(folder) / name) for name in UNITS]


def verify_units() -> str:
    """Output of `systemd-analyze verify` on the units."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["systemd-analyze", "verify", *_units_here(folder)]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = (ended.stdout + ended.stderr).splitlines()
    return "\n".join(line for line in lines if any(name in line for name in UNITS))


def exposure() -> float:
    """Larger exposure of the units by `systemd-analyze security`: 0 is none, 10 all."""
    with tempfile.TemporaryDirectory() as folder:
        return max(map(_exposure_of, _units_here(folder)))


def _exposure_of(unit: str) -> float:
    command = ["systemd-analyze", "security", "--offline=true", unit]
    output = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    found = re.search(r"Overall exposure level.*: ([\d.]+)", output)
    if found is None:
        raise SystemExit(f"systemd-analyze printed no exposure: {output[-300:]}")
    return float(found[1])


def wheels_mb(python: str, extras: Sequence[str] = ()) -> float:
    """Size of all dependencies on the drone, from aarch64 wheels alone, MB.

    Raises:
        SystemExit: a dependency has no wheel.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    optional = project["optional-dependencies"]
    texts = [*project["dependencies"], *(text for extra in extras for text in optional[extra])]
    wanted = [text.split(";")[0] for text in texts]
    platforms = [f"--platform=manylinux_{glibc}_aarch64" for glibc in GLIBCS]
    with tempfile.TemporaryDirectory() as folder:
        command = [
            *(sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"),
            *(
                "--no-compile",
                "--no-warn-conflicts",
                "--only-binary=:all:",
                f"--python-version={python}",
            ),
            *(*platforms, "--platform=manylinux2014_aarch64", f"--target={folder}", *wanted),
        ]
        if subprocess.run(command, check=False).returncode != 0:
            raise SystemExit(f"Python {python}: a dependency has no wheel for aarch64")
        subprocess.run([str(DEPLOY / "slim.sh"), folder], check=True)
        sizes = (path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
        return sum(sizes) / 1e6


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--python", action="append", choices=PYTHONS)
    arguments.add_argument("--extra", action="append", default=[])
    arguments.add_argument("--no-wheels", action="store_true")
    options = arguments.parse_args()
    print(f"shellcheck: {lint_scripts() or 'clean'}")
    if shutil.which("systemd-analyze"):
        print(f"systemd-analyze verify: {verify_units() or 'clean'}")
        print(f"systemd-analyze security: {exposure()} of {MAX_EXPOSURE} allowed")
    largest_mb = 0.0
    for python in () if options.no_wheels else options.python or PYTHONS:
        mb = wheels_mb(python, options.extra)
        largest_mb = max(largest_mb, mb)
        print(f"aarch64, Python {python}: {mb:.0f} MB of {MAX_MB} allowed")
    if largest_mb > MAX_MB:
        raise SystemExit("too large: see deploy/slim.sh for what can be left out")


if __name__ == "__main__":
    main()
