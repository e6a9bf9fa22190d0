"""A small ray-traced pair, and what schemes embed in it, each made once in a run of the tests."""

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.cli import main
from gspure.metrics.image_metrics import psnr
from gspure.public_model import RenderView
from gspure.schemes.pair import Capture, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import Scheme, hide
from gspure.training.dataset import read_photographs
from tests.documentation import example

SETTINGS: dict[str, dict[str, Any]] = {
    "splats_in_splats": {"iterations": 60, "max_gaussians": 800},
    "gs_hider": {"iterations": 60, "max_gaussians": 400},
    "secure_gs": {"iterations": 60, "max_anchors": 200},
    "keyss": {"iterations": 60, "max_gaussians": 400},
    "keyed_pattern": {"iterations": 60, "max_gaussians": 800},
    "marked_clones": {"iterations": 30, "max_gaussians": 400, "decoder_steps": 2, "marking_steps": 2},
    "rendered_bits": {"iterations": 30, "max_gaussians": 400, "decoder_steps": 2, "colour_steps": 2},
    "lsb_opacities": {"iterations": 30, "max_gaussians": 400},
    "planted": {"gaussians": 800},
    "veil": {"iterations": 20, "max_gaussians": 800},
    "glint": {"iterations": 20, "max_gaussians": 800},
}
EXAMPLES = {"veil", "glint"}
NEEDS_TORCH = {"gs_hider", "secure_gs", "keyss", "marked_clones", "rendered_bits"}


def small_pair(folder: Path, protocol: str = "shared") -> Path:
    """Return the folder of a pair of 12 views of 48x36 pixels."""
    size = ("--views", "12", "--width", "48", "--height", "36")
    assert main(["pair", "room", "vault", "--protocol", protocol, *size, "--out", str(folder)]) == 0
    return folder


def held_out(capture: Capture) -> list[tuple[Camera, Float32]]:
    """Return the held-out views of a capture, with their photographs."""
    return list(zip(capture.dataset.test, read_photographs(capture.dataset.test), strict=True))


def quality(view: RenderView, capture: Capture) -> float:
    """Return the mean PSNR of what is shown in the held-out views of a capture."""
    return float(np.mean([psnr(view(camera).clip(0, 1), photograph) for camera, photograph in held_out(capture)]))


def scheme_of_example(name: str) -> Scheme:
    """Return a scheme of the guide, as its package would hold it."""
    module = ModuleType(name)
    sys.modules[name] = module  # where dataclasses look for it
    exec(compile(example(name), f"{name}.py", "exec"), module.__dict__)  # noqa: S102
    scheme: Scheme = module.SCHEME
    return scheme


def embedded_in(folder: Path, name: str) -> SimpleNamespace:
    """Return a scheme, the pair in a folder, and what the scheme made of it."""
    if name in NEEDS_TORCH:
        pytest.importorskip("torch")
    scheme = scheme_of_example(name) if name in EXAMPLES else find_scheme(name)
    pair = read_pair(folder)
    public, key = hide(scheme, pair, **SETTINGS[name])
    return SimpleNamespace(scheme=scheme, pair=pair, public=public, key=key, settings=SETTINGS[name], folder=folder)
