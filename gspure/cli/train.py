"""``gspure train``: a 3DGS model from photographs."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gspure.cli.options import (
    add_background,
    add_device,
    add_force,
    read_background,
    read_device,
    record_command,
    require_own_folder,
)
from gspure.cli.parser import Arguments, Parser
from gspure.progress import say, track
from gspure.settings import MAX_GAUSSIANS, SEED, STEPS

if TYPE_CHECKING:
    from gspure.cameras import Camera
    from gspure.evaluation.comparison import ViewMetrics
    from gspure.files import Float32
    from gspure.opencl.device import Device
    from gspure.opencl.trainable import Parameters
    from gspure.training.checkpoints import Snapshot
    from gspure.training.dataset import Dataset
    from gspure.training.trainer import Trainer

EXAMPLES = """\
  gspure train scene --out trained                     # COLMAP project: scene/images and scene/sparse/0
  gspure train scene/transforms.json --out trained --resolution 1/4 --iterations 7000
  gspure train pair --out trained                      # the ray-traced scene of `gspure pair room vault --out pair`
  gspure train pair --out message --images pair/message
  gspure train scene --out trained --resume            # continue an interrupted run

3DGS's own settings are --iterations 30000 --resolution 1600px; the defaults suit a laptop without a GPU.
Every eighth view by name is held out, unless DATA has splits; the model is evaluated on the held-out views. The files
in DIR are those of 3DGS's trainer and render script:
  point_cloud/iteration_N/point_cloud.ply, cameras.json, cfg_args, input.ply
  test/ours_N/gt, test/ours_N/renders     held-out photographs and the model's renders
  metrics.csv                             metrics of these
"""

_SECONDS_BETWEEN_CHECKPOINTS = 30.0
_WATCHED = 3  # number of held-out views over which progress reports average the PSNR


def add_arguments(parser: Parser) -> None:
    parser.reads(
        "data",
        "DATA",
        "COLMAP project, transforms.json (nerfstudio, Blender), cameras.json, or a folder with one of them; with "
        "transforms_train.json, the views of transforms_test.json (or _val) are held out",
    )
    parser.writes("--out", "DIR", "folder for the model")
    parser.writes("--model", "PLY|SPZ", "also copy the model there", required=False)
    parser.number("--iterations", "N", "steps", STEPS, 3000)
    parser.text(
        "--resolution",
        "RULE",
        "image size: Wpx, at most W pixels wide; 1/N; native; or photographs, if those are smaller",
        "320px",
    )
    meaning = "photographs, named as the views, instead of those that DATA names"
    parser.reads("--images", "DIR", meaning, required=False)
    add_background(parser, "the model and transparent photographs", "DATA")
    parser.number(
        "--max-gaussians",
        "N",
        "upper bound of growth (default: one per point of DATA and one per pixel of a view)",
        MAX_GAUSSIANS,
    )
    parser.flag("--skip-missing", "leave out views whose photograph is missing, instead of refusing")
    parser.number("--seed", "N", "random seed", SEED, 0)
    add_force(parser)
    parser.flag("--resume", "continue from the checkpoint of an interrupted run in DIR, if any")
    add_device(parser)


def run(args: Arguments) -> None:
    """Check the data, train, write the model, and compare the held-out views."""
    from gspure.evaluation.comparison import as_text
    from gspure.files import filling, replacing
    from gspure.model import require_writable
    from gspure.model.inria import trained_background
    from gspure.training.dataset import fingerprint, read_dataset, read_photographs
    from gspure.training.output import point_cloud, remove_results

    require_own_folder(args)
    if args.model:
        require_writable(args.model)
    args.background = read_background(args, trained_background(args.data))
    photographs = {"photographs": args.images, "skip_missing": args.skip_missing}
    dataset = read_dataset(args.data, args.resolution, **photographs, seed=args.seed)
    args.max_gaussians = args.max_gaussians or dataset.max_gaussians
    images = read_photographs(track(dataset.train, "photographs"), args.background)
    size = f"{dataset.train[0].width}x{dataset.train[0].height}"
    views = f"{len(dataset.train)} views of {size}, {len(dataset.test)} held out"
    say(f"{views}, {len(dataset.xyz)} points, extent {dataset.extent:.3g}")
    used = ("iterations", "resolution", "background", "max_gaussians", "seed")
    settings = {name: getattr(args, name) for name in used} | {"photographs and cameras": fingerprint(dataset, images)}
    device = read_device(args)
    record_command(args, args.out)
    with filling(args.out) as folder:
        trainer = _train(args, dataset, images, settings, device)
        rows = _write(folder, args, dataset, trainer.model.state().parameters, device)
        remove_results(args.out)
    model = point_cloud(args.out, args.iterations)
    if args.model:
        with replacing(args.model) as temporary:
            shutil.copyfile(model, temporary)
    _checkpoint(args).unlink(missing_ok=True)
    if rows:
        print("\n".join(as_text(rows)))
    say(f"{trainer.model.count} Gaussians in {model}")


def _train(
    args: Arguments, dataset: Dataset, images: Sequence[Float32], settings: dict[str, Any], device: Device
) -> Trainer:
    """Train to the end, and write checkpoints."""
    from gspure.evaluation.metrics import psnr
    from gspure.opencl.trainable import TrainableModel
    from gspure.training.checkpoints import write_checkpoint
    from gspure.training.monitor import watched
    from gspure.training.schedule import Schedule
    from gspure.training.trainer import Trainer

    start = _start(args, dataset, settings)
    model = TrainableModel(start.state, start.iteration, device)
    model.set_targets(images)
    trainer = Trainer(
        *(model, dataset.train, Schedule.scaled(args.iterations), start),
        extent=dataset.extent,
        background=args.background,
        max_gaussians=args.max_gaussians,
    )
    views, photographs = _watched(dataset, args.background)

    def quality() -> str:
        shown = (model.image(view, args.background).clip(0, 1) for view in views)
        state = f"PSNR {sum(map(psnr, shown, photographs)) / len(views):.2f}  {model.count} Gaussians"
        reset = trainer.recovering_from
        return f"{state}  (opacities were reset at {reset}: PSNR drops, then recovers)" if reset else state

    began = saved = time.monotonic()
    for _ in watched(trainer, args.iterations, quality, start.iteration):
        if trainer.rests and time.monotonic() - saved > _SECONDS_BETWEEN_CHECKPOINTS:
            write_checkpoint(_checkpoint(args), trainer.snapshot(), settings)
            saved = time.monotonic()
    say(f"trained {args.iterations - start.iteration} iterations in {time.monotonic() - began:.1f} s")
    return trainer


def _start(args: Arguments, dataset: Dataset, settings: dict[str, Any]) -> Snapshot:
    """Return the checkpoint of an interrupted run, or the beginning."""
    from gspure.training.checkpoints import read_checkpoint
    from gspure.training.initialization import gaussians_at, thinned
    from gspure.training.trainer import beginning

    if args.resume and _checkpoint(args).is_file():
        snapshot = read_checkpoint(_checkpoint(args), settings)
        say(f"continuing from iteration {snapshot.iteration}")
        return snapshot
    return beginning(gaussians_at(*thinned(dataset.xyz, dataset.rgb, args.max_gaussians, args.seed)), args.seed)


def _checkpoint(args: Arguments) -> Path:
    return Path(args.out) / "checkpoint.npz"


def _watched(dataset: Dataset, background: Sequence[float]) -> tuple[list[Camera], list[Float32]]:
    """Return a few views, held out if there are any, and their photographs."""
    from gspure.training.dataset import read_photographs

    views = dataset.test or dataset.train
    views = views[:: -(-len(views) // _WATCHED)]
    return views, read_photographs(views, background)


def _write(
    folder: Path, args: Arguments, dataset: Dataset, parameters: Parameters, device: Device
) -> list[ViewMetrics]:
    """Write the model and the comparison of the held-out views; return the metrics."""
    from gspure.evaluation.comparison import TRUTH, ImagePair, compare, write_metrics
    from gspure.images import write_image
    from gspure.model import read_model
    from gspure.renderer import Renderer
    from gspure.training.dataset import read_photographs
    from gspure.training.output import comparison, write_output

    model = write_output(folder, dataset, parameters, args.iterations, args.background, place=args.out)
    truth, renders = comparison(folder, args.iterations)
    renderer = Renderer(read_model(model), device)
    photographs = read_photographs(dataset.test, args.background)
    rows = []
    for camera, photograph in zip(track(dataset.test, "held out"), photographs, strict=True):
        pair = ImagePair(".", camera.name, truth / f"{camera.name}.png", renders / f"{camera.name}.png")
        write_image(pair.reference, photograph)
        write_image(pair.image, renderer.image(camera, background=args.background))
        rows.append(compare(pair, TRUTH))
    if rows:
        write_metrics(folder / "metrics.csv", rows)
    return rows
