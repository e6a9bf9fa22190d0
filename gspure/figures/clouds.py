"""Colours of point clouds with their legends: by cluster, rank, weight, prune mask and the message's share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from gspure.arrays import Bools, Float32, Float64, Indices, Int32, UInt8
from gspure.cameras.camera import Camera
from gspure.constants import NOISE_LABEL, TAU_C, TAU_N
from gspure.figures import style
from gspure.method.pruning import deciding_weights, prune_mask
from gspure.model import Gaussians
from gspure.public_model import PublicModel, Rows
from gspure.text import percent

_STEPS = 256  # colours of a scale
_PALE = 0.55  # share of white in the colours of kept clusters
_NOISE = style.tint(style.NOISE, 0.7)
_LEGEND = 6  # entries in a row of the legend

Legend = tuple[tuple[tuple[str, str], ...], ...]


@dataclass(frozen=True)
class Colouring:
    """The sRGB colours of points, uint8 [K,3].

    The legend has rows of labels with their colours; the colour of plain text is ``none``. Continuous colours have a
    scale instead: uint8 [S,3] from lowest to highest, with the labels of its low end, middle and high end. `named`
    holds the rows of the points that a picture names, by name.
    """

    colours: UInt8
    legend: Legend = ()
    scale: UInt8 | None = None
    scale_labels: tuple[str, str, str] = ("", "", "")
    named: Mapping[str, Indices] = field(default_factory=dict)


@dataclass(frozen=True)
class Purified:
    """A model with K >= 1 rows, Gaussians or anchors, and the decision about each.

    `labels` and `weights` are [K]; `tau_c` and `tau_n` are the pruning factors. With the owner's key, `hidden` [K] are
    the weights in views of the message, `message` is `Key.gaussians` for the public model, and `extracted` returns a
    picture [H,W,3] of what the key extracts from a model.
    """

    public: PublicModel
    labels: Int32
    weights: Float32
    hidden: Float32 | None = None
    tau_c: float = TAU_C
    tau_n: float = TAU_N
    message: Callable[[Camera], tuple[Gaussians, Rows]] | None = None
    extracted: Callable[[PublicModel], Float32] | None = None

    @property
    def means(self) -> Float32:
        """The centres [K,3]."""
        return self.public.model.means

    @cached_property
    def pruned(self) -> Bools:
        """The prune mask [K]."""
        return prune_mask(self.labels, self.weights, self.tau_c, self.tau_n)

    @property
    def row_kind(self) -> str:
        """What the rows are: Gaussians or anchors."""
        return "anchors" if self.public.model.has_anchors else "Gaussians"

    @cached_property
    def ranks(self) -> Float64:
        """The ranks [K] of the deciding weights times the pruning factors: GSPure prunes the lowest ranks.

        The weights are those of `gspure.method.pruning.deciding_weights`; the factor is `tau_c` in clusters and `tau_n`
        outside. A rank is the share of rows with a lower product, from 0 to 1. Equal products share their mean rank.
        """
        factors = np.where(self.labels != NOISE_LABEL, self.tau_c, self.tau_n)
        deciding = deciding_weights(self.labels, self.weights) * factors
        _, tie, count = np.unique(deciding, return_inverse=True, return_counts=True)
        first = np.cumsum(count) - count
        return np.asarray((first + (count - 1) / 2)[tie] / max(len(deciding) - 1, 1))

    @cached_property
    def colourings(self) -> dict[str, Colouring]:
        """The colours of the rows by what they show: cluster, rank, prune mask, and the message if it is known."""
        colourings = {
            "cluster": by_cluster(self.labels, self.pruned),
            "rank": by_rank(self.ranks),
            "pruned": by_decision(self.pruned),
        }
        if self.hidden is not None:
            colourings["message"] = by_share(self.weights, self.hidden)
        return colourings


def by_cluster(labels: Int32, pruned: Bools) -> Colouring:
    """Colour rows by their cluster, pale if the cluster is kept; noise is light grey.

    The largest clusters have a number and a colour each; smaller ones use these colours again. `pruned` [K] is the
    prune mask, equal for all rows of a cluster.
    """
    hues = len(style.CLUSTERS)
    pale = [style.tint(colour, _PALE) for colour in style.CLUSTERS]
    palette = np.array([style.rgb(colour) for colour in (*style.CLUSTERS, *pale, _NOISE)])
    clustered = labels != NOISE_LABEL
    sizes = np.bincount(labels[clustered])
    kept = np.bincount(labels[clustered & pruned], minlength=len(sizes)) == 0
    entry = np.empty(len(sizes) + 1, np.intp)  # of the palette, by label; the noise label -1 is the last one
    largest_first = np.argsort(-sizes, kind="stable")
    entry[largest_first] = np.arange(len(sizes)) % hues + hues * kept[largest_first]
    entry[NOISE_LABEL] = -1
    legend = _cluster_legend(sizes[largest_first], kept[largest_first], len(labels))
    named = {f"{i + 1}": np.flatnonzero(labels == label) for i, label in enumerate(largest_first[:hues])}
    return Colouring(palette[entry[labels]], legend, named=named)


def _cluster_legend(sizes: Indices, kept: Bools, total: int) -> Legend:
    """Return legend rows for pruned clusters, kept clusters and noise.

    `sizes` and `kept` are of clusters, the largest first; `total` is the number of rows of the model.
    """
    hues = len(style.CLUSTERS)
    rows: list[tuple[tuple[str, str], ...]] = []
    for fate, paleness, mask in (("pruned", 0.0, ~kept), ("kept (pale)", _PALE, kept)):
        if not mask.any():
            continue
        entries = [(f"{fate}:", "none")]
        numbered = np.flatnonzero(mask[:hues])
        entries += [
            (f"{i + 1}: {percent(sizes[i] / total)}", style.tint(style.CLUSTERS[i], paleness)) for i in numbered
        ]
        smaller = sizes[hues:][mask[hues:]]
        if len(smaller):
            entries.append((f"{len(smaller)} smaller: {percent(smaller.sum() / total)}", "none"))
        rows += [tuple(entries[i : i + _LEGEND]) for i in range(0, len(entries), _LEGEND)]
    noise = (total - sizes.sum()) / total
    return (*rows, ((f"noise: {percent(noise)}", _NOISE),))


def by_decision(pruned: Bools) -> Colouring:
    """Colour rows by the prune mask [K]."""
    share = float(pruned.mean())
    legend_row = ((f"kept: {percent(1 - share)}", style.KEPT), (f"pruned: {percent(share)}", style.PRUNED))
    palette = np.array([style.rgb(style.KEPT), style.rgb(style.PRUNED)])
    return Colouring(palette[pruned.astype(np.intp)], (legend_row,))


def by_reason(masks: Mapping[str, Bools]) -> Colouring:
    """Colour rows by the last of these masks [K] that is true for them; rows in no mask are pale.

    The legend names the masks.
    """
    hues = (style.PRUNED, style.MESSAGE, style.SCENE)
    entry = np.zeros(len(next(iter(masks.values()))), np.intp)
    for i, mask in enumerate(masks.values(), 1):
        entry[mask] = i
    labels = [f"{name}: {percent(mask.mean())}" for name, mask in masks.items()]
    palette = np.array([style.rgb(colour) for colour in (_NOISE, *hues)])
    return Colouring(palette[entry], tuple(((label, hue),) for label, hue in zip(labels, hues, strict=False)))


def by_rank(ranks: Float64) -> Colouring:
    """Colour rows by their ranks [K] (`Purified.ranks`)."""
    return _on_scale(ranks, ("lowest", "rank", "highest"), _rank_colours)


def by_share(weights: Float32, hidden: Float32) -> Colouring:
    """Colour rows by the message's share of their weight, h / (h + ω); grey if both are 0.

    `weights` [K] are ω, in views of the scene; `hidden` [K] are h, in views of the message
    (`gspure.schemes.hidden_weight.hidden_weights`).
    """
    total = weights.astype(np.float64) + hidden
    shares = np.divide(hidden, total, where=total > 0, out=np.full(len(total), np.nan))
    return _on_scale(shares, ("0%", "message's share", "100%"), _share_colours)


def _on_scale(values: Float64, labels: tuple[str, str, str], colour_map: Callable[[Float64], UInt8]) -> Colouring:
    """Colour values [K] from 0 to 1; NaN is grey."""
    known = colour_map(np.nan_to_num(values))
    colours = np.where(np.isnan(values)[:, None], style.rgb(style.NOISE), known)
    return Colouring(colours, scale=colour_map(np.linspace(0, 1, _STEPS)), scale_labels=labels)


def _rank_colours(ranks: Float64) -> UInt8:
    """Return the colours [S,3] of ranks."""
    from matplotlib import colormaps

    colours: UInt8 = colormaps[style.RANKS](ranks, bytes=True)[:, :3]
    return colours


def _share_colours(shares: Float64) -> UInt8:
    """Return the colours [S,3] of the message's shares: from that of kept rows (0) to that of the message (1)."""
    kept = style.rgb(style.KEPT).astype(np.float64)
    message = style.rgb(style.MESSAGE).astype(np.float64)
    return np.rint(kept + shares[:, None] * (message - kept)).astype(np.uint8)
