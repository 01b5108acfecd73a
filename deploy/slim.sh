#!/usr/bin/env bash
# Takes out of a site-packages folder what no flight loads: other packages' tests, MAVLink's other
# dialects and its generator with lxml, and of fontTools, with which matplotlib puts fonts into PDFs,
# the compiled parts, their sources and its own formats; of scipy what filterpy leaves alone; of pillow
# what a PNG does without; a font; other languages than Python of what colours tracebacks; zstandard,
# with which others' recordings may be packed, ours are not; what is for those who compile; and pip and
# setuptools, with which it was installed. The installer's self_test.py proves what is left.
# slim.sh SITE_PACKAGES
set -euo pipefail

packages=${1:?slim.sh needs the folder of the packages}
[ -d "$packages/pymavlink" ] || { echo "slim.sh: no pymavlink in $packages" >&2; exit 2; }

rm -rf "$packages"/{lxml,zstandard} "$packages"/{lxml,zstandard}-*
rm -rf "$packages"/{pip,setuptools,pkg_resources,_distutils_hack} "$packages"/{pip,setuptools}-*
rm -f "$packages/distutils-precedence.pth"
rm -rf "$packages"/fontTools/{varLib,feaLib,otlLib,ufoLib,cu2qu,qu2cu,designspaceLib,merge,subset}
rm -rf "$packages"/scipy/{io,signal,odr,cluster,datasets,fftpack,misc}
rm -rf "$packages"/matplotlib/mpl-data/{sample_data,fonts/pdfcorefonts,fonts/afm}
rm -rf "$packages"/tzdata "$packages"/PIL/_{avif,imagingcms,imagingft,imagingtk}.*
rm -f "$packages"/pillow.libs/lib{avif,brotlicommon,brotlidec,freetype,harfbuzz,lcms2}-*
find "$packages" -path '*/mpl-data/fonts/ttf/STIX*' -delete
find "$packages" -path '*/pygments/lexers/*.py' -not -name '_*' -not -name python.py \
    -not -name special.py -delete
find "$packages" -path '*/fontTools/*' \( -name '*.so' -o -name '*.c' -o -name '*.pyx' \) -delete
find "$packages" -type d -name tests -prune -exec rm -rf {} +
find "$packages" \( -name '*.pyi' -o -name '*.pxd' -o -name '*.h' -o -name '*.a' \) -delete
find "$packages/pymavlink/dialects" -type f -not -path '*/v20/ardupilotmega.py' \
    -not -name __init__.py -delete
rm -rf "$packages/pymavlink/generator"
