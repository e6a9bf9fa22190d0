"""``gspure audit``: the workflow on the user's models, from a checkout or an installed package, and its answer."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from shutil import get_terminal_size
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Final

from gspure.cli import options
from gspure.cli.options import QUIET, add_cameras, read_source
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.files import Json, alone_in
from gspure.progress import say
from gspure.settings import CORES
from gspure.workflow.running import forecast, unlock
from gspure.workflow.running import run as run_workflow

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
    parser.flag("-n", "--dry-run", "count the jobs that would run; with -v, list them, and why")
    parser.number("-c --cores", "N", "number of cores (default: all)", CORES)
    parser.flag(*QUIET)
    parser.flag("-v", "--verbose", "print Snakemake's output instead of progress; implied by options after --")
    parser.set_defaults(passed_on=[])  # what follows `--`
    parser.epilog = f"{parser.epilog}{_STATUSES}"


@dataclass(frozen=True)
class RunOptions:
    """The options of `audited`."""

    json: bool
    fail_under: float | None
    dry_run: bool
    cores: int | None
    verbose: bool
    passed_on: Sequence[str]


@dataclass(frozen=True)
class AuditOptions:
    """What to audit: a configuration, or a model with its views and what its owner has."""

    source: Path
    key: Path | None
    message: Path | None
    cameras: Path | str | None
    up: Sequence[float] | None
    everyday: bool

    @property
    def is_configuration(self) -> bool:
        """Whether the source is a configuration of the workflow."""
        return self.source.suffix in {".yaml", ".yml"}


def run(args: Arguments) -> int:
    """Write the configuration of a model, and run Snakemake; a dry run writes to a temporary folder only."""
    wanted = options.typed(args, AuditOptions)
    run_options = options.typed(args, RunOptions)
    if wanted.is_configuration and (wanted.cameras or wanted.up or wanted.key or wanted.everyday):
        conflict = "views or a key"
        raise InputError(wanted.source, "--cameras", expected="nothing beside a configuration", found=conflict)
    if run_options.dry_run:
        with TemporaryDirectory() as folder:
            target = Path(folder) / _CONFIGURATION.name
            return audited(run_options, _configuration(wanted, target, draws=False))
    with alone_in(Path.cwd()):
        return audited(run_options, _configuration(wanted, _CONFIGURATION, draws=True))


def audited(run_options: RunOptions, configuration: Path) -> int:
    """Run Snakemake, then print the answer, and return the exit status.

    With options after ``--``, all output is Snakemake's. Jobs that failed leave the answer for the other variants.
    """
    words = _snakemake_options(run_options, configuration)
    if run_options.dry_run and not (run_options.verbose or run_options.passed_on):
        lines = forecast(words)
        if lines:
            print(*lines, sep="\n")
        return SUCCESS if lines else FAILED
    if run_options.dry_run or run_options.passed_on:
        return SUCCESS if run_workflow(words) else FAILED
    if unlock(words):
        say("an earlier run was killed: what it left undone is done now")
    page = _RESULTS / "report.html"
    earlier = page.stat().st_mtime_ns if page.is_file() else 0
    succeeded = run_workflow(words, silent=not run_options.verbose)
    if not succeeded and not (page.is_file() and page.stat().st_mtime_ns > earlier):
        return FAILED
    damage = _answer(as_json=run_options.json)
    if not succeeded:
        return FAILED
    is_lost = run_options.fail_under is not None and damage < run_options.fail_under
    return LOST if is_lost else SUCCESS


def _answer(*, as_json: bool) -> float:
    """Print the verdict of every condition; return the least damage, dB, at which a message is lost."""
    from gspure.evaluation.results import read_results
    from gspure.report.answer import answers

    conditions = answers(read_results(_RESULTS / "tables" / "results.csv"))
    if as_json:
        print(json.dumps([answer.facts() for answer in conditions], indent=2))
    else:
        for answer in conditions:
            *table, sentence = answer.lines()
            print("", *table, fill(sentence, get_terminal_size((120, 24)).columns), sep="\n")
        print(f"\n{_RESULTS / 'report.html'}")
    return min((answer.audit.damage for answer in conditions), default=inf)


def _snakemake_options(run_options: RunOptions, configuration: Path) -> list[str]:
    """Return the options of Snakemake: the workflow with its own profile, and those of the user."""
    profile = snakefile().parent / "profiles" / "default"
    words = ["--snakefile", str(snakefile()), "--workflow-profile", str(profile)]
    if run_options.dry_run:
        words.append("--dry-run")
    if run_options.cores:
        words += ["--cores", str(run_options.cores)]
    return [*words, "--configfile", str(configuration), *run_options.passed_on]


def snakefile() -> Path:
    """Return the workflow: inside an installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "workflow" / "Snakefile"
    return installed if installed.is_file() else package.parent / "Snakefile"


def _configuration(wanted: AuditOptions, target: Path, *, draws: bool) -> Path:
    """Return the configuration: the user's, or that of a model, written unless the results here are of another one.

    Warn of doubtful views.
    """
    if wanted.is_configuration:
        return wanted.source
    import yaml

    from gspure.cameras import GENERATED
    from gspure.files import write_text
    from gspure.model import model_file, read_model
    from gspure.schemes.registry import recognized

    model = model_file(wanted.source)
    rows = read_model(wanted.source)
    asset = _asset(wanted, model)
    if asset["cameras"] not in GENERATED:
        read_source(Path(asset["cameras"]), model)  # for its warnings, before the workflow runs
    elif draws:
        _mention_up(wanted)
    scene = _scene_name(wanted.source)
    content: Json = {"assets": {scene: asset}}
    scheme = recognized(rows)
    if scheme:
        content["method"] = {"tau_c": scheme.tau_c, "tau_n": scheme.tau_n}
    variants = _variants(wanted, has_photographs=_has_photographs(asset["cameras"]))
    if variants:
        content["variants"] = variants
    _require_same_model(scene, model)
    write_text(target, yaml.safe_dump(content))
    return target


def _has_photographs(cameras: str) -> bool:
    """Return whether the views of the scene name photographs, by which damage is measured."""
    from gspure.cameras import GENERATED, read_cameras
    from gspure.cameras.photographs import missing_photographs

    return cameras not in GENERATED and not missing_photographs(read_cameras(cameras))


def _variants(wanted: AuditOptions, *, has_photographs: bool) -> Json:
    """Return what is done to the model; nothing for the attacks of a run that names none."""
    from gspure.workflow.config import DEFAULT_VARIANTS
    from gspure.workflow.config_reading import load_yaml

    if wanted.everyday:
        variants: Json = load_yaml(snakefile().parent / "config" / "everyday.yaml")["variants"]
        return variants
    if not wanted.key:
        return {}
    return {name: {} for name in DEFAULT_VARIANTS} | (_SEARCHED if has_photographs else {})


def _require_same_model(scene: str, model: Path) -> None:
    """Refuse to replace the results of another model, even of one that has the same name."""
    from gspure.workflow.config_reading import load_yaml

    if not _CONFIGURATION.is_file():
        return
    assets = load_yaml(_CONFIGURATION).get("assets", {})
    hint = f"delete {_CONFIGURATION} to replace the results, or audit in another folder"
    if [*assets] != [scene]:
        raise InputError(_CONFIGURATION, "assets", expected=scene, found=", ".join(assets), hint=hint)
    audited_model = str(assets[scene].get("model", ""))
    if Path(audited_model).resolve() != model.resolve():
        raise InputError(_CONFIGURATION, "model", expected=str(model), found=audited_model, hint=hint)


def _scene_name(source: Path) -> str:
    """Return the name of a model's folder of results: that of its file or, for general names, of its folder."""
    from gspure.model.inria import UNPACKED_SOG

    named = source.resolve().parent if source.name in {UNPACKED_SOG, "public"} else source.resolve()
    return re.sub("[^A-Za-z0-9_-]+", "_", named.stem).lstrip("-")[:100] or "model"


def _mention_up(wanted: AuditOptions) -> None:
    """Warn if the up direction of generated views is unsure, and draw the model with each axis up."""
    from gspure.cli.options import mention_up
    from gspure.schemes.registry import read_public_model

    public = read_public_model(wanted.source).drawable(wanted.source)
    if public.visible:
        mention_up(public.model, public.scene(background=public.model.background), wanted.up, _RESULTS)


def _asset(wanted: AuditOptions, model: Path) -> Json:
    """Return the model's entry: with its views and, for its owner, the key and the photographs of the message."""
    from gspure.cameras.reading import place_in
    from gspure.schemes.pair import message_folder
    from gspure.schemes.registry import made_by

    pairs = [made_by(wanted.key)[1]] if wanted.key else []
    message = wanted.message or next(filter(place_in, map(message_folder, pairs)), None)
    cameras = wanted.cameras or options.default_cameras(model, *pairs)
    owner = f", key {wanted.key}, message {message or 'as before the attacks'}" if wanted.key else ""
    say(f"{model}: views {cameras}{owner}")
    paths = {"model": model, "cameras": cameras, "key": wanted.key, "message": message}
    asset: Json = {name: str(path) for name, path in paths.items() if path}
    if wanted.up:
        asset["generated"] = {"up": [*wanted.up]}
    return asset


def decibels(text: str) -> float:
    """Return a number with or without its unit; an argument type."""
    return float(text.removesuffix("dB"))
