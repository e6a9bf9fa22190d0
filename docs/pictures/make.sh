#!/usr/bin/env bash
# Draw the README's pictures from the results of `make demo`.
# usage: docs/pictures/make.sh [RESULTS]
set -eu
here=$(realpath "$(dirname "$0")")
root=$(realpath "$here/../..")
cd "${1:-$root/results}/splats_in_splats/room"
python=$root/.venv/bin/python

for target in scene message; do
  PYTHONPATH=$root "$python" -m gspure figures panels --rows 1 --out "$here/$target.png" \
    --column "photograph=../../pairs/room/$target" \
    --column "unattacked=unattacked/renders/$target" \
    --column "after GSPure=gspure/renders/$target" \
    --column "as many removed at random=random_matched/renders/$target"
  rm "$here/$target.png.json"
  "$python" - "$here/$target.png" <<'END_OF_PYTHON'
import sys
from PIL import Image

picture = Image.open(sys.argv[1]).convert("RGB")
picture = picture.resize((1200, 1200 * picture.height // picture.width), Image.Resampling.LANCZOS)
colours = picture.quantize(256, Image.Quantize.MAXCOVERAGE)
picture.quantize(palette=colours, dither=Image.Dither.FLOYDSTEINBERG).save(sys.argv[1], optimize=True)
END_OF_PYTHON
done
