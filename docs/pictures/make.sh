#!/usr/bin/env bash
# Draw the README's pictures from the results of `make demo`, or that of docs/results.md from those of config/six_pairs.yaml.
# usage: docs/pictures/make.sh [demo|poses] [RESULTS]
set -eu
here=$(realpath "$(dirname "$0")")
root=$(realpath "$here/../..")
results=$(realpath "${2:-$root/results}")
python=$root/.venv/bin/python

# draw NAME ROWS COLUMN...: a picture of a few columns
draw() {
  name=$1 rows=$2
  shift 2
  PYTHONPATH=$root "$python" -m gspure figures panels --rows "$rows" --out "$here/$name.png" "${@/#/--column=}"
  rm "$here/$name.png.json"
  shrink "$here/$name.png" "$name"
}

# shrink PICTURE NAME: the same, 1200 pixels wide, in 256 colours
shrink() {
  "$python" - "$1" "$here/$2.png" <<'END_OF_PYTHON'
import sys
from PIL import Image

picture = Image.open(sys.argv[1]).convert("RGB")
picture = picture.resize((1200, 1200 * picture.height // picture.width), Image.Resampling.LANCZOS)
colours = picture.quantize(256, Image.Quantize.MAXCOVERAGE)
picture.quantize(palette=colours, dither=Image.Dither.FLOYDSTEINBERG).save(sys.argv[2], optimize=True)
END_OF_PYTHON
}

case ${1:-demo} in
  demo)
    cd "$results/splats_in_splats/room"
    for target in scene message; do
      draw "$target" 1 "photograph=../../pairs/room/$target" \
        "unattacked=unattacked/renders/$target" \
        "after GSPure=gspure/renders/$target" \
        "as many removed at random=random_matched/renders/$target"
    done
    shrink figures/model/purification.png purification
    ;;
  poses)
    cd "$results/gs_hider/rooms_own"
    draw poses 1 "photograph=../../pairs/rooms_own/message" \
      "unattacked=unattacked/renders/message" \
      "after GSPure=gspure/renders/message" \
      "clean model=clean/renders/message"
    ;;
esac
