"""``gspure audit``: the workflow on the user's models, from a checkout or an installed package, and its answer."""

import json
import re
from pathlib import Path
from shutil import get_terminal_size
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Any, Final

from gspure.cli.options import QUIET, add_cameras, read_source
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError, reading
from gspure.files import digest, read_json
from gspure.progress import say
from gspure.settings import CORES
from gspure.workflow.running import run as run_workflow
from gspure.workflow.running import unlock

EXAMPLES = """\
  gspure audit point_cloud.ply                              # all attacks on the scene: results/report.html
  gspure audit marked/public --key marked/key               # and what is left of the message, as its owner sees it
  gspure audit marked/public --key marked/key --fail-under 1dB      # status 3 if the message is lost below 1 dB
  gspure audit marked/public --key marked/key --everyday    # does the mark survive formats, crops, levels of detail?
  gspure audit mine.yaml --cores 4                          # a configuration, with all settings of the workflow
  gspure audit mine.yaml -- --forcerun evaluate_variant     # options of Snakemake
"""

SUCCESS: Final = 0
FAILED: Final = 2
LOST: Final = 3
_STATUSES = """
exit status:
  0      success
  1      whoever reads the output has gone
  2      bad input, or failed jobs (the answer is that for the other variants)
  3      an attack removes the message with less damage than --fail-under
  130    interrupted, by Ctrl-C or SIGINT; 143 by SIGTERM, 129 by SIGHUP; the next run goes on from there
"""
_RESULTS = Path("results")
_CONFIGURATION = _RESULTS / "audit.yaml"
_LINKS = Path(".snakemake") / "gspure-links"
_SEARCHED: Final = {"gspure_scaled": {"damage": [1, 2]}}  # tested beside the default attacks, for a verdict


def add_arguments(parser: Parser) -> None:
    meaning = "file of a 3DGS model, or folder of a training run; or a configuration of the workflow, .yaml"
    parser.reads("source", "MODEL|CONFIG", meaning)
    parser.reads("--key", "DIR", "the owner's key, from `gspure embed`, to extract the message", required=False)
    meaning = "photographs of the message, with cameras (default: the key's pair's, or the extraction before attacks)"
    parser.reads("--message", "DIR", meaning, required=False)
    default = " (default: those of the key's pair, or beside MODEL, or orbit)"
    add_cameras(parser, "views of MODEL", more=default, required=False)
    parser.flag("--everyday", "what customers do, instead of attacks: half precision, web formats, fewer rows, crops")
    add_run_options(parser)


def add_run_options(parser: Parser) -> None:
    """Add the options of `audited`."""
    parser.flag("--json", "print the answer as JSON")
    meaning = "exit with status 3 if an attack removes the message with less damage to the scene, in dB of PSNR"
    parser.text("--fail-under", "DB", meaning, type=decibels)
    parser.flag("-n", "--dry-run", "list the jobs that would run, and why")
    parser.number("-c --cores", "N", "number of cores (default: all)", CORES)
    parser.flag(*QUIET)
    parser.flag("-v", "--verbose", "print Snakemake's output instead of progress; implied by options after --")
    parser.set_defaults(passed_on=[])  # what follows `--`
    parser.epilog = f"{parser.epilog}{_STATUSES}"


def run(args: Arguments) -> int:
    """Write the configuration of a model, and run Snakemake; a dry run writes to a temporary folder only."""
    if args.dry_run:
        with TemporaryDirectory() as folder:
            return audited(args, _configuration(args, Path(folder) / _CONFIGURATION.name))
    return audited(args, _configuration(args, _CONFIGURATION))


def audited(args: Arguments, configuration: Path) -> int:
    """Run Snakemake, then print the answer, and return the exit status.

    With options after ``--``, all output is Snakemake's. Jobs that failed leave the answer for the other variants.
    """
    options = _options(args, configuration)
    if args.dry_run or args.passed_on:
        return SUCCESS if run_workflow(options) else FAILED
    if unlock(options):
        say("an earlier run was killed: what it left undone is done now")
    page = _RESULTS / "report.html"
    earlier = page.stat().st_mtime_ns if page.is_file() else 0
    succeeded = run_workflow(options, silent=not args.verbose)
    if not succeeded and not (page.is_file() and page.stat().st_mtime_ns > earlier):
        return FAILED
    is_lost = bool(_answer(args)) and args.fail_under is not None
    if not succeeded:
        return FAILED
    return LOST if is_lost else SUCCESS


def _answer(args: Arguments) -> int:
    """Print the verdict of every condition; return 1 if the message is lost below the limit, else 0."""
    from gspure.evaluation.collecting import collect
    from gspure.evaluation.survival import Survival
    from gspure.metrics.csv_tables import read_table
    from gspure.report.answer import answers
    from gspure.workflow.plan import Plan
    from gspure.workflow.variants import report_plan

    plan = report_plan(Plan(read_json(_RESULTS / "configuration.json")))
    survivals = read_table(_RESULTS / "tables" / "survival.csv", Survival)
    found = answers(collect(_RESULTS, plan.models), survivals)
    if args.json:
        print(json.dumps([answer.facts() for answer in found], indent=2))
    else:
        for answer in found:
            *table, sentence = answer.lines()
            print("", *table, fill(sentence, get_terminal_size((120, 24)).columns), sep="\n")
        print(f"\n{_RESULTS / 'report.html'}")
    return int(any(answer.audit.damage < (args.fail_under or 0) for answer in found))


def _options(args: Arguments, configuration: Path) -> list[str]:
    """Return the options of Snakemake: the workflow with its own profile, and those of the user."""
    folder = snakefile().parent
    options = ["--snakefile", str(snakefile()), "--workflow-profile", str(folder / "profiles" / "default")]
    options += ["--dry-run"] if args.dry_run else []
    options += ["--cores", str(args.cores)] if args.cores else []
    return [*options, "--configfile", str(configuration), *args.passed_on]


def snakefile() -> Path:
    """Return the workflow: inside an installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "workflow" / "Snakefile"
    return installed if installed.is_file() else package.parent / "Snakefile"


def _configuration(args: Arguments, target: Path) -> Path:
    """Return the configuration file; that of a model is written to `target`."""
    import yaml

    from gspure.cameras import GENERATED
    from gspure.cameras.worlds import mention_unseen
    from gspure.cli.options import mention_up
    from gspure.files import write_text
    from gspure.model import model_file, read_model
    from gspure.model.inria import UNPACKED_SOG
    from gspure.schemes.registry import read_public_model, recognized

    source: Path = args.source
    if source.suffix in {".yaml", ".yml"}:
        if args.cameras or args.up or args.key or args.everyday:
            raise InputError(source, "--cameras", expected="nothing beside a configuration", found="views or a key")
        return source
    rows = read_model(source)
    model = model_file(source)
    asset = _asset(args, model)
    if asset["cameras"] not in GENERATED:
        mention_unseen(rows, read_source(Path(asset["cameras"]), model))
    elif (public := read_public_model(source).drawable(source)).visible and not args.dry_run:
        mention_up(public.model, public.scene(background=rows.background), args.up, _RESULTS)
    named = source.resolve().parent if source.name in {UNPACKED_SOG, "public"} else source.resolve()
    scene = re.sub("[^A-Za-z0-9_-]+", "_", named.stem).lstrip("-")[:100] or "model"
    configuration: dict[str, Any] = {"assets": {scene: asset}}
    if scheme := recognized(rows):
        configuration["method"] = {"tau_c": scheme.tau_c, "tau_n": scheme.tau_n}
    if args.everyday:
        everyday = snakefile().parent / "config" / "everyday.yaml"
        configuration["variants"] = yaml.safe_load(everyday.read_text(encoding="utf-8"))["variants"]
    elif args.key:
        schema = yaml.safe_load((snakefile().parent / "schemas" / "config.schema.yaml").read_text(encoding="utf-8"))
        configuration["variants"] = {**schema["properties"]["variants"]["default"], **_SEARCHED}
    if _CONFIGURATION.is_file():
        with reading(_CONFIGURATION, "a configuration, as YAML"):
            last = yaml.safe_load(_CONFIGURATION.read_text(encoding="utf-8"))
        if [*last["assets"]] != [scene]:
            hint = f"delete {_CONFIGURATION} to replace the results, or audit in another folder"
            raise InputError(_CONFIGURATION, "assets", expected=scene, found=", ".join(last["assets"]), hint=hint)
    write_text(target, yaml.safe_dump(configuration))
    return target


def _asset(args: Arguments, model: Path) -> dict[str, Any]:
    """Return the model's entry: with its views and, for its owner, the key and the photographs of the message."""
    from gspure.cameras.reading import place_in
    from gspure.schemes.pair import message_folder
    from gspure.schemes.registry import made_by

    run = model.parents[2] if model.parent.match("point_cloud/iteration_*") else model.parent
    pairs = [made_by(args.key)[1]] if args.key else []
    message = args.message or next(filter(place_in, map(message_folder, pairs)), None)
    cameras = args.cameras or next(filter(place_in, [*pairs, model.parent, run]), "orbit")
    owned = f", key {args.key}, message {message or 'as before the attacks'}" if args.key else ""
    say(f"{model}: views {cameras}{owned}")
    paths = {"model": model, "cameras": cameras, "key": args.key, "message": message}
    asset: dict[str, Any] = {name: str(_without_braces(Path(path))) for name, path in paths.items() if path}
    return asset | {"generated": {"up": args.up}} if args.up else asset


def _without_braces(path: Path) -> Path:
    """Return the path, or one through a link to its last part with braces, which Snakemake takes for wildcards."""
    marked = next((part for part in (path, *path.parents) if {*"{}"} & {*part.name}), None)
    if marked is None:
        return path
    target = marked.absolute()
    link = _LINKS / digest(str(target)) / re.sub("[{}]", "_", target.name)
    if not link.is_symlink():  # a new link would count as a new model
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(target)
    return link / path.relative_to(marked)


def decibels(text: str) -> float:
    """Return a number with or without its unit; an argument type."""
    return float(text.removesuffix("dB"))
