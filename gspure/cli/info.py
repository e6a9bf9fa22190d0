"""``gspure info``: statistics of a model file."""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

from gspure.cameras.orbit import up_of
from gspure.cli.parser import Arguments, Parser
from gspure.errors import printable
from gspure.model import Gaussians, model_file, read_model
from gspure.model.finite import FILTER
from gspure.model.inria import model_parts, training_arguments
from gspure.model.summary import Summary, doubts, summarize, suspicious_lines
from gspure.progress import warn
from gspure.provenance import run_of

EXAMPLES = """\
  gspure info point_cloud.ply
  gspure info output/bicycle                                   # a training run's folder: its newest iteration
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "file of a 3DGS model, or folder of a training run")


def run(args: Arguments) -> None:
    """Print the summary of a model as aligned lines."""
    file = model_file(args.model)
    training = training_arguments(args.model) if args.model.is_dir() else {}
    model = read_model(file)
    for doubt in doubts(model):
        warn(f"{file}: {doubt}")
    summary = summarize(model)
    has_drawable_rows = len(summary.suspicious.get("undrawable", ())) < len(model)
    up = str(up_of(model)) if has_drawable_rows else ""
    lines = [str(file), f"  {_facts(file, model)}", f"  {summary.kind}"]
    run_id = run_of(file)
    if run_id:
        lines.append(f"  run {run_id}")
    if summary.further_columns:
        lines.append(f"  further properties: {_series(summary.further_columns)}")
    lines += ["", *_table(summary)]
    if up:
        lines.append(f"  {'guessed up':<18}{up:>11}")
    lines += [f"  {line}" for line in suspicious_lines(summary.suspicious, len(model))]
    if model.comments or training:
        lines.append("")
    lines += [f"  comment: {comment}" for comment in model.comments]
    lines += [f"  trained with {name} = {value}" for name, value in sorted(training.items())]
    print("\n".join(map(printable, lines)))


def _facts(file: Path, model: Gaussians) -> str:
    """Return the numbers of rows and properties, the colours and the size of the file."""
    rows = "anchors" if model.has_anchors else "Gaussians"
    colour = f"SH degree {model.sh_degree}" if model.sh_degree >= 0 else "no spherical harmonics"
    size = sum(part.stat().st_size for part in model_parts(file)) / 1e6
    return f"{len(model):,} {rows}, {colour}, {len(model.names)} properties, {size:,.1f} MB"


def _table(summary: Summary) -> Iterable[str]:
    """Yield the quantiles of the columns, and the numbers of suspicious rows."""
    cells = {"": ["min", "5 %", "25 %", "median", "75 %", "95 %", "max"]}
    for name, values in summary.quantiles.items():
        cells[name.replace("_", " ")] = [f"{value:.4g}" for value in values] or ["no finite value"]
    for name, row in cells.items():
        yield f"  {name:<18}" + "".join(f"{cell:>11}" for cell in row)
    if FILTER in summary.further_columns:
        yield "  stored values: the 3-D filter is not part of them"
    where = (f"{name} in {rows:,}, first {first}" for name, (rows, first) in summary.non_finite_columns.items())
    yield ""
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
