"""``gspure purify``: the whole method on one model in one process."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gspure import __version__
from gspure.arrays import Float32, Indices, save_array
from gspure.cameras import Camera, scaled, split
from gspure.cameras.photographs import TRAINING_RULE
from gspure.cameras.reading import default_cameras
from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.constants import (
    ANCHOR_TAU_C,
    ANCHOR_TAU_N,
    MAX_CLUSTER_SHARE,
    MIN_CLUSTER_SIZE,
    MIN_SAMPLES,
    TAU_C,
    TAU_N,
    Energy,
)
from gspure.errors import InputError
from gspure.figures.panels import mention_up
from gspure.files import Json, filling_alone, write_json
from gspure.images import write_image
from gspure.method.clusters import SELECTIONS
from gspure.method.purify import Purification, purify
from gspure.method.settings import MethodSettings
from gspure.method.subpixel import near_lines, subpixel_rows
from gspure.method.weights import REDUCTIONS
from gspure.metrics import comparison
from gspure.metrics.comparison import ViewMetrics
from gspure.model import Gaussians, model_file
from gspure.model.inria import PURIFIED
from gspure.model.summary import suspicious_lines, suspicious_rows
from gspure.opencl.device import Device, choose_device
from gspure.progress import say, track, warn
from gspure.provenance import bind_rows
from gspure.public_model import PublicModel
from gspure.settings import CLUSTER_SHARE, CLUSTER_SIZE, FACTOR, NEIGHBOURS, STEPS
from gspure.text import decimal

EXAMPLES = """\
  gspure purify point_cloud.ply --cameras cameras.json --out purified
  gspure purify trained --out purified                                # with the cameras beside the model, or orbit

files in DIR:
  purified.ply       the remaining Gaussians, bit-identical unless repaired or filtered in 3-D
  weights.npy        float32 [K]   mean contribution of every Gaussian (row)
  labels.npy         int32 [K]     its cluster; -1 is noise
  prune_mask.npy     bool [K]      true where the row was removed
  cameras.json       the views
  diagnosis.json     diagnosis of clustering and renders, with warnings and suspicious rows
  renders/           held-out views of the model before and after pruning, and after repair
  metrics.csv        metrics of the renders after pruning (and repair), against those before
  figures/           clusters, weights, kept and pruned rows, before and after; captions.json explains them
  provenance.json    command, settings and inputs
"""

_SHOWN = 2  # warnings on the console
_VISIBLE = 30.0  # dB against renders before pruning; views below it visibly lack detail; ours
_SETTINGS = ("reduction", "min_samples", "min_cluster_size", "selection", "max_cluster_share", "tau_c", "tau_n")
_RENDERS = {"unattacked": "", "pruned": "pruned", "purified": "scene"}
"""Folders of renders, with the target of their metrics."""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "file of a 3DGS model, or folder of a training run")
    more = "; at most 1600 px wide, every eighth by name held out for the metrics (default: beside MODEL, or orbit)"
    options.add_cameras(parser, more=more, required=False)
    parser.writes("--out", "DIR", "folder for the results")
    options.add_energy(parser, "ray", "ewa", "center_ray")
    parser.choice("--reduction", REDUCTIONS, "how the pixels of a view become one contribution", REDUCTIONS[0])
    parser.number("--min-samples", "N", "HDBSCAN's min_samples", NEIGHBOURS, MIN_SAMPLES)
    parser.number("--min-cluster-size", "N", "HDBSCAN's min_cluster_size", CLUSTER_SIZE, MIN_CLUSTER_SIZE)
    meaning = "clusters of HDBSCAN's hierarchy: excess of mass, capped by --max-cluster-share or not, or leaves"
    parser.choice("--selection", SELECTIONS, meaning, SELECTIONS[0])
    meaning = "for eom_capped: largest share of the Gaussians in one cluster"
    parser.number("--max-cluster-share", "SHARE", meaning, CLUSTER_SHARE, MAX_CLUSTER_SHARE)
    for name, rows, value, of_anchors in (
        ("--tau-c", "clusters whose mean weight", TAU_C, ANCHOR_TAU_C),
        ("--tau-n", "unclustered rows whose weight", TAU_N, ANCHOR_TAU_N),
    ):
        meaning = f"prune {rows} is below the mean of all rows divided by TAU (default: {value}; anchors: {of_anchors})"
        parser.number(name, "TAU", meaning, FACTOR)
    meaning = "after pruning, train the rest on renders of MODEL, as `gspure_repair` (default: as many as that attack)"
    parser.number("--repair", "ITERATIONS", meaning, STEPS, nargs="?", const=0)
    parser.flag("--no-figures", "draw no figures")
    parser.flag(*options.PER_VIEW)
    parser.flag(*options.FORCE)
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Purify, compare the held-out views and write the results, all or none; then draw figures, and print."""
    from gspure.schemes.registry import read_public_model

    options.require_own_folder(args)
    if not args.cameras:
        args.cameras = default_cameras(args.model)
        say(f"{args.model}: views {args.cameras}")
    stored = read_public_model(args.model)
    suspects = suspicious_rows(stored.model)
    public = stored.drawable(args.model)
    settings = _settings(args, public)
    if args.repair is not None and not public.visible:
        raise InputError(args.model, "--repair", expected="a model with colours", found="none")
    cameras = scaled(options.read_source(args.cameras, args.model, up=args.up), TRAINING_RULE)
    train, test = split(cameras)
    if not train:
        warn("a single view: it measures the weights, and none is held out for the metrics")
        train = test
    device = choose_device(args.device)
    with filling_alone(args.out) as folder:
        purification = purify(public, train, device=device, **settings.of_purify)
        models = _models(public, purification, train, args.repair, device)
        models["purified"].write(folder / PURIFIED)
        options.write_views(folder, cameras)
        for name in ("weights", "labels", "prune_mask"):
            save_array(folder / f"{name}.npy", getattr(purification, name))
            bind_rows(model_file(args.model), folder / f"{name}.npy")
        metrics = _compare(folder, models, test, device)
        diagnosis = _diagnosis(purification, suspects, metrics)
        if public.rows_are_gaussians:
            diagnosis["warnings"] += _remarks_on_views(public.model, purification.weights, train, args.energy)
        write_json(folder / "diagnosis.json", diagnosis)
        options.record_command(args, folder, resolved=settings.of_purify)
        renders = [f"renders/{title}/*.png" for title in _RENDERS]
        options.remove_older(args.out, "metrics.csv", "figures/*.png", "figures/*.svg", *renders)
    if public.visible and isinstance(args.cameras, str):
        mention_up(public.model, public.scene(device, public.model.background), args.up, args.out)
    if not args.no_figures:
        _draw(args.out, public, purification, settings, cameras, [*models], device)
    print(*purification.diagnosis.lines(), *_lines_of_metrics(metrics), sep="\n")
    print(*suspicious_lines(suspects, len(public.model))[:1], f"results in {args.out}", sep="\n")
    if args.per_view and metrics:
        print("", *comparison.as_text(metrics, per_view=True), sep="\n")
    _warn(diagnosis["warnings"], args.out)


def _settings(args: Arguments, public: PublicModel) -> MethodSettings:
    """Return the settings of the method; by default, the model's scheme decides about the pruning factors."""
    from gspure.schemes.registry import recognized

    scheme = recognized(public.model)
    settings = MethodSettings(**{name: getattr(args, name) for name in ("energy", *_SETTINGS)})
    return replace(
        settings,
        tau_c=settings.tau_c or (scheme.tau_c if scheme else TAU_C),
        tau_n=settings.tau_n or (scheme.tau_n if scheme else TAU_N),
    )


def _models(
    public: PublicModel, purification: Purification, views: Sequence[Camera], repair: int | None, device: Device
) -> dict[str, PublicModel]:
    """Return the models by the title of their renders.

    After `repair` steps, 0 for the default, the purified model is the pruned one trained on renders of the public one.
    """
    pruned = public.with_model(purification.model)
    if repair is None:
        return {"unattacked": public, "purified": pruned}
    from gspure.attacks.attack import Teacher
    from gspure.attacks.learning import ITERATIONS

    iterations = repair or ITERATIONS
    teacher = Teacher("gspure_repair", public, views, device)
    rows = teacher.train(pruned, np.random.default_rng(0), iterations, "all")
    rows = rows.with_comment(f"gspure {__version__} repaired iterations={iterations}")
    return {"unattacked": public, "pruned": pruned, "purified": public.with_model(rows)}


def _compare(
    folder: Path, models: Mapping[str, PublicModel], views: Sequence[Camera], device: Device
) -> list[ViewMetrics]:
    """Render the views of each model, and compare the images as written with those of the unattacked one."""
    if not models["unattacked"].visible:
        say("the model holds no colour: no renders, no metrics")
        return []
    renders = folder / "renders"
    background = models["unattacked"].model.background
    for title, public in models.items():
        scene = public.scene(device, background)
        for camera in track(views, f"render {title}"):
            write_image(renders / title / f"{camera.name}.png", scene(camera))
    changed = [title for title in models if title != "unattacked"]
    pairs = []
    for title in reversed(changed):
        of_title, _ = comparison.pair_images(renders / "unattacked", renders / title)
        pairs += [pair._replace(target=_RENDERS[title]) for pair in of_title]
    metrics = [comparison.compare(pair) for pair in track(pairs, "metrics")]
    comparison.write_metrics(folder / "metrics.csv", metrics)
    return metrics


def _diagnosis(purification: Purification, suspects: Mapping[str, Indices], metrics: Sequence[ViewMetrics]) -> Json:
    """Return the content of ``diagnosis.json``; the PSNR of a target is left out if all its views are identical."""
    diagnosis = purification.diagnosis.to_json()
    diagnosis["suspicious"] = {reason: rows.tolist() for reason, rows in suspects.items()}
    for mean, low in zip(comparison.means(metrics), comparison.worst(metrics), strict=True):
        if math.isfinite(low.psnr):
            key = "psnr" if mean.target == "scene" else "psnr_before_repair"
            diagnosis[key] = {"mean": mean.psnr, "worst": low.psnr, "worst_view": low.view}
    diagnosis["warnings"] = [*_lost_detail(metrics), *comparison.far_below(metrics), *diagnosis["warnings"]]
    return diagnosis


def _remarks_on_views(model: Gaussians, weights: Float32, views: Sequence[Camera], energy: Energy) -> list[str]:
    """Return remarks on Gaussians near the cameras and, with energy "ray", on those smaller than a pixel."""
    lines = near_lines(model, weights, views)
    subpixel = subpixel_rows(model, weights, views) if energy == "ray" else None
    if subpixel:
        lines.append(subpixel.line(len(model), views[0].width))
    return lines


def _lines_of_metrics(metrics: Sequence[ViewMetrics]) -> list[str]:
    """Return the PSNR of the purified model's renders and, if it was repaired, of those before."""
    lines = []
    for mean, low in zip(comparison.means(metrics), comparison.worst(metrics), strict=True):
        title = "renders" if mean.target == "scene" else "before repair"
        worst_view = f"worst view {decimal(low.psnr, 1)} dB ({low.view})"
        lines.append(f"{title:<16}  PSNR {decimal(mean.psnr, 1)} dB, {worst_view}")
    return lines


def _lost_detail(metrics: Sequence[ViewMetrics]) -> list[str]:
    """Return a sentence if the worst view of the purified model visibly differs."""
    sentences = []
    for low in comparison.worst([row for row in metrics if row.target == "scene"]):
        if low.psnr < _VISIBLE:
            level = f"{low.view} has {low.psnr:.1f} dB, so visible detail is lost"
            sentences.append(f"{level}: a larger --tau-n prunes less, --repair trains the remaining rows")
    return sentences


def _warn(sentences: Sequence[str], out: Path) -> None:
    """Print the first warnings, and the number of the others."""
    for sentence in sentences[:_SHOWN]:
        warn(sentence)
    if len(sentences) > _SHOWN:
        warn(f"{len(sentences) - _SHOWN} more in {out / 'diagnosis.json'}")


def _draw(
    out: Path,
    public: PublicModel,
    purification: Purification,
    settings: MethodSettings,
    cameras: Sequence[Camera],
    titles: Sequence[str],
    device: Device,
) -> None:
    """Draw some of the compared views before and after, and the model."""
    from gspure.figures.clouds import Purified
    from gspure.figures.gallery import draw_model
    from gspure.figures.panels import draw_before_after

    folder = out / "figures"
    model = Purified(
        public,
        purification.labels,
        purification.weights,
        tau_c=settings.factors.tau_c,
        tau_n=settings.factors.tau_n,
    )
    draw_model(folder, model, cameras, device)
    if public.visible:
        path = folder / "before_after.png"
        try:
            draw_before_after(path, {title: out / "renders" / title for title in titles})
        except Exception as error:  # noqa: BLE001 - plotting libraries raise many types
            warn(f"{path}: not drawn: {' '.join(str(error).split()) or type(error).__name__}")
