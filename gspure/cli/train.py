"""``gspure train``: a 3DGS model from photographs."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.progress import say, track
from gspure.settings import MAX_GAUSSIANS, SCHEDULES, SEED, STEPS

if TYPE_CHECKING:
    from gspure.arrays import Float32
    from gspure.metrics.comparison import ViewMetrics
    from gspure.opencl.device import Device
    from gspure.opencl.trainable import TrainableModel
    from gspure.training.dataset import Dataset
    from gspure.training.output import Snapshot
    from gspure.training.schedule import Schedule
    from gspure.training.trainer import Trainer

EXAMPLES = """\
  gspure train scene --out trained                     # COLMAP project: scene/images and scene/sparse/0
  gspure train scene/transforms.json --out trained --resolution 1/4 --iterations 7000
  gspure train scene --out trained --schedule fast     # a similar PSNR in about half the time
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


@dataclass(frozen=True)
class TrainingSettings:
    """The settings of a run, which a resumed run must share."""

    iterations: int
    resolution: str
    background: tuple[float, ...]
    max_gaussians: int
    seed: int
    schedule: str


def add_arguments(parser: Parser) -> None:
    meaning = "COLMAP project, transforms.json (nerfstudio, Blender), cameras.json, or a folder with one of them"
    parser.reads("data", "DATA", meaning)
    parser.writes("--out", "DIR", "folder for the model")
    parser.writes("--model", "PLY|SPZ", "also copy the model there", required=False)
    parser.number("--iterations", "N", "training steps", STEPS, 3000)
    meaning = "vanilla, that of 3DGS, or fast, ours: a similar PSNR in about half the time"
    parser.choice("--schedule", SCHEDULES, meaning, SCHEDULES[0])
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
    from gspure.files import filling_alone, replacing
    from gspure.metrics.comparison import as_text
    from gspure.model import require_writable
    from gspure.model.inria import trained_background
    from gspure.training import dataset, output
    from gspure.training.fast import schedule_of

    options.require_own_folder(args)
    if args.model:
        require_writable(args.model)
    background = tuple(args.background or trained_background(args.data))
    data = dataset.read_dataset(
        args.data, args.resolution, photographs=args.images, skip_missing=args.skip_missing, seed=args.seed
    )
    images = dataset.read_photographs(track(data.train, "photographs"), background)
    schedule = schedule_of(args.schedule, args.iterations).of_photographs()
    if schedule.needs_surfaces:
        data = dataset.with_agreed_points(data, images, args.seed)
    max_gaussians = args.max_gaussians or data.max_gaussians(schedule.pixels_per_gaussian)
    settings = TrainingSettings(
        args.iterations, args.resolution, background, max_gaussians, args.seed, schedule=args.schedule
    )
    size = f"{data.train[0].width}x{data.train[0].height}"
    views = f"{len(data.train)} views of {size}, {len(data.test)} held out"
    say(f"{views}, {len(data.xyz)} points, extent {data.extent:.3g}")
    device = options.read_device(args)
    options.record_command(args, args.out, resolved={"background": background, "max_gaussians": max_gaussians})
    with filling_alone(args.out) as folder:
        trainer = _train(settings, schedule, data, images, args.out / CHECKPOINT, resume=args.resume, device=device)
        parameters = trainer.model.state().parameters
        written = output.write_output(folder, data, parameters, args.iterations, background, place=args.out)
        rows = _compare(folder, settings, data, written, device) if data.test else []
        output.remove_results(args.out)
    model = output.point_cloud(args.out, args.iterations)
    if args.model:
        with replacing(args.model) as temporary:
            shutil.copyfile(model, temporary)
    (args.out / CHECKPOINT).unlink(missing_ok=True)
    if rows:
        print("\n".join(as_text(rows, per_view=args.per_view)))
    say(f"{trainer.model.count} Gaussians in {model}")


def _train(
    settings: TrainingSettings,
    schedule: Schedule,
    data: Dataset,
    images: Sequence[Float32],
    checkpoint: Path,
    *,
    resume: bool,
    device: Device,
) -> Trainer:
    """Train to the end from the beginning, or from the checkpoint of an interrupted run, and write checkpoints."""
    from gspure.opencl.trainable import TrainableModel
    from gspure.training import dataset, output
    from gspure.training.trainer import Trainer, watched

    identity = asdict(settings) | {"photographs and cameras": dataset.fingerprint(data, images)}
    if resume and checkpoint.is_file():
        start = output.read_checkpoint(checkpoint, identity)
        say(f"continuing from iteration {start.iteration}")
    else:
        start = _beginning(settings, schedule, data)
    model = TrainableModel(start.state, start.iteration, device)
    trainer = Trainer(
        model,
        data.train,
        images,
        schedule,
        start,
        extent=data.extent,
        background=settings.background,
        max_gaussians=settings.max_gaussians,
    )
    quality = _quality(model, data, settings.background)
    began = time.monotonic()
    saved = began
    for _ in watched(trainer, settings.iterations, quality, start.iteration):
        if trainer.rests and time.monotonic() - saved > _SECONDS_BETWEEN_CHECKPOINTS:
            output.write_checkpoint(checkpoint, trainer.snapshot(), identity)
            saved = time.monotonic()
    say(f"trained {settings.iterations - start.iteration} iterations in {time.monotonic() - began:.1f} s")
    return trainer


def _beginning(settings: TrainingSettings, schedule: Schedule, data: Dataset) -> Snapshot:
    """Return the snapshot before the first iteration: Gaussians at the points of the dataset."""
    from gspure.training import initialization
    from gspure.training.trainer import beginning

    at_most = schedule.budget(settings.max_gaussians, 1)
    xyz, rgb = initialization.thinned(data.xyz, data.rgb, at_most, settings.seed)
    return beginning(initialization.gaussians_at(xyz, rgb), settings.seed)


def _quality(model: TrainableModel, data: Dataset, background: Sequence[float]) -> Callable[[], str]:
    """Return a function that measures the PSNR in a few held-out views, and counts the Gaussians."""
    from gspure.metrics.image_metrics import psnr
    from gspure.training.dataset import read_photographs

    candidates = data.test or data.train
    step = -(-len(candidates) // _WATCHED)
    views = candidates[::step]
    photographs = read_photographs(views, background)

    def quality() -> str:
        renders = (model.image(view, background).clip(0, 1) for view in views)
        mean = sum(map(psnr, renders, photographs)) / len(views)
        return f"PSNR {mean:.2f}  {model.count} Gaussians"

    return quality


def _compare(folder: Path, settings: TrainingSettings, data: Dataset, model: Path, device: Device) -> list[ViewMetrics]:
    """Render the held-out views from the model's file, and compare them as PNG files, as 3DGS does."""
    from gspure.images import write_image
    from gspure.metrics.comparison import TRUTH, ImagePair, compare, write_metrics
    from gspure.model import read_model
    from gspure.renderer import Renderer
    from gspure.training.dataset import read_photographs
    from gspure.training.output import comparison_folders

    truth, renders = comparison_folders(folder, settings.iterations)
    renderer = Renderer(read_model(model), device)
    photographs = read_photographs(data.test, settings.background)
    rows = []
    for camera, photograph in zip(track(data.test, "held out"), photographs, strict=True):
        pair = ImagePair(".", camera.name, truth / f"{camera.name}.png", renders / f"{camera.name}.png")
        write_image(pair.reference, photograph)
        write_image(pair.image, renderer.image(camera, background=settings.background))
        rows.append(compare(pair, TRUTH))
    write_metrics(folder / "metrics.csv", rows)
    return rows
