"""Charts: the weights with their thresholds, and PSNR against the pruning factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.summary import summarize
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
_BINS: Final = 72
_DECADES: Final = 9  # at most, below the largest weight
_LETTERS: Final = 18  # in a line beside a panel
_FACTORS: Final = (r"noise pruning factor $\tau_n$", r"cluster pruning factor $\tau_c$")
_TAIL: Final = 5e-4  # share of the weights below the axis, which are drawn in its lowest bin


def draw_weights(path: Path, model: Purified) -> str:
    """Draw a histogram of the weights as PNG and SVG, and return the caption.

    It has a separate bar for zero and lines at the thresholds. The share of the pruned rows in every bar is coloured.
    """
    weights, zero = model.weights, model.weights == 0
    decades = np.log10(weights, where=~zero, out=np.zeros(len(weights)))
    low, high = -3.0, 0.0
    if not zero.all():
        high = float(decades.max(where=~zero, initial=-np.inf)) + 0.05
        low = max(float(np.quantile(decades[~zero], _TAIL)) - 0.05, high - _DECADES)
    edges, step = np.linspace(low, high, _BINS + 1, retstep=True)
    powers = np.arange(np.ceil(low), high)[:: 1 + int(high - low > 6)]
    ticks = {float(power): f"$10^{{{int(power)}}}$" for power in powers}
    if zero.any():
        ticks[low - 3 * step] = "0"

    with style.page(path, style.COLUMN, 2.0, vector=True) as figure:
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
            marks = [(r"mean $\bar\omega$", mean, "-"), (r"$\bar\omega/\tau_c$", mean / model.tau_c, "--")]
            marks.append((r"$\bar\omega/\tau_n$", mean / model.tau_n, ":"))
            if model.tau_c == model.tau_n:
                marks[1:] = [(rf"$\bar\omega/{model.tau_c:g}$", mean / model.tau_c, "--")]
            look: dict[str, Any] = {"color": style.INK, "linewidth": 0.8}
            keys += [
                axes.axvline(float(np.log10(at)), linestyle=dash, label=label, **look) for label, at, dash in marks
            ]
        axes.set_xticks(list(ticks), list(ticks.values()), parse_math=True)
        left = low - (5 if zero.any() else 1) * step
        axes.set(xlim=(left, high + step), xlabel="weight ω (mean over views)", ylabel=f"{model.rows} (%)")
        for text in figure.legend(handles=keys, loc="outside upper center", ncols=5).get_texts():
            text.set_parse_math(True)
    return (
        f"Histogram of the weights ω, with mean ω̄. {percent(float(zero.mean()))} are 0: these {model.rows} contribute "
        f"to no pixel. GSPure prunes clusters if their mean weight is below ω̄/{model.tau_c:g}, and {model.rows} in no "
        f"cluster if their weight is below ω̄/{model.tau_n:g}."
    )


def draw_factors(path: Path, outcomes: Sequence[Outcome], points: Mapping[str, tuple[float, float]]) -> str | None:
    """Draw scene and message of a condition against the pruning factors as PNG and SVG, and return the caption.

    `points` are tau_n and tau_c of variants, those of the method, which a ring marks, first. A target that some point
    lacks is left out. None if too few of them are known.
    """
    means = {row.variant: row for row in reversed(summarize(outcomes))}  # the first extraction
    known = {factors: means[name] for name, factors in points.items() if name in means and means[name].scene}
    method = next(iter(points.values()), (0.0, 0.0))
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
