"""``gspure metrics``: the metrics of two folders of images."""

from gspure.cli.options import PER_VIEW, QUIET, record_command
from gspure.cli.parser import Arguments, Parser
from gspure.metrics.comparison import REFERENCES, RENDER, as_text, compare, pair_images, write_metrics
from gspure.metrics.names import BASELINES
from gspure.progress import say, track
from gspure.settings import SHARE

EXAMPLES = """\
  gspure metrics before after
  gspure metrics pair renders --reference truth --against message_adaptive=message
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("images", "DIR_A", "reference images; may hold more views than DIR_B")
    parser.reads("other", "DIR_B", "images to compare, with the same names (suffixes may differ), sizes and subfolders")
    meaning = "kind of images in DIR_A: photographs (truth) or renders of the unattacked model"
    parser.choice("--reference", REFERENCES, meaning, RENDER)
    parser.pairs("--against", "TARGET=OTHER", "compare subfolder TARGET of DIR_B with subfolder OTHER of DIR_A")
    parser.text("--targets", "TARGET", "subfolders of DIR_B to compare (default: all)", nargs="+")
    meaning = "compare DIR_A with images of one colour instead of DIR_B: black, or each image's mean colour"
    parser.choice("--baseline", BASELINES, meaning)
    meaning = "colour of the renders behind transparent pixels (default: black)"
    parser.number("--background", ("R", "G", "B"), meaning, SHARE, nargs=3)
    parser.writes("--out", "CSV", "also write the metrics of every view to this table", required=False)
    parser.flag(*PER_VIEW)
    parser.flag(*QUIET)


def run(args: Arguments) -> None:
    behind = args.background or (0.0, 0.0, 0.0)
    pairs, unused = pair_images(args.images, args.other, dict(args.against), args.targets or (), behind)
    rows = [compare(pair, args.reference, args.baseline) for pair in track(pairs, "metrics")]
    if unused:
        say(f"metrics: {unused} images of {args.images} have no counterpart in {args.other}")
    if args.out:
        write_metrics(args.out, rows)
        record_command(args, args.out.parent)
    print("\n".join(as_text(rows, per_view=args.per_view)))
