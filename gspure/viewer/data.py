"""The data of the 3-D view: splats in the order in which GSPure prunes, quantized; their colours, and cameras."""

import base64
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64, UInt8
from gspure.cameras.camera import Camera
from gspure.cameras.splits import split
from gspure.constants import ALPHA_MIN, NOISE_LABEL, SH_DC
from gspure.figures.clouds import Purified
from gspure.figures.viewpoint import choose_camera, in_view, project, world_axes
from gspure.files import write_json
from gspure.model.finite import undrawable_rows
from gspure.model.gaussians import COLOUR, Gaussians
from gspure.public_model import PublicModel, Rows

MOST: Final = 100_000  # splats of a model: they take 2.5 MB of a page
_SPAN: Final = 14.0  # of the logarithms of scales, below the largest
_FAINT: Final = 0.12  # highest opacity of noise among clusters
_GREY: Final = 140  # of models without colours
_PRESETS: Final = 24  # test cameras to choose from
_VISITED: Final = 8  # cameras for which Gaussians are computed from anchors
_CUTS: Final = 400  # positions of the slider

Data = dict[str, Any]
Source = Callable[[Camera], tuple[Gaussians, Rows]]
"""From a camera to the Gaussians that it sees, and the row of each."""


def write_viewer(path: Path, model: Purified, cameras: Sequence[Camera]) -> None:
    """Write the view of a model as JSON: its scene, message, pruned rows and clusters, and what the slider removes."""
    removal, pruned = _removal(model), model.pruned
    cuts = np.unique([*np.linspace(0, 1, _CUTS + 1), pruned.mean()])
    gaussians, rows = _seen(model.public.gaussians, model.public, cameras)
    clusters = model.colourings["cluster"]
    faint = np.minimum(gaussians.opacities, np.where(model.labels == NOISE_LABEL, _FAINT, 1)[rows])
    paints = [_paint(gaussians), _rgba(clusters.colours[rows], faint)]
    centre = np.median(gaussians.means, axis=0)
    clouds = [_cloud("", gaussians, centre, paints, model.weights[rows], removal[rows], cuts)]
    scene: Data = {"name": "scene", "panes": [[0, 0]], "backdrop": _css(model.public)}
    modes = [scene] if gaussians.sh_degree >= 0 else []
    if model.message and (message := _seen(model.message, model.public, cameras))[0].sh_degree >= 0:
        hidden, rows = message
        clouds.append(_cloud("", hidden, centre, [_paint(hidden)], _mass(hidden), removal[rows], cuts))
        modes.append(scene | {"name": "message", "panes": [[1, 0]]})
    legend = [entry for line in clusters.legend for entry in line]
    modes += [{"name": "pruned", "panes": [[0, 0]]}, {"name": "clusters", "panes": [[0, 1]], "legend": legend}]
    decision, removed = int(np.searchsorted(cuts, pruned.mean())), _removed(model, removal, cuts)
    view = _view(clouds, modes, gaussians.means, centre, cameras)
    write_json(path, view | {"rows": model.row_kind, "decision": decision, "removed": removed})


def view_of(models: Mapping[str, PublicModel], cameras: Sequence[Camera]) -> Data:
    """Return the view of one model, or of several side by side, by their titles."""
    seen = {title: _seen(public.gaussians, public, cameras)[0] for title, public in models.items()}
    first = next(iter(seen.values()))
    centre = np.median(first.means, axis=0)
    clouds = [_cloud(title, shown, centre, [_paint(shown)], _mass(shown)) for title, shown in seen.items()]
    backdrop = _css(next(iter(models.values())))
    modes = [{"name": "scene", "panes": [[i, 0] for i in range(len(clouds))], "backdrop": backdrop}]
    return _view(clouds, modes, first.means, centre, cameras)


def _seen(source: Source, public: PublicModel, cameras: Sequence[Camera]) -> tuple[Gaussians, Rows]:
    """Return Gaussians that show a model from all sides; those of an anchor are as the first camera sees them."""
    overview = choose_camera(public.model.means, ())
    if public.rows_are_gaussians or not cameras:
        return source(overview)
    seen, parts, owners = np.zeros(len(public.model), np.bool_), [], []
    for camera in [*cameras[:: -(-len(cameras) // _VISITED)], overview]:
        gaussians, rows = source(camera)
        new = ~seen[rows]
        parts.append(gaussians.table[new])
        owners.append(rows[new])
        seen[rows] = True
    return Gaussians(np.concatenate(parts)), np.concatenate(owners)


def _removal(model: Purified) -> Float64:
    """Return for every row [K] the share of rows removed once it is, if the lowest ranks go first, as in GSPure."""
    rank = model.ranks.astype(np.float32)
    return np.searchsorted(np.sort(rank), rank, side="right") / len(rank)


def _removed(model: Purified, removal: Float64, cuts: Float64) -> dict[str, list[float]]:
    """Return the shares of rows and of weights that the slider removes at each of its positions."""
    order = np.argsort(removal, kind="stable")
    below = np.searchsorted(removal[order], cuts, side="right")
    amounts = (("rows", np.ones(len(removal))), ("scene", model.weights), ("message", model.hidden))
    shares = {
        name: np.append(0, np.cumsum(values[order], dtype=np.float64)) / values.sum(dtype=np.float64)
        for name, values in amounts
        if values is not None and values.any()
    }
    return {name: share[below].round(6).tolist() for name, share in shares.items()}


def _paint(gaussians: Gaussians) -> UInt8:
    """Return colours of degree 0, and opacities."""
    if gaussians.sh_degree < 0:
        return _rgba(np.full((len(gaussians), 3), _GREY, np.uint8), gaussians.opacities)
    colours = np.clip(0.5 + SH_DC * gaussians.columns(*COLOUR), 0, 1)
    return _rgba(np.rint(255 * colours).astype(np.uint8), gaussians.opacities)


def _rgba(colours: UInt8, opacities: NDArray[np.floating]) -> UInt8:
    """Return colours [K,4]; the last channel is the root of the opacity, since many splats are faint."""
    alpha = np.where(opacities >= ALPHA_MIN, np.rint(255 * np.sqrt(opacities)), 0)
    return np.column_stack([colours, alpha.astype(np.uint8)])


def _mass(gaussians: Gaussians) -> Float64:
    """Return how much of a picture each splat fills: its opacity times its largest cross-section."""
    return np.asarray(gaussians.opacities * np.sort(gaussians.scales, axis=1)[:, 1:].prod(axis=1, dtype=np.float64))


def _cloud(
    title: str,
    gaussians: Gaussians,
    centre: NDArray[np.floating],
    paints: Sequence[UInt8],
    weights: Float32 | Float64,
    removal: Float64 | None = None,
    cuts: Float64 | None = None,
) -> Data:
    """Return splats, those that the slider removes first at the beginning; `starts` are the first left at each cut.

    The arrays, one after the other: centres int16 [N,3], asinh of the distance along the axes from `centre` in `unit`,
    at most `reach`; logarithms of scales uint8 [N,3], `_SPAN` below `largest`; quaternions (w, x, y, z) int8 [N,4];
    `paints` uint8 [N,4] each.
    """
    removal = np.zeros(len(gaussians)) if removal is None else removal
    visible = np.max([paint[:, 3] for paint in paints], axis=0) > 0
    visible[undrawable_rows(gaussians)] = False
    visible |= ~visible.any()
    rows = _sampled(np.flatnonzero(visible), weights)
    rows = rows[np.argsort(removal[rows], kind="stable")]
    offsets = gaussians.means[rows] - centre
    unit = float(np.median(np.abs(offsets), axis=0).max()) or 1.0
    bent = np.arcsinh(offsets / unit)
    reach = float(np.abs(bent).max()) or 1.0
    logs = gaussians.log_scales[rows]
    largest = float(logs.max())
    quats = gaussians.quats[rows]
    quats = quats / (np.linalg.norm(quats, axis=1, keepdims=True) + 1e-30)
    arrays = (
        np.rint(32767 * bent / reach).astype("<i2"),
        np.rint(255 * np.clip(1 + (logs - largest) / _SPAN, 0, 1)).astype(np.uint8),
        np.rint(127 * quats).astype(np.int8),
        *(paint[rows] for paint in paints),
    )
    starts = [] if cuts is None else np.searchsorted(removal[rows], cuts, side="right").tolist()
    packed = zlib.compress(b"".join(array.tobytes() for array in arrays), 9)
    counts = {"splats": len(rows), "of": int(visible.sum()), "paints": len(paints), "starts": starts}
    ranges = {"unit": unit, "reach": reach, "largest": largest, "span": _SPAN}
    return {"title": title, **counts, **ranges, "data": base64.b64encode(packed).decode()}


def _sampled(rows: Rows, weights: Float32 | Float64) -> Rows:
    """Return at most `MOST` of the rows, drawn without repetition: a row of mean weight twice as likely as one of 0."""
    if len(rows) <= MOST:
        return rows
    shares = weights[rows] / (weights[rows].mean(dtype=np.float64) or 1) + 1
    times = np.random.default_rng(0).exponential(size=len(rows)) / shares
    return rows[np.argpartition(times, MOST)[:MOST]]


def _view(
    clouds: list[Data], modes: list[Data], means: Float32, centre: NDArray[np.floating], cameras: Sequence[Camera]
) -> Data:
    """Return the view, with an overview and test cameras, in coordinates from `centre`, to choose from."""
    test = split(cameras)[1]
    views = [("overview", choose_camera(means, cameras)), *((view.name, view) for view in test[:: len(test) // _PRESETS + 1])]
    presets = {
        "up": world_axes(means, cameras)[1].tolist(),
        "views": [_preset(name, view, means, centre) for name, view in views],
    }
    return {"clouds": clouds, "modes": modes, "cameras": presets, "removed": {}}


def _preset(name: str, camera: Camera, means: Float32, centre: NDArray[np.floating]) -> Data:
    """Return a camera, with the depth of what it shows, around which the view is turned."""
    depths, K, size = project(means, camera)[1][in_view(means, camera)], camera.K, (camera.width, camera.height)
    return {
        "name": name,
        "axes": camera.viewmat[:3, :3].tolist(),
        "eye": (camera.centre - centre).tolist(),
        "distance": float(np.median(depths)) if len(depths) else 1.0,
        "focal": K[1, 1] / camera.height,
        "aspect": camera.width / camera.height,
        "middle": [(2 * place - side) / 2 / camera.height for place, side in zip(K[:2, 2], size, strict=True)],
    }


def _css(public: PublicModel) -> str:
    return "rgb({} {} {})".format(*(round(255 * channel) for channel in public.model.background))
