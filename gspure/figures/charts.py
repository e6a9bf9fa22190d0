"""Charts: the weights with their thresholds, and PSNR against the pruning factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gspure.arrays import Bools, Float64
from gspure.evaluation.outcomes import Outcome, extractions, mean_of
from gspure.figures import style
from gspure.figures.clouds import Purified
from gspure.method.pruning import mean_weight
from gspure.metrics.names import extraction_name
from gspure.metrics.statistics import Interval
from gspure.metrics.targets import MESSAGE, SCENE, is_picture
from gspure.text import percent

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

_COLOURS: Final = {SCENE: style.SCENE, MESSAGE: style.MESSAGE}
_BINS: Final = 72  # of the histogram
_DECADES: Final = 9  # most decades on the axis, below the largest weight
_LETTERS: Final = 18  # letters in a line of a panel's label
_FACTORS: Final = (r"noise pruning factor $\tau_n$", r"cluster pruning factor $\tau_c$")
_TAIL: Final = 5e-4  # share of the weights below the axis, which are drawn in its lowest bin


def draw_weights(path: Path, model: Purified) -> str:
    """Draw a histogram of the weights as PNG and SVG, and return the caption.

    It has a separate bar for zero and lines at the thresholds. The share of the pruned rows in every bar is coloured.
    """
    zero = model.weights == 0
    decades = np.log10(model.weights, where=~zero, out=np.zeros(len(model.weights)))
    low, high = _decade_range(decades, zero)
    edges, step = np.linspace(low, high, _BINS + 1, retstep=True)
    with style.page(path, style.COLUMN, 2.0, vector=True) as figure:
        axes = figure.add_subplot()
        bars = _draw_bars(axes, model, np.clip(decades, low, high), edges, step)
        lines = _draw_thresholds(axes, model)
        every = 2 if high - low > 6 else 1  # decades between two ticks
        powers = np.arange(np.ceil(low), high)[::every]
        ticks = {float(power): f"$10^{{{int(power)}}}$" for power in powers}
        if zero.any():
            ticks[low - 3 * step] = "0"
        axes.set_xticks(list(ticks), list(ticks.values()), parse_math=True)
        left = low - (5 if zero.any() else 1) * step
        axes.set(xlim=(left, high + step), xlabel="weight ω (mean over views)", ylabel=f"{model.row_kind} (%)")
        for text in figure.legend(handles=[*bars, *lines], loc="outside upper center", ncols=5).get_texts():
            text.set_parse_math(True)
    return (
        f"Histogram of the weights ω, with mean ω̄. {percent(float(zero.mean()))} are 0: these {model.row_kind} "
        f"contribute to no pixel. GSPure prunes clusters if their mean weight is below ω̄/{model.tau_c:g}, and "
        f"{model.row_kind} in no cluster if their weight is below ω̄/{model.tau_n:g}."
    )


def _decade_range(decades: Float64, zero: Bools) -> tuple[float, float]:
    """Return the ends of the axis for decimal logarithms [K] of the weights, those of weights of 0 left out."""
    if zero.all():
        return -3.0, 0.0
    high = float(decades.max(where=~zero, initial=-np.inf)) + 0.05
    low = float(np.quantile(decades[~zero], _TAIL)) - 0.05
    return max(low, high - _DECADES), high


def _draw_bars(axes: Axes, model: Purified, decades: Float64, edges: Float64, step: float) -> list[Artist]:
    """Draw bars with the pruned rows on top of the kept ones, and return the legend's entries for both.

    `decades` [K] are clipped to the bins with these `edges`, which are `step` apart. The bar of zero is to their left.
    """
    zero = model.weights == 0
    row_share = 1 / len(model.weights)
    entries: list[Artist] = []
    below = np.zeros(_BINS)
    below_zero = 0.0
    for name, colour, mask in (("kept", style.KEPT, ~model.pruned), ("pruned", style.PRUNED, model.pruned)):
        share = 100 * row_share * np.histogram(decades[mask & ~zero], edges)[0]
        share_zero = 100 * row_share * np.count_nonzero(mask & zero)
        label = f"{name}: {percent(np.count_nonzero(mask) * row_share)}"
        entries.append(axes.stairs(below + share, edges, baseline=below, fill=True, color=colour, label=label))
        axes.bar(edges[0] - 3 * step, share_zero, 2 * step, below_zero, color=colour)
        below = below + share
        below_zero += share_zero
    return entries


def _draw_thresholds(axes: Axes, model: Purified) -> list[Artist]:
    """Draw lines at the mean weight and at the thresholds, and return them."""
    mean = mean_weight(model.weights)
    if mean == 0:
        return []
    lines = [(r"mean $\bar\omega$", mean, "-")]
    if model.tau_c == model.tau_n:
        lines.append((rf"$\bar\omega/{model.tau_c:g}$", mean / model.tau_c, "--"))
    else:
        lines.append((r"$\bar\omega/\tau_c$", mean / model.tau_c, "--"))
        lines.append((r"$\bar\omega/\tau_n$", mean / model.tau_n, ":"))
    look: dict[str, Any] = {"color": style.INK, "linewidth": 0.8}
    return [axes.axvline(float(np.log10(at)), linestyle=dash, label=label, **look) for label, at, dash in lines]


def draw_factors(path: Path, outcomes: Sequence[Outcome], points: Mapping[str, tuple[float, float]]) -> str | None:
    """Draw the scene and the message of a condition against the pruning factors as PNG and SVG; return the caption.

    `points` are (tau_n, tau_c) by variant, the method's first: a ring marks it. Targets unknown at any point are left
    out. None if the method's point or every other one is unknown.
    """
    extraction = next(iter(extractions(outcomes)), MESSAGE)
    by_factors = {factors: _means(outcomes, name, extraction) for name, factors in points.items()}
    by_factors = {factors: levels for factors, levels in by_factors.items() if SCENE in levels}
    method = next(iter(points.values()), (0.0, 0.0))
    if method not in by_factors or len(by_factors) < 2:
        return None
    labels = {SCENE: "scene PSNR (dB)", MESSAGE: _message_label(extraction, outcomes)}
    targets = [target for target in labels if all(target in levels for levels in by_factors.values())]
    with style.page(path, style.COLUMN, 0.45 + 1.05 * len(targets), vector=True) as figure:
        grid = figure.subplots(len(targets), 2, sharex="col", sharey="row", squeeze=False)
        for target, row in zip(targets, grid, strict=True):
            levels = {factors: known[target] for factors, known in by_factors.items()}
            for axis, axes in enumerate(row):
                fixed = 1 - axis  # the factor that is the method's
                curve = {at[axis]: level for at, level in levels.items() if at[fixed] == method[fixed]}
                _draw_curve(axes, dict(sorted(curve.items())), method[axis], _COLOURS[target])
            row[0].set_ylabel(fill(labels[target], _LETTERS))
        for axes, label in zip(grid[-1], _FACTORS, strict=True):
            axes.set_xlabel(label, parse_math=True)
    scenes = max(mean.scenes for levels in by_factors.values() for mean in levels.values())
    noun = "scene" if scenes == 1 else "scenes"
    if scenes == 1:
        band = ""
    elif scenes <= 5:
        band = " and their range"
    else:
        band = " and 95% interval"
    return (
        f"PSNR after GSPure with other pruning factors: one varies, the other is τ_n = {method[0]:g} or τ_c = "
        f"{method[1]:g} (ring: both). Mean over {scenes} {noun}{band}."
    )


def _means(outcomes: Sequence[Outcome], variant: str, extraction: str) -> dict[str, Interval]:
    """Return the means of the levels of scene and message after a variant, where they are known."""
    alike = [o for o in outcomes if o.variant == variant]
    levels = {
        SCENE: mean_of(alike, lambda o: o.level(SCENE)),
        MESSAGE: mean_of(alike, lambda o: o.level(extraction)),
    }
    return {target: level for target, level in levels.items() if level}


def _message_label(extraction: str, outcomes: Sequence[Outcome]) -> str:
    """Return the name and the unit of what an extraction returns."""
    if is_picture(extraction):
        unit = "PSNR (dB)"
    elif any(o.detections[extraction].bits for o in outcomes if extraction in o.detections):
        unit = "correct bits (%)"
    else:
        unit = "score"
    return f"{extraction_name(extraction)} {unit}"


def _draw_curve(axes: Axes, means: Mapping[float, Interval], ringed: float, colour: str) -> None:
    """Draw means with their intervals by factor."""
    factors = [*means]
    level, low, high = np.array([mean[:3] for mean in means.values()]).T
    axes.fill_between(factors, low, high, color=style.tint(colour, 0.82), linewidth=0)
    axes.plot(factors, level, "o-", color=colour, linewidth=1.1, markersize=2.6)
    ring: dict[str, Any] = {"markersize": 6, "markerfacecolor": "none", "markeredgecolor": style.INK, "mew": 0.7}
    axes.plot(ringed, means[ringed].mean, "o", **ring)
    axes.set_xticks(factors, [f"{factor:g}" for factor in factors])
    axes.grid(axis="y", color=style.tint(style.FAINT, 0.75), linewidth=0.4)
    axes.set_axisbelow(True)
