"""The numbers of all tables on a fixed benchmark: no rearrangement of the code may change a digit."""

import hashlib
import re
from pathlib import Path

import numpy as np

from gspure.evaluation.contest import Contest, contest
from gspure.evaluation.csv_tables import write_table
from gspure.evaluation.matched import Matched, match
from gspure.evaluation.results import write_results
from gspure.evaluation.summary import Summary, summarize
from gspure.evaluation.survival import Survival, survival
from tests.contest_cases import benchmark

SWEEPS = {"gspure": ["gspure", "tau_2"], "pruning": ["weak", "strong"]}

CELLS = {  # SHA-256 of all rows below the header, in six digits: they change with the columns only
    "contest.csv": "8006cd6dc530819b",
    "matched.csv": "6898bc5d0c36d59e",
    "results.csv": "17809a19befd20f5",
    "summary.csv": "a04d0d35e75f95a7",
    "survival.csv": "b4d906b056f600ac",
}


def test_the_cells_of_all_tables_do_not_change(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    variants = ("gspure", "tau_2", "weak", "strong", "gof")
    drops = {f"s{i}": {name: tuple(rng.uniform(0, 20, 2).round(3).tolist()) for name in variants} for i in range(7)}
    outcomes = benchmark(drops, seeds=2)
    write_results(tmp_path / "results.csv", outcomes)
    write_table(tmp_path / "summary.csv", Summary, summarize(outcomes))
    gentle = {scene: {name: (s / 10, m) for name, (s, m) in of.items()} for scene, of in drops.items()}
    write_table(tmp_path / "matched.csv", Matched, match(benchmark(gentle, seeds=2), SWEEPS))
    write_table(tmp_path / "contest.csv", Contest, contest(outcomes, SWEEPS))
    write_table(tmp_path / "survival.csv", Survival, survival(outcomes))
    tables = {path.name: path.read_text().partition("\n")[2] for path in tmp_path.glob("*.csv")}
    rounded = {
        name: re.sub(r"-?\d+\.\d+(e-\d+)?", lambda x: f"{float(x[0]):.6g}", cells) for name, cells in tables.items()
    }
    named_as_then = {name: cells.replace("unattacked", "watermarked").encode() for name, cells in rounded.items()}
    assert {name: hashlib.sha256(cells).hexdigest()[:16] for name, cells in named_as_then.items()} == CELLS
