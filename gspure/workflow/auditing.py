"""An audit of a model or of a configuration: the run of the workflow that it takes, and its results."""

from collections.abc import Iterator, Sequence
from contextlib import chdir, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Self

from gspure import progress
from gspure.errors import InputError
from gspure.evaluation.identity import RESULTS
from gspure.evaluation.radius import RADIUS, ModelRadius, Radius, RadiusRecord
from gspure.evaluation.results import Result, read_results
from gspure.files import alone_in, read_json
from gspure.progress import say
from gspure.workflow.console import Console, Listener
from gspure.workflow.request import AUDIT_FILE, AuditRequest, own_place, write_configuration
from gspure.workflow.running import run as run_workflow
from gspure.workflow.running import unlock


@dataclass(frozen=True)
class Audit:
    """The results of an audit.

    Attributes
    ----------
    folder : Path
        The folder of the results, with ``report.html``.
    results : tuple of Result
        The rows of ``tables/results.csv``: one for each model, variant and owner. A variant that failed has a row with
        its `failure`.
    radii : tuple of Radius
        The robust radius, dB, of each scheme, `owner` ("published" or "adaptive") and `kind`: at which the message is
        gone ("message"), or no longer "readable". Empty without a key or a detector.
    model_radii : tuple of ModelRadius
        The same of each model.

    """

    folder: Path
    results: tuple[Result, ...]
    radii: tuple[Radius, ...]
    model_radii: tuple[ModelRadius, ...]

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read a folder of results, or raise `InputError`."""
        from gspure.codec import read

        record: RadiusRecord = read(RadiusRecord, read_json(folder / RADIUS), folder / RADIUS)
        results = read_results(folder / "tables" / "results.csv")
        return cls(folder, tuple(results), record.conditions, record.models)


def audit(
    source: str | Path,
    *,
    key: str | Path | None = None,
    message: str | Path | None = None,
    cameras: str | Path | None = None,
    suite: str = "",
    out: str | Path | None = None,
    cores: int | None = None,
    show_progress: bool = False,
) -> Audit:
    """Attack a model, or all models of a configuration, and measure what is left: ``gspure audit``.

    Results that are up to date are not computed again. Warnings go to standard error. While it runs, the folder of the
    results is the process's current one.

    Parameters
    ----------
    source : str or Path
        A model, or a configuration of the workflow (``.yaml``), which excludes all parameters but the last two.
    key, message : str or Path, optional
        The owner's key, and photographs of the message; by default, those of the key's pair.
    cameras : str or Path, optional
        Views of the model: cameras, "orbit" or "shells"; by default those of the key's pair, or beside the model.
    suite : str, optional
        Attacks and strengths: "small-1", "standard-1" or "everyday-1".
    out : str or Path, optional
        Folder of ``results``; by default the current one or, if its results are others, one below it.
    cores : int, optional
        Number of cores; by default all.
    show_progress : bool
        Whether to print what the command prints while it runs, to standard error.

    Raises
    ------
    InputError
        If the input is unusable, or if there are no results, with the reason.

    """
    wanted = AuditRequest(
        source=Path(source),
        key=_path(key),
        message=_path(message),
        cameras=cameras if cameras is None else _camera_source(cameras),
        up=None,
        suite=suite,
        everyday=False,
        out=_path(out),
    )
    console = Console() if show_progress else Listener()
    with nullcontext() if show_progress else _quiet(), prepared(wanted) as (configuration, _):
        run = run_to_report(snakemake_options(configuration, cores), console)
        if not run.has_report:
            raise InputError(wanted.source, "audit", expected="results", found="; ".join(console.reasons))
        return Audit.read(RESULTS.resolve())


def _path(path: str | Path | None) -> Path | None:
    return None if path is None else Path(path)


def _camera_source(cameras: str | Path) -> str | Path:
    from gspure.cameras import GENERATED

    return cameras if cameras in GENERATED else Path(cameras)


@contextmanager
def _quiet() -> Iterator[None]:
    """Leave out progress in the block."""
    before = progress.quiet
    progress.quiet = True
    try:
        yield
    finally:
        progress.quiet = before


@contextmanager
def prepared(wanted: AuditRequest, *, is_rehearsal: bool = False) -> Iterator[tuple[Path, Path]]:
    """Enter the folder of a run, keep other runs out of it, and yield the configuration and the folder.

    A rehearsal leaves no files, and stays in the current folder if the run would make a new one.
    """
    if wanted.is_configuration:
        of_models = {
            "--cameras": wanted.cameras,
            "--up": wanted.up,
            "--key": wanted.key,
            "a suite": wanted.suite_name,
            "--out": wanted.out,
        }
        given = ", ".join(name for name, value in of_models.items() if value)
        if given:
            raise InputError(wanted.source, "options", expected="none of a model beside a configuration", found=given)
        with nullcontext() if is_rehearsal else alone_in(Path.cwd()):
            yield wanted.source, Path()
    elif is_rehearsal:
        place = wanted.out or own_place(wanted)
        if place != Path() and place.is_dir():
            wanted = wanted.resolved()
        else:
            place = Path()
        with TemporaryDirectory() as folder, chdir(place):
            yield write_configuration(wanted, Path(folder) / AUDIT_FILE.name, draws=False), Path()
    else:
        from gspure.model.copies import STORED, copies_in

        place = wanted.out or own_place(wanted)
        if place != Path():
            wanted = wanted.resolved()
            place.mkdir(parents=True, exist_ok=True)
            say(f"all files go to {place}")
        with chdir(place), alone_in(Path()), copies_in(STORED):
            yield write_configuration(wanted, AUDIT_FILE, draws=True), place


@dataclass(frozen=True)
class Run:
    """How a run ended: whether all jobs succeeded, and whether it wrote a report."""

    succeeded: bool
    has_report: bool


def run_to_report(words: Sequence[str], console: Console | None) -> Run:
    """Run Snakemake with its options, also where an earlier run was killed; a console takes the place of its output."""
    if unlock(words):
        say("an earlier run was killed: what it left undone is done now")
    page = RESULTS / "report.html"
    earlier = page.stat().st_mtime_ns if page.is_file() else 0
    succeeded = run_workflow(words, console)
    return Run(succeeded, succeeded or (page.is_file() and page.stat().st_mtime_ns > earlier))


def snakemake_options(configuration: Path, cores: int | None) -> list[str]:
    """Return the options of Snakemake: the workflow with its own profile and a configuration, which is the last."""
    profile = snakefile().parent / "profiles" / "default"
    words = ["--snakefile", str(snakefile()), "--workflow-profile", str(profile)]
    if cores:
        words += ["--cores", str(cores)]
    return [*words, "--configfile", str(configuration)]


def snakefile() -> Path:
    """Return the workflow: inside an installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "workflow" / "Snakefile"
    return installed if installed.is_file() else package.parent / "Snakefile"
