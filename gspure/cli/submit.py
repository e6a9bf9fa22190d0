"""``gspure submit``: the robust radii of a run as one record for the leaderboard."""

from datetime import UTC, datetime

from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError

EXAMPLES = """\
  gspure submit results --out experiments/leaderboard/mine.json    # of a run of a suite; then open a pull request
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("results", "DIR", "results folder of `gspure audit` with a suite")
    parser.writes("--out", "JSON", "the record to write")


def run(args: Arguments) -> None:
    """Write the record, or refuse a run whose attacks are its own."""
    from gspure import __version__
    from gspure.cameras import read_cameras
    from gspure.codec import plain, read
    from gspure.evaluation.plan import read_plan
    from gspure.evaluation.radius import RADIUS, RadiusRecord, Record
    from gspure.files import file_digest, read_json, write_json

    plan = read_plan(args.results)
    if not plan.suite:
        hint = "`gspure audit --suite standard-1`, or `suite:` in a configuration"
        raise InputError(args.results, "suite", expected="a run of a suite", found="attacks of its own", hint=hint)
    file = args.results / RADIUS
    radii: RadiusRecord = read(RadiusRecord, read_json(file), file)
    if not radii.conditions:
        raise InputError(file, "conditions", expected="a message with a robust radius", found="none")
    first = read_cameras(args.results / plan.models[0].id.name / "cameras.json")[0]
    record = Record(
        gspure=__version__,
        suite=plan.suite,
        date=datetime.now(UTC).date().isoformat(),
        scenes=len({model.model.scene for model in radii.models}),
        size=f"{first.width}x{first.height}",
        results=file_digest(args.results / "tables" / "results.csv"),
        conditions=radii.conditions,
        models=radii.models,
    )
    write_json(args.out, plain(record))
    print(args.out)
