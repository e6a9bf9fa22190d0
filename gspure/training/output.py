"""The output folder of training, in the layout of 3DGS's trainer; and checkpoints, which resume a run bit for bit."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.arrays import Kind, Shape, load_arrays
from gspure.cameras import write_cameras
from gspure.errors import InputError, reading
from gspure.files import replacing, write_text
from gspure.model import Gaussians, write_model
from gspure.model.inria import saved_iterations
from gspure.model.ply import offset_comment, write_point_ply
from gspure.opencl.trainable import Parameters, TrainState
from gspure.training.dataset import Dataset

_PARTS: Final = tuple(field.name for field in fields(TrainState))
_SHAPES: Final[dict[str, Shape]] = {
    "means": (None, 3),
    "quats": (None, 4),
    "log_scales": (None, 3),
    "opacity_logits": (None,),
    "sh_coeffs": (None, None, 3),
}
_CONTENT: Final = "a checkpoint of training"


def point_cloud(folder: Path, iteration: int) -> Path:
    """Return the model file of an iteration."""
    return folder / "point_cloud" / f"iteration_{iteration}" / "point_cloud.ply"


def comparison_folders(folder: Path, iteration: int) -> tuple[Path, Path]:
    """Return the folders of held-out photographs and of the model's images, named as by 3DGS's render script."""
    views = folder / "test" / f"ours_{iteration}"
    return views / "gt", views / "renders"


def as_gaussians(parameters: Parameters) -> Gaussians:
    """Return raw parameters as the table of a vanilla model."""
    return Gaussians.from_stored(**vars(parameters))


def write_output(
    folder: Path, dataset: Dataset, parameters: Parameters, iteration: int, background: Sequence[float], *, place: Path
) -> Path:
    """Write model, cameras (test views first), arguments and initial points; return the model's file.

    Cameras have the size of training and name their photographs. Coordinates are relative to the dataset's offset; if
    it is not zero, a comment of the model gives it. `folder` is temporary, and will become `place`.
    """
    model = point_cloud(folder, iteration)
    write_point_ply(folder / "input.ply", dataset.xyz, dataset.rgb)
    write_cameras(folder / "cameras.json", [*dataset.test, *dataset.train], place)
    write_text(folder / "cfg_args", _arguments(place, dataset, parameters, background))
    rows = as_gaussians(parameters).with_background(background)
    if dataset.offset.any():
        rows = rows.with_comment(offset_comment(dataset.offset))
    write_model(model, rows)
    return model


def remove_results(folder: Path) -> None:
    """Remove models and images of earlier runs, as only the last model is read; files of other names stay."""
    for iteration, model in saved_iterations(folder).items():
        model.unlink()
        for images in comparison_folders(folder, iteration):
            for image in images.glob("*.png"):
                image.unlink()


def _arguments(model_path: Path, dataset: Dataset, parameters: Parameters, background: Sequence[float]) -> str:
    arguments = {
        "sh_degree": round(parameters.sh_coeffs.shape[1] ** 0.5) - 1,
        "source_path": str(dataset.source.absolute()),
        "model_path": str(model_path),
        "images": "images",
        "resolution": dataset.train[0].width,  # above 8, 3DGS takes it as the width in pixels
        "white_background": tuple(background) == (1.0, 1.0, 1.0),
        "data_device": "cpu",
        "eval": True,
    }
    return f"Namespace({', '.join(f'{name}={value!r}' for name, value in arguments.items())})"


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The state of a run between two densifications (`gspure.training.schedule.Schedule.rests`).

    `pending_views` are the training views left in the current pass over all of them; the last is next. `rng` is the
    state of the run's only bit generator.
    """

    iteration: int
    state: TrainState
    pending_views: tuple[int, ...]
    rng: Mapping[str, Any]


def write_checkpoint(path: Path, snapshot: Snapshot, settings: Mapping[str, Any]) -> None:
    """Write a snapshot and the settings of its run as .npz without pickle, whole or not at all."""
    run = {"iteration": snapshot.iteration, "unseen": snapshot.pending_views, "rng": snapshot.rng, "settings": settings}
    arrays: dict[str, Any] = {}
    for part in _PARTS:
        parameters = getattr(snapshot.state, part)
        arrays |= {f"{part}.{group}": getattr(parameters, group) for group in _SHAPES}
    with replacing(path) as temporary:
        np.savez(temporary, run=np.array(json.dumps(run)), **arrays)


def read_checkpoint(path: Path, settings: Mapping[str, Any]) -> Snapshot:
    """Read a snapshot, or raise `InputError` if its run has other settings."""
    kinds: dict[str, Kind] = {
        f"{part}.{group}": (np.float32, shape) for part in _PARTS for group, shape in _SHAPES.items()
    }
    arrays = load_arrays(path, kinds | {"run": (np.str_, ())}, _CONTENT)
    with reading(path, _CONTENT):
        run = json.loads(str(arrays["run"]))
        for name, value in json.loads(json.dumps(settings)).items():
            stored = run["settings"].get(name)
            if stored != value:
                hint = "delete it to begin anew, since --resume continues the same run only"
                raise InputError(path, name, expected=json.dumps(value), found=json.dumps(stored), hint=hint)
        parts = [Parameters(*(arrays[f"{part}.{group}"] for group in _SHAPES)) for part in _PARTS]
        np.random.default_rng().bit_generator.state = run["rng"]  # raises what `reading` reports
        return Snapshot(run["iteration"], TrainState(*parts), tuple(run["unseen"]), run["rng"])
