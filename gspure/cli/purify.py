"""``gspure purify``: the whole method on one model in one process."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gspure.cli.cluster import add_selection
from gspure.cli.method_options import add_factors, add_min_samples
from gspure.cli.options import add_cameras, add_device, add_energy, read_source, require_least
from gspure.cli.parser import Arguments, Parser
from gspure.cli.weights import add_reduction
from gspure.errors import InputError

if TYPE_CHECKING:
    from gspure.cameras import Camera
    from gspure.evaluation.comparison import ViewMetrics
    from gspure.method.purify import Purification
    from gspure.model import Gaussians
    from gspure.opencl.device import Device
    from gspure.public_model import PublicModel

HELP = "run GSPure on one model: purified model, weights, clusters, metrics and figures"
EXAMPLES = """\
  gspure purify point_cloud.ply --cameras cameras.json --out purified
  gspure purify output/bicycle --cameras output/bicycle --out purified --tau-n 2 --tau-c 3
  gspure purify point_cloud.ply --cameras orbit --out purified        # a model without cameras
  gspure purify point_cloud.ply --cameras cameras.json --out purified --repair

files in DIR:
  purified.ply       the remaining Gaussians, bit-identical unless repaired
  weights.npy        float32 [K]   mean contribution of every Gaussian (row)
  labels.npy         int32 [K]     its cluster; -1 is noise
  prune_mask.npy     bool [K]      true where the row was removed
  cameras.json       the views
  diagnosis.json     diagnosis of clustering and renders, with warnings and suspicious rows
  renders/           held-out views before and after, and between pruning and repair
  metrics.csv        metrics of the renders after pruning (and repair), against those before
  figures/           clusters, weights, kept and pruned rows, before and after; if one fails, a warning says why

The model and each array have their provenance beside them, in FILE.json.
"""

_SETTINGS = ("reduction", "min_samples", "min_cluster_size", "selection", "max_cluster_share", "tau_c", "tau_n")
_RENDERS = ("unattacked", "pruned", "purified")
_FIGURES = ("before_after", "clusters", "ranks", "kept", "weights")
_SHOWN = 3
"""Number of views in the before/after figure."""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "file of a 3DGS model, or folder of a training run")
    add_cameras(parser, "views (at most 1600 px wide; every eighth by name is held out for the metrics)")
    parser.writes("--out", "DIR", "folder for the results")
    add_energy(parser, "ray", "ewa", "center_ray")
    add_reduction(parser)
    add_min_samples(parser)
    add_selection(parser)
    add_factors(parser, by_scheme=True)
    _add_repair(parser)
    add_device(parser)


def _add_repair(parser: Parser) -> None:
    from gspure.attacks.learning import ITERATIONS

    parser.add_argument(
        "--repair",
        type=int,
        nargs="?",
        const=ITERATIONS,
        metavar="ITERATIONS",
        help="after pruning, train the rest on renders of MODEL at the views of the weights, as the attack "
        "`prune_repair` (without a number: %(const)s iterations)",
    )


def run(args: Arguments) -> None:
    """Purify, compare the held-out views and write the results, all or none; then draw figures, and print."""
    from gspure.artifacts import filling, write_json, write_provenance
    from gspure.cameras import scaled, split, write_cameras
    from gspure.cameras.scale import TRAINING_RULE
    from gspure.evaluation.comparison import as_text
    from gspure.images import require_no_other_images
    from gspure.method.purify import purify
    from gspure.method.subpixel import subpixel_rows
    from gspure.model import model_file, read_model, suspicious
    from gspure.model.signature import Signature
    from gspure.opencl.device import choose_device
    from gspure.progress import say
    from gspure.schemes.registry import read_public_model

    public = read_public_model(args.model)
    stored = read_model(args.model)
    suspects = suspicious.suspicious_rows(stored)
    public = public.drawable(args.model)
    model = public.model
    _choose_factors(args, model)
    _require_repairable(args, public)
    cameras = scaled(read_source(args.cameras, args.model, up=args.up), TRAINING_RULE)
    train, test = split(cameras)
    writes_views = _writes_views(args)
    for renders in _renders(args.out).values():
        require_no_other_images(renders, (camera.name for camera in test))
    settings: dict[str, Any] = {name: getattr(args, name) for name in _SETTINGS}
    device = choose_device(args.device)
    with filling(args.out) as folder:
        purification = purify(public, train or test, device=device, energy=args.energy, **settings)
        models = _models(public, purification, train or test, args.repair, device)
        _write(folder, models["purified"], purification)
        inputs, geometry = {"model": model_file(args.model), "cameras": args.cameras}, stored.geometry_digest()
        names = ["purified.ply", "weights.npy", "labels.npy", "prune_mask.npy"]
        if writes_views:
            write_cameras(folder / "cameras.json", [replace(camera, image=None) for camera in cameras])
            names.append("cameras.json")
        for name in names:
            record = {"energy": args.energy, **settings} | ({"repair": args.repair} if args.repair else {})
            write_provenance(folder / name, inputs=inputs, settings=record, geometry=geometry)
        rows = _compare(folder, models, test, device, model.background) if public.visible else []
        diagnosis = _with_psnr(
            purification.diagnosis.to_json() | {"suspicious": suspicious.to_json(suspects)},
            rows,
        )
        write_json(folder / "diagnosis.json", diagnosis)
        _remove_older(args.out)
    if not public.visible:
        say("the model holds no colour: no renders, no metrics")
    captions = _draw_views(args.out, models, test) if public.visible else []
    captions += _draw_model(args, model, purification, cameras)
    print("\n".join([*purification.diagnosis.lines(), *suspicious.lines(suspects, len(model))]))
    gaussian_rays = args.energy == "ray" and Signature.of(model.table.dtype.names or ()).rows == "Gaussians"
    if gaussian_rays and (small := subpixel_rows(model, purification.weights, train or test)):
        print(small.line(len(model), cameras[0].width))
    print("\n".join([*_repair_lines(diagnosis), f"results in {args.out}", *(as_text(rows) if rows else []), *captions]))


def _writes_views(args: Arguments) -> bool:
    """Return whether to write the views: not over their source, nor over a file that is no result."""
    from gspure.artifacts.checksums import record_of

    file = args.out / "cameras.json"
    if file.resolve() == Path(args.cameras).resolve():
        return False
    if file.exists() and record_of(file) is None:
        raise InputError(file, "output", expected="a result of an earlier run", found="another file")
    return True


def _choose_factors(args: Arguments, model: Gaussians) -> None:
    """Set missing pruning factors to the paper's for the scheme of the model's columns."""
    from gspure.constants import TAU_C, TAU_N
    from gspure.schemes.registry import recognized

    scheme = recognized(model)
    defaults = (scheme.tau_c, scheme.tau_n) if scheme else (TAU_C, TAU_N)
    for name, value in zip(("tau_c", "tau_n"), defaults, strict=True):
        if getattr(args, name) is None:
            setattr(args, name, value)


def _write(folder: Path, purified: PublicModel, purification: Purification) -> None:
    from gspure.artifacts import save_array

    purified.write(folder / "purified.ply")
    save_array(folder / "weights.npy", purification.weights)
    save_array(folder / "labels.npy", purification.labels)
    save_array(folder / "prune_mask.npy", purification.prune_mask)


def _require_repairable(args: Arguments, public: PublicModel) -> None:
    """Refuse ``--repair`` without iterations, or of a model without colours."""
    require_least(args, "purify", {"repair": 1})
    if args.repair and not public.visible:
        raise InputError(args.model, "--repair", expected="a model with colours", found="none")


def _models(
    public: PublicModel, purification: Purification, views: Sequence[Camera], repair: int | None, device: Device
) -> dict[str, PublicModel]:
    """Return the models by title of their renders; with `repair`, train the rest on renders of the public model."""
    import numpy as np

    from gspure import __version__
    from gspure.attacks.learning import Teacher

    pruned = public.with_model(purification.model)
    if not (repair and len(purification.model)):
        return {"unattacked": public, "purified": pruned}
    teacher = Teacher("prune_repair", public, views, device)
    rows = teacher.train(pruned, np.random.default_rng(0), repair, "all")
    rows = rows.with_comment(f"gspure {__version__} repaired iterations={repair}")
    return {"unattacked": public, "pruned": pruned, "purified": public.with_model(rows)}


def _compare(
    folder: Path,
    models: Mapping[str, PublicModel],
    views: Sequence[Camera],
    device: Device,
    background: Sequence[float],
) -> list[ViewMetrics]:
    """Render the views of each model, and compare the images as written with those of the unattacked one."""
    from gspure.evaluation.comparison import Pair, compare, write_metrics
    from gspure.images import record_views, write_image
    from gspure.progress import track

    files = _renders(folder)
    for title, public in models.items():
        scene = public.scene(device, background)
        for camera in track(views, f"render {title}"):
            write_image(files[title] / f"{camera.name}.png", scene(camera))
        record_views(files[title], (camera.name for camera in views))
    names = [f"{camera.name}.png" for camera in views]
    targets = {"purified": "scene", "pruned": "pruned"}
    pairs = [
        Pair(targets[title], Path(name).stem, files["unattacked"] / name, files[title] / name)
        for title in targets
        if title in models
        for name in names
    ]
    rows = [compare(pair) for pair in track(pairs, "metrics")]
    write_metrics(folder / "metrics.csv", rows)
    return rows


def _with_psnr(diagnosis: dict[str, Any], rows: Sequence[ViewMetrics]) -> dict[str, Any]:
    """Add the mean PSNR of the held-out views, and the worst of them with its warning; nothing if all are identical."""
    from gspure.evaluation.comparison import far_below, means, worst

    for mean, low in zip(means(rows), worst(rows), strict=True):
        if math.isfinite(low.psnr):
            key = "psnr" if mean.target == "scene" else "psnr_before_repair"
            diagnosis[key] = {"mean": mean.psnr, "worst": low.psnr, "worst_view": low.view}
    return diagnosis | {"warnings": diagnosis["warnings"] + far_below(rows)}


def _repair_lines(diagnosis: Mapping[str, Any]) -> list[str]:
    if not {"psnr_before_repair", "psnr"} <= diagnosis.keys():
        return []
    before, after = diagnosis["psnr_before_repair"]["mean"], diagnosis["psnr"]["mean"]
    return [f"repair: mean PSNR {before:.2f} dB before, {after:.2f} dB after"]


def _renders(folder: Path) -> dict[str, Path]:
    return {title: folder / "renders" / title for title in _RENDERS}


def _remove_older(folder: Path) -> None:
    """Remove what the next run may lack: without colour, without a figure, or killed while it draws."""
    from gspure.images import RENDERED

    shown = [path for renders in _renders(folder).values() for path in (*renders.glob("*.png"), renders / RENDERED)]
    suffixes = (".png", ".gltf", ".gltf.json", ".vtp", ".vtp.json")
    drawn = [folder / "figures" / f"{name}{suffix}" for name in _FIGURES for suffix in suffixes]
    for path in (*shown, *drawn, folder / "metrics.csv"):
        path.unlink(missing_ok=True)


def _draw_views(folder: Path, titles: Collection[str], views: Sequence[Camera]) -> list[str]:
    """Draw a few of the rendered views before and after, and return a line about the figure."""
    from gspure.figures.optional import optional
    from gspure.figures.panels import write_panels
    from gspure.images import read_image

    captions, path = [], folder / "figures" / "before_after.png"
    with optional(path):
        shown = [camera.name for camera in views[:: -(-len(views) // _SHOWN)]]
        files = [(title, renders) for title, renders in _renders(folder).items() if title in titles]
        images = {title: {view: read_image(renders / f"{view}.png") for view in shown} for title, renders in files}
        write_panels(path, images, shown, difference=True)
        captions.append(f"{path}: {len(shown)} of {len(views)} held-out views before and after, and the difference.")
    return captions


def _draw_model(args: Arguments, model: Gaussians, purification: Purification, cameras: Sequence[Camera]) -> list[str]:
    """Draw the model, and return a line per figure."""
    from gspure.figures.gallery import Evidence, drawings
    from gspure.figures.optional import optional
    from gspure.model.signature import Signature

    rows = Signature.of(model.table.dtype.names or ()).rows
    arrays = (model.means, purification.labels, purification.weights, purification.prune_mask)
    evidence = Evidence(*arrays, tau_c=args.tau_c, tau_n=args.tau_n, rows=rows)
    captions = []
    for path, caption, draw in drawings(args.out / "figures", evidence, cameras):
        with optional(path):
            draw()
            captions.append(f"{path}: {caption}")
    return captions
