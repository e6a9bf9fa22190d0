"""A pair that an owner could publish to be un-auditable: an honest scene, and the same with planted rows.

Each group of planted rows tries another way: numbers that overflow, that hide the scene, or that stop a reader.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gspure.cameras import Camera, intrinsics
from gspure.model import Gaussians
from tests.models import gaussians, joined

WALL, HIDDEN = 300, 100
NEEDLES = ((1e-6, 1e-6, 1e6), (1e-6, 1e-6, 1e2))
FLAKE = (1.4e-9, 0.156, 0.196)
"""Flat, as Gaussians of real surfaces are, so not suspicious. Seen along its plane, it made large numbers cancel."""

NOT_FINITE = {"x": np.nan, "opacity": np.inf, "scale_1": np.nan, "rot_2": -np.inf, "f_dc_0": np.nan, "scale_0": 1e3}
"""Column and value of one row each; a scale of exp(1000) is not finite either."""


def honest() -> Gaussians:
    """An opaque wall, and before it a compact group that is all but transparent."""
    rng = np.random.default_rng(0)
    wall = np.column_stack([rng.uniform(-1.5, 1.5, (WALL, 2)), rng.normal(4, 0.02, WALL)])
    hidden = np.array([0.5, 0.5, 3.0]) + rng.normal(0, 0.05, (HIDDEN, 3))
    opacities = np.repeat([0.9, 0.005], [WALL, HIDDEN]) + rng.uniform(0, 1e-3, WALL + HIDDEN)
    return gaussians(
        means=np.concatenate([wall, hidden]), scales=0.1, opacities=opacities, colors=rng.random((WALL + HIDDEN, 3))
    )


def views(count: int = 9) -> list[Camera]:
    cameras = []
    for i in range(count):
        viewmat = np.eye(4)
        viewmat[0, 3] = 0.1 * (i - count // 2)
        cameras.append(Camera(f"price_$5_and_$6 [b]{i}", 48, 40, intrinsics(40, 40, 24, 20), viewmat))
    return cameras


def grazing(scales: tuple[float, float, float], view: Camera, count: int, seed: int) -> Gaussians:
    """Gaussians that rays of pixels meet almost along their third axis, and almost at right angles to their first."""
    rng = np.random.default_rng(seed)
    means, quats = [], []
    for _ in range(count):
        pixel = [*(rng.integers(8, 32, 2) + 0.5), 1.0]
        ray = np.linalg.solve(view.K, pixel)
        ray /= np.linalg.norm(ray)
        across = np.cross(ray, rng.normal(size=3))
        across /= np.linalg.norm(across)
        means.append(view.centre + ray * rng.uniform(2, 4) + across * 10 ** rng.uniform(-9, -3))
        x, y, z, w = Rotation.from_matrix(np.stack([across, np.cross(ray, across), ray], axis=1)).as_quat()
        quats.append([w, x, y, z])
    return gaussians(means=means, quats=quats, scales=scales, opacities=0.6)


def planted() -> tuple[Gaussians, dict[str, list[int]]]:
    """The scene with planted rows behind its own, and the rows that each reason should name."""
    rng = np.random.default_rng(1)
    groups = {
        "needle": gaussians(means=[[0, 0, 3.5], [0.3, 0.2, 3.6]], scales=NEEDLES, quats=[[1, 0.2, 0.1, 0]] * 2),
        "veil": gaussians(means=rng.normal([0, 0, 3], 0.1, (3, 3)), scales=[50, 40, 30], opacities=0.02),
        "grazing": grazing(NEEDLES[0], views()[4], 40, 2),
        "flake": grazing(FLAKE, views()[4], 60, 3),
        "far": gaussians(means=[[1e30, 0, 4], [0, -3e38, 4]], scales=0.1),
        "pile": gaussians(means=np.tile([0.2, -0.2, 3.8], (40, 1)), scales=rng.uniform(0.05, 0.1, (40, 3))),
        "undrawable": gaussians(means=rng.normal([0, 0, 3.5], 0.1, (len(NOT_FINITE), 3)), scales=0.1),
    }
    for row, (column, value) in enumerate(NOT_FINITE.items()):
        groups["undrawable"].table[column][row] = value
    scene = honest()
    groups["duplicate"] = scene[np.arange(len(scene)) < 5]
    rows, start = {}, len(scene)
    for name, group in groups.items():
        rows[name] = list(range(start, start + len(group)))
        start += len(group)
    del rows["flake"]
    rows["needle"] += rows.pop("grazing")
    rows["oversized"] = sorted([*rows["needle"], *rows.pop("veil")])
    return joined(scene, *groups.values()), rows
