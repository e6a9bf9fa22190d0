"""``gspure audit``: the workflow on the user's models, from a checkout or an installed package, and its answer."""

import json
import re
from collections.abc import Sequence
from contextlib import chdir, nullcontext
from dataclasses import dataclass, replace
from itertools import chain, count
from pathlib import Path
from shutil import get_terminal_size
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Final, Self

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
  gspure audit marked/public --key marked/key --fail-under 1dB      # status 3 if the robust radius is below 1 dB
  gspure audit marked/public --key marked/key --everyday    # what customers do: formats, crops, fewer rows
  gspure audit marked/public --key marked/key --suite standard-1 --out standard      # for publications: hours
  gspure audit mine.yaml --cores 4                          # a configuration, with all settings of the workflow
  gspure audit mine.yaml -- --forcerun evaluate_variant     # options of Snakemake
"""

SUCCESS: Final = 0
FAILED: Final = 2
LOST: Final = 3
_STATUSES = """
exit status: 0, even if the message is gone; 2 after bad input or failed jobs; 3 if the robust radius is smaller than
--fail-under; 130 after Ctrl-C, from where the next run goes on. docs/troubleshooting.md lists all.
"""
_RESULTS = Path("results")
_CONFIGURATION = _RESULTS / "audit.yaml"
_SUITE: Final = "small-1"  # of a model with a key
_EVERYDAY: Final = "everyday-1"


def add_arguments(parser: Parser) -> None:
    meaning = "file of a 3DGS model, or folder of a training run; or a configuration of the workflow, .yaml"
    parser.reads("source", "MODEL|CONFIG", meaning)
    parser.reads("--key", "DIR", "the owner's key, from `gspure embed`, to extract the message", required=False)
    meaning = "photographs of the message, with cameras (default: the key's pair's, or the extraction before attacks)"
    parser.reads("--message", "DIR", meaning, required=False)
    default = " (default: those of the key's pair, or beside MODEL, or orbit)"
    add_cameras(parser, "views of MODEL", more=default, required=False)
    parser.text("--suite", "NAME", f"attacks and strengths to try: small-1, standard-1 (default with --key: {_SUITE})")
    parser.flag("--everyday", "what customers do, instead of attacks: half precision, web formats, fewer rows, crops")
    meaning = "folder of the results (default: here or, if the results here are others, a folder of their own)"
    parser.writes("--out", "DIR", meaning, required=False)
    add_run_options(parser)


def add_run_options(parser: Parser) -> None:
    """Add the options of `audited`."""
    parser.flag("--json", "print the answer as JSON")
    meaning = "exit with status 3 if the robust radius is smaller: an attack with less damage ends the message"
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
    suite: str | None
    everyday: bool
    out: Path | None

    @property
    def is_configuration(self) -> bool:
        """Whether the source is a configuration of the workflow."""
        return self.source.suffix in {".yaml", ".yml"}

    @property
    def suite_name(self) -> str:
        """The suite; empty for the attacks of a run that names none."""
        if self.everyday:
            return _EVERYDAY
        return self.suite or (_SUITE if self.key else "")

    def resolved(self) -> Self:
        """Return the same with absolute paths, for a run in another folder."""
        return replace(
            self,
            source=self.source.resolve(),
            key=self.key and self.key.resolve(),
            message=self.message and self.message.resolve(),
            cameras=self.cameras.resolve() if isinstance(self.cameras, Path) else self.cameras,
        )


def run(args: Arguments) -> int:
    """Write the configuration of a model, and run Snakemake; a dry run writes to a temporary folder only."""
    wanted = options.typed(args, AuditOptions)
    run_options = options.typed(args, RunOptions)
    if wanted.is_configuration:
        if wanted.cameras or wanted.up or wanted.key or wanted.suite_name or wanted.out:
            conflict = "views, a key, a suite or a folder"
            raise InputError(wanted.source, "--cameras", expected="nothing beside a configuration", found=conflict)
        with nullcontext() if run_options.dry_run else alone_in(Path.cwd()):
            return audited(run_options, wanted.source)
    if run_options.fail_under is not None and not wanted.key:
        hint = "only the owner's key tells when a message is gone"
        raise InputError("audit", "--key", expected="one beside --fail-under", found="none", hint=hint)
    place = wanted.out or own_place(wanted)
    if run_options.dry_run:
        with TemporaryDirectory() as folder:
            target = Path(folder) / _CONFIGURATION.name
            return audited(run_options, _written(wanted, target, draws=False))
    if place == Path():
        with alone_in(place):
            return audited(run_options, _written(wanted, _CONFIGURATION, draws=True))
    wanted = wanted.resolved()
    place.mkdir(parents=True, exist_ok=True)
    say(f"all files go to {place}")
    with chdir(place), alone_in(Path()):
        return audited(run_options, _written(wanted, _CONFIGURATION, draws=True), place)


def own_place(wanted: AuditOptions) -> Path:
    """Return this folder if its results are of the same model and suite, or it has none; else a folder below it."""
    scene = _scene_name(wanted.source)
    name = "-".join(filter(None, ("audit", scene, wanted.suite_name)))
    numbered = (Path(f"{name}-{number}") for number in count(2))
    return next(place for place in chain([Path(), Path(name)], numbered) if _is_free(place, wanted))


def _is_free(place: Path, wanted: AuditOptions) -> bool:
    """Return whether a folder has no results, or those of this model and suite."""
    from gspure.model import model_file
    from gspure.workflow.config_reading import load_yaml

    if not (place / _CONFIGURATION).is_file():
        return True
    known = load_yaml(place / _CONFIGURATION)
    models = [str(asset.get("model", "")) for asset in known.get("assets", {}).values()]
    is_same = [(place / model).resolve() for model in models] == [model_file(wanted.source).resolve()]
    return is_same and known.get("suite", "") == wanted.suite_name


def audited(run_options: RunOptions, configuration: Path, place: Path = Path()) -> int:
    """Run Snakemake, then print the answer, and return the exit status.

    With options after ``--``, all output is Snakemake's. Jobs that failed leave the answer for the other variants.
    `place` is the current folder, as its user named it.
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
    damages = _answer(place, as_json=run_options.json)
    if not succeeded:
        return FAILED
    if run_options.fail_under is None:
        return SUCCESS
    if not damages:
        raise InputError("audit", "--fail-under", expected="a message with a robust radius", found="none")
    return LOST if min(damages) < run_options.fail_under else SUCCESS


def _answer(place: Path, *, as_json: bool) -> list[float]:
    """Print the verdict of every condition; return the known damages, dB, at which messages are gone."""
    from gspure.evaluation.results import read_results
    from gspure.report.answer import answers

    conditions = answers(read_results(_RESULTS / "tables" / "results.csv"))
    if as_json:
        print(json.dumps([answer.facts() for answer in conditions], indent=2))
    else:
        for answer in conditions:
            *table, sentence = answer.lines()
            print("", *table, fill(sentence, get_terminal_size((120, 24)).columns), sep="\n")
        print(f"\n{place / _RESULTS / 'report.html'}")
    return [answer.audit.damage for answer in conditions if answer.audit.has_radius]


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


def _written(wanted: AuditOptions, target: Path, *, draws: bool) -> Path:
    """Write the configuration of a model; warn of doubtful views."""
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
    if wanted.suite_name:
        content["suite"] = wanted.suite_name
    write_text(target, yaml.safe_dump(content))
    return target


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
