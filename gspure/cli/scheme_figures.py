"""The kinds of ``gspure figures`` that compare the variants of one condition over its scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from gspure.cli.image_figures import Drawn
from gspure.cli.options import require_one_attack, require_variants
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.evaluation.names import display_name, extraction_name

if TYPE_CHECKING:
    from gspure.evaluation.outcomes import Outcome


def _add_sweep(parser: Parser) -> None:
    _add_condition(parser)
    meaning = "a variant and its pruning factors, above 0, first those of the method"
    parser.pairs("--point", "VARIANT=TAU_N,TAU_C", meaning, _factors, required=True)
    parser.set_defaults(draw=_draw_sweep)


def _add_tradeoff(parser: Parser) -> None:
    _add_condition(parser)
    parser.set_defaults(draw=_draw_tradeoff)


def _add_condition(parser: Parser) -> None:
    parser.reads("--table", "CSV", "from `gspure table`")
    parser.text(
        "--condition",
        "SCHEME-PROTOCOL-INITIALIZATION",
        "whose variants to compare; the scheme alone if the table names neither protocol nor initialization",
        required=True,
    )
    parser.writes("--out", "PNG|SVG|PDF", "the figure")


def _factors(text: str) -> tuple[float, float]:
    tau_n, tau_c = map(float, text.split(","))
    if not (0 < tau_n < math.inf and 0 < tau_c < math.inf):
        raise ValueError
    return tau_n, tau_c


def _outcomes(args: Arguments) -> list[Outcome]:
    from gspure.evaluation.outcomes import by_condition
    from gspure.evaluation.results import read_results

    known = {condition.key: outcomes for condition, outcomes in by_condition(read_results(args.table)).items()}
    if args.condition not in known:
        raise InputError(args.table, "condition", expected=args.condition, found=", ".join(known) or "no row")
    return known[args.condition]


def _draw_sweep(args: Arguments) -> Drawn:
    from gspure.evaluation.names import GSPURE
    from gspure.evaluation.summary import summarize
    from gspure.figures.factors import Point, write_factor_curves

    outcomes = _outcomes(args)
    means = {row.variant: row for row in reversed(summarize(outcomes))}  # the first extraction
    require_variants(args.table, args.point, means, f"a variant of {args.condition}")
    require_one_attack(args.table, args.point, GSPURE)
    points = []
    for variant, factors in args.point.items():
        known = {name: value for name in ("scene", "message") if (value := getattr(means[variant], name))}
        points.append(Point(factors, known))
    drawn = [name for name in ("scene", "message") if all(name in point.means for point in points)]
    if not drawn:
        raise InputError(args.table, "PSNR", expected="scene or message, known at every point", found="neither")
    method = points[0].factors
    write_factor_curves(args.out, points, method, _label(outcomes, means[next(iter(args.point))].extraction))
    counts = {
        name: max((i.scenes for i in p.means.values()), default=0) for name, p in zip(args.point, points, strict=True)
    }
    scenes = max(counts.values(), default=0)
    fewer = [f"{display_name(name)} over {count}" for name, count in counts.items() if count < scenes]
    caption = (
        f"{' and '.join(drawn).capitalize()} after GSPure with other pruning factors: one varies, the other is "
        f"τ_n = {method[0]:g} or τ_c = {method[1]:g} (ring: both). Mean over {scenes} scene{'s' * (scenes != 1)}"
    )
    band = " and 95% interval" if scenes > 5 else " and their range" if scenes > 1 else ""
    settings = {"condition": args.condition, "points": {name: list(factors) for name, factors in args.point.items()}}
    caption += f"{band}; {', '.join(fewer)}." if fewer else f"{band}."
    return {args.out: caption}, {"table": args.table}, settings


def _label(outcomes: Sequence[Outcome], extraction: str) -> str:
    """Return the label of an axis for the levels of an extraction."""
    from gspure.evaluation.outcomes import is_picture

    bits = any(o.detections[extraction].bits for o in outcomes if extraction in o.detections)
    unit = "PSNR (dB)" if is_picture(extraction) else "correct bits (%)" if bits else "score"
    return f"{extraction_name(extraction)} {unit}"


def _draw_tradeoff(args: Arguments) -> Drawn:
    from gspure.evaluation.intervals import known_interval
    from gspure.evaluation.survival import floor
    from gspure.figures.tradeoff import LINEAR, places, write_tradeoff

    outcomes = _outcomes(args)
    if not places(outcomes):
        raise InputError(args.table, "score", expected=f"of a variant of {args.condition}", found="none")
    mean_floor = known_interval(floor(outcomes))
    front = write_tradeoff(args.out, outcomes, mean_floor.mean if mean_floor else None)
    shown = {name for place in places(outcomes) for name in place.variants}
    left_out = [name for name in dict.fromkeys(o.variant for o in outcomes if not o.is_control) if name not in shown]
    caption = (
        "PSNR of the message and drop of the scene's PSNR after every variant, mean over the scenes. Variants on the "
        f"Pareto front: {len(front)}. Attacks to the lower left are stronger. The horizontal axis is logarithmic above "
        f"{LINEAR:g} dB. Vertical lines: drops at which attacks are compared."
    )
    if left_out:
        caption += f" Not shown, since they lack a scene or a random seed: {', '.join(map(display_name, left_out))}."
    if mean_floor:
        caption += " Dashed line: the floor, the highest PSNR of a control without the message."
    return {args.out: caption}, {"table": args.table}, {"condition": args.condition}


KINDS = {
    "sweep": ("scene and message against the pruning factors", _add_sweep),
    "tradeoff": ("PSNR of the message against damage to the scene", _add_tradeoff),
}
