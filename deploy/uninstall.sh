#!/usr/bin/env bash
# Removes what install.sh installed. Maps in /var/lib/pdps, the configuration and the user stay, unless
# --purge is given. The boot configuration stays unchanged.
set -euo pipefail

root=
purge=no
while [ $# -gt 0 ]; do
    case $1 in
        --root) root=${2:?--root needs a folder}; shift 2 ;;
        --purge) purge=yes; shift ;;
        *) echo "uninstall.sh: $1: unknown; --root, --purge" >&2; exit 2 ;;
    esac
done
[ -n "$root" ] || [ "$(id -u)" = 0 ] || { echo "uninstall.sh: run it with sudo" >&2; exit 2; }

if [ -z "$root" ]; then
    systemctl disable --now --quiet pdps-companion.service pdps-recover.service 2>/dev/null || true
fi
rm -rf "$root/opt/pdps"
rm -f "$root/etc/systemd/system/pdps-companion.service" \
    "$root/etc/systemd/system/pdps-recover.service" "$root/etc/udev/rules.d/70-pdps.rules" \
    "$root/etc/modules-load.d/pdps.conf"
if [ "$purge" = yes ]; then
    rm -rf "$root/etc/pdps" "$root/var/lib/pdps"
    [ -n "$root" ] || userdel pdps 2>/dev/null || true
fi
if [ -z "$root" ]; then
    systemctl daemon-reload
    udevadm control --reload
fi
echo "uninstalled"
