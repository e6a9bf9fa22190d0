"""Small sets of Gaussians and cameras that are awkward on purpose, shared by the renderer's tests."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from gspure.arrays import Bools, Float64
from gspure.cameras.camera import Camera, intrinsics
from gspure.constants import NEAR_CENTRE
from gspure.model.gaussians import Gaussians
from gspure.model.rotations import rotation_matrices
from gspure.public_model import PublicModel

Case = tuple[Gaussians, Camera]


def camera(
    width: int = 65,
    height: int = 47,
    *,
    focal: float = 60.0,
    principal: tuple[float, float] | None = None,
    viewmat: Float64 | None = None,
    name: str = "view",
) -> Camera:
    """A camera at the origin that looks along +z, unless told otherwise."""
    cx, cy = (width / 2, height / 2) if principal is None else principal
    focal = min(focal, 19.0 * max(width, height))  # narrower views are refused
    return Camera(name, width, height, intrinsics(focal, focal, cx, cy), np.eye(4) if viewmat is None else viewmat)


def tilted_camera(width: int = 65, height: int = 47, **settings: Any) -> Camera:
    """A camera away from the origin and turned about all three axes, roughly towards (0, 0, 5)."""
    viewmat = np.eye(4)
    viewmat[:3, :3] = Rotation.from_euler("XYZ", [0.3, -0.2, 0.5]).as_matrix()
    viewmat[:3, 3] = [0.0, 0.0, 5.0] - viewmat[:3, :3] @ [0.0, 0.0, 5.0]
    return camera(width, height, viewmat=viewmat, **settings)


def gaussians(
    *,
    means: ArrayLike,
    scales: ArrayLike,
    opacities: ArrayLike = 0.5,
    quats: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    colors: ArrayLike = 0.7,
) -> Gaussians:
    """Gaussians of degree 0 with these colours; everything broadcasts over the rows of `means`."""
    means = np.atleast_2d(np.asarray(means, np.float64))
    count = len(means)
    scales = np.broadcast_to(np.asarray(scales, np.float64), (count, 3))
    dc = (np.broadcast_to(np.asarray(colors, np.float64), (count, 3)) - 0.5) / 0.28209479177387814
    return Gaussians.from_parameters(
        means=means,
        quats=np.broadcast_to(np.asarray(quats, np.float64), (count, 4)),
        scales=scales,
        opacities=np.broadcast_to(np.asarray(opacities, np.float64), (count,)),
        sh_coeffs=dc[:, None, :],
    )


def blobs(count: int, seed: int = 0, *, sh_degree: int = 3, size: tuple[float, float] = (0.02, 0.4)) -> Gaussians:
    """`count` Gaussians before the cameras above: anisotropic, turned, log-uniform in size, of any opacity."""
    rng = np.random.default_rng(seed)
    least, most = np.log(size)
    depths = rng.uniform(3.0, 9.0, count)
    slopes = rng.uniform(-0.6, 0.6, (2, count))
    sh_coeffs = rng.normal(0.0, 0.15, (count, (sh_degree + 1) ** 2, 3))
    sh_coeffs[:, 0] = rng.normal(0.0, 1.2, (count, 3))
    return Gaussians.from_parameters(
        means=np.stack([slopes[0] * depths, slopes[1] * depths, depths], axis=1),
        quats=rng.normal(size=(count, 4)) * rng.uniform(0.3, 3.0, (count, 1)),
        scales=np.exp(rng.uniform(least, most, (count, 3))),
        opacities=np.clip(rng.beta(0.7, 0.7, count), 1e-4, 1 - 1e-6),
        sh_coeffs=sh_coeffs,
    )


def points_of(means: Float64, opacities: Float64) -> Any:
    """What generated views are placed around."""
    return SimpleNamespace(means=means, opacities=opacities)


def covariances(model: Gaussians) -> Float64:
    turns = rotation_matrices(model.quats)
    spreads: Float64 = np.einsum("kij,kj,klj->kil", turns, model.scales.astype(np.float64) ** 2, turns)
    return spreads


def without(public: PublicModel, prune_mask: Bools) -> PublicModel:
    """The public model without the rows where `prune_mask` [K] is true."""
    return public.with_model(public.model[~prune_mask])


def joined(*models: Gaussians) -> Gaussians:
    """All rows, one model after the other."""
    return Gaussians(np.concatenate([model.table for model in models]))


def nothing() -> Case:
    return blobs(1)[np.zeros(1, bool)], camera()


def off_screen() -> Case:
    """Far to the side, each in another direction; some are large enough to reach into the image."""
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    means = np.stack([9 * np.cos(angle), 9 * np.sin(angle), np.full(12, 4.0)], axis=1)
    return gaussians(means=means, scales=np.linspace(0.1, 3.0, 12)[:, None], colors=0.9), camera()


def behind() -> Case:
    """Behind the camera and astride it, with reaches that pass the camera plane."""
    depths = np.array([-5.0, -0.3, -1e-3, 0.0, 0.1, 0.19, 0.21, 0.5])
    means = np.stack([np.linspace(-1, 1, 8), np.linspace(0.5, -0.5, 8), depths], axis=1)
    return gaussians(means=means, scales=0.3, opacities=0.6), camera()


def covering() -> Case:
    """Every Gaussian covers the whole image; faint ones before an opaque one."""
    means = np.stack([np.linspace(-2, 2, 9), np.linspace(1, -1, 9), np.linspace(3, 20, 9)], axis=1)
    opacities = np.append(np.linspace(0.02, 0.3, 8), 0.999)
    return gaussians(
        means=means, scales=60.0, opacities=opacities, colors=np.linspace(0.1, 0.9, 27).reshape(9, 3)
    ), camera()


def inside() -> Case:
    """The camera stands inside several ellipsoids, among ordinary Gaussians."""
    means = [[0.1, 0.0, 0.3], [-0.4, 0.2, 0.8], [0.5, -0.5, 1.5]]
    quats = [[1.0, 0.2, 0.1, 0.0], [0.7, -0.5, 0.3, 0.2], [0.3, 0.4, 0.5, 0.9]]
    scales = [[1.0, 0.7, 0.5], [2.0, 0.5, 1.0], [0.4, 3.0, 2.0]]
    return joined(
        gaussians(means=means, scales=scales, quats=quats, opacities=0.3), blobs(20, 5, sh_degree=0)
    ), camera()


def needles() -> Case:
    """One axis a thousand times longer than the others, at all angles, along the line of sight too."""
    rng = np.random.default_rng(7)
    means = np.stack([rng.uniform(-1, 1, 40), rng.uniform(-0.7, 0.7, 40), rng.uniform(3, 6, 40)], axis=1)
    quats = rng.normal(size=(40, 4))
    quats[0] = [1, 0, 1, 0]  # long axis (x) turned onto the line of sight
    return gaussians(means=means, quats=quats, scales=[1.5, 0.0015, 0.0015], opacities=0.8), camera()


def close_needles() -> Case:
    """Needles a metre before a long lens: thousands of pixels long, two wide."""
    rng = np.random.default_rng(7)
    depths = rng.uniform(0.5, 3, 40)
    means = np.stack([rng.uniform(-0.03, 0.03, 40) * depths, rng.uniform(-0.02, 0.02, 40) * depths, depths], axis=1)
    return gaussians(means=means, quats=rng.normal(size=(40, 4)), scales=[3.0, 0.002, 0.002]), camera(focal=800.0)


def grazing() -> Case:
    """Ellipsoids alpha >= 1/255 that come within 1/30 to 1/100 000 of the camera plane, from the front."""
    rng = np.random.default_rng(27)
    depths, opacities, quats = rng.uniform(0.3, 4, 12), rng.uniform(0.02, 0.3, 12), rng.normal(size=(12, 4))
    means = np.stack([rng.uniform(-1.5, 1.5, 12) * depths, rng.uniform(-1.5, 1.5, 12) * depths, depths], axis=1)
    scales = np.exp(rng.uniform(np.log(0.02), 0, (12, 3)))
    deviations = np.sqrt((rotation_matrices(quats)[:, 2] ** 2 * scales**2).sum(axis=1))  # along the view axis
    gaps = np.geomspace(1e-5, 0.03, 12)
    scales *= ((1 - gaps) * depths / deviations / np.sqrt(2 * np.log(255 * opacities)))[:, None]
    return gaussians(means=means, quats=quats, scales=scales, opacities=opacities), camera(130, 100, focal=150.0)


def flakes() -> Case:
    """Flat discs, some seen edge-on."""
    rng = np.random.default_rng(8)
    means = np.stack([rng.uniform(-1, 1, 40), rng.uniform(-0.7, 0.7, 40), rng.uniform(3, 6, 40)], axis=1)
    quats = rng.normal(size=(40, 4))
    quats[0] = [1, 0, 1, 0]
    return gaussians(means=means, quats=quats, scales=[0.3, 0.3, 0.002], opacities=0.8), camera()


def subpixel() -> Case:
    """Standard deviations from 0.01 to 0.5 pixels."""
    rng = np.random.default_rng(9)
    means = np.stack([rng.uniform(-2, 2, 200), rng.uniform(-1.5, 1.5, 200), rng.uniform(3, 6, 200)], axis=1)
    sizes = np.exp(rng.uniform(np.log(0.01), np.log(0.5), 200))
    return gaussians(means=means, scales=(sizes * means[:, 2] / 60)[:, None], opacities=0.9), camera()


def extreme_opacities() -> Case:
    """Logits so large that the opacity is exactly 0 or 1 in float32, and two either side of the cut-off."""
    model = blobs(12, 3)
    logits = np.array([-200.0, -90.0, -20.0, -5.6, -5.5, 0.0, 5.0, 18.0, 90.0, 200.0, 200.0, 90.0])
    return model.with_columns({"opacity": logits}), camera()


def same_depth() -> Case:
    """One plane of overlapping Gaussians at the same view depth: the row decides the order."""
    means = np.stack([np.linspace(-0.5, 0.5, 40), np.tile([0.0, 0.1], 20), np.full(40, 4.0)], axis=1)
    colors = np.random.default_rng(10).uniform(0, 1, (40, 3))
    return gaussians(means=means, scales=0.3, opacities=0.6, colors=colors), camera()


def off_centre() -> Case:
    """A principal point outside the image, as a crop of a larger photograph has."""
    return blobs(80, 11), camera(principal=(-14.25, 55.5), focal=75.0)


def _moved(offset: float) -> Case:
    """A scene away from the world's origin; its centres are rounded to float32 there."""
    model, view, shift = blobs(60, 4), tilted_camera(), offset * np.array([1.0, -0.6, 0.3])
    table = model.table.copy()
    for axis, by in zip("xyz", shift, strict=True):
        table[axis] = table[axis].astype(np.float64) + by
    transform = np.eye(4)
    transform[:3, 3] = shift
    return Gaussians(table), view.moved(transform)


def off_origin() -> Case:
    """Nearly as far from the world's origin as cameras may be without becoming the origin themselves."""
    return _moved(0.7 * NEAR_CENTRE)


def geographic() -> Case:
    """In coordinates of a map, in metres."""
    return _moved(5e5)


AWKWARD: dict[str, Callable[[], Case]] = {
    make.__name__: make
    for make in (
        *(nothing, off_screen, behind, covering, inside, needles, close_needles, grazing, flakes, subpixel),
        *(extreme_opacities, same_depth, off_centre, off_origin, geographic),
    )
}


ROTATION = ("rot_0", "rot_1", "rot_2", "rot_3")
UNDRAWN = [{"x": np.nan}, {"z": np.inf}, {"opacity": np.nan}, {"scale_0": np.inf}, {"rot_1": np.nan}]
UNDRAWN += [dict.fromkeys(ROTATION, 0.0)]
"""Columns with which a row is not drawn."""


def with_column(model: Gaussians, name: str, values: ArrayLike) -> Gaussians:
    """The same rows with one more column."""
    table = np.empty(len(model), [*model.table.dtype.descr, (name, "<f4")])
    for column in model.names:
        table[column] = model.table[column]
    table[name] = values
    return Gaussians(table, model.comments)
