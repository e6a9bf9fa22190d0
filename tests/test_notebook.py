"""The notebook: it runs, and shows what it says."""

import json
import re
from pathlib import Path

import matplotlib as mpl
import pytest

NOTEBOOK = Path(__file__).parents[1] / "examples" / "audit_a_model.ipynb"


def cells():
    return [cell for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


def drops(printed):
    """PSNR of scene and message after each attack."""
    lines = re.findall(r"(\w+) +scene +([\d.]+) dB +message +([\d.]+) dB", printed)
    return {name: (float(scene), float(message)) for name, scene, message in lines}


def test_the_notebook_is_stored_with_its_results():
    assert all(cell["execution_count"] for cell in cells())
    outputs = [output for cell in cells() for output in cell["outputs"]]
    assert {output["output_type"] for output in outputs} <= {"stream", "display_data", "execute_result"}
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2


def test_every_cell_of_the_notebook_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    names = {}
    for cell in cells():
        exec("".join(cell["source"]), names)  # noqa: S102
    after = drops(capsys.readouterr().out)
    assert after["GSPure"][0] > after["random"][0] + 5
    assert after["GSPure"][1] < after["random"][1]
    stored = drops("".join(line for output in cells()[-1]["outputs"] for line in output["text"]))
    assert after["GSPure"] == pytest.approx(stored["GSPure"], abs=1)
