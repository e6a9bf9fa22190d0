"""``gspure stages``: delete unused stages, and verify files of a workflow."""

from pathlib import Path

from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError

EXAMPLES = """\
  gspure stages prune
  gspure stages prune --stages /scratch/stages --results /scratch/results
  gspure stages --verify                      # stages/ and results/
  gspure stages --verify results/vanilla      # status 1 if a file is corrupt
"""


def add_arguments(parser: Parser) -> None:
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument(
        "action", nargs="?", choices=["prune"], help="prune: delete every stage file that no index lists"
    )
    action.add_argument(
        "--verify",
        type=Path,
        nargs="?",
        const=Path(),
        metavar="FOLDER",
        help="list the files that do not agree with their checksums (default: of both folders below)",
    )
    parser.reads("--stages", "DIR", "folder of stages", default=Path("stages"))
    parser.reads("--results", "DIR", "folder searched for indices", default=Path("results"))


def run(args: Arguments) -> int:
    """Verify, or delete unlisted stages and print the freed space; not while a workflow runs."""
    if args.verify is not None:
        return _verify([args.stages, args.results] if args.verify == Path() else [args.verify])
    return _prune(args.stages, args.results)


def _verify(folders: list[Path]) -> int:
    from gspure.corruption import problems_in

    for folder in folders:
        if not folder.is_dir():
            raise InputError(folder, "folder", expected="a folder of results or stages", found="no such folder")
    verified, problems = problems_in(folders)
    print("\n".join([*problems, f"{verified} files verified, {len(problems)} corrupt"]))
    return 1 if problems else 0


def _prune(stages: Path, results: Path) -> int:
    from gspure.method.contributions import is_index, remove_unlisted

    indices = sorted(path for path in results.rglob("*.tsv") if is_index(path))
    if not indices:
        hint = "to drop every stage, delete the folder of stages"
        raise InputError(results, "contributions/*.tsv", expected="at least one index", found="none", hint=hint)
    count, freed = remove_unlisted(stages, indices)
    print(f"{count} stages deleted, {freed} bytes ({freed / 1e6:.1f} MB) freed")
    return 0
