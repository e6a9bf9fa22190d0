"""Kernel sources: their folder, build options and digest."""

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from gspure import constants
from gspure.files import digest

RENDERER_CONSTANTS = {
    name: getattr(constants, name)
    for name in (
        "TILE",
        "NEAR_PLANE",
        "ALPHA_MIN",
        "ALPHA_MAX",
        "TRANSMITTANCE_MIN",
        "MEDIAN_TRANSMITTANCE",
        "EWA_DILATION",
        "EWA_FRUSTUM_MARGIN",
        "EWA_DEVIATION_MAX",
        "RAY_SCALE_RATIO",
        "MAGNITUDE_MAX",
        "COORDINATE_MAX",
        "COLOUR_MAX",
        "SSIM_WINDOW",
        "SSIM_C1",
        "SSIM_C2",
        "ADAM_BETA1",
        "ADAM_BETA2",
        "ADAM_EPSILON",
        "BLOCK",
        "GEOMETRY_ATTRIBUTES",
        "FOOTPRINT_FLOATS",
        "MOMENTS",
        "LEAF",
    )
} | {
    "LOG2_ALPHA_MIN": math.log2(constants.ALPHA_MIN),
    # Subtracted in single precision, 1 - 0.999 would be 5e-5 off.
    "ADAM_GAIN1": 1.0 - constants.ADAM_BETA1,
    "ADAM_GAIN2": 1.0 - constants.ADAM_BETA2,
}

# Never -cl-fast-relaxed-math: it breaks exp2_polynomial (vector.cl).
BUILD_OPTIONS = ("-cl-std=CL1.2",)


@cache
def kernel_folder() -> Path:
    """Return the folder of the .cl files: inside an installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    folders = (package / "kernels_cl", package.parent / "kernels_cl")
    return next(folder for folder in folders if folder.is_dir())


def kernel_source(*names: str) -> str:
    """Return the named .cl files, concatenated in this order."""
    return "\n".join((kernel_folder() / f"{name}.cl").read_text(encoding="utf-8") for name in names)


def build_options(defines: Mapping[str, int]) -> list[str]:
    """Return compiler options: the renderer's constants and `defines` as -D."""
    suffixes = {int: "", float: "f"}
    numbers = [f"-D{name}={value!r}{suffixes[type(value)]}" for name, value in RENDERER_CONSTANTS.items()]
    return [*BUILD_OPTIONS, *numbers, *(f"-D{name}={value}" for name, value in sorted(defines.items()))]


def kernel_digest() -> str:
    """Return a digest of all kernel sources, constants and build options: everything that can change a rendering."""
    names = sorted(path.stem for path in kernel_folder().glob("*.cl"))
    return digest(*names, kernel_source(*names), " ".join(build_options({})))
