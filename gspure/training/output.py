"""The output folder of training, in the layout of 3DGS's trainer, which most tools read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gspure.artifacts import write_text
from gspure.cameras import write_cameras
from gspure.model import Gaussians, write_model
from gspure.model.points import write_point_ply
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
    count = len(parameters)
    table = Gaussians.from_parameters(
        means=parameters.means,
        quats=parameters.quats,
        scales=np.ones((count, 3)),
        opacities=np.full(count, 0.5),
        sh_coeffs=parameters.sh_coeffs,
    )
    raw = {f"scale_{i}": column for i, column in enumerate(parameters.log_scales.T)}
    return table.with_columns(raw | {"opacity": parameters.opacity_logits})


def write_output(
    folder: Path, dataset: Dataset, parameters: Parameters, iteration: int, background: Sequence[float]
) -> Path:
    """Write model, cameras (test views first), arguments and initial points; return the model's file.

    Cameras have their size in training and name their photographs.
    """
    model = point_cloud(folder, iteration)
    write_point_ply(folder / "input.ply", dataset.xyz, dataset.rgb)
    write_cameras(folder / "cameras.json", [*dataset.test, *dataset.train])
    write_text(folder / "cfg_args", _arguments(folder, dataset, parameters, background))
    write_model(model, as_gaussians(parameters).with_background(background))
    return model


def _arguments(folder: Path, dataset: Dataset, parameters: Parameters, background: Sequence[float]) -> str:
    arguments = {
        "sh_degree": round(parameters.sh_coeffs.shape[1] ** 0.5) - 1,
        "source_path": str(dataset.source.absolute()),
        "model_path": str(folder),
        "images": "images",
        "resolution": dataset.train[0].width,  # above 8, 3DGS takes it as the width in pixels
        "white_background": tuple(background) == (1.0, 1.0, 1.0),
        "data_device": "cpu",
        "eval": True,
    }
    return f"Namespace({', '.join(f'{name}={value!r}' for name, value in arguments.items())})"
