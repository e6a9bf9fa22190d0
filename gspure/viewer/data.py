"""The data of the 3-D view: splats in the order in which GSPure prunes, quantized; their colours, and cameras."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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
_SPAN: Final = 14.0  # range of the logarithms of scales, below the largest
_FAINT: Final = 0.12  # highest opacity of noise among clusters
_GREY: Final = 140  # of models without colours
_PRESETS: Final = 24  # most test cameras to choose from
_VISITED: Final = 8  # most cameras for which Gaussians are computed from anchors
_CUTS: Final = 400  # steps of the slider

Data = dict[str, Any]
Source = Callable[[Camera], tuple[Gaussians, Rows]]
"""From a camera to the Gaussians that it sees, and the row of each."""


@dataclass(frozen=True)
class Slider:
    """The slider that removes the lowest ranks first, as GSPure does.

    Its positions `cuts` are shares of the rows removed. `removal` [K] are the positions at which each row is removed.
    """

    removal: Float64
    cuts: Float64

    def at(self, rows: Rows) -> Slider:
        """Return the slider for Gaussians of these rows [N]."""
        return Slider(self.removal[rows], self.cuts)


def write_viewer(path: Path, model: Purified, cameras: Sequence[Camera]) -> None:
    """Write the view of a model as JSON: its scene, message, pruned rows and clusters, and what the slider removes."""
    pruned_share = model.pruned.mean()
    slider = Slider(_removal(model), np.unique([*np.linspace(0, 1, _CUTS + 1), pruned_share]))
    gaussians, rows = _from_all_sides(model.public.gaussians, model.public, cameras)
    clusters = model.colourings["cluster"]
    most_opaque = np.where(model.labels == NOISE_LABEL, _FAINT, 1)
    cluster_paint = _rgba(clusters.colours[rows], np.minimum(gaussians.opacities, most_opaque[rows]))
    centre = np.median(gaussians.means, axis=0)
    clouds = [_cloud("", gaussians, centre, [_paint(gaussians), cluster_paint], model.weights[rows], slider.at(rows))]
    backdrop = _css(model.public)
    modes: list[Data] = []
    if gaussians.sh_degree >= 0:
        modes.append({"name": "scene", "panes": [[0, 0]], "backdrop": backdrop})
    if model.message:
        message, message_rows = _from_all_sides(model.message, model.public, cameras)
        if message.sh_degree >= 0:
            clouds.append(_cloud("", message, centre, [_paint(message)], _mass(message), slider.at(message_rows)))
            modes.append({"name": "message", "panes": [[1, 0]], "backdrop": backdrop})
    legend = [entry for line in clusters.legend for entry in line]
    modes.append({"name": "pruned", "panes": [[0, 0]]})
    modes.append({"name": "clusters", "panes": [[0, 1]], "legend": legend})
    view = _view(clouds, modes, gaussians.means, centre, cameras)
    view["rows"] = model.row_kind
    view["decision"] = int(np.searchsorted(slider.cuts, pruned_share))
    view["removed"] = _removed(model, slider)
    write_json(path, view)


def view_of(models: Mapping[str, PublicModel], cameras: Sequence[Camera]) -> Data:
    """Return the view of one model, or of several side by side, by their titles."""
    shown = {title: _from_all_sides(public.gaussians, public, cameras)[0] for title, public in models.items()}
    first = next(iter(shown.values()))
    centre = np.median(first.means, axis=0)
    clouds = [_cloud(title, each, centre, [_paint(each)], _mass(each)) for title, each in shown.items()]
    backdrop = _css(next(iter(models.values())))
    modes = [{"name": "scene", "panes": [[i, 0] for i in range(len(clouds))], "backdrop": backdrop}]
    return _view(clouds, modes, first.means, centre, cameras)


def _from_all_sides(source: Source, public: PublicModel, cameras: Sequence[Camera]) -> tuple[Gaussians, Rows]:
    """Return Gaussians that show a model from all sides, and the row of each.

    The Gaussians of an anchor are those that the first camera sees.
    """
    overview = choose_camera(public.model.means, ())
    if public.rows_are_gaussians or not cameras:
        return source(overview)
    step = -(-len(cameras) // _VISITED)
    visited = np.zeros(len(public.model), np.bool_)
    tables = []
    owners = []
    for camera in [*cameras[::step], overview]:
        gaussians, rows = source(camera)
        new = ~visited[rows]
        tables.append(gaussians.table[new])
        owners.append(rows[new])
        visited[rows] = True
    return Gaussians(np.concatenate(tables)), np.concatenate(owners)


def _removal(model: Purified) -> Float64:
    """Return the share of the rows removed at which each row [K] is removed."""
    ranks = model.ranks.astype(np.float32)
    return np.searchsorted(np.sort(ranks), ranks, side="right") / len(ranks)


def _removed(model: Purified, slider: Slider) -> dict[str, list[float]]:
    """Return the shares of rows and of weights that the slider removes at each of its positions."""
    order = np.argsort(slider.removal, kind="stable")
    removed_rows = np.searchsorted(slider.removal[order], slider.cuts, side="right")
    removed = {}
    for name, values in (("rows", np.ones(len(order))), ("scene", model.weights), ("message", model.hidden)):
        if values is not None and values.any():
            shares = np.append(0, np.cumsum(values[order], dtype=np.float64)) / values.sum(dtype=np.float64)
            removed[name] = shares[removed_rows].round(6).tolist()
    return removed


def _paint(gaussians: Gaussians) -> UInt8:
    """Return the colours [K,4] of splats: those of degree 0, grey without colours, and opacities."""
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
    slider: Slider | None = None,
) -> Data:
    """Return at most `MOST` visible splats, in the order in which the slider removes them.

    `starts` are the first splats left at the positions of the slider. `data` holds arrays, one after the other: centres
    int16 [N,3], asinh of the distance from `centre` along the axes, in `unit`, at most `reach`; logarithms of scales
    uint8 [N,3], from `span` below `largest`; quaternions (w, x, y, z) int8 [N,4]; and `paints`, uint8 [N,4] each.
    """
    visible = np.max([paint[:, 3] for paint in paints], axis=0) > 0
    visible[undrawable_rows(gaussians)] = False
    if not visible.any():
        visible[:] = True
    rows = _sampled(np.flatnonzero(visible), weights)
    starts: list[int] = []
    if slider is not None:
        rows = rows[np.argsort(slider.removal[rows], kind="stable")]
        starts = np.searchsorted(slider.removal[rows], slider.cuts, side="right").tolist()

    offsets = gaussians.means[rows] - centre
    unit = float(np.median(np.abs(offsets), axis=0).max()) or 1.0
    distances = np.arcsinh(offsets / unit)
    reach = float(np.abs(distances).max()) or 1.0
    log_scales = gaussians.log_scales[rows]
    largest = float(log_scales.max())
    quats = gaussians.quats[rows]
    quats = quats / (np.linalg.norm(quats, axis=1, keepdims=True) + 1e-30)
    arrays = [
        np.rint(32767 * distances / reach).astype("<i2"),
        np.rint(255 * np.clip(1 + (log_scales - largest) / _SPAN, 0, 1)).astype(np.uint8),
        np.rint(127 * quats).astype(np.int8),
        *(paint[rows] for paint in paints),
    ]
    packed = zlib.compress(b"".join(array.tobytes() for array in arrays), 9)
    return {
        "title": title,
        "splats": len(rows),
        "of": int(visible.sum()),
        "paints": len(paints),
        "starts": starts,
        "unit": unit,
        "reach": reach,
        "largest": largest,
        "span": _SPAN,
        "data": base64.b64encode(packed).decode(),
    }


def _sampled(rows: Rows, weights: Float32 | Float64) -> Rows:
    """Return at most `MOST` of the rows, drawn without repetition.

    A row of mean weight is twice as likely as one of weight 0: rows get random times of arrival, at rates that grow
    with their weights, and the first ones are drawn.
    """
    if len(rows) <= MOST:
        return rows
    rates = weights[rows] / (weights[rows].mean(dtype=np.float64) or 1) + 1
    times = np.random.default_rng(0).exponential(size=len(rows)) / rates
    return rows[np.argpartition(times, MOST)[:MOST]]


def _view(
    clouds: list[Data], modes: list[Data], means: Float32, centre: NDArray[np.floating], cameras: Sequence[Camera]
) -> Data:
    """Return the view, in coordinates from `centre`; it begins at the first test camera, an overview is last."""
    test = split(cameras)[1]
    step = len(test) // _PRESETS + 1
    presets = [_preset(camera.name, camera, means, centre) for camera in test[::step]]
    presets.append(_preset("overview", choose_camera(means, cameras), means, centre))  # often among floaters
    up = world_axes(means, cameras)[1].tolist()
    return {"clouds": clouds, "modes": modes, "cameras": {"up": up, "views": presets}, "removed": {}}


def _preset(name: str, camera: Camera, means: Float32, centre: NDArray[np.floating]) -> Data:
    """Return a camera, with the median depth of what it shows: the view is turned around a point at this depth."""
    depths = project(means[in_view(means, camera)], camera)[1]
    cx, cy = camera.K[:2, 2]
    return {
        "name": name,
        "axes": camera.viewmat[:3, :3].tolist(),
        "eye": (camera.centre - centre).tolist(),
        "distance": float(np.median(depths)) if len(depths) else 1.0,
        "focal": camera.K[1, 1] / camera.height,
        "aspect": camera.width / camera.height,
        "middle": [(2 * cx - camera.width) / 2 / camera.height, (2 * cy - camera.height) / 2 / camera.height],
    }


def _css(public: PublicModel) -> str:
    """Return the background of a model as a CSS colour."""
    red, green, blue = (round(255 * channel) for channel in public.model.background)
    return f"rgb({red} {green} {blue})"
