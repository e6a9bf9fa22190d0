"""Draw the pictures of the documentation from results.

``python docs/pictures/make.py radius|survival|demo|poses|robot [RESULTS]``, in a checkout: of the committed
tables, of `make demo`, of experiments/six_pairs.yaml, or of

    gspure pair snowmiku_plush robot.ply --resolution 640px --out pair     # the robot stands where the figure does
    gspure embed splats_in_splats pair --out marked --set iterations=7000 --set max_gaussians=120000
    gspure purify marked/public --cameras pair/cameras.json --out purified

with renders of the test views (`gspure render`) and messages (`gspure extract`) of both models in scene, message,
scene_after and message_after.
"""

import csv
import sys
from pathlib import Path

from PIL import Image

from gspure.evaluation.results import read_results
from gspure.figures import style
from gspure.figures.panels import Tile, write_tiles
from gspure.figures.radius_chart import draw_conditions
from gspure.grouping import grouped
from gspure.images import read_image
from gspure.report.audit import audits, is_judged

HERE = Path(__file__).parent
EXPERIMENTS = HERE.parents[1] / "experiments"


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


ROWS = ("quantize", "compression", "warp", "split", "merge_pairs", "densify", "remesh", "rigid_transform", "crop")
FAMILIES = {
    "rows, places, formats": ROWS,
    "colours": ("sh_edit", "feature_scaling", "gaussian_noise", "reestimate", "finetune"),
    "pruning": ("gspure", "prune_repair"),
    "unmark": ("unmark",),
    "copies with other marks": ("collusion",),
    "such copies, then unmark": ("collusion, unmark",),
}
"""Attacks on keyed patterns; all others train a new model on renders."""

WEAK = 7  # largest z of a point with a name


def draw_survival() -> None:
    """Draw the best reading of a keyed pattern against damage, a point for each attack and strength."""
    with (EXPERIMENTS / "tables" / "keyed_pattern.csv").open(newline="", encoding="utf-8") as stream:
        known = [row for row in csv.DictReader(stream) if row["damage"] and row["attack"] != "embedding"]
    rows = [row for row in known if "bank also" not in row["strength"]]
    family_of = {attack: family for family, attacks in FAMILIES.items() for attack in attacks}
    by_family = grouped(rows, lambda row: family_of.get(row["attack"], "new models from renders"))
    with style.page(HERE / "survival.png", style.PAGE, 3.2) as figure:
        axes = figure.add_subplot()
        for colour, (family, alike) in zip(style.CLUSTERS, by_family.items(), strict=False):
            label = family
            for row in alike:
                damage = max(0.0, float(row["damage"]))
                best = max(float(row[f"z {reading}"]) for reading in ("rows", "clean model", "bank"))
                fill = colour if float(row["p"]) <= 1e-3 else "white"
                axes.plot(damage, best, "o", markersize=4, color=colour, markerfacecolor=fill, label=label)
                label = None
                if best < WEAK and row["attack"] not in FAMILIES["such copies, then unmark"]:
                    name = f"{row['attack']}, {row['strength']}"
                    place = {"xytext": (-5, -9), "ha": "right"} if damage > 20 else {"xytext": (5, 4)}
                    axes.annotate(name, (damage, best), textcoords="offset points", fontsize=5, **place)
        axes.set_xscale("symlog", linthresh=1)
        axes.set_xticks([0, 0.3, 1, 3, 10, 30], ["0", "0.3", "1", "3", "10", "30"])
        axes.set_xlabel("damage to the scene (dB)")
        axes.set_ylabel("z of the best reading")
        axes.set_ylim(0, None)
        axes.set_xlim(-0.05, 60)
        figure.legend(loc="outside upper center", ncols=3)
    shrink(HERE / "survival.png", "survival")


what, results = sys.argv[1], Path(*sys.argv[2:] or ["results"])
if what == "radius":
    rows = read_results(*(EXPERIMENTS / "results" / run / "results.csv" for run in ("radius", "scenes")))
    conditions = {}
    for audit in audits(rows):
        if audit.has_radius:
            alike = [row for row in rows if row.condition == audit.condition and is_judged(row, audit.extraction)]
            conditions[audit.condition.title] = (alike, audit.radii)
    draw_conditions(HERE / "radius.png", conditions)
    shrink(HERE / "radius.png", "radius")
elif what == "survival":
    draw_survival()
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
