"""Charts: the distribution of weights with its thresholds, and what each variant did to scene and message."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.evaluation.outcomes import MESSAGE, SCENE, Outcome
from gspure.figures import style
from gspure.pruning import mean_weight

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS: Final = {SCENE: style.SCENE, MESSAGE: style.MESSAGE}
_BINS: Final = 72
_DECADES: Final = 9  # below the largest weight; smaller ones are drawn in the lowest bin


def write_weight_histogram(
    path: Path, weights: NDArray[np.float32], pruned: NDArray[np.bool_], tau_c: float, tau_n: float
) -> None:
    """Write a histogram of the weights, in which weights of zero have a bar of their own.

    Parameters
    ----------
    path : Path
        PNG to write.
    weights : float32 array [K]
        View-accumulated weights.
    pruned : bool array [K]
        True where a Gaussian is pruned; its share of every bar is coloured.
    tau_c, tau_n : float
        Pruning factors: the thresholds are mean / tau.

    """
    seen = weights > 0
    decades = np.log10(weights[seen], dtype=np.float64)
    high = float(decades.max(initial=-3.0)) + 0.05
    low = max(float(decades.min(initial=high - 1)), high - _DECADES)
    edges = np.linspace(low, high, _BINS + 1)
    step = edges[1] - edges[0]

    with style.page(path, style.COLUMN, 2.0) as figure:
        axes = figure.add_subplot()
        bottom = np.zeros(_BINS + 1)
        for label, colour, chosen in (("kept", style.KEPT, ~pruned), ("pruned", style.PRUNED, pruned)):
            counts = np.histogram(np.clip(decades[chosen[seen]], low, high), edges)[0]
            share = 100 * np.append(counts, np.count_nonzero(chosen & ~seen)) / max(len(weights), 1)
            centres = np.append(edges[:-1] + step / 2, low - 3 * step)
            name = f"{label}: {chosen.mean() if len(chosen) else 0:.1%}"
            axes.bar(centres, share, np.append(np.full(_BINS, step), 2 * step), bottom, color=colour, label=name)
            bottom += share
        if mean := mean_weight(weights):
            _mark_thresholds(axes, mean, tau_c, tau_n)
        powers = np.arange(np.ceil(low), high)[:: 1 + int(high - low > 6)]
        axes.set_xticks([low - 3 * step, *powers], ["0", *(f"$10^{{{power:.0f}}}$" for power in powers)])
        axes.set_xlim(low - 5 * step, high + step)
        axes.set_xlabel("view-accumulated weight ω")
        axes.set_ylabel("Gaussians (%)")
        figure.legend(loc="outside upper center", ncols=5)


def _mark_thresholds(axes: Axes, mean: float, tau_c: float, tau_n: float) -> None:
    """Mark the mean weight and the thresholds below which clusters and noise points go."""
    marks = [(r"mean $\bar\omega$", mean, "-")]
    if tau_c == tau_n:
        marks.append((rf"$\bar\omega/{tau_c:g}$", mean / tau_c, "--"))
    else:
        marks.append((rf"$\bar\omega/\tau_c$, $\tau_c={tau_c:g}$", mean / tau_c, "--"))
        marks.append((rf"$\bar\omega/\tau_n$, $\tau_n={tau_n:g}$", mean / tau_n, ":"))
    for label, value, dashes in marks:
        axes.axvline(np.log10(value), color=style.INK, linestyle=dashes, linewidth=0.8, label=label)


def write_outcomes(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Write scene and message PSNR of every variant of one model as bars, with the Score beside them, as a PNG."""
    shown = [o for o in outcomes if o.targets.keys() & {SCENE, MESSAGE}]
    targets = [t for t in (SCENE, MESSAGE) if any(t in o.targets for o in shown)]
    thickness = 0.72 / len(targets) if targets else 0
    rows = np.arange(len(shown))
    with style.page(path, style.COLUMN, 0.6 + 0.27 * len(shown)) as figure:
        axes = figure.add_subplot()
        for i, target in enumerate(targets):
            values = np.array([o.targets[target].psnr if target in o.targets else np.nan for o in shown])
            y = rows + (i - (len(targets) - 1) / 2) * thickness
            bars = axes.barh(
                y, np.where(np.isfinite(values), values, 0), thickness, label=target, color=_COLOURS[target]
            )
            axes.bar_label(bars, [_decibels(value) for value in values], padding=1.5, fontsize=5.5)
        beside: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "va": "center", "ha": "right"}
        if any(np.isfinite(o.score) for o in shown):
            axes.text(1.14, -0.9, "Score", **beside)
        for row, outcome in zip(rows, shown, strict=True):
            axes.text(1.14, float(row), _signed(outcome.score), **beside)
        axes.set_yticks(rows, [o.variant.replace("_", " ") for o in shown])
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.set_ylim(len(shown) - 0.4, -0.6)
        axes.set_xlim(0, axes.get_xlim()[1] * 1.08)
        axes.set_xlabel("PSNR (dB)")
        figure.legend(loc="outside upper center", ncols=2)


def _decibels(value: float) -> str:
    return "" if np.isnan(value) else "identical" if np.isinf(value) else f"{value:.1f}"


def _signed(score: float) -> str:
    return "" if np.isnan(score) else f"{score:+.2f}".replace("-", "\N{MINUS SIGN}")
