#!/usr/bin/env bash
# Takes out of a site-packages folder what no flight loads: other packages' tests, MAVLink's other
# dialects and its generator with lxml, and matplotlib's PDF fonts. slim.sh SITE_PACKAGES
set -euo pipefail

packages=${1:?slim.sh needs the folder of the packages}
[ -d "$packages/pymavlink" ] || { echo "slim.sh: no pymavlink in $packages" >&2; exit 2; }

rm -rf "$packages"/lxml "$packages"/lxml-* "$packages"/fontTools "$packages"/fonttools-*
find "$packages" -type d -name tests -prune -exec rm -rf {} +
find "$packages/pymavlink/dialects" -type f -not -path '*/v20/ardupilotmega.py' \
    -not -name __init__.py -delete
rm -rf "$packages/pymavlink/generator"
