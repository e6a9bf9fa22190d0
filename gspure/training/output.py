"""The output folder of training, in the layout of 3DGS's trainer, which most tools read."""

from collections.abc import Sequence
from pathlib import Path

from gspure.cameras import write_cameras
from gspure.files import write_text
from gspure.model import Gaussians, write_model
from gspure.model.conversion import offset_comment
from gspure.model.inria import saved_iterations
from gspure.model.ply import write_point_ply
from gspure.opencl.trainable import Parameters
from gspure.training.dataset import Dataset


def point_cloud(folder: Path, iteration: int) -> Path:
    """Return the model file of an iteration."""
    return folder / "point_cloud" / f"iteration_{iteration}" / "point_cloud.ply"


def comparison(folder: Path, iteration: int) -> tuple[Path, Path]:
    """Return the folders of held-out photographs and of the model's images, named as by 3DGS's render script."""
    views = folder / "test" / f"ours_{iteration}"
    return views / "gt", views / "renders"


def as_gaussians(parameters: Parameters) -> Gaussians:
    """Return raw parameters as the table of a vanilla model."""
    return Gaussians.from_stored(**vars(parameters))


def write_output(
    folder: Path,
    dataset: Dataset,
    parameters: Parameters,
    iteration: int,
    background: Sequence[float],
    *,
    place: Path,
) -> Path:
    """Write model, cameras (test views first), arguments and initial points; return the model's file.

    Cameras have their size in training and name their photographs; all lies around the offset of the dataset, if any,
    which a comment of the model names. `place` is the folder that `folder` will become.
    """
    model = point_cloud(folder, iteration)
    write_point_ply(folder / "input.ply", dataset.xyz, dataset.rgb)
    write_cameras(folder / "cameras.json", [*dataset.test, *dataset.train], place)
    write_text(folder / "cfg_args", _arguments(place, dataset, parameters, background))
    rows = as_gaussians(parameters).with_background(background)
    write_model(model, rows.with_comment(offset_comment(dataset.offset)) if dataset.offset.any() else rows)
    return model


def remove_results(folder: Path) -> None:
    """Remove models and images of earlier runs, as only the last model is read; files of other names stay."""
    for iteration, model in saved_iterations(folder).items():
        model.unlink()
        for image in (image for images in comparison(folder, iteration) for image in images.glob("*.png")):
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
