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

_BULK = 0.95  # share of the model's opacity whose middle is looked at; the rest may be floaters
_FRAMED = 0.995  # share in view, unless that needs `_WIDER` views than the bulk
_WIDER = 1.3
_ELEVATIONS: Final = (15.0, 45.0, -20.0)  # degrees above the horizon of the rings
_RADII: Final = (0.6, 1.0, 1.6)  # radii of the shells, as multiples of the distance at which the model fills a view
_GOLDEN_ANGLE = 180 * (3 - math.sqrt(5))  # degrees

_COLMAP = np.array([0.0, -1.0, 0.0])  # y points down, and 3DGS models use COLMAP's world
_FLAT = 0.8  # largest ratio of the smallest to the second deviation for which a model counts as flat. Ours
_UPRIGHT = 0.94  # cosine of 20 degrees: nearer axes are taken as they are. Ours
_EVEN, _LOPSIDED = 0.15, 0.4  # skewness below which sides are alike, and above which not. Ours
UP_SHEET: Final = "up.png"  # pictures of a model with each axis up, in the folder of results
_SURE = 0.75  # share of the limits of flatness and skewness at which a guess is sure. Ours
_NEUTRAL = 1e-6  # a normal with less of -y + z has no sense. Ours


class Up(NamedTuple):
    """A guessed up direction: a unit vector [3], and whether the guess is sure."""

    direction: Float64
    is_sure: bool

    def __str__(self) -> str:
        return " ".join(f"{x:.3g}" for x in self.direction + 0.0) + " (unsure)" * (not self.is_sure)


def orbit_cameras(model: Gaussians, *, count: int = 24, **framing: Any) -> list[Camera]:
    """Return `count` views on rings around the `bounding_sphere` of a model, which fills them.

    Consecutive views alternate between the rings, so that the test split, every eighth view, covers all sides.

    The other parameters are `width` and `height` in pixels, `fov_degrees`, horizontal, and `up` [3], the up direction
    of the world: (0, -1, 0) for models trained from COLMAP data, (0, 0, 1) for those from nerfstudio, Blender and most
    scanners. By default it is guessed, and printed. Raise `InputError` if the model has no finite row, or a setting is
    out of range.
    """
    VIEWS.require("orbit views", "count", count)
    placements = [(_ELEVATIONS[i % len(_ELEVATIONS)], 360.0 * i / count, 1.0) for i in range(count)]
    return _views("orbit", model, placements, **framing)


def shell_cameras(model: Gaussians, *, count: int = 48, **framing: Any) -> list[Camera]:
    """Return views from all directions, also from below, on spherical shells; the parameters are as above.

    The directions are a Fibonacci spiral; consecutive views alternate between the shells.
    """
    VIEWS.require("shell views", "count", count)
    sines = ((2 * i + 1) / count - 1 for i in range(count))
    elevations = (math.degrees(math.asin(sine)) for sine in sines)
    placements = [(elevation, i * _GOLDEN_ANGLE, _RADII[i % len(_RADII)]) for i, elevation in enumerate(elevations)]
    return _views("shell", model, placements, **framing)


GENERATED: Final[Mapping[str, Callable[..., list[Camera]]]] = {"orbit": orbit_cameras, "shells": shell_cameras}
"""What a command or a configuration may name in place of a camera file: views around a model."""


def bounding_sphere(means: Floats, opacities: Floats) -> tuple[Float64, float]:
    """Return centre [3] and radius of the sphere that holds most of a model's opacity.

    The centre is that of the box between the opacity-weighted 5 % and 95 % quantiles of each coordinate, the radius the
    weighted 99.5 % quantile of the distances to it, but at most 1.3 times the 95 % quantile: floaters change neither.
    Rows that are not finite are ignored. A single point gets radius 1.
    """
    points, weights = _finite(means, opacities)
    low, high = ([_quantile(axis, weights, q) for axis in points.T] for q in (1 - _BULK, _BULK))
    centre = (np.array(low) + np.array(high)) / 2
    distances = np.linalg.norm(points - centre, axis=1)
    bulk, framed = (_quantile(distances, weights, q) for q in (_BULK, _FRAMED))
    return centre, min(framed, _WIDER * bulk) or framed or 1.0


def _finite(means: Floats, opacities: Floats) -> tuple[Float64, Float64]:
    points, weights = np.asarray(means, np.float64), np.asarray(opacities, np.float64)
    finite = np.isfinite(points).all(axis=1) & np.isfinite(weights)
    if not finite.any():
        raise InputError("model", "Gaussians", expected="at least one finite row", found="none")
    return points[finite], weights[finite]


def _quantile(values: Float64, weights: Float64, q: float) -> float:
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(share, q * share[-1])]])


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
        up = (guess := up_of(model)).direction.tolist()
        say(f"up direction {guess}, guessed from the model's shape; --up X Y Z sets another")
    frame = _frame(Entry(f"{kind} views", "", {"up": up}))
    SIDE.require(f"{kind} views", "width", width)
    SIDE.require(f"{kind} views", "height", height)
    FIELD_OF_VIEW.require(f"{kind} views", "fov_degrees", fov_degrees)
    focal = width / 2 / math.tan(math.radians(fov_degrees) / 2)
    K = intrinsics(focal, focal, width / 2, height / 2)
    filling = radius / math.sin(math.atan(min(width, height) / 2 / focal))
    nearest = 1.25 * radius + NEAR_PLANE  # keeps the sphere of a small model, and a margin, beyond the near plane
    digits = max(3, len(str(len(placements) - 1)))
    poses = (_looking_at(centre, frame, e, a, max(filling * shell, nearest)) for e, a, shell in placements)
    return [Camera(f"{kind}_{i:0{digits}d}", width, height, K, viewmat) for i, viewmat in enumerate(poses)]


def up_of(model: Gaussians) -> Up:
    """Return `guessed_up` of the rows in the bounding sphere of a model."""
    points, weights = _finite(model.means, model.opacities)
    centre, radius = bounding_sphere(points, weights)
    inside = np.linalg.norm(points - centre, axis=1) <= radius
    return guessed_up(points[inside], weights[inside])


def _frame(settings: Entry) -> Float64:
    """Return the world axes front, right-hand side and up [3,3]; the front is -z, or -y if z is up."""
    up = settings.array("up", (3,))
    if not np.linalg.norm(up) > 0:
        raise settings.refusal("up", expected="a direction", found="0 0 0")
    up /= np.linalg.norm(up)
    towards = np.array([0.0, 0.0, -1.0] if abs(up[2]) < 0.9 else [0.0, -1.0, 0.0])
    front = towards - (towards @ up) * up
    front /= np.linalg.norm(front)
    return np.stack([front, np.cross(up, front), up])


def _looking_at(centre: Float64, frame: Float64, elevation: float, azimuth: float, distance: float) -> Float64:
    """Return the view matrix of a camera that looks at `centre`; its axes are well defined at the poles too."""
    front, side, up = frame
    a, e = math.radians(azimuth), math.radians(elevation)
    horizontal = math.cos(a) * front + math.sin(a) * side
    backward = math.cos(e) * horizontal + math.sin(e) * up
    right = math.cos(a) * side - math.sin(a) * front
    down = math.sin(e) * horizontal - math.cos(e) * up
    rotation = np.stack([right, down, -backward])
    return rigid(rotation, -rotation @ (centre + distance * backward))


@np.errstate(over="ignore", invalid="ignore")  # of points in one plane
def guessed_up(points: Float64, weights: NDArray[Any]) -> Up:
    """Return the unit vector [3] normal to the plane in which a model extends: its ground, or that of a flat object.

    People and figurines with arms spread are flat, too, but alike in front and behind, and not above and below: the
    vector is along their height. Its sense is that of the usual worlds, -y or +z up. A direction near an axis is that
    axis. It is -y, as from COLMAP, if the model is not flat or its plane is upright in both worlds. Points [K,3] are
    finite; their weights [K] may be opacities.

    The guess is unsure if it is that last resort or no axis, or flatness or skewness are within 25 % of their limits.
    """
    weights = weights + np.finfo(np.float64).tiny  # some may be invisible, but not all
    offsets = points - np.average(points, axis=0, weights=weights)
    variances, axes = np.linalg.eigh((offsets * weights[:, None]).T @ offsets)
    spreads = np.sqrt(np.maximum(variances / weights.sum(), np.finfo(np.float64).tiny))
    skews = np.abs(weights @ (offsets @ axes / spreads) ** 3) / weights.sum()
    stands, might, must = (skews[0] < _EVEN * m and skews[1:].max() > _LOPSIDED / m for m in (1, 1 / _SURE, _SURE))
    axis = axes[:, 1 + skews[1:].argmax() if stands else 0]
    sense = axis @ (0, -1, 1)
    normal = axis * np.sign(sense)
    is_flat, is_neutral = variances[0] < _FLAT**2 * variances[1], abs(sense) < _NEUTRAL
    if not is_flat or is_neutral or abs(normal[0]) > max(-normal[1], normal[2]):
        return Up(_COLMAP, is_sure=False)
    nearest = np.round(normal * (np.abs(normal) > _UPRIGHT))
    is_sure = might == must and nearest.any() and variances[0] < (_SURE * _FLAT) ** 2 * variances[1]
    return Up(nearest if nearest.any() else normal, bool(is_sure))
