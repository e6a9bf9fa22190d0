"""Generated views and the up direction, for models that come without cameras."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64
from gspure.cameras.camera import Camera, intrinsics, rigid
from gspure.cameras.entry import Entry
from gspure.constants import NEAR_PLANE
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians
from gspure.progress import say
from gspure.settings import FIELD_OF_VIEW, SIDE, VIEWS

Floats = NDArray[np.floating[Any]]

_BULK = 0.95  # share of the model's opacity that determines its middle; the rest may be floaters
_FRAMED = 0.995  # share of the opacity in view, unless it needs a radius of more than `_WIDER` times that of the bulk
_WIDER = 1.3
_ELEVATIONS: Final = (15.0, 45.0, -20.0)  # degrees above the horizon of the rings
_RADII: Final = (0.6, 1.0, 1.6)  # radii of the shells, as multiples of the distance at which the model fills a view
_GOLDEN_ANGLE = 180 * (3 - math.sqrt(5))  # degrees

_COLMAP = np.array([0.0, -1.0, 0.0])  # y points down, and 3DGS models use COLMAP's world
# Ours:
_FLAT = 0.8  # largest ratio of the smallest to the second deviation for which a model counts as flat
_ROUND = 0.6  # least ratio of the second to the largest deviation of a ground
_UPRIGHT = 0.94  # cosine of 20 degrees: a direction nearer to an axis becomes that axis
_EVEN = 0.15  # skewness below which two sides are alike
_LOPSIDED = 0.4  # skewness above which they are not
_SURE = 0.75  # a guess is sure if it stands with limits of flatness and skewness stricter by this factor
_NEUTRAL = 1e-6  # a normal whose component along -y + z is smaller has no sense

UP_SHEET: Final = "up.png"  # pictures of a model with each axis up, in the folder of results


class Up(NamedTuple):
    """A guessed up direction: a unit vector [3], and whether the guess is sure."""

    direction: Float64
    is_sure: bool

    def __str__(self) -> str:
        text = " ".join(f"{x:.3g}" for x in self.direction + 0.0)
        return text if self.is_sure else f"{text} (unsure)"


def orbit_cameras(model: Gaussians, *, count: int = 24, **framing: Any) -> list[Camera]:
    """Return `count` views on rings around a model; its `bounding_sphere` fills them.

    Consecutive views alternate between the rings, so that the test split, every eighth view, covers all sides.

    Further parameters are `width` and `height` in pixels, `fov_degrees`, horizontal, and `up` [3], the up direction of
    the world: (0, -1, 0) for models trained from COLMAP data, (0, 0, 1) for those from nerfstudio, Blender and most
    scanners. By default it is guessed, and printed. Raise `InputError` if the model has no finite row, or a setting is
    out of range.

    >>> [camera.name for camera in gspure.orbit_cameras(model, count=3, up=(0, 0, 1))]
    ['orbit_000', 'orbit_001', 'orbit_002']
    """
    VIEWS.require("orbit views", "count", count)
    placements = [(_ELEVATIONS[i % len(_ELEVATIONS)], 360.0 * i / count, 1.0) for i in range(count)]
    return _views("orbit", model, placements, **framing)


def shell_cameras(model: Gaussians, *, count: int = 48, **framing: Any) -> list[Camera]:
    """Return `count` views from all directions, also from below, on spherical shells.

    The directions are a Fibonacci spiral; consecutive views alternate between the shells. The further parameters are
    those of `orbit_cameras`.
    """
    VIEWS.require("shell views", "count", count)
    elevations = (math.degrees(math.asin((2 * i + 1) / count - 1)) for i in range(count))
    placements = [(elevation, i * _GOLDEN_ANGLE, _RADII[i % len(_RADII)]) for i, elevation in enumerate(elevations)]
    return _views("shell", model, placements, **framing)


GENERATED: Final[Mapping[str, Callable[..., list[Camera]]]] = {"orbit": orbit_cameras, "shells": shell_cameras}
"""Views around a model, by the name that a command or a configuration takes in place of a camera file."""


def bounding_sphere(means: Floats, opacities: Floats) -> tuple[Float64, float]:
    """Return centre [3] and radius of the sphere that holds most of a model's opacity.

    The centre is the middle of the box between the opacity-weighted 5 % and 95 % quantiles of each coordinate. The
    radius is the weighted 99.5 % quantile of the distances to it, but at most 1.3 times the 95 % quantile. So floaters
    change neither. Rows that are not finite are ignored. A single point gets radius 1.
    """
    points, weights = _finite(means, opacities)
    low, high = np.array([_quantiles(axis, weights, 1 - _BULK, _BULK) for axis in points.T]).T
    centre = (low + high) / 2
    distances = np.linalg.norm(points - centre, axis=1)
    bulk, framed = _quantiles(distances, weights, _BULK, _FRAMED)
    return centre, min(framed, _WIDER * bulk) or framed or 1.0


def _finite(means: Floats, opacities: Floats) -> tuple[Float64, Float64]:
    points = np.asarray(means, np.float64)
    weights = np.asarray(opacities, np.float64)
    finite = np.isfinite(points).all(axis=1) & np.isfinite(weights)
    if not finite.any():
        raise InputError("model", "Gaussians", expected="at least one finite row", found="none")
    return points[finite], weights[finite]


def _quantiles(values: Float64, weights: Float64, *levels: float) -> list[float]:
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weights[order])
    return [float(values[order[np.searchsorted(share, level * share[-1])]]) for level in levels]


def _views(
    kind: str,
    model: Gaussians,
    placements: Sequence[tuple[float, float, float]],
    *,
    width: int = 640,
    height: int = 480,
    fov_degrees: float = 50.0,
    up: Sequence[float] | None = None,
) -> list[Camera]:
    """Place one view at each (elevation, azimuth, radius); angles in degrees, radius 1 fills the view."""
    centre, radius = bounding_sphere(model.means, model.opacities)
    if up is None:
        guess = _up_inside(model, centre, radius)
        say(f"up direction {guess}, guessed from the model's shape; --up X Y Z sets another")
        up = guess.direction.tolist()
    frame = _frame(Entry(f"{kind} views", "", {"up": up}))
    SIDE.require(f"{kind} views", "width", width)
    SIDE.require(f"{kind} views", "height", height)
    FIELD_OF_VIEW.require(f"{kind} views", "fov_degrees", fov_degrees)
    focal = width / 2 / math.tan(math.radians(fov_degrees) / 2)
    K = intrinsics(focal, focal, width / 2, height / 2)
    filling = radius / math.sin(math.atan(min(width, height) / 2 / focal))
    nearest = 1.25 * radius + NEAR_PLANE  # keeps the sphere of a small model, and a margin, beyond the near plane
    digits = max(3, len(str(len(placements) - 1)))
    cameras = []
    for i, (elevation, azimuth, shell) in enumerate(placements):
        viewmat = _looking_at(centre, frame, elevation, azimuth, max(filling * shell, nearest))
        cameras.append(Camera(f"{kind}_{i:0{digits}d}", width, height, K, viewmat))
    return cameras


def up_of(model: Gaussians) -> Up:
    """Return `guessed_up` for the rows of a model in its bounding sphere."""
    return _up_inside(model, *bounding_sphere(model.means, model.opacities))


def _up_inside(model: Gaussians, centre: Float64, radius: float) -> Up:
    """Return `guessed_up` for the rows of a model in a sphere."""
    points, weights = _finite(model.means, model.opacities)
    inside = np.linalg.norm(points - centre, axis=1) <= radius
    return guessed_up(points[inside], weights[inside])


def _frame(settings: Entry) -> Float64:
    """Return the world axes front, right and up [3,3]; the front is -z, or -y if z is up."""
    up = settings.array("up", (3,))
    if not np.linalg.norm(up) > 0:
        raise settings.refusal("up", expected="a direction", found="0 0 0")
    up /= np.linalg.norm(up)
    towards = np.array([0.0, 0.0, -1.0] if abs(up[2]) < 0.9 else [0.0, -1.0, 0.0])
    front = towards - (towards @ up) * up
    front /= np.linalg.norm(front)
    return np.stack([front, np.cross(up, front), up])


def _looking_at(centre: Float64, frame: Float64, elevation: float, azimuth: float, distance: float) -> Float64:
    """Return the viewmat of a camera that looks at `centre`; its axes are well defined at the poles too."""
    front, side, up = frame
    a = math.radians(azimuth)
    e = math.radians(elevation)
    horizontal = math.cos(a) * front + math.sin(a) * side
    backward = math.cos(e) * horizontal + math.sin(e) * up
    right = math.cos(a) * side - math.sin(a) * front
    down = math.sin(e) * horizontal - math.cos(e) * up
    rotation = np.stack([right, down, -backward])
    return rigid(rotation, -rotation @ (centre + distance * backward))


@np.errstate(over="ignore", invalid="ignore")  # points in one plane
def guessed_up(points: Float64, weights: NDArray[Any]) -> Up:
    """Return the normal [3] of the plane in which a model extends: of its ground, or of a flat object.

    Standing people and figurines are flat, too, but in another plane: their front and back are alike, above and below
    are not. For these the vector is along their height. Its sense is that of the usual worlds, -y or +z up. A direction
    near an axis becomes that axis. If the model is not flat, or its plane is upright in both worlds, the guess is -y,
    as in COLMAP's world. Points [K,3] are finite; their weights [K] may be opacities.

    The guess is unsure if it is this default or no axis, if flatness or skewness is within 25 % of its limit, or if the
    model is long: it may be a figure on its back.
    """
    weights = weights + np.finfo(np.float64).tiny  # some may be invisible, but not all
    offsets = points - np.average(points, axis=0, weights=weights)
    variances, axes = np.linalg.eigh((offsets * weights[:, None]).T @ offsets)
    spreads = np.sqrt(np.maximum(variances / weights.sum(), np.finfo(np.float64).tiny))
    skews = np.abs(weights @ (offsets @ axes / spreads) ** 3) / weights.sum()

    def stands(factor: float) -> bool:
        """Return whether only front and back of the model are alike, with limits looser by this factor."""
        return bool(skews[0] < _EVEN * factor and skews[1:].max() > _LOPSIDED / factor)

    axis = axes[:, 1 + skews[1:].argmax() if stands(1) else 0]
    sense = axis @ (0, -1, 1)
    normal = axis * np.sign(sense)
    is_flat = variances[0] < _FLAT**2 * variances[1]
    is_neutral = abs(sense) < _NEUTRAL
    if not is_flat or is_neutral or abs(normal[0]) > max(-normal[1], normal[2]):
        return Up(_COLMAP, is_sure=False)
    nearest = np.round(normal * (np.abs(normal) > _UPRIGHT))
    is_clearly_flat = variances[0] < (_SURE * _FLAT) ** 2 * variances[1]
    is_round = variances[1] > _ROUND**2 * variances[2]  # a long flat model may lie on its back
    is_sure = stands(1 / _SURE) == stands(_SURE) and nearest.any() and is_clearly_flat and is_round
    return Up(nearest if nearest.any() else normal, bool(is_sure))
