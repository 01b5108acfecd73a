#!/usr/bin/env bash
# Takes out of a site-packages folder what no flight loads: other packages' tests, MAVLink's other
# dialects and its generator with lxml, and of fontTools, with which matplotlib puts fonts into PDFs,
# the compiled parts, their sources and its own formats; of scipy what filterpy leaves alone; and
# zstandard, with which others' recordings may be packed, ours are not; and setuptools, which Python
# 3.11 puts into every venv. The installer's self_test.py proves what is left. slim.sh SITE_PACKAGES
set -euo pipefail

packages=${1:?slim.sh needs the folder of the packages}
[ -d "$packages/pymavlink" ] || { echo "slim.sh: no pymavlink in $packages" >&2; exit 2; }

rm -rf "$packages"/{lxml,zstandard} "$packages"/{lxml,zstandard}-*
rm -rf "$packages"/{setuptools,pkg_resources,_distutils_hack} "$packages"/setuptools-*
rm -f "$packages/distutils-precedence.pth"
rm -rf "$packages"/fontTools/{varLib,feaLib,otlLib,ufoLib,cu2qu,qu2cu,designspaceLib,merge,subset}
rm -rf "$packages"/scipy/{io,signal,odr,cluster,datasets,fftpack,misc}
rm -rf "$packages"/matplotlib/mpl-data/{sample_data,fonts/pdfcorefonts,fonts/afm}
find "$packages" -path '*/fontTools/*' \( -name '*.so' -o -name '*.c' -o -name '*.pyx' \) -delete
find "$packages" -type d -name tests -prune -exec rm -rf {} +
find "$packages/pymavlink/dialects" -type f -not -path '*/v20/ardupilotmega.py' \
    -not -name __init__.py -delete
rm -rf "$packages/pymavlink/generator"
