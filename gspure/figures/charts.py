"""Charts: the weights with their thresholds, the PSNR of all variants, and PSNR against the pruning factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gspure.evaluation.intervals import Interval
from gspure.evaluation.matched import reached_names
from gspure.evaluation.names import extraction_name
from gspure.evaluation.outcomes import MESSAGE, SCENE, Outcome, is_picture
from gspure.evaluation.summary import summarize
from gspure.figures import style
from gspure.figures.clouds import Purified
from gspure.files import Float64
from gspure.method.pruning import mean_weight
from gspure.progress import UNKNOWN, decimal, percent, signed

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

_COLOURS: Final = {SCENE: style.SCENE, MESSAGE: style.MESSAGE}
_BINS: Final = 72
_DECADES: Final = 9  # at most, below the largest weight
_LETTERS: Final = 18  # in a line beside a panel
_FACTORS: Final = (r"noise pruning factor $\tau_n$", r"cluster pruning factor $\tau_c$")
_TAIL: Final = 5e-4  # share of the weights below the axis, which are drawn in its lowest bin


def write_weight_histogram(path: Path, model: Purified, *, vector: bool = True) -> None:
    """Write a histogram of the weights, with a separate bar for zero and thresholds at mean / tau.

    It is a PNG and, with `vector`, also an SVG. The share of the pruned rows in every bar is coloured.
    """
    weights, zero = model.weights, model.weights == 0
    decades = np.log10(weights, where=~zero, out=np.zeros(len(weights)))
    low, high = _range(decades[~zero])
    edges, step = np.linspace(low, high, _BINS + 1, retstep=True)
    powers = np.arange(np.ceil(low), high)[:: 1 + int(high - low > 6)]
    ticks = {float(power): f"$10^{{{int(power)}}}$" for power in powers}
    if zero.any():
        ticks[low - 3 * step] = "0"

    with style.page(path, style.COLUMN, 2.0, vector=vector) as figure:
        axes = figure.add_subplot()
        keys: list[Artist] = []
        below, below_zero = np.zeros(_BINS), 0.0
        for name, colour, chosen in (("kept", style.KEPT, ~model.pruned), ("pruned", style.PRUNED, model.pruned)):
            each = 1 / len(weights)
            share = 100 * each * np.histogram(np.clip(decades[chosen & ~zero], low, high), edges)[0]
            share_zero = 100 * each * np.count_nonzero(chosen & zero)
            label = f"{name}: {percent(np.count_nonzero(chosen) * each)}"
            keys.append(axes.stairs(below + share, edges, baseline=below, fill=True, color=colour, label=label))
            axes.bar(low - 3 * step, share_zero, 2 * step, below_zero, color=colour)
            below, below_zero = below + share, below_zero + share_zero
        if mean := mean_weight(weights):
            keys += _mark_thresholds(axes, mean, model.tau_c, model.tau_n)
        axes.set_xticks(list(ticks), list(ticks.values()), parse_math=True)
        axes.set_xlim(low - (5 if zero.any() else 1) * step, high + step)
        axes.set_xlabel("weight ω (mean over views)")
        axes.set_ylabel(f"{model.rows} (%)")
        for text in figure.legend(handles=keys, loc="outside upper center", ncols=5).get_texts():
            text.set_parse_math(True)


def _range(decades: Float64) -> tuple[float, float]:
    """Return the lowest and highest decade of the axis, without a share of `_TAIL` of the smallest weights."""
    if not len(decades):
        return -3.0, 0.0
    high = float(decades.max()) + 0.05
    return max(float(np.quantile(decades, _TAIL)) - 0.05, high - _DECADES), high


def _mark_thresholds(axes: Axes, mean: float, tau_c: float, tau_n: float) -> list[Artist]:
    """Mark the mean weight and the thresholds of clusters and noise points; return the lines."""
    marks = [(r"mean $\bar\omega$", mean, "-")]
    if tau_c == tau_n:
        marks.append((rf"$\bar\omega/{tau_c:g}$", mean / tau_c, "--"))
    else:
        marks.append((r"$\bar\omega/\tau_c$", mean / tau_c, "--"))
        marks.append((r"$\bar\omega/\tau_n$", mean / tau_n, ":"))
    look: dict[str, Any] = {"color": style.INK, "linewidth": 0.8}
    return [axes.axvline(float(np.log10(value)), linestyle=dash, label=label, **look) for label, value, dash in marks]


def draw_outcomes(path: Path, outcomes: Sequence[Outcome]) -> str:
    """Draw scene and message PSNR of every variant of one model as bars, as PNG and SVG, and return the caption.

    Beside them is the Score or, of a model without a message, the share of the rows that the attack removed.
    """
    shown = [o for o in outcomes if o.targets.keys() & {SCENE, MESSAGE}]
    targets = [t for t in (SCENE, MESSAGE) if any(t in o.targets for o in shown)]
    thickness = 0.72 / len(targets) if targets else 0
    rows, names = np.arange(len(shown)), reached_names(shown)
    if MESSAGE in targets:
        title, note, beside = "Score", "its Score, dB", [signed(o.score).strip(UNKNOWN) for o in shown]
    else:
        title, note = "rows removed", "the share of the rows that it removed"
        beside = [percent(o.pruned_share).strip(UNKNOWN) for o in shown]
    truth = all(o.against_truth for o in shown)
    with style.page(path, style.COLUMN, 0.6 + 0.27 * len(shown), vector=True) as figure:
        axes = figure.add_subplot()
        for i, target in enumerate(targets):
            values = np.array([o.targets[target].psnr if target in o.targets else np.nan for o in shown])
            widths, y = np.where(np.isfinite(values), values, 0), rows + (i - (len(targets) - 1) / 2) * thickness
            bars = axes.barh(y, widths, thickness, label=target, color=_COLOURS[target])
            axes.bar_label(bars, [_decibels(value) for value in values], padding=1.5, fontsize=5.5)
        place: dict[str, Any] = {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
        for row, text in [(-0.9, title * any(beside)), *enumerate(beside)]:
            axes.annotate(text, (1, row), (30, 0), va="center", ha="right", **place)
        axes.set_yticks(rows, [names[o.variant] for o in shown])
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.set_ylim(len(shown) - 0.4, -0.6)
        axes.set_xlim(0, axes.get_xlim()[1] * 1.08)
        axes.set_xlabel("PSNR (dB)" if truth else "PSNR against renders before the attack (dB)", x=1, ha="right")
        if len(targets) > 1:
            figure.legend(loc="outside upper center", ncols=2)
    against = "photographs" if truth else "renders of the unattacked model"
    return f"PSNR of every variant against {against}{f', and {note}' * any(beside)}; mean over the views."


def _decibels(value: float) -> str:
    return "" if np.isnan(value) else "identical" if value == np.inf else decimal(value, 1)


Factors = tuple[float, float]
"""The pruning factors tau_n and tau_c."""


def draw_factors(path: Path, outcomes: Sequence[Outcome], points: Mapping[str, Factors]) -> str | None:
    """Draw scene and message of a condition against the pruning factors as PNG and SVG, and return the caption.

    `points` are the factors of variants, those of the method, which a ring marks, first. A target that some point lacks
    is left out. None if too few of them are known.
    """
    means = {row.variant: row for row in reversed(summarize(outcomes))}  # the first extraction
    known = {factors: means[name] for name, factors in points.items() if name in means and means[name].scene}
    method = next(iter(points.values()))
    if method not in known or len(known) < 2:
        return None
    extraction = known[method].extraction
    bits = any(o.detections[extraction].bits for o in outcomes if extraction in o.detections)
    unit = "PSNR (dB)" if is_picture(extraction) else "correct bits (%)" if bits else "score"
    labels = {SCENE: "scene PSNR (dB)", MESSAGE: f"{extraction_name(extraction)} {unit}"}
    targets = [target for target in labels if all(getattr(row, target) for row in known.values())]
    with style.page(path, style.COLUMN, 0.45 + 1.05 * len(targets), vector=True) as figure:
        grid = figure.subplots(len(targets), 2, sharex="col", sharey="row", squeeze=False)
        for target, row in zip(targets, grid, strict=True):
            for axis, axes in enumerate(row):
                others = {at[axis]: getattr(known[at], target) for at in known if at[1 - axis] == method[1 - axis]}
                _draw_curve(axes, dict(sorted(others.items())), method[axis], _COLOURS[target])
            row[0].set_ylabel(fill(labels[target], _LETTERS))
        for axes, label in zip(grid[-1], _FACTORS, strict=True):
            axes.set_xlabel(label, parse_math=True)
    scenes = max(mean.scenes for row in known.values() for mean in (row.scene, row.message) if mean)
    band = " and 95% interval" if scenes > 5 else " and their range" if scenes > 1 else ""
    return (
        f"PSNR after GSPure with other pruning factors: one varies, the other is τ_n = {method[0]:g} or τ_c = "
        f"{method[1]:g} (ring: both). Mean over {scenes} scene{'s' * (scenes != 1)}{band}."
    )


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
