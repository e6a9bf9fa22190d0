"""``gspure info``: statistics of a model file."""

from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from gspure.cli.parser import Arguments, Parser
from gspure.errors import printable
from gspure.files import run_of
from gspure.model import Gaussians, model_file, read_model
from gspure.model.filtered import FILTER
from gspure.model.inria import UNPACKED_SOG, training_arguments
from gspure.model.summary import Summary, doubts, summarize, suspicious_lines
from gspure.progress import warn

EXAMPLES = """\
  gspure info point_cloud.ply
  gspure info output/bicycle                                   # a training run's folder: its newest iteration
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "file of a 3DGS model, or folder of a training run")


def run(args: Arguments) -> None:
    file = model_file(args.model)
    training = training_arguments(args.model) if args.model.is_dir() else {}
    model = read_model(file)
    for doubt in doubts(model):
        warn(f"{file}: {doubt}")
    print("\n".join(map(printable, as_text(file, model, training))))


def as_text(file: Path, model: Gaussians, training: dict[str, Any]) -> list[str]:
    """Return the summary of a model as aligned lines."""
    summary = summarize(model)
    rows = "anchors" if model.has_anchors else "Gaussians"
    colour = f"SH degree {model.sh_degree}" if model.sh_degree >= 0 else "no spherical harmonics"
    parts = file.parent.glob("*.webp") if file.name == UNPACKED_SOG else []  # the images of an unpacked SOG model
    size = f"{sum(part.stat().st_size for part in (file, *parts)) / 1e6:,.1f} MB"
    return [
        str(file),
        f"  {len(model):,} {rows}, {colour}, {len(model.names)} properties, {size}",
        f"  {summary.kind}",
        *([f"  run {run}"] if (run := run_of(file)) else []),
        *([f"  further properties: {_series(summary.further_columns)}"] if summary.further_columns else []),
        "",
        *_quantile_table(summary),
        *(["  stored values: the 3-D filter is not part of them"] if FILTER in model.names else []),
        "",
        *_row_counts(summary),
        *(f"  {line}" for line in suspicious_lines(summary.suspicious, len(model))),
        *([""] if model.comments or training else []),
        *(f"  comment: {comment}" for comment in model.comments),
        *(f"  trained with {name} = {value}" for name, value in sorted(training.items())),
    ]


def _quantile_table(summary: Summary) -> Iterable[str]:
    yield _table_row("", ["min", "5 %", "25 %", "median", "75 %", "95 %", "max"])
    for name, values in summary.quantiles.items():
        yield _table_row(name.replace("_", " "), [f"{value:.4g}" for value in values] or ["no finite value"])


def _table_row(name: str, cells: Sequence[str]) -> str:
    return f"  {name:<18}" + "".join(f"{cell:>11}" for cell in cells)


def _row_counts(summary: Summary) -> Iterable[str]:
    where = (f"{name} in {rows:,}, first {first}" for name, (rows, first) in summary.non_finite_columns.items())
    yield f"  {'non-finite rows':<18}{summary.non_finite_rows:>11,}   {'; '.join(where)}".rstrip()
    yield f"  {'zero quaternions':<18}{summary.zero_quaternion_rows:>11,}"
    yield f"  {'repeated positions':<18}{summary.repeated_position_rows:>11,}"


def _series(names: Iterable[str]) -> str:
    """Return the names in one line, with ``semantic_0..15`` for semantic_0 to semantic_15."""
    runs = []
    for stem, run in groupby(names, key=lambda name: name.rstrip("0123456789")):
        first, *rest = run
        runs.append(f"{first}..{rest[-1].removeprefix(stem)}" if rest else first)
    return " ".join(runs)
