"""Point clouds of figures: points, their colours and the legend.

Three clouds show the method, as in the paper: clusters, ranks of the weights that decide about pruning, and the prune
mask. One shows the message: its share of each Gaussian's weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gspure.constants import NOISE_LABEL, SH_DC, TAU_C, TAU_N
from gspure.figures import style
from gspure.files import Bools, Float32, Float64, Indices, Int32, UInt8
from gspure.method.pruning import deciding_weights, prune_mask
from gspure.progress import percent
from gspure.public_model import PublicModel

_STEPS = 256  # of a scale

_PALE = 0.55  # share of white in the colours of kept clusters
_LEGEND = 7  # entries in a row

Legend = tuple[tuple[tuple[str, str], ...], ...]


@dataclass(frozen=True)
class Scale:
    """A colour scale: uint8 [S,3] from lowest to highest, with labels of the low end, the middle and the high end."""

    colours: UInt8
    words: tuple[str, str, str]


@dataclass(frozen=True)
class Cloud:
    """A coloured point cloud: world coordinates [N,3] and sRGB colours [N,3].

    The rows of the legend are labels with their colours, ``none`` for words alone; it is empty if there is a `scale`
    of continuous colours.
    """

    points: Float32
    colours: UInt8
    legend: Legend = ()
    scale: Scale | None = None

    def __len__(self) -> int:
        return len(self.points)

    def subset(self, rows: Indices | Bools) -> Cloud:
        """Return the points in `rows` (indices or a mask [N]), with the legend of all."""
        return replace(self, points=self.points[rows], colours=self.colours[rows])


def colour_cloud(means: Float32, sh_dc: Float32) -> Cloud:
    """Colour each Gaussian as it looks on average over all directions: by its coefficients of degree 0, [K,3]."""
    return Cloud(means, np.rint(255 * np.clip(0.5 + SH_DC * sh_dc, 0, 1)).astype(np.uint8))


def weight_cloud(means: Float32, weights: Float32) -> Cloud:
    """Colour each Gaussian by its weight [K], on a logarithmic scale; grey if no view shows it."""
    positive = weights > 0
    decades = np.log10(weights, where=positive, out=np.zeros(len(weights)))
    low, high = np.quantile(decades[positive], (0.02, 1)) if positive.any() else (0.0, 0.0)
    place = np.clip((decades - low) / ((high - low) or 1), 0, 1)
    colours = np.where(positive[:, None], _colour_map(place), style.rgb(style.NOISE)).astype(np.uint8)
    ends = [np.format_float_positional(10**end, 1, fractional=False, trim="-") for end in (low, high)]
    scale = Scale(_colour_map(np.linspace(0, 1, _STEPS)), (f"{ends[0]} or less", "weight (grey: 0)", ends[1]))
    return Cloud(means, colours, scale=scale)


def cluster_cloud(means: Float32, labels: Int32, pruned: Bools) -> Cloud:
    """Colour each Gaussian by its cluster, pale if the cluster is kept; noise is grey.

    The largest clusters have a colour each, which smaller ones use again. `pruned` [K] is true for all of a cluster or
    for none of it.
    """
    hues = len(style.CLUSTERS)
    pale = [style.tint(colour, _PALE) for colour in style.CLUSTERS]
    palette = np.array([style.rgb(colour) for colour in (*style.CLUSTERS, *pale, style.NOISE)])
    clustered = labels != NOISE_LABEL
    sizes = np.bincount(labels[clustered])
    kept = np.bincount(labels[clustered & pruned], minlength=len(sizes)) == 0
    entry = np.empty(len(sizes) + 1, np.intp)  # of the palette, by label; the noise label -1 is the last one
    largest_first = np.argsort(-sizes, kind="stable")
    entry[largest_first] = np.arange(len(sizes)) % hues + hues * kept[largest_first]
    entry[NOISE_LABEL] = -1
    legend = _cluster_legend(sizes[largest_first], kept[largest_first], max(len(labels), 1))
    return Cloud(means, palette[entry[labels]], legend)


def _cluster_legend(sizes: Indices, kept: Bools, total: int) -> Legend:
    """Return rows of pruned and of kept clusters, from the largest, and of noise; words have no colour."""
    hues = len(style.CLUSTERS)
    rows: list[tuple[tuple[str, str], ...]] = []
    for fate, share, chosen in (("pruned", 0.0, ~kept), ("kept (pale)", _PALE, kept)):
        entries = [(f"{fate}:", "none")] * bool(chosen.any())
        largest = np.flatnonzero(chosen[:hues])
        entries += [(percent(sizes[i] / total), style.tint(style.CLUSTERS[i], share)) for i in largest]
        if rest := np.count_nonzero(chosen[hues:]):
            entries.append((f"{rest} smaller: {percent(sizes[hues:][chosen[hues:]].sum() / total)}", "none"))
        rows += [tuple(entries[i : i + _LEGEND]) for i in range(0, len(entries), _LEGEND)]
    return (*rows, ((f"noise: {percent((total - sizes.sum()) / total)}", style.NOISE),))


def ranks(labels: Int32, weights: Float32, tau_c: float = 1.0, tau_n: float = 1.0) -> Float64:
    """Return the rank [K] of the weight that decides about each Gaussian, times its factor: GSPure prunes low ranks.

    The weight is that of `gspure.method.pruning.deciding_weights`, the factor `tau_c` in clusters and `tau_n` outside.
    The rank is the share of Gaussians with a lower product, from 0 to 1; equal ones share their mean rank.
    """
    deciding = deciding_weights(labels, weights) * np.where(labels != NOISE_LABEL, tau_c, tau_n)
    _, tie, count = np.unique(deciding, return_inverse=True, return_counts=True)
    first = np.cumsum(count) - count
    return np.asarray((first + (count - 1) / 2)[tie] / max(len(labels) - 1, 1))


def rank_cloud(means: Float32, rank: Float64) -> Cloud:
    """Colour each Gaussian by its rank."""
    scale = Scale(_colour_map(np.linspace(0, 1, _STEPS)), ("lowest", "rank", "highest"))
    return Cloud(means, _colour_map(rank), scale=scale)


def _colour_map(values: Float64) -> UInt8:
    from matplotlib import colormaps

    colours: UInt8 = colormaps[style.RANKS](values, bytes=True)[:, :3]
    return colours


def kept_cloud(means: Float32, pruned: Bools) -> Cloud:
    """Colour each Gaussian by the prune mask (bool [K])."""
    colours = np.array([style.rgb(style.KEPT), style.rgb(style.PRUNED)])[pruned.astype(np.intp)]
    share = float(pruned.mean()) if len(pruned) else 0.0
    row = ((f"kept: {percent(1 - share)}", style.KEPT), (f"pruned: {percent(share)}", style.PRUNED))
    return Cloud(means, colours, (row,))


def share_cloud(means: Float32, weights: Float32, hidden: Float32) -> Cloud:
    """Colour each Gaussian by the message's share of its weight, h / (h + ω); grey if both are 0.

    `hidden` holds its weight h in views of the message (`gspure.schemes.hidden_weight.hidden_weights`), `weights` ω in
    views of the scene.
    """
    total = weights.astype(np.float64) + hidden
    share = np.divide(hidden, total, where=total > 0, out=np.full(len(total), np.nan))
    colours = np.where(total[:, None] > 0, _between(np.nan_to_num(share)), style.rgb(style.NOISE)).astype(np.uint8)
    scale = Scale(_between(np.linspace(0, 1, _STEPS)), ("0%", "message's share", "100%"))
    return Cloud(means, colours, scale=scale)


def _between(share: Float64) -> UInt8:
    """Return colours [S,3] between those of the scene (0) and of the message (1)."""
    ends = [style.rgb(colour).astype(np.float64) for colour in (style.KEPT, style.MESSAGE)]
    return np.rint(ends[0] + share[:, None] * (ends[1] - ends[0])).astype(np.uint8)


@dataclass(frozen=True)
class Purified:
    """A model with K >= 1 rows, Gaussians or anchors, and the decision about each.

    `labels` and `weights` are [K]; so is `hidden`, the weights in views of the message, if there is one. Rows are
    pruned by the factors `tau_c` and `tau_n`.
    """

    public: PublicModel
    labels: Int32
    weights: Float32
    hidden: Float32 | None = None
    tau_c: float = TAU_C
    tau_n: float = TAU_N

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
        """The ranks [K] by which GSPure prunes."""
        return ranks(self.labels, self.weights, self.tau_c, self.tau_n)
