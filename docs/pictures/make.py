"""Draw the pictures of the README from the results of `make demo`, or of docs/results.md from config/six_pairs.yaml.

``python docs/pictures/make.py demo|poses [RESULTS]``, in a checkout.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

from PIL import Image

from gspure.figures.panels import common_views, write_panels
from gspure.images import read_image

HERE = Path(__file__).parent


def draw(name: str, folders: Mapping[str, Path]) -> None:
    """Draw the first view of each folder of ``VIEW.png``, by title."""
    view = common_views(folders.values())[0]
    columns = {title: {view: read_image(folder / f"{view}.png")} for title, folder in folders.items()}
    write_panels(HERE / f"{name}.png", columns, [view], difference=False)
    shrink(HERE / f"{name}.png", name)


def shrink(source: Path, name: str) -> None:
    """Write a picture 1200 pixels wide, in 256 colours."""
    picture = Image.open(source).convert("RGB")
    picture = picture.resize((1200, 1200 * picture.height // picture.width), Image.Resampling.LANCZOS)
    colours = picture.quantize(256, Image.Quantize.MAXCOVERAGE)
    picture = picture.quantize(palette=colours, dither=Image.Dither.FLOYDSTEINBERG)
    picture.save(HERE / f"{name}.png", optimize=True)


what, results = sys.argv[1], Path(*sys.argv[2:] or ["results"])
if what == "demo":
    model = results / "splats_in_splats" / "room"
    for target in ("scene", "message"):
        attacks = {"unattacked": "unattacked", "after GSPure": "gspure", "as many removed at random": "random_matched"}
        renders = {title: model / variant / "renders" / target for title, variant in attacks.items()}
        draw(target, {"photograph": results / "pairs" / "room" / target} | renders)
    shrink(model / "figures" / "model" / "purification.png", "purification")
else:
    model = results / "gs_hider" / "rooms_own"
    attacks = {"unattacked": "unattacked", "after GSPure": "gspure", "clean model": "clean"}
    renders = {title: model / variant / "renders" / "message" for title, variant in attacks.items()}
    draw("poses", {"photograph": results / "pairs" / "rooms_own" / "message"} | renders)
