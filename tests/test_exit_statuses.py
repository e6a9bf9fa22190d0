"""Exit statuses: shell lines for every situation of the table in docs/troubleshooting.md."""

import re
import subprocess
import sys

import pytest

from gspure.evaluation.collecting import collect
from gspure.evaluation.judging import judged
from gspure.evaluation.results import write_results
from tests.documentation import ROOT
from tests.outcome_cases import write_model

TABLE = dict(re.findall(r"^\| (.+) \| (\d+) \|$", (ROOT / "docs" / "troubleshooting.md").read_text(), re.MULTILINE))
FAILED = "jobs failed; the verdict covers the others"
WRONG = "wrong option, configuration or file; no OpenCL device; full disk; closed standard output"
RADIUS = "[robust radius](statistics.md#the-robust-radius)"
CLOSED = "pipe closed, as by `head`"
SITUATIONS = [
    ("`audit` ended, even if the message is gone", "gspure audit mine.yaml", ""),
    (f"{RADIUS} at least `--fail-under`", "gspure audit mine.yaml --fail-under 0.7dB", ""),
    ("robust radius smaller than `--fail-under`", "gspure audit mine.yaml --fail-under 0.9", ""),
    (FAILED, "gspure audit mine.yaml --fail-under 0.9 | grep 'gone at 0.82 dB of damage'", "ended with status 1"),
    (FAILED, "touch results/report.html; PAGE=none gspure audit mine.yaml | (! grep .)", "ended with status 1"),
    (WRONG, "gspure audit model.ply --fail-under 1", "--key: expected one beside --fail-under"),
    (WRONG, "sed -i 1q results/tables/results.csv; gspure audit mine.yaml --fail-under 1", "expected a message"),
    (WRONG, "gspure info missing.ply", "missing.ply: no such file"),
    (WRONG, "gspure info cameras.json", "cameras.json: file: expected "),
    (WRONG, f"PYTHONPATH={ROOT} gspure audit metod.yaml", "metod: expected method?"),
    (
        WRONG,
        "OCL_ICD_VENDORS=/none gspure purify model.ply --cameras orbit --out o",
        "see `gspure doctor`",
    ),
    (
        WRONG,
        "gspure attack random_pruning --model model.ply --out o.ply > /dev/full; s=$?; test -f o.ply && exit $s",
        "No space left",
    ),
    (WRONG, "gspure info model.ply >&-", "standard output is closed"),
    (CLOSED, "gspure demo --dry-run --verbose | head --lines 1", ""),
    ("Ctrl-C", "gspure demo", "interrupted"),
    ("SIGTERM (SIGHUP: 129)", "gspure demo", "interrupted"),
]
SNAKEMAKE = {
    FAILED: "pathlib.Path('results', os.environ.get('PAGE', 'report.html')).touch(); sys.exit(1)",
    CLOSED: "while True: print('Building DAG of jobs', flush=True)",
    "Ctrl-C": "os.kill(os.getppid(), signal.SIGINT); time.sleep(60)",
    "SIGTERM (SIGHUP: 129)": "os.kill(os.getppid(), signal.SIGTERM); time.sleep(60)",
}
"""What Snakemake does, if it does anything."""


@pytest.fixture
def folder(asset, snakemake, monkeypatch):
    """A user's folder: a model, and an audit whose message is gone at 0.82 dB; the program `gspure` is on the path."""
    model = write_model(asset / "results", "sis/room", {"gof": (0.055, 1.0)})
    write_results(asset / "results/tables/results.csv", judged(collect(asset / "results", [model]), {}))
    (asset / "mine.yaml").write_text("{}")
    (asset / "metod.yaml").write_text("metod: {}")
    program = asset / "bin" / "gspure"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m gspure "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent), prepend=":")


@pytest.mark.parametrize(("situation", "line", "reason"), SITUATIONS, ids=[row[0] for row in SITUATIONS])
def test_a_situation_has_its_status_and_its_reason(folder, snakemake, situation, line, reason):
    snakemake(SNAKEMAKE.get(situation, ""))
    done = subprocess.run(["bash", "-o", "pipefail", "-c", line], capture_output=True, text=True, check=False)
    assert done.returncode == int(TABLE[situation]), done.stderr
    assert reason in done.stderr
    assert "BrokenPipeError" not in done.stderr


def test_the_table_names_the_situations_that_are_tested():
    assert [*TABLE] == [*dict.fromkeys(situation for situation, _, _ in SITUATIONS)]
