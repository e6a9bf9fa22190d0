"""Draw the pictures of the documentation from results.

``python docs/pictures/make.py radius|demo|poses|robot [RESULTS]``, in a checkout: of the committed radii,
of `make demo`, of config/six_pairs.yaml, or of

    gspure pair snowmiku_plush robot.ply --resolution 640px --out pair     # the robot stands where the figure does
    gspure embed splats_in_splats pair --out marked --set iterations=7000 --set max_gaussians=120000
    gspure purify marked/public --cameras pair/cameras.json --out purified

with renders of the test views (`gspure render`) and messages (`gspure extract`) of both models in scene, message,
scene_after and message_after.
"""

import sys
from pathlib import Path

from PIL import Image

from gspure.evaluation.results import read_results
from gspure.figures.panels import Tile, write_tiles
from gspure.figures.radius_chart import draw_conditions
from gspure.images import read_image
from gspure.report.audit import audits, is_judged

HERE = Path(__file__).parent


def shrink(source: Path, name: str) -> None:
    """Write a picture 1200 pixels wide, in 256 colours."""
    picture = Image.open(source).convert("RGB")
    picture = picture.resize((1200, 1200 * picture.height // picture.width), Image.Resampling.LANCZOS)
    colours = picture.quantize(256, Image.Quantize.MAXCOVERAGE)
    picture = picture.quantize(palette=colours, dither=Image.Dither.FLOYDSTEINBERG)
    picture.save(HERE / f"{name}.png", optimize=True)


def side_by_side(name: str, files: list[Path]) -> None:
    """Write pictures in one row, 400 pixels wide each."""
    row = Image.new("RGB", (404 * len(files) - 4, 300), "white")
    for index, file in enumerate(files):
        tile = Image.open(file).convert("RGB").resize((400, 300), Image.Resampling.LANCZOS)
        row.paste(tile, (404 * index, 0))
    row.save(HERE / f"{name}.jpg", quality=88)


what, results = sys.argv[1], Path(*sys.argv[2:] or ["results"])
if what == "radius":
    rows = read_results(*sorted(HERE.parent.glob("results/radius/*.csv")))
    conditions = {}
    for audit in audits(rows):
        if audit.has_radius:
            alike = [row for row in rows if row.condition == audit.condition and is_judged(row, audit.extraction)]
            conditions[audit.condition.title] = (alike, audit.radii)
    draw_conditions(HERE / "radius.png", conditions)
    shrink(HERE / "radius.png", "radius")
elif what == "demo":
    shrink(results / "splats_in_splats" / "room" / "figures" / "model" / "purification.png", "purification")
elif what == "robot":
    folders = ("scene", "message", "scene_after", "message_after")
    side_by_side("robot", [results / folder / "20240212_003956.png" for folder in folders])
else:
    model = results / "gs_hider" / "rooms_own"
    attacks = {"unattacked": "unattacked", "after GSPure": "gspure", "clean model": "clean"}
    folders = {title: model / variant / "renders" / "message" for title, variant in attacks.items()}
    folders = {"photograph": results / "pairs" / "rooms_own" / "message"} | folders
    view = min(folders["unattacked"].glob("*.png")).name
    write_tiles(HERE / "poses.png", [*folders], [[Tile(read_image(folder / view)) for folder in folders.values()]])
    shrink(HERE / "poses.png", "poses")
