"""``gspure audit``: the workflow on the user's models, from a checkout or an installed package, and its answer."""

import fcntl
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from shutil import get_terminal_size
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Any, Final

from gspure.cli.options import QUIET, add_cameras, read_source
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError, reading
from gspure.progress import say, tell
from gspure.settings import CORES

EXAMPLES = """\
  gspure audit point_cloud.ply                              # all attacks on the scene: results/report.html
  gspure audit marked/public --key marked/key               # and what is left of the message, as its owner sees it
  gspure audit marked/public --key marked/key --fail-under 1dB      # status 1 if the message is lost below 1 dB
  gspure audit marked/public --key marked/key --everyday    # does the mark survive formats, crops, levels of detail?
  gspure audit mine.yaml --cores 4                          # a configuration, with all settings of the workflow
  gspure audit mine.yaml -- --forcerun evaluate_variant     # options of Snakemake
"""

_RESULTS = Path("results")
_CONFIGURATION = _RESULTS / "audit.yaml"
_STATE = Path(".snakemake")
_JOB = re.compile(r"Job \d+: (.+)")
_DONE = re.compile(r"(\d+) of (\d+) steps")
_SEARCHED: Final = {"gspure_scaled": {"damage": [1, 2]}}  # tested beside the default attacks, for a verdict
_ENDING = 2.0  # seconds that a killed Snakemake may take to end
_SHOWN = 20  # lines of Snakemake's, if it fails without a reason


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
    meaning = "exit with status 1 if an attack removes the message with less damage to the scene, in dB of PSNR"
    parser.text("--fail-under", "DB", meaning, type=decibels)
    parser.flag("-n", "--dry-run", "list the jobs that would run, and why")
    parser.number("-c --cores", "N", "number of cores (default: all)", CORES)
    parser.flag(*QUIET)
    parser.flag("-v", "--verbose", "print Snakemake's output instead of one line per job; implied by options after --")
    parser.set_defaults(passed_on=[])  # what follows `--`


def run(args: Arguments) -> int:
    """Write the configuration of a model, and run Snakemake; a dry run writes to a temporary folder only."""
    if args.dry_run:
        with TemporaryDirectory() as folder:
            return audited(args, _configuration(args, Path(folder) / _CONFIGURATION.name))
    return audited(args, _configuration(args, _CONFIGURATION))


def audited(args: Arguments, configuration: Path) -> int:
    """Run Snakemake, then print the answer; options after ``--`` leave all output to Snakemake."""
    if args.dry_run:
        return subprocess.call(_command(args, configuration, "--dry-run"))
    if args.passed_on:
        return os.execv(sys.executable, _command(args, configuration))  # noqa: S606
    if any(_STATE.glob("locks/*.lock")):
        _require_no_other_run()
        subprocess.run(_command(args, configuration, "--unlock"), check=True, capture_output=True)
        say("an earlier run was killed: what it left undone is done now")
    page = _RESULTS / "report.html"
    earlier = page.stat().st_mtime_ns if page.is_file() else 0
    status = (subprocess.call if args.verbose else _shown)(_command(args, configuration))
    if status and not (page.is_file() and page.stat().st_mtime_ns > earlier):
        return status
    return _answer(args) or status


def _answer(args: Arguments) -> int:
    """Print the verdict of every condition; return 1 if the message is lost below the limit, else 0."""
    from gspure.evaluation.collecting import collect
    from gspure.evaluation.plan import read_plan
    from gspure.evaluation.survival import Survival
    from gspure.metrics.csv_tables import read_table
    from gspure.report.answer import answers

    plan = read_plan(_RESULTS)
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


def _command(args: Arguments, configuration: Path, *words: str) -> list[str]:
    """Return the command line of Snakemake, which finds its default profile beside the workflow."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(snakefile()), *words]
    command += ["--cores", str(args.cores)] if args.cores else []
    return [*command, "--configfile", str(configuration), *args.passed_on]


def snakefile() -> Path:
    """Return the workflow: inside an installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "workflow" / "Snakefile"
    return installed if installed.is_file() else package.parent / "Snakefile"


def _require_no_other_run() -> None:
    """Wait until a killed Snakemake has ended, or refuse to run beside one that lives."""
    with (_STATE / "gspure.lock").open("a") as alive:  # which every Snakemake holds (rules/common.smk)
        deadline = time.monotonic() + _ENDING
        while True:
            try:
                return fcntl.flock(alive, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise InputError(_STATE, "lock", expected="no other run here", found="one that runs") from None
            time.sleep(0.05)


def _shown(command: Sequence[str]) -> int:
    """Run Snakemake, and show a line for each job, and reasons of failures, in place of its output."""
    began, done, total = time.monotonic(), 0, 0
    last: deque[str] = deque(maxlen=_SHOWN)
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, errors="replace") as process:
        signal.signal(signal.SIGTERM, lambda *_: process.terminate())
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal interrupts Snakemake, too
        for line in process.stderr or ():
            if progress := _DONE.match(line):
                done, total = int(progress[1]), int(progress[2])
            elif (job := _JOB.match(line)) and not job[1].startswith("Done"):
                place = f"{done} of {total} jobs done, " if total else ""
                say(f"{place}{timedelta(seconds=round(time.monotonic() - began))}: {job[1]}")
            elif line.startswith(("gspure", "warning:", "Nothing to be done")):
                tell(line.rstrip())
                last.clear()
            else:
                last.append(line.rstrip())
    if process.returncode:
        tell("\n".join(last))
    return process.returncode


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
    from gspure.workflow.config import DEFAULT_VARIANTS

    source: Path = args.source
    if source.suffix in {".yaml", ".yml"}:
        if args.cameras or args.up or args.key or args.everyday:
            raise InputError(source, "--cameras", expected="nothing beside a configuration", found="views or a key")
        return source
    rows, asset = read_model(source), _asset(args, model := model_file(source))
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
        configuration["variants"] = {name: {} for name in DEFAULT_VARIANTS} | _SEARCHED
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
    asset: dict[str, Any] = {name: str(path) for name, path in paths.items() if path}
    return asset | {"generated": {"up": args.up}} if args.up else asset


def decibels(text: str) -> float:
    """Return a number with or without its unit; an argument type."""
    return float(text.removesuffix("dB"))
