"""The notebook runs, and shows what it says."""

import json
import re
from pathlib import Path

import matplotlib as mpl
import pytest

NOTEBOOK = Path(__file__).parents[1] / "examples" / "audit_a_model.ipynb"
CELLS = [cell for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


def drops(printed):
    """PSNR of scene and message after each attack."""
    lines = re.findall(r"(\w+) +scene +([\d.]+) dB +message +([\d.]+) dB", printed)
    return {name: (float(scene), float(message)) for name, scene, message in lines}


def test_every_cell_of_the_notebook_runs_and_is_stored_with_its_results(tmp_path, monkeypatch, capsys):
    outputs = [output for cell in CELLS for output in cell["outputs"]]
    assert all(cell["execution_count"] for cell in CELLS)
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    names = {}
    for cell in CELLS:
        exec("".join(cell["source"]), names)  # noqa: S102
    after = drops(capsys.readouterr().out)
    assert after["GSPure"][0] > after["random"][0] + 5
    assert after["GSPure"][1] < after["random"][1]
    stored = drops("".join(line for output in CELLS[-1]["outputs"] for line in output["text"]))
    assert after["GSPure"] == pytest.approx(stored["GSPure"], abs=1)
