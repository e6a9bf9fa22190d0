"""Reading and writing a model of a million Gaussians; the file lies in the system's cache."""

from pathlib import Path

import numpy as np
import pytest
from findings import Findings
from room import LARGE
from timing import Measure

from gspure.model import read_model, write_model


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ply") / "room.ply"
    write_model(path, LARGE.model)
    return path


def read_all(path: Path) -> tuple[object, ...]:
    model = read_model(path)
    return model.means, model.quats, model.scales, model.opacities, model.sh_coeffs


def test_ply_files(path: Path, measure: Measure, findings: Findings) -> None:
    model = LARGE.model
    keep = np.arange(len(model)) % 4 > 0
    copy = path.with_name("copy.ply")
    times = measure(
        {
            "read (map)": lambda: read_model(path),
            "read every column": lambda: read_all(path),
            "read, drop a quarter": lambda: read_model(path)[keep],
            "write": lambda: write_model(copy, model),
        },
        rounds=5,
    )
    assert copy.read_bytes() == path.read_bytes()
    size = path.stat().st_size
    findings.figure("file, MB", size / 1e6)
    for name in ("read every column", "write"):
        findings.figure(f"{name}, MB/s", size / 1e6 / np.median(times[name].wall))
