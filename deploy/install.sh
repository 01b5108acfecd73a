#!/usr/bin/env bash
# Installs or upgrades the companion on Raspberry Pi OS 64-bit (Debian 12 or 13). It may be run again:
# existing files stay, above all /etc/pdps.
#
#   sudo deploy/install.sh                 from this checkout
#   sudo deploy/install.sh --from WHEEL    from a wheel, or a name and version of the package index
#   sudo deploy/install.sh --extra foxglove,team    with these extras
#   deploy/install.sh --root DIR           everything under DIR, for a test; no users, nothing started
#
# The program runs as the user pdps, which owns only /var/lib/pdps.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
from=$(dirname "$here")
extras=
root=
python=python3

fail() { echo "install.sh: $*" >&2; exit 2; }

while [ $# -gt 0 ]; do
    case $1 in
        --from) from=${2:?--from needs a wheel, folder or name}; shift 2 ;;
        --extra) extras=[${2:?--extra needs names, such as foxglove,team}]; shift 2 ;;
        --root) root=${2:?--root needs a folder}; shift 2 ;;
        --python) python=${2:?--python needs a program}; shift 2 ;;
        *) fail "$1: unknown; --from, --extra, --root, --python" ;;
    esac
done

check_machine() {
    "$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' ||
        fail "$("$python" --version): Python 3.11 to 3.13 is needed"
    [ -n "$root" ] && return
    [ "$(id -u)" = 0 ] || fail "it needs root to install; it does not run as root: sudo $0"
    case $(uname -m) in
        aarch64 | x86_64) ;;
        *) fail "$(uname -m): numpy and scipy have no wheels for it; use the 64-bit OS" ;;
    esac
    "$python" -c 'import ensurepip' 2>/dev/null || apt-get install -y -qq python3-venv
}

make_user() {
    [ -n "$root" ] && return
    id -u pdps >/dev/null 2>&1 ||
        useradd --system --home-dir /var/lib/pdps --shell /usr/sbin/nologin pdps
    for group in dialout i2c spi; do
        getent group "$group" >/dev/null || groupadd --system "$group"
        usermod --append --groups "$group" pdps
    done
}

make_venv() {
    venv=$root/opt/pdps/venv
    [ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
    # the drone does not need pip: slim.sh removes it again
    "$venv/bin/python" -m ensurepip >/dev/null
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-cache-dir \
        --no-compile --upgrade "$from$extras"
    "$here/slim.sh" "$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')"
    # Compiles and loads all modules of a flight and its map, as a test of what slim.sh left.
    "$venv/bin/python" "$here/self_test.py"
}

put_files() {
    install -d -m 755 "$root/etc/pdps" "$root/etc/udev/rules.d" "$root/etc/systemd/system" \
        "$root/opt/pdps/docs"
    [ -e "$root/etc/pdps/drone.toml" ] ||
        install -m 644 "$here/drone.toml" "$root/etc/pdps/drone.toml"
    install -m 644 "$here/70-pdps.rules" "$root/etc/udev/rules.d/70-pdps.rules"
    install -m 644 "$here/pdps-companion.service" "$here/pdps-recover.service" \
        "$root/etc/systemd/system/"
    install -m 644 "$here/ardupilot.parm" "$here/px4.params" "$here/wiring.svg" "$here/mounting.svg" "$here"/../docs/*.md \
        "$root/opt/pdps/docs/"
}

# I2C at 400 kHz, SPI, and the full UART for the autopilot, without a login shell.
set_up_buses() {
    boot=$root/boot/firmware
    [ -d "$boot" ] || { echo "no $boot: not a Raspberry Pi, its buses are left alone"; return; }
    model=
    [ ! -r "$root/proc/device-tree/model" ] || model=$(tr -d '\0' <"$root/proc/device-tree/model")
    "$python" "$here/boot_config.py" "$boot" "$model"
    install -d -m 755 "$root/etc/modules-load.d"
    echo i2c-dev >"$root/etc/modules-load.d/pdps.conf"
}

start_using() {
    # nothing runs yet while an image is being built
    [ -n "$root" ] || [ ! -d /run/systemd/system ] && return
    systemctl daemon-reload
    for unit in serial-getty@ttyAMA0.service hciuart.service; do
        systemctl disable --now --quiet "$unit" 2>/dev/null || true
    done
    udevadm control --reload && udevadm trigger
}

check_machine
make_user
make_venv
put_files
set_up_buses
start_using

cat <<END
installed: pdps-companion $("$venv/bin/python" -c 'from importlib.metadata import version
print(version("pdps-companion"))')
  1. set the wiring of the sensors in /etc/pdps/drone.toml
  2. reboot, if this was the first time
  3. sudo -u pdps /opt/pdps/venv/bin/companion check --config /etc/pdps/drone.toml
  4. propellers off: sudo -u pdps /opt/pdps/venv/bin/companion fly --rehearse \
         --config /etc/pdps/drone.toml --out /var/lib/pdps/map
  5. sudo systemctl start pdps-companion    the drone takes off
END
