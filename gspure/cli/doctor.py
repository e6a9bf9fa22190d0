"""``gspure doctor``: check OpenCL, OpenGL and packages."""

import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement

import gspure
from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure doctor
  gspure doctor --fix            # install what is missing into this environment
  GSPURE_DEVICE=1 gspure doctor  # check one device
"""

_CHECKOUT: Final = Path(gspure.__file__).resolve().parents[1]  # of an editable installation


@dataclass(frozen=True)
class Finding:
    """One line of the report."""

    ok: bool
    cells: tuple[str, ...]  # by column
    needed: bool = True  # gspure cannot run without it
    fix: str = ""  # a command


def add_arguments(parser: Parser) -> None:
    parser.flag("--fix", "install missing packages, and an OpenCL driver, with pip, into this environment")


def run(args: Arguments) -> int:
    """Print the report; return 0 if gspure can run, else 1."""
    fixes = examine()
    by_pip = [fix for fix in fixes if fix.startswith(shlex.quote(sys.executable))]
    if args.fix and by_pip:
        for fix in by_pip:
            print(f"\n{fix}", flush=True)
            subprocess.run(shlex.split(fix), check=False)
        print(flush=True)
        fixes = examine()
    if fixes:
        print("\ngspure cannot run yet: see the fixes above.")
        return 1
    print("\ngspure can run.")
    return 0


def examine() -> list[str]:
    """Print the findings; return the fix of each fault without which gspure cannot run."""
    checks = {
        "Packages: installed, required": packages,
        "Plug-ins: attacks and schemes of installed packages": plug_ins,
        "OpenGL: a picture drawn off screen": opengl,
        "OpenCL: a small frame rendered on each device": opencl,
    }
    system = f"{platform.system()} {platform.machine()}"
    print(f"gspure {gspure.__version__}, Python {platform.python_version()}, {system}", flush=True)
    faults: list[Finding] = []
    with ThreadPoolExecutor() as pool:  # each check waits for a subprocess
        for title, findings in zip(checks, pool.map(lambda check: check(), checks.values()), strict=True):
            print(*report(title, findings), sep="\n", flush=True)
            faults += [finding for finding in findings if finding.needed and not finding.ok]
    return [finding.fix for finding in faults]


def opencl() -> list[Finding]:
    """Return one finding per OpenCL device, and another if none is usable."""
    from gspure.opencl.selftest import try_devices

    trials = try_devices()
    working = [trial for trial in trials if trial.problem is None]
    usable = [trial for trial in working if trial.selected]
    findings = []
    for trial in trials:
        use = ", in use" if trial in usable[:1] else ""
        status = trial.problem or f"{trial.seconds:.1f} s{use}"
        cells = (str(trial.index), trial.kind, trial.name, f"{trial.platform} {trial.driver}", status)
        findings.append(Finding(trial in working, cells, needed=False))
    if working and not usable:
        mismatch = f"GSPURE_DEVICE={os.environ.get('GSPURE_DEVICE')} matches no working device"
        findings.append(Finding(ok=False, cells=(mismatch,), fix="unset GSPURE_DEVICE"))
    elif not usable:
        by_pip = (platform.system(), platform.machine()) == ("Linux", "x86_64")
        driver = _pip("intel-opencl-rt", "intel-cmplr-lib-rt") if by_pip else "sudo apt-get install pocl-opencl-icd"
        findings.append(Finding(ok=False, cells=("no working device",), fix=_make("opencl") or driver))
    return findings


def opengl() -> list[Finding]:
    """Return whether 3-D figures can be drawn with OpenGL."""
    from gspure.figures.plates import opengl_renderer

    renderer = opengl_renderer()
    if renderer:
        return [Finding(ok=True, cells=(renderer,), needed=False)]
    fix = _make("gl") or "sudo apt-get install libegl1 libgl1-mesa-dri"
    return [Finding(ok=False, cells=("off-screen rendering fails: no point clouds",), needed=False, fix=fix)]


def packages() -> list[Finding]:
    """Return one finding per package that gspure requires."""
    try:
        requirements = map(Requirement, metadata.requires("gspure") or [])
    except metadata.PackageNotFoundError:
        return [Finding(ok=False, cells=("gspure", "is not installed"), fix=_pip("--editable", str(_CHECKOUT)))]
    findings = []
    wanted = [(r.name, r.specifier) for r in requirements if not r.marker or r.marker.evaluate({"extra": ""})]
    for name, specifier in wanted:
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            version = "missing"
        ok = version != "missing" and specifier.contains(version, prereleases=True)
        findings.append(Finding(ok, (name, version, str(specifier)), fix=_pip(f"{name}{specifier}")))
    return findings


def plug_ins() -> list[Finding]:
    """Return one finding per plug-in."""
    from gspure.errors import InputError
    from gspure.plugins import installed, loaded, package_of

    findings = []
    for entry in installed():
        try:
            plugin = loaded(entry)
        except InputError as error:
            findings.append(Finding(ok=False, cells=(entry.name, package_of(entry), error.found), needed=False))
            continue
        names = [added.name for added in (*plugin.attacks, *plugin.schemes)]
        cells = (entry.name, package_of(entry), ", ".join([*names, *plugin.detectors]))
        findings.append(Finding(ok=True, cells=cells, needed=False))
    return findings or [Finding(ok=True, cells=("none",), needed=False)]


def _pip(*arguments: str) -> str:
    return shlex.join([sys.executable, "-m", "pip", "install", *arguments])


def _make(target: str) -> str | None:
    """Return the make command that repairs this installation, if make created it."""
    by_make = (_CHECKOUT / "Makefile").is_file() and Path(sys.prefix).resolve() == (_CHECKOUT / ".venv").resolve()
    return f"make -C {shlex.quote(str(_CHECKOUT))} {target}" if by_make else None


def _colour(finding: Finding) -> int:
    """Return the terminal's colour: green, or red for a fault and yellow for a remark."""
    if finding.ok:
        return 32
    return 31 if finding.needed else 33


def report(title: str, findings: Sequence[Finding]) -> Iterator[str]:
    """Yield the lines of a section; columns of rows of equal length are aligned."""
    yield f"\n{title}"
    for finding in findings:
        table = [row.cells for row in findings if len(row.cells) == len(finding.cells)]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        cells = "  ".join(cell.ljust(width) for cell, width in zip(finding.cells, widths, strict=True))
        word = "ok" if finding.ok else "no"
        mark = f"\033[{_colour(finding)}m{word}\033[0m" if sys.stdout.isatty() else word
        yield f"  {mark}  {cells}".rstrip()
        if not finding.ok and finding.fix:
            yield f"        fix: {finding.fix}"
