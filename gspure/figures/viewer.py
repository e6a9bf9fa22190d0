"""The data of the report's 3-D viewer: points, their colours, and what pruning removes; quantized, as JSON."""

import base64
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.constants import NOISE_LABEL
from gspure.figures.clouds import Colouring, Purified, by_harmonics
from gspure.files import Float32, Float64, Indices, write_json
from gspure.method.pruning import cluster_weights, mean_weight
from gspure.model.gaussians import COLOUR

MAX_POINTS: Final = 40_000  # of a thinned cloud; they take 1.2 MB of a page, and every laptop turns them smoothly
REACH: Final = 2.0  # of points, in half extents of their bulk: farther floaters would shrink all else
_BULK: Final = (0.02, 0.98)  # quantiles
_CUTS: Final = 400  # positions of the slider


def write_viewer(path: Path, model: Purified, axes: NDArray[np.floating]) -> None:
    """Write the data of the viewer as JSON with base64 arrays, little-endian.

    The rows of `axes` [3,3] are the world's right, up and front (`gspure.figures.viewpoint.world_axes`).
    """
    table, count = model.public.model, len(model.means)
    colour = {"colour": by_harmonics(table.columns(*COLOUR))} if table.sh_degree >= 0 else {}
    shown = np.sort(np.random.default_rng(0).permutation(count)[:MAX_POINTS])
    removal = _removal(model)
    data = {
        "rows": model.rows,
        "count": count,
        "points": len(shown),
        "reach": REACH,
        "positions": _packed(_positions(model.means, axes)[shown], "<i2"),
        "removal": _packed(np.rint(65535 * removal[shown]), "<u2"),
        "weights": _packed(model.weights[shown], "<f4"),
        "mean_weight": mean_weight(model.weights),
        "pruned": _packed(model.pruned[shown], "u1"),
        **_clusters(model, shown),
        "colours": {name: _packed_colours(key, shown) for name, key in (colour | model.colourings).items()},
        **_cuts(model, removal),
    }
    write_json(path, data)


def _packed(values: NDArray[Any], dtype: str) -> str:
    return base64.b64encode(values.astype(dtype).tobytes()).decode()


def _positions(means: Float32, axes: NDArray[np.floating]) -> Float64:
    """Return centres [K,3] along the world's axes, where the bulk fills [-1, 1] of the longest; 32767 is `REACH`."""
    local = means @ axes.T
    low, high = np.quantile(local, _BULK, axis=0)
    half = float((high - low).max()) / 2 or 1.0
    return np.asarray(np.rint(32767 * np.clip((local - (low + high) / 2) / half / REACH, -1, 1)))


def _removal(model: Purified) -> Float64:
    """Return for every row [K] the share of rows removed once it is, if the lowest ranks go first, as in GSPure."""
    rank = model.ranks.astype(np.float32)
    return np.searchsorted(np.sort(rank), rank, side="right") / len(rank)


def _clusters(model: Purified, shown: Indices) -> dict[str, Any]:
    """Return the cluster of every point, 65535 for noise, and of these clusters size and mean weight."""
    labels, index = np.unique(model.labels[shown], return_inverse=True)
    noise = int(labels[0] == NOISE_LABEL)
    clusters = labels[noise:]
    return {
        "clusters": _packed(np.where(index < noise, 65535, index - noise), "<u2"),
        "sizes": np.bincount(model.labels + 1)[1:][clusters].tolist(),
        "cluster_weights": cluster_weights(model.labels, model.weights)[clusters].tolist(),
    }


def _packed_colours(key: Colouring, shown: Indices) -> dict[str, Any]:
    """Return colours as indices into a palette, or one by one if there are too many, and what they mean."""
    colours = key.colours[shown]
    palette, index = np.unique(colours, axis=0, return_inverse=True)
    legend = [[label, colour] for row in key.legend for label, colour in row]
    ramp = [] if key.scale is None else key.scale[:: -(len(key.scale) // 8)][::-1].tolist()
    meaning: dict[str, Any] = {"legend": legend, "ramp": ramp, "words": () if key.scale is None else key.words}
    if len(palette) > 256:
        return {**meaning, "rgb": _packed(colours, "u1")}
    return {**meaning, "palette": _packed(palette, "u1"), "index": _packed(index, "u1")}


def _cuts(model: Purified, removal: Float64) -> dict[str, Any]:
    """Return the positions of the slider, that of the decision among them, and the shares removed at each."""
    decision = float(model.pruned.mean())
    cuts = np.unique([*np.linspace(0, 1, _CUTS + 1), decision])
    order = np.argsort(removal, kind="stable")
    below = np.searchsorted(removal[order], cuts, side="right")
    amounts = (("rows", np.ones(len(removal))), ("scene", model.weights), ("message", model.hidden))
    shares = {
        name: np.append(0, np.cumsum(values[order], dtype=np.float64)) / values.sum(dtype=np.float64)
        for name, values in amounts
        if values is not None and values.any()
    }
    return {
        "cuts": np.rint(65535 * cuts).astype(int).tolist(),
        "decision": int(np.searchsorted(cuts, decision)),
        "removed": {name: share[below].round(6).tolist() for name, share in shares.items()},
    }
