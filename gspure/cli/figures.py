"""``gspure figures``: pictures of a model and its purification, of renderings side by side, and of the outcomes."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from gspure.cli.method_options import add_factors
from gspure.cli.scheme_figures import add_sweep, add_tradeoff
from gspure.errors import InputError

if TYPE_CHECKING:
    from gspure.cameras import Camera

HELP = "draw figures: point clouds and weights, renderings side by side, outcomes, sweeps, trade-offs"
EXAMPLES = """\
  gspure figures model --model point_cloud.ply --weights omega.npy --clusters clusters.npz \\
      --prune-mask prune_mask.npy --cameras cameras.json --out figures
  gspure figures panels --column before=before --column after=after --difference --out figures/views.png
  gspure figures outcomes --table results.csv --asset planted/room --out figures/outcomes.png
  gspure figures sweep --table results.csv --scheme planted --point gspure=4,4 --point tau_n_1=1,4 --out sweep.png
  gspure figures tradeoff --table results.csv --scheme planted --out tradeoff.png
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the kinds of figures, and the options of each."""
    kinds = parser.add_subparsers(title="figures", metavar="KIND", required=True)
    _add_model(kinds.add_parser("model", help="point clouds (.png, .gltf, .vtp) and the histogram of weights"))
    _add_panels(kinds.add_parser("panels", help="the same views in several renderings, with their PSNR"))
    _add_outcomes(kinds.add_parser("outcomes", help="PSNR of scene and message, and Score, of every variant"))
    add_sweep(kinds.add_parser("sweep", help="PSNR of scene and message against the pruning factors"))
    add_tradeoff(kinds.add_parser("tradeoff", help="what variants leave of the message against damage to the scene"))


def _add_model(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--model", type=Path, required=True, metavar="PLY", help="the model that was purified")
    parser.add_argument("--weights", type=Path, required=True, metavar="NPY", help="of `gspure weights`")
    parser.add_argument("--clusters", type=Path, required=True, metavar="NPZ", help="of `gspure cluster`")
    parser.add_argument("--prune-mask", type=Path, required=True, metavar="NPY", help="of `gspure prune`")
    add_factors(parser)
    parser.add_argument("--truth", type=Path, metavar="NPY", help="bool [K], true for Gaussians of the message")
    parser.add_argument(
        "--cameras", type=Path, metavar="FILE", help="the model's views: which way is up, and where from"
    )
    parser.add_argument(
        "--view", metavar="NAME", help="look from this view; default: from outside, or from within a room"
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder for clusters, ranks, kept (and truth) as .png, .gltf and .vtp, and weights.png; "
        "each .png has its caption in .png.json",
    )
    parser.set_defaults(draw=_draw_model)


def _add_panels(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--column",
        type=_column,
        action="append",
        required=True,
        metavar="TITLE=DIR",
        help="a column and its folder of VIEW.png; give the reference first; may be repeated",
    )
    parser.add_argument(
        "--rows", type=int, default=3, metavar="N", help="how many views to show (default: %(default)s)"
    )
    parser.add_argument(
        "--difference", action="store_true", help="add the difference between the last column and the first"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="PNG", help="the figure")
    parser.set_defaults(draw=_draw_panels)


def _add_outcomes(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--table", type=Path, required=True, metavar="CSV", help="of `gspure table`")
    parser.add_argument("--asset", required=True, metavar="SCHEME/SCENE", help="the model whose variants to show")
    parser.add_argument("--out", type=Path, required=True, metavar="PNG", help="the figure")
    parser.set_defaults(draw=_draw_outcomes)


def _column(text: str) -> tuple[str, Path]:
    title, found, folder = text.rpartition("=")
    if not (title and found and folder):
        raise argparse.ArgumentTypeError(f"expected TITLE=DIR, found {text!r}")
    return title, Path(folder)


def run(args: argparse.Namespace) -> None:
    """Draw what was asked for."""
    args.draw(args)


def _draw_model(args: argparse.Namespace) -> None:
    import numpy as np

    from gspure.artifacts import load_array
    from gspure.cameras import read_cameras
    from gspure.clustering.store import read_clusters
    from gspure.figures.gallery import Evidence, draw
    from gspure.model import read_model, require_finite

    model = read_model(args.model)
    require_finite(model, args.model)
    if not len(model):
        raise InputError(args.model, "Gaussians", expected="at least one", found="none")
    shape = (len(model),)
    labels = read_clusters(args.clusters).labels
    if labels.shape != shape:
        raise InputError(args.clusters, "labels", expected=f"{len(model)}, as in {args.model}", found=str(len(labels)))
    evidence = Evidence(
        model.means,
        labels,
        load_array(args.weights, dtype=np.float32, shape=shape),
        load_array(args.prune_mask, dtype=np.bool_, shape=shape),
        load_array(args.truth, dtype=np.bool_, shape=shape) if args.truth else None,
        args.tau_c,
        args.tau_n,
    )
    cameras = read_cameras(args.cameras) if args.cameras else []
    captions = draw(args.out, evidence, cameras, _named(cameras, args.view, args.cameras) if args.view else None)
    names = ("model", "weights", "clusters", "prune_mask", "truth", "cameras")
    inputs = {name: path for name in names if (path := getattr(args, name))}
    _note(captions, inputs, {"tau_c": args.tau_c, "tau_n": args.tau_n, "view": args.view})


def _named(cameras: list[Camera], name: str, source: Path | None) -> Camera:
    for camera in cameras:
        if camera.name == name:
            return camera
    found = f"{len(cameras)} others" if cameras else "no cameras"
    raise InputError(source or "--cameras", "view", expected=f"one named {name}", found=found)


def _draw_panels(args: argparse.Namespace) -> None:
    import numpy as np

    from gspure.figures.findings import spoken
    from gspure.figures.panels import GAIN, write_panels
    from gspure.images import read_image

    folders = dict(args.column)
    views = sorted(set.intersection(*({path.stem for path in folder.glob("*.png")} for folder in folders.values())))
    if not views:
        raise InputError(args.column[0][1], "*.png", expected="a view that all columns have", found="none")
    chosen = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, args.rows).round().astype(int))]
    images = {title: {view: read_image(folder / f"{view}.png") for view in chosen} for title, folder in folders.items()}
    write_panels(args.out, images, chosen, difference=args.difference)
    titles = list(folders)
    caption = f"{len(chosen)} of {len(views)} views, with their PSNR against {spoken(titles[0])}."
    if args.difference:
        caption += (
            f" Last column: {GAIN} times the absolute difference between {spoken(titles[-1])} and {spoken(titles[0])}."
        )
    inputs = {f"{title} {view}": folders[title] / f"{view}.png" for title in titles for view in chosen}
    _note({args.out: caption}, inputs, {})


def _draw_outcomes(args: argparse.Namespace) -> None:
    from gspure.evaluation.reading import read_table
    from gspure.figures.plots import write_outcomes

    outcomes = [o for o in read_table(args.table) if f"{o.scheme}/{o.scene}" == args.asset]
    if not outcomes:
        raise InputError(args.table, "scheme, scene", expected=args.asset, found="no such row")
    write_outcomes(args.out, outcomes)
    against = "photographs" if all(o.against_truth for o in outcomes) else "what the unattacked model shows"
    caption = f"PSNR of every variant against {against}, mean over the views"
    if any(not math.isnan(o.score) for o in outcomes):
        caption += ", and its Score: what the message lost less what the scene lost, in dB"
    _note({args.out: caption + "."}, {"table": args.table}, {"asset": args.asset})


def _note(captions: dict[Path, str], inputs: dict[str, Path], settings: dict[str, str | float | None]) -> None:
    """Write beside every figure what it shows and what it was made of, and say where it is."""
    from gspure.artifacts import write_provenance

    for path, caption in captions.items():
        write_provenance(path, inputs=inputs, settings={**settings, "caption": caption})
        print(f"{path}: {caption}")
