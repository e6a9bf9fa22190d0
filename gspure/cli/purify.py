"""``gspure purify``: the whole method on one model in one process."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gspure.cli.cluster import add_selection
from gspure.cli.method_options import add_factors, add_min_samples
from gspure.cli.options import add_device, add_energy
from gspure.cli.weights import add_reduction

if TYPE_CHECKING:
    from gspure.cameras import Camera
    from gspure.method.purify import Purification
    from gspure.model import Gaussians
    from gspure.opencl.device import Device
    from gspure.schemes.asset import Asset

HELP = "run GSPure on one model: purified model, weights, clusters, metrics and figures"
EXAMPLES = """\
  gspure purify point_cloud.ply --cameras cameras.json --out purified
  gspure purify output/bicycle --cameras output/bicycle --out purified --tau-n 2 --tau-c 3
  gspure purify point_cloud.ply --cameras orbit --out purified        # a model that came without cameras

what it leaves in DIR:
  purified.ply       the Gaussians that remain, bit-identical
  weights.npy        float32 [K]   mean contribution of every Gaussian
  labels.npy         int32 [K]     its cluster; -1 is noise
  pruned.npy         bool [K]      whether it was removed
  diagnosis.json     what the clustering did, and whether to trust it
  renders/           held-out views before and after
  metrics.csv        PSNR and SSIM of the views after against those before
  figures/           clusters, weights, kept and pruned, before and after
"""

_SETTINGS = ("reduction", "min_samples", "min_cluster_size", "selection", "max_cluster_share", "tau_c", "tau_n")
_SHOWN = 3
"""How many views the before/after figure shows."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("model", type=Path, metavar="MODEL", help="3DGS .ply, or the output folder of a training run")
    parser.add_argument(
        "--cameras",
        required=True,
        metavar="SOURCE",
        help="cameras.json, transforms.json, or a folder with one of them or a COLMAP model (views wider than 1600 "
        "pixels are reduced to that); or `orbit` or `shells` for views around the model; for other settings write a "
        "file with `gspure cameras`. By name, every eighth view is held out for the metrics; weights are measured on "
        "the others",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the results")
    add_energy(parser, default="ray")
    add_reduction(parser)
    add_min_samples(parser)
    add_selection(parser)
    add_factors(parser, by_scheme=True)
    add_device(parser)


def run(args: argparse.Namespace) -> None:
    """Purify, then write what was found, metrics of the held-out views, and figures."""
    from gspure.artifacts import filling
    from gspure.cameras import split
    from gspure.figures.gallery import Evidence, draw
    from gspure.method.purify import purify
    from gspure.model import require_finite
    from gspure.model.signature import Signature
    from gspure.opencl.device import choose_device
    from gspure.progress import say
    from gspure.schemes.registry import open_asset

    asset = open_asset(args.model)
    model = asset.units
    require_finite(model, args.model)
    _choose_factors(args, model)
    cameras = _cameras(args.cameras, model)
    train, test = split(cameras)
    settings: dict[str, Any] = {name: getattr(args, name) for name in _SETTINGS}
    device = choose_device(args.device)
    with filling(args.out) as folder:
        found = purify(asset, train or test, device=device, energy=args.energy, **settings)
        purified = asset.with_units(found.model)
        _write(folder, purified, found)
        print("\n".join(found.diagnosis.lines()))
        if asset.visible:
            _compare(folder, asset, purified, test, device)
        else:
            say("the model holds no colour: no renders, no metrics")
        rows = Signature.of(model.table.dtype.names or ()).rows
        shown = (model.means, found.labels, found.weights, found.pruned)
        evidence = Evidence(*shown, tau_c=args.tau_c, tau_n=args.tau_n, rows=rows)
        for path, caption in draw(folder / "figures", evidence, cameras).items():
            print(f"{args.out / path.relative_to(folder)}: {caption}")
    print(f"results in {args.out}")


def _choose_factors(args: argparse.Namespace, model: Gaussians) -> None:
    """Fill in the pruning factors that were not given: the paper's, for the scheme that the model's columns tell."""
    from gspure.constants import TAU_C, TAU_N
    from gspure.schemes.registry import recognized

    scheme = recognized(model)
    suited = (scheme.tau_c, scheme.tau_n) if scheme else (TAU_C, TAU_N)
    for name, value in zip(("tau_c", "tau_n"), suited, strict=True):
        if getattr(args, name) is None:
            setattr(args, name, value)


def _cameras(source: str, model: Gaussians) -> list[Camera]:
    from gspure.cameras import orbit_cameras, read_cameras, scaled, shell_cameras
    from gspure.cameras.scale import TRAINING_RULE

    if source == "orbit":
        return orbit_cameras(model.means, model.opacities)
    if source == "shells":
        return shell_cameras(model.means, model.opacities)
    return scaled(read_cameras(Path(source)), TRAINING_RULE)


def _write(folder: Path, purified: Asset, found: Purification) -> None:
    from gspure.artifacts import save_array, write_json

    purified.write(folder / "purified.ply")
    save_array(folder / "weights.npy", found.weights)
    save_array(folder / "labels.npy", found.labels)
    save_array(folder / "pruned.npy", found.pruned)
    write_json(folder / "diagnosis.json", found.diagnosis.to_json())


def _compare(folder: Path, before: Asset, after: Asset, views: Sequence[Camera], device: Device) -> None:
    """Render the views before and after, and compare the images as written."""
    from gspure.evaluation.comparison import Pair, as_text, compare, write_metrics
    from gspure.figures.panels import write_panels
    from gspure.images import read_image, write_image
    from gspure.progress import track

    files = {title: folder / "renders" / title for title in ("unattacked", "purified")}
    for title, asset in zip(files, (before, after), strict=True):
        scene = asset.scene(device)
        for camera in track(views, f"render {title}"):
            write_image(files[title] / f"{camera.name}.png", scene(camera))
    names = [f"{camera.name}.png" for camera in views]
    pairs = [Pair("scene", Path(name).stem, files["unattacked"] / name, files["purified"] / name) for name in names]
    rows = [compare(pair) for pair in track(pairs, "metrics")]
    write_metrics(folder / "metrics.csv", rows)
    print("\n".join(as_text(rows)))
    shown = [camera.name for camera in views[:: -(-len(views) // _SHOWN)]]
    images = {title: {view: read_image(path / f"{view}.png") for view in shown} for title, path in files.items()}
    write_panels(folder / "figures" / "before_after.png", images, shown, difference=True)
