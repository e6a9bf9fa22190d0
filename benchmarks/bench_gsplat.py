"""A frame, and one with gradients, beside gsplat's CUDA rasterizer on the same GPU: see `make gpu`."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from benchmarks.findings import Findings
from benchmarks.room import Scene, each_scene
from benchmarks.stages import Stages
from benchmarks.timing import Measure
from gspure.metrics.image_metrics import psnr
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Traversal
from gspure.opencl.passes import backward, forward

torch = pytest.importorskip("torch")
gsplat = pytest.importorskip("gsplat")

NAMES = ("means", "quats", "scales", "opacities", "sh_coeffs")


def rasterized(parameters: list[Any], scene: Scene) -> Any:
    """Return gsplat's image [H,W,3] of the scene's view."""
    viewmats = torch.tensor(scene.camera.viewmat[None], dtype=torch.float32, device="cuda")
    intrinsics = torch.tensor(scene.camera.K[None], dtype=torch.float32, device="cuda")
    size = (scene.width, scene.height)
    images, *_ = gsplat.rasterization(*parameters, viewmats, intrinsics, *size, near_plane=0.2, sh_degree=3)
    return images[0]


@each_scene
def test_gsplat(scene: Scene, engine: Engine, measure: Measure, findings: Findings) -> None:
    if engine.style == "cpu" or not torch.cuda.is_available():
        pytest.skip("no GPU for both OpenCL and CUDA")
    frame = Stages(engine, scene.model, scene.camera, Traversal("ewa", channels=3, sh_degree=3)).frame
    parameters = [torch.tensor(getattr(scene.model, name), device="cuda", requires_grad=True) for name in NAMES]
    gradient = np.random.default_rng(0).normal(size=(scene.height, scene.width, 3)).astype(np.float32)
    uploaded = engine.uploaded(gradient)
    tensor = torch.tensor(gradient, device="cuda")

    def ours(*, gradients: bool) -> None:
        rendered = forward(frame, (0.0, 0.0, 0.0))
        if gradients:
            backward(rendered, uploaded)
        engine.queue.finish()

    def theirs(*, gradients: bool) -> None:
        with torch.set_grad_enabled(gradients):
            image = rasterized(parameters, scene)
            if gradients:
                torch.autograd.grad(image, parameters, tensor)
        torch.cuda.synchronize()

    variants = {
        f"{name}, {kind}": partial(run, gradients=gradients)
        for kind, gradients in (("image", False), ("image and gradients", True))
        for name, run in (("gspure", ours), ("gsplat", theirs))
    }
    times = measure(variants, rounds=21, warm_ups=3)
    for kind, goal in (("image", 1.5), ("image and gradients", None)):
        ratio = np.median(np.divide(times[f"gspure, {kind}"].wall, times[f"gsplat, {kind}"].wall))
        findings.figure(f"gspure / gsplat, {kind}, wall", ratio, at_most=goal)
    image = rasterized(parameters, scene).detach().cpu().numpy()
    agreement = psnr(forward(frame, (0.0, 0.0, 0.0)).image().clip(0, 1), image.clip(0, 1))
    findings.figure("agreement of the images, PSNR, dB", agreement, at_least=50.0)
