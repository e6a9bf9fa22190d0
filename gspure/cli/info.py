"""``gspure info``: statistics of a model file."""

from collections.abc import Iterable
from itertools import groupby

from gspure.cameras.orbit import up_of
from gspure.cli.parser import Arguments, Parser
from gspure.errors import printable
from gspure.model import model_file, read_model
from gspure.model.finite import FILTER
from gspure.model.inria import UNPACKED_SOG, training_arguments
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
    up = str(up_of(model)) if len(summary.suspicious.get("undrawable", ())) < len(model) else ""
    rows = "anchors" if model.has_anchors else "Gaussians"
    colour = f"SH degree {model.sh_degree}" if model.sh_degree >= 0 else "no spherical harmonics"
    parts = file.parent.glob("*.webp") if file.name == UNPACKED_SOG else []  # the images of an unpacked SOG model
    size = f"{sum(part.stat().st_size for part in (file, *parts)) / 1e6:,.1f} MB"
    facts = f"  {len(model):,} {rows}, {colour}, {len(model.names)} properties, {size}"
    lines = [str(file), facts, f"  {summary.kind}"]
    lines += [f"  run {run}"] if (run := run_of(file)) else []
    lines += [f"  further properties: {_series(summary.further_columns)}"] if summary.further_columns else []
    lines += ["", *_table(summary), *([f"  {'guessed up':<18}{up:>11}"] if up else [])]
    lines += [f"  {line}" for line in suspicious_lines(summary.suspicious, len(model))]
    lines += [""] if model.comments or training else []
    lines += [f"  comment: {comment}" for comment in model.comments]
    lines += [f"  trained with {name} = {value}" for name, value in sorted(training.items())]
    print("\n".join(map(printable, lines)))


def _table(summary: Summary) -> Iterable[str]:
    """Yield the quantiles of the columns, and the numbers of odd rows."""
    cells = {"": ["min", "5 %", "25 %", "median", "75 %", "95 %", "max"]}
    for name, values in summary.quantiles.items():
        cells[name.replace("_", " ")] = [f"{value:.4g}" for value in values] or ["no finite value"]
    yield from (f"  {name:<18}" + "".join(f"{cell:>11}" for cell in row) for name, row in cells.items())
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
