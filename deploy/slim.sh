#!/usr/bin/env bash
# Removes from a site-packages folder what no flight loads:
#   - other packages' tests, headers and stubs
#   - MAVLink's other dialects, and its generator with lxml
#   - of fontTools, which matplotlib uses to embed fonts in PDFs: compiled parts, their sources, its own formats
#   - of scipy what is not used; of pillow what a PNG does not need; a font
#   - of pygments, which colours tracebacks, all languages but Python
#   - zstandard, which only recordings of other programs may use
#   - pip and setuptools, which installed the rest
# The installer then runs self_test.py on what is left.
# slim.sh SITE_PACKAGES
set -euo pipefail

packages=${1:?slim.sh needs the folder of the packages}
[ -d "$packages/pymavlink" ] || { echo "slim.sh: no pymavlink in $packages" >&2; exit 2; }

rm -rf "$packages"/{lxml,zstandard} "$packages"/{lxml,zstandard}-*
rm -rf "$packages"/{pip,setuptools,pkg_resources,_distutils_hack} "$packages"/{pip,setuptools}-*
rm -f "$packages/distutils-precedence.pth"
rm -rf "$packages"/fontTools/{varLib,feaLib,otlLib,ufoLib,cu2qu,qu2cu,designspaceLib,merge,subset}
rm -rf "$packages"/scipy/{cluster,datasets,fft,fftpack,integrate,interpolate,io,misc,odr,optimize,signal,stats}
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
