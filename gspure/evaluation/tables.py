"""The tables of all outcomes: a long CSV, and Markdown for reading."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final

from gspure.artifacts import write_text
from gspure.evaluation.comparison import RENDER, TRUTH
from gspure.evaluation.controls import CONTROLS
from gspure.evaluation.outcomes import MESSAGE, REFERENCE, Outcome, ordered

HEADER: Final = (
    *("scheme", "scene", "seed", "variant", "target", "reference", "views", "psnr", "ssim"),
    *("psnr_drop", "ssim_drop", "score", "reached", "pruned_share", "precision", "recall", "failure"),
    *("off_path_psnr", "off_path_ssim", "off_path_psnr_drop", "off_path_score"),
)

FAILED: Final = {"scheme", "scene", "seed", "variant", "failure"}
"""Columns that are known of what failed."""

LEGEND: Final = f"""\
PSNR in dB, mean over views, against `{TRUTH}` (photographs) or `{RENDER}` (what `{REFERENCE}` shows, so that its own
PSNR is infinite). Score = (drop of the message's PSNR) - (drop of the scene's PSNR), relative to
`{REFERENCE}`: higher means that more of the message is gone for less damage to the scene. Rows named
{", ".join(CONTROLS)} are no attacks but what is to be seen where there is no message, or
none that the key opens. † The attack did not reach what this extraction reads. Off path: from views beside the
path of the cameras, on which neither training nor a contribution ever looked. Where the truth is known: precision is
the share of the pruned Gaussians that belong to the message, recall the share of the message that is pruned."""


def write_table(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Write one CSV row per scheme, scene, seed, variant and target; unknown numbers are empty."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADER)
    for o in outcomes:
        if o.failure:
            table.writerow([getattr(o, name) if name in FAILED else "" for name in HEADER])
        for target in ordered(o.targets):
            mean = o.targets[target]
            message = target if target in o.messages else MESSAGE
            drops = (mean.psnr, mean.ssim, o.psnr_drop(target), o.ssim_drop(target), o.score_of(message))
            reached = str(o.reached.get(target, "")).lower()
            shares = map(_plain, (o.pruned_share, o.precision, o.recall))
            numbers = [*map(_plain, drops), reached, *shares, "", *_off_path(o.aside(), target, message)]
            table.writerow([o.scheme, o.scene, o.seed, o.variant, target, mean.reference, o.views[target], *numbers])
    write_text(path, text.getvalue())


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Return one Markdown table per model, and what its columns mean."""
    lines: list[str] = []
    for (scheme, asset), group in groupby(outcomes, key=lambda o: (o.scheme, o.asset)):
        variants = list(group)
        targets = ordered({target for o in variants for target in o.targets})
        columns = [f"{name} {target}" for target in targets for name in ("PSNR", "SSIM")]
        columns += [f"PSNR {target} off path" for target in _beside(variants, targets)]
        messages = [target for target in targets if target.startswith(MESSAGE)] or [MESSAGE]
        scores = ["Score" if target == MESSAGE else f"Score {target}" for target in messages]
        columns = ["variant", "reference", *columns, *scores, "pruned", "precision", "recall"]
        lines += [f"### {scheme} / {asset}", "", _row(columns), _row(["---"] * 2 + ["---:"] * (len(columns) - 2))]
        lines += [_row(_cells(o, targets, _beside(variants, targets), messages)) for o in variants if not o.failure]
        lines += ["", *_failures(variants), ""]
    return "\n".join([*lines, LEGEND, ""])


def _failures(variants: Sequence[Outcome]) -> list[str]:
    """Return a line for every reason, with the variants that failed for it."""
    failed: dict[str, list[str]] = {}
    for o in variants:
        failed.setdefault(o.failure, []).append(o.variant)
    return [f"{', '.join(names)} failed: {reason}" for reason, names in failed.items() if reason]


def _beside(variants: Sequence[Outcome], targets: Sequence[str]) -> list[str]:
    """Return the targets that views beside the path show."""
    return [target for target in targets if any(target in o.off_path for o in variants)]


def _cells(o: Outcome, targets: Sequence[str], beside: Sequence[str], messages: Sequence[str]) -> list[str]:
    cells = [o.variant, TRUTH if o.against_truth else RENDER]
    for target in targets:
        mean = o.targets.get(target)
        missed = "" if o.variant == REFERENCE or o.reached.get(target, True) else " †"
        cells += [_decibels(mean.psnr) + missed, f"{mean.ssim:.4f}"] if mean else ["", ""]
    cells += [_decibels(o.off_path[target].psnr) if target in o.off_path else "" for target in beside]
    shares = [_percent(o.pruned_share), _percent(o.precision), _percent(o.recall)]
    scores = [o.score_of(target) for target in messages]
    return [*cells, *("" if math.isnan(score) else f"{score:.2f}" for score in scores), *shares]


def _off_path(aside: Outcome, target: str, message: str) -> list[str]:
    if target not in aside.targets:
        return [""] * 4
    mean = aside.targets[target]
    return [*map(_plain, (mean.psnr, mean.ssim, aside.psnr_drop(target), aside.score_of(message)))]


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _decibels(psnr: float) -> str:
    return "∞" if math.isinf(psnr) else f"{psnr:.2f}"


def _percent(share: float) -> str:
    return "" if math.isnan(share) else f"{share:.1%}"


def _plain(number: float) -> str:
    return "" if math.isnan(number) else f"{number:.6g}"
