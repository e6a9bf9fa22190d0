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

_STEPS = 256  # of a scale
_PALE = 0.55  # share of white in the colours of kept clusters
_NOISE = style.tint(style.NOISE, 0.7)
_LEGEND = 6  # entries in a row

Legend = tuple[tuple[tuple[str, str], ...], ...]


@dataclass(frozen=True)
class Colouring:
    """The sRGB colours of points, uint8 [K,3].

    The rows of the legend are labels with their colours, ``none`` for words alone. Continuous colours have a scale
    instead: uint8 [S,3] from lowest to highest, with the labels of its low end, middle and high end. `named` are the
    rows of points to name in a picture.
    """

    colours: UInt8
    legend: Legend = ()
    scale: UInt8 | None = None
    words: tuple[str, str, str] = ("", "", "")
    named: Mapping[str, Indices] = field(default_factory=dict)


@dataclass(frozen=True)
class Purified:
    """A model with K >= 1 rows, Gaussians or anchors, and the decision about each.

    `labels` and `weights` are [K]; so is `hidden`, the weights in views of the message, if there is one. Then `message`
    is `Key.gaussians` for the public model, and `extracted` a picture [H,W,3] of what the key extracts from a model.
    Rows are pruned by the factors `tau_c` and `tau_n`.
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
    def rows(self) -> str:
        """What a row is: Gaussians or anchors."""
        return "anchors" if self.public.model.has_anchors else "Gaussians"

    @cached_property
    def ranks(self) -> Float64:
        """The rank [K] of the weight that decides about each row, times its factor: GSPure prunes low ranks.

        The weight is that of `gspure.method.pruning.deciding_weights`, the factor `tau_c` in clusters and `tau_n`
        outside. The rank is the share of rows with a lower product, from 0 to 1; equal ones share their mean rank.
        """
        factors = np.where(self.labels != NOISE_LABEL, self.tau_c, self.tau_n)
        deciding = deciding_weights(self.labels, self.weights) * factors
        _, tie, count = np.unique(deciding, return_inverse=True, return_counts=True)
        first = np.cumsum(count) - count
        return np.asarray((first + (count - 1) / 2)[tie] / max(len(deciding) - 1, 1))

    @cached_property
    def colourings(self) -> dict[str, Colouring]:
        """The colours of the rows by what they show; the message only if it is known."""
        colourings = {
            "cluster": by_cluster(self.labels, self.pruned),
            "rank": by_rank(self.ranks),
            "pruned": by_decision(self.pruned),
        }
        return colourings if self.hidden is None else {**colourings, "message": by_share(self.weights, self.hidden)}


def by_cluster(labels: Int32, pruned: Bools) -> Colouring:
    """Colour rows by their cluster, pale if the cluster is kept; noise is light grey.

    The largest clusters have a number and a colour each; smaller ones use these colours again. `pruned` [K] is true
    for all of a cluster or for none of it.
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
    """Return rows of pruned and of kept clusters, from the largest, and of noise."""
    hues = len(style.CLUSTERS)
    rows: list[tuple[tuple[str, str], ...]] = []
    for fate, share, chosen in (("pruned", 0.0, ~kept), ("kept (pale)", _PALE, kept)):
        entries = [(f"{fate}:", "none")] * bool(chosen.any())
        largest = np.flatnonzero(chosen[:hues])
        entries += [(f"{i + 1}: {percent(sizes[i] / total)}", style.tint(style.CLUSTERS[i], share)) for i in largest]
        if rest := np.count_nonzero(chosen[hues:]):
            entries.append((f"{rest} smaller: {percent(sizes[hues:][chosen[hues:]].sum() / total)}", "none"))
        rows += [tuple(entries[i : i + _LEGEND]) for i in range(0, len(entries), _LEGEND)]
    return (*rows, ((f"noise: {percent((total - sizes.sum()) / total)}", _NOISE),))


def by_decision(pruned: Bools) -> Colouring:
    """Colour rows by the prune mask [K]."""
    share = float(pruned.mean())
    row = ((f"kept: {percent(1 - share)}", style.KEPT), (f"pruned: {percent(share)}", style.PRUNED))
    return Colouring(np.array([style.rgb(colour) for _, colour in row])[pruned.astype(np.intp)], (row,))


def by_reason(masks: Mapping[str, Bools]) -> Colouring:
    """Colour rows by the last of these masks [K] in which they are, with its name; the others are pale."""
    hues = (style.PRUNED, style.MESSAGE, style.SCENE)
    entry = np.zeros(len(next(iter(masks.values()))), np.intp)
    for i, mask in enumerate(masks.values(), 1):
        entry[mask] = i
    legend = [(f"{name}: {percent(mask.mean())}", hue) for (name, mask), hue in zip(masks.items(), hues, strict=False)]
    palette = np.array([style.rgb(colour) for colour in (_NOISE, *hues)])
    return Colouring(palette[entry], tuple((row,) for row in legend))


def by_rank(rank: Float64) -> Colouring:
    """Colour rows by their `ranks` [K]."""
    return _on_scale(rank, ("lowest", "rank", "highest"), _colour_map)


def by_share(weights: Float32, hidden: Float32) -> Colouring:
    """Colour rows by the message's share of their weight, h / (h + ω); grey if both are 0.

    `hidden` holds the weight h in views of the message (`gspure.schemes.hidden_weight.hidden_weights`), `weights` ω in
    views of the scene.
    """
    total = weights.astype(np.float64) + hidden
    share = np.divide(hidden, total, where=total > 0, out=np.full(len(total), np.nan))
    return _on_scale(share, ("0%", "message's share", "100%"), _between)


def _on_scale(place: Float64, words: tuple[str, str, str], colour: Callable[[Float64], UInt8]) -> Colouring:
    """Colour places [K] from 0 to 1; NaN is grey."""
    known = colour(np.nan_to_num(place))
    colours = np.where(np.isnan(place)[:, None], style.rgb(style.NOISE), known)
    return Colouring(colours, scale=colour(np.linspace(0, 1, _STEPS)), words=words)


def _colour_map(values: Float64) -> UInt8:
    from matplotlib import colormaps

    colours: UInt8 = colormaps[style.RANKS](values, bytes=True)[:, :3]
    return colours


def _between(share: Float64) -> UInt8:
    """Return colours [S,3] between those of the scene (0) and of the message (1)."""
    ends = [style.rgb(colour).astype(np.float64) for colour in (style.KEPT, style.MESSAGE)]
    return np.rint(ends[0] + share[:, None] * (ends[1] - ends[0])).astype(np.uint8)
