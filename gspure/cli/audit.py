"""``gspure audit``: the workflow on the user's models, from a checkout or an installed package."""

import fcntl
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from gspure.cli.options import add_cameras, add_quiet
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError, reading
from gspure.settings import CORES
from gspure.workflow.job_progress import COMMAND, SHOWN
from gspure.workflow.options import DEFAULT_PROFILE, profile_options

EXAMPLES = """\
  gspure audit point_cloud.ply --cameras orbit              # results/report.html
  gspure audit output/bicycle --cameras output/bicycle --dry-run
  gspure audit mine.yaml --cores 4                          # a configuration, with all settings of the workflow
  gspure audit mine.yaml -- --forcerun render_scene         # options of Snakemake
"""

_CONFIGURATION = Path("results/audit.yaml")
_LOCKS = Path(".snakemake/locks")
_DRY_RUN = re.compile("--dry-?r.*|-[a-zA-Z]*n[a-zA-Z]*")
_UNTIL_UNREAD = (  # Snakemake, ended without a traceback when the reader of its output (`| head`) has gone
    "import signal; signal.signal(signal.SIGPIPE, signal.SIG_DFL); from snakemake.cli import main; main()"
)


def add_arguments(parser: Parser) -> None:
    parser.reads(
        "source",
        "MODEL|CONFIG",
        "file of a 3DGS model or folder of a training run (its configuration is written to "
        f"{_CONFIGURATION}); or a configuration of the workflow, .yaml",
    )
    add_cameras(parser, "views of MODEL", required=False)
    parser.flag("-n", "--dry-run", "list the jobs that would run, and why")
    parser.number(("-c", "--cores"), "N", "number of cores (default: all)", CORES)
    add_quiet(parser)
    parser.flag("-v", "--verbose", "print Snakemake's output, not a progress bar; options after -- imply this")
    parser.set_defaults(passed_on=[])  # what follows `--`


def run(args: Arguments) -> int:
    """Write the configuration of a model, and become Snakemake; a dry run writes to a temporary folder only."""
    if not os.access(Path.cwd(), os.W_OK):
        raise InputError(Path.cwd(), "permissions", expected="a folder to write results to", found="a read-only one")
    if args.dry_run or any(_DRY_RUN.fullmatch(word) for word in args.passed_on):
        with TemporaryDirectory() as folder:
            configuration = _configuration(args, Path(folder) / _CONFIGURATION.name)
            status = subprocess.call(_command(args, configuration, ["-c", _UNTIL_UNREAD]))
        if status == -signal.SIGPIPE:
            raise BrokenPipeError
        return status
    configuration = _configuration(args, _CONFIGURATION)
    environment = {**os.environ, COMMAND: shlex.join(["gspure", *sys.argv[1:]])}
    if args.quiet or not (args.verbose or args.passed_on):
        environment[SHOWN] = "problems" if args.quiet else "jobs"
    with nullcontext() if {"--unlock", "--nolock"} & {*args.passed_on} else _only_run(configuration):
        return os.execve(sys.executable, _command(args, configuration), environment)  # noqa: S606


@contextmanager
def _only_run(configuration: Path) -> Iterator[None]:
    """Refuse a second run in this folder, until the process that this one becomes has ended."""
    _LOCKS.mkdir(parents=True, exist_ok=True)
    with _LOCKS.with_name("audit").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(_LOCKS, "lock", expected="no other run here", found="one that runs") from None
        if any(_LOCKS.glob("*.lock")):  # Snakemake's
            hint = f"if none runs: gspure audit {shlex.quote(str(configuration))} -- --unlock"
            found = "one that runs or was killed"
            raise InputError(_LOCKS, "lock", expected="no other run here", found=found, hint=hint)
        os.set_inheritable(lock.fileno(), True)  # noqa: FBT003
        yield


def _command(args: Arguments, configuration: Path, snakemake: Sequence[str] = ("-m", "snakemake")) -> list[str]:
    """Return the command line of Snakemake; the default profile as options, unless another profile may be meant."""
    workflow = snakefile()  # named after --configfile, which would take the targets for configurations
    options = ["--configfile", str(configuration), "--snakefile", str(workflow)]
    if not (args.verbose or args.passed_on or any(Path(name).exists() for name in ("default", DEFAULT_PROFILE))):
        options += profile_options(workflow.parent)
    options += ["--dry-run"] if args.dry_run else []
    options += ["--cores", str(args.cores)] if args.cores else []
    sys.stdout.flush()
    return [sys.executable, *snakemake, *options, *args.passed_on]


def snakefile() -> Path:
    """Return the workflow: inside an installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "workflow" / "Snakefile"
    return installed if installed.is_file() else package.parent / "Snakefile"


def _configuration(args: Arguments, target: Path) -> Path:
    """Return the configuration file; write that of a model to `target`, unless the last audit had the same."""
    import yaml

    from gspure.artifacts import replacing_only, write_text
    from gspure.model import model_file
    from gspure.model.compressed.sog import INDEX
    from gspure.workflow.configuration import require_distinct_names, resolved, validated

    source: Path = args.source
    if source.suffix in {".yaml", ".yml"}:
        if args.cameras or args.up:
            raise InputError(source, "--cameras", expected="nothing beside a configuration", found="views")
        require_distinct_names(source)
        return source
    if not args.cameras:
        raise InputError("audit", "--cameras", expected="views of the model, or orbit", found="nothing")
    with reading(model := model_file(source), "a model"):
        model.stat()
    asset: dict[str, Any] = {"model": str(model), "cameras": str(args.cameras)}
    if args.up:
        asset["generated"] = {"up": args.up}
    named = source.resolve().parent if source.name == INDEX else source.resolve()
    scene = re.sub("[^A-Za-z0-9_-]+", "_", named.stem).lstrip("-")[:100] or "model"
    scene = re.sub(r"(.+?)\1{19,}$", r"\1", scene)  # which no name may have
    configuration = {"assets": {scene: asset}, **_method(model)}
    schema = snakefile().parent / "schemas" / "config.schema.yaml"
    resolved(validated(configuration, schema, _CONFIGURATION), _CONFIGURATION)
    text = yaml.safe_dump(configuration)
    if _CONFIGURATION.is_file():
        with reading(_CONFIGURATION, "a configuration, as YAML"):
            last = _CONFIGURATION.read_text(encoding="utf-8")
            if not _is_audit_of(configuration, yaml.safe_load(last)):
                hint = f"delete {_CONFIGURATION} to replace the results, or audit in another folder"
                found = "that of another model, or an edited one"
                raise InputError(_CONFIGURATION, "assets", expected=f"the audit of {model}", found=found, hint=hint)
        if last == text:
            return _CONFIGURATION
    with replacing_only("audit", [target]):
        write_text(target, text)
    return target


def _method(model: Path) -> dict[str, Any]:
    """Return the settings of the method that suit the columns of a model better than the defaults."""
    from gspure.constants import TAU_C, TAU_N
    from gspure.model import read_model
    from gspure.schemes.registry import recognized

    scheme = recognized(read_model(model)) if model.suffix == ".ply" else None  # other formats hold no anchors
    if not scheme or (scheme.tau_c, scheme.tau_n) == (TAU_C, TAU_N):
        return {}
    return {"method": {"tau_c": scheme.tau_c, "tau_n": scheme.tau_n}}


def _is_audit_of(configuration: dict[str, Any], last: Any) -> bool:
    """Return whether the `last` configuration is an audit of the same model, with these or other views."""
    ((scene, asset),) = configuration["assets"].items()
    match last:
        case {"assets": {**assets}} if last | {"assets": 0} == configuration | {"assets": 0} and [*assets] == [scene]:
            match assets[scene]:
                case {"model": str(model), **views} if views.keys() <= {"cameras", "generated"}:
                    return Path(model).resolve() == Path(asset["model"]).resolve()
    return False
