#!/usr/bin/env bash
# Installs the companion in an arm64 Debian under qemu, as a Raspberry Pi has it, and runs its tests of
# drivers, link, mission, health and configuration there. Needs root, debootstrap, qemu-user-static and
# binfmt-support; 40 min on two cores, most of it the emulator's.
#
#   sudo benchmarks/devices/arm64.sh FOLDER [SUITE]
set -euo pipefail

here=$(cd "$(dirname "$0")/../.." && pwd)
root=${1:?arm64.sh needs a folder for the Debian}
suite=${2:-bookworm}
tests="tests/contract tests/unit/drivers/test_bus.py tests/unit/config/test_config.py tests/unit/core/test_frames.py
tests/unit/safety/test_velocity_guard.py tests/unit/safety/test_obstacle_memory.py
tests/unit/safety/test_too_near_readings.py tests/unit/safety/test_health.py tests/unit/drivers/test_linux_wires.py
tests/unit/pdps/test_flight_phases.py tests/unit/pdps/test_return_and_landing.py
tests/unit/pdps/test_room_scan.py tests/unit/pdps/test_perpendicular.py
tests/unit/link/test_reports.py tests/unit/link/test_serial_transport.py tests/unit/run/test_systemd.py
tests/unit/drivers/test_sharp.py tests/unit/link/test_signing.py tests/unit/navigation/test_standoff.py
tests/unit/drivers/test_tfmini.py tests/unit/drivers/test_vl53l1x.py"

mountpoint -q /proc/sys/fs/binfmt_misc || mount -t binfmt_misc none /proc/sys/fs/binfmt_misc
update-binfmts --enable qemu-aarch64
[ -e "$root/usr/bin/python3" ] ||
    debootstrap --arch=arm64 --variant=minbase --include=python3,python3-venv,ca-certificates \
        "$suite" "$root"
# names are resolved, and certificates trusted, as here
cp /etc/resolv.conf "$root/etc/"
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
rm -rf "$root/src" "$root/tests"
mkdir "$root/src" "$root/tests"
git -C "$here" archive HEAD | tar -x -C "$root/src"
# only the tests: the companion is the one that is installed
git -C "$here" archive HEAD tests benchmarks deploy pyproject.toml | tar -x -C "$root/tests"
mount --bind /proc "$root/proc"
trap 'umount "$root/proc"' EXIT

chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 TESTS="$tests" \
    PIP_CERT=/etc/ssl/certs/ca-certificates.crt bash -eu <<'END'
/src/deploy/install.sh --root /drone
python=/drone/opt/pdps/venv/bin/python
du -sm /drone/opt/pdps/venv
"$python" -m ensurepip >/dev/null
"$python" -m pip install --quiet hypothesis pytest pytest-xdist python-fcl
# pytest colours what differs, which the drone's pygments cannot any more
"$python" -m pip install --quiet --force-reinstall --no-deps pygments
cd /tests
"$python" -c "import companion, platform as p; print(companion.__file__, p.machine())"
# shellcheck disable=SC2086
exec "$python" -m pytest -n 0 -p no:cacheprovider -p no:sitl $TESTS
END
