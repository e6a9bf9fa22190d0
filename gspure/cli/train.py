"""``gspure train``: a 3DGS model from photographs."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.progress import say, track
from gspure.settings import MAX_GAUSSIANS, SEED, STEPS

if TYPE_CHECKING:
    from gspure.arrays import Float32
    from gspure.metrics.comparison import ViewMetrics
    from gspure.opencl.device import Device
    from gspure.training.dataset import Dataset
    from gspure.training.trainer import Trainer

EXAMPLES = """\
  gspure train scene --out trained                     # COLMAP project: scene/images and scene/sparse/0
  gspure train scene/transforms.json --out trained --resolution 1/4 --iterations 7000
  gspure train scene --out trained --resume            # continue an interrupted run

3DGS's own settings are --iterations 30000 --resolution 1600px; the defaults suit a laptop without a GPU.
Every eighth view by name is held out, unless DATA has splits; the model is evaluated on the held-out views. The files
in DIR are those of 3DGS's trainer and render script:
  point_cloud/iteration_N/point_cloud.ply, cameras.json, cfg_args, input.ply
  test/ours_N/gt, test/ours_N/renders     held-out photographs and the model's renders
  metrics.csv                             metrics of these
"""

CHECKPOINT = "checkpoint.npz"
_SECONDS_BETWEEN_CHECKPOINTS = 30.0
_WATCHED = 3  # number of held-out views over which progress reports average the PSNR


def add_arguments(parser: Parser) -> None:
    meaning = "COLMAP project, transforms.json (nerfstudio, Blender), cameras.json, or a folder with one of them"
    parser.reads("data", "DATA", meaning)
    parser.writes("--out", "DIR", "folder for the model")
    parser.writes("--model", "PLY|SPZ", "also copy the model there", required=False)
    parser.number("--iterations", "N", "training steps", STEPS, 3000)
    meaning = "image size: Wpx, at most W pixels wide; 1/N; native; or photographs, if those are smaller"
    parser.text("--resolution", "RULE", meaning, "320px")
    meaning = "folder of photographs, named as the views (default: those that DATA names)"
    parser.reads("--images", "DIR", meaning, required=False)
    options.add_background(parser, "the model and transparent photographs", "DATA")
    meaning = "most Gaussians of the model (default: the points of DATA plus the pixels of a view)"
    parser.number("--max-gaussians", "N", meaning, MAX_GAUSSIANS)
    parser.flag("--skip-missing", "leave out views without a photograph")
    parser.number("--seed", "N", "random seed", SEED, 0)
    parser.flag(*options.PER_VIEW)
    parser.flag(*options.FORCE)
    parser.flag("--resume", "continue from the checkpoint of an interrupted run in DIR, if any")
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Check the data, train, write the model, and compare the held-out views."""
    from gspure.files import filling, replacing
    from gspure.metrics.comparison import as_text
    from gspure.model import require_writable
    from gspure.model.inria import trained_background
    from gspure.training import dataset, output

    options.require_own_folder(args)
    if args.model:
        require_writable(args.model)
    args.background = tuple(args.background or trained_background(args.data))
    photographs = {"photographs": args.images, "skip_missing": args.skip_missing}
    data = dataset.read_dataset(args.data, args.resolution, **photographs, seed=args.seed)
    args.max_gaussians = args.max_gaussians or data.max_gaussians
    images = dataset.read_photographs(track(data.train, "photographs"), args.background)
    size = f"{data.train[0].width}x{data.train[0].height}"
    views = f"{len(data.train)} views of {size}, {len(data.test)} held out"
    say(f"{views}, {len(data.xyz)} points, extent {data.extent:.3g}")
    device = options.read_device(args)
    options.record_command(args, args.out)
    with filling(args.out) as folder:
        trainer = _train(args, data, images, device)
        parameters = trainer.model.state().parameters
        model = output.write_output(folder, data, parameters, args.iterations, args.background, place=args.out)
        rows = _compare(folder, args, data, model, device) if data.test else []
        output.remove_results(args.out)
    if args.model:
        with replacing(args.model) as temporary:
            shutil.copyfile(output.point_cloud(args.out, args.iterations), temporary)
    (args.out / CHECKPOINT).unlink(missing_ok=True)
    if rows:
        print("\n".join(as_text(rows, per_view=args.per_view)))
    say(f"{trainer.model.count} Gaussians in {output.point_cloud(args.out, args.iterations)}")


def _train(args: Arguments, data: Dataset, images: Sequence[Float32], device: Device) -> Trainer:
    """Train to the end from the beginning, or from the checkpoint of an interrupted run, and write checkpoints."""
    from gspure.metrics.image_metrics import psnr
    from gspure.opencl.trainable import TrainableModel
    from gspure.training import dataset, initialization, output
    from gspure.training.schedule import Schedule
    from gspure.training.trainer import Trainer, beginning, watched

    checkpoint = args.out / CHECKPOINT
    used = ("iterations", "resolution", "background", "max_gaussians", "seed")
    settings = {name: getattr(args, name) for name in used}
    settings["photographs and cameras"] = dataset.fingerprint(data, images)
    if args.resume and checkpoint.is_file():
        start = output.read_checkpoint(checkpoint, settings)
        say(f"continuing from iteration {start.iteration}")
    else:
        points = initialization.thinned(data.xyz, data.rgb, args.max_gaussians, args.seed)
        start = beginning(initialization.gaussians_at(*points), args.seed)
    model = TrainableModel(start.state, start.iteration, device)
    model.set_targets(images)
    bounds: dict[str, Any] = {"extent": data.extent, "max_gaussians": args.max_gaussians}
    schedule = Schedule.scaled(args.iterations)
    trainer = Trainer(model, data.train, schedule, start, background=args.background, **bounds)
    views = data.test or data.train
    views = views[:: -(-len(views) // _WATCHED)]
    photographs = dataset.read_photographs(views, args.background)

    def quality() -> str:
        shown = (model.image(view, args.background).clip(0, 1) for view in views)
        return f"PSNR {sum(map(psnr, shown, photographs)) / len(views):.2f}  {model.count} Gaussians"

    began = saved = time.monotonic()
    for _ in watched(trainer, args.iterations, quality, start.iteration):
        if trainer.rests and time.monotonic() - saved > _SECONDS_BETWEEN_CHECKPOINTS:
            output.write_checkpoint(checkpoint, trainer.snapshot(), settings)
            saved = time.monotonic()
    say(f"trained {args.iterations - start.iteration} iterations in {time.monotonic() - began:.1f} s")
    return trainer


def _compare(folder: Path, args: Arguments, data: Dataset, model: Path, device: Device) -> list[ViewMetrics]:
    """Render the held-out views from the model's file, and compare them as PNG files, as 3DGS does."""
    from gspure.images import write_image
    from gspure.metrics.comparison import TRUTH, ImagePair, compare, write_metrics
    from gspure.model import read_model
    from gspure.renderer import Renderer
    from gspure.training.dataset import read_photographs
    from gspure.training.output import comparison_folders

    truth, renders = comparison_folders(folder, args.iterations)
    renderer = Renderer(read_model(model), device)
    photographs = read_photographs(data.test, args.background)
    rows = []
    for camera, photograph in zip(track(data.test, "held out"), photographs, strict=True):
        pair = ImagePair(".", camera.name, truth / f"{camera.name}.png", renders / f"{camera.name}.png")
        write_image(pair.reference, photograph)
        write_image(pair.image, renderer.image(camera, background=args.background))
        rows.append(compare(pair, TRUTH))
    write_metrics(folder / "metrics.csv", rows)
    return rows
