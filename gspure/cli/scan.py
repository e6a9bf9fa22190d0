"""``gspure scan``: whether a model hides anything, without a key."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError, printable
from gspure.progress import warn

if TYPE_CHECKING:
    from gspure.arrays import Float32
    from gspure.cameras import Camera
    from gspure.model import Gaussians

EXAMPLES = """\
  gspure scan point_cloud.ply
  gspure scan point_cloud.ply --cameras cameras.json --picture suspicious.png      # also what no public view sees
  gspure scan output/bicycle --json

The verdict is "hidden content likely", "nothing found", or "unlike the calibration models" (docs/scan.md). At most 1 %
of the clean calibration files lie beyond any threshold. "Nothing found" does not mean that nothing is hidden.

never drawn  rows whose opacity is at most 1/255
unseen       other rows without weight in the training views among the cameras
clumping     from 0, places at random, to 1, a separate cloud
flatter      than a row that is drawn or seen: hidden surfaces are flat, floaters are round
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("model", "MODEL", "file of a 3DGS model, or folder of a training run")
    parser.reads("--cameras", "SOURCE", "public views, used to weight the rows: a file or folder", required=False)
    parser.flag("--json", "print the verdict as JSON")
    parser.writes("--picture", "PNG", "also draw the rows that the statistics count", required=False)
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Print the verdict, its reasons, and where this file lies among clean models."""
    from gspure.cameras import scaled
    from gspure.cameras.photographs import TRAINING_RULE
    from gspure.model import model_file, read_model
    from gspure.scan.verdict import judge

    file = model_file(args.model)
    model = read_model(file)
    if not len(model):
        raise InputError(file, "rows", expected="at least one", found="none")
    is_vanilla = model.sh_degree >= 0 and not model.has_anchors
    cameras = scaled(options.read_source(args.cameras, file), TRAINING_RULE) if args.cameras and is_vanilla else []
    weights = _weights(args, model, cameras) if cameras else None
    verdict = judge(model, weights)
    if args.picture and not verdict.measured.rows:
        warn(f"{args.picture}: not drawn, as no statistic counts rows of this model")
    elif args.picture:
        from gspure.figures.gallery import draw_rows

        masks = {name.replace("_", " "): mask for name, mask in verdict.measured.rows.items()}
        draw_rows(args.picture, model, masks, cameras)
    if args.json:
        facts = {
            "model": str(file),
            "verdict": verdict.word,
            "reasons": verdict.reasons,
            "statistics": verdict.statistics(),
        }
        print(json.dumps(facts, indent=2))
        return
    reasons = [f"  {reason}" for reason in verdict.reasons]
    print(printable(f"{file}: {verdict.word}"))
    print("\n".join([*reasons, *verdict.lines()]))


def _weights(args: Arguments, model: Gaussians, cameras: Sequence[Camera]) -> Float32:
    """Return the weights [K] of the rows in the training views among the cameras."""
    from gspure.cameras import split
    from gspure.method.weights import accumulate, require_in_view
    from gspure.progress import track
    from gspure.public_model import PublicModel

    train, test = split(cameras)
    contributions = PublicModel(model).drawable(args.model).contributions(options.read_device(args))
    weights = accumulate(map(contributions, track(train or test, "contributions")), len(model))
    require_in_view(weights)
    return weights
