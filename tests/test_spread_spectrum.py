"""The example of a detector: it reads what it embeds, and nothing else."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys

import numpy as np
import pytest

from gspure.cli import detect
from gspure.evaluation.detection import read_marks
from gspure.images import write_image
from tests.documentation import ROOT


def test_the_example_of_the_help_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    write_image(tmp_path / "a.png", np.random.default_rng(0).random((32, 32, 3)))
    words = shlex.split(detect.EXAMPLES.splitlines()[0])
    command = words[words.index("--command") + 1].replace("python", shlex.quote(sys.executable), 1)
    assert [reading.view for reading in read_marks(command, tmp_path, "", 60)] == ["a"]


def test_the_example_reads_what_it_embeds(tmp_path):
    rng = np.random.default_rng(0)
    for i in range(4):
        write_image(tmp_path / "clean" / f"{i}.png", 0.2 + 0.6 * rng.random((9, 12, 3)).repeat(8, 0).repeat(8, 1))
    script = [sys.executable, str(ROOT / "examples" / "spread_spectrum.py")]

    def embed(folder, *options):
        words = [*script, "embed", "--key", "7", *options, str(tmp_path / "clean"), str(tmp_path / folder)]
        subprocess.run(words, check=True)

    def score(folder, *options):
        return [row.level for row in read_marks(shlex.join([*script, "detect", *options]), tmp_path / folder, "", 60)]

    embed("marked")
    for folder, options in (("clean", []), ("marked", []), ("new", ["--bits", "01x"]), ("new", ["--strength", "nan"])):
        with pytest.raises(subprocess.CalledProcessError):
            embed(folder, *options)
    embed("bits", "--bits", "01101001")
    assert min(score("marked", "--key", "7")) > 3
    assert np.abs(score("clean", "--key", "7")).max() < 3
    assert np.abs(score("marked", "--key", "8")).max() < 3
    command = shlex.join([*script, "detect", "--key", "7", "--count", "8"])
    assert np.mean([row.level for row in read_marks(command, tmp_path / "bits", "01101001", 60)]) > 85


def run_example(*words):
    script = ROOT / "examples" / "spread_spectrum.py"
    return subprocess.run([sys.executable, script, *map(str, words)], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("level", [0.0, 0.5, 1.0])
def test_the_example_reads_flat_images_as_unmarked_ones(tmp_path, level):
    write_image(tmp_path / "flat.png", np.full((32, 48, 3), level))
    reading = run_example("detect", "--key", 7, "--count", 64, tmp_path)
    assert 20 < json.loads(reading.stdout)["flat"].count("1") < 44
    scores = [json.loads(run_example("detect", "--key", key, tmp_path).stdout)["flat"] for key in range(6)]
    assert 0.2 < np.std(scores) < 3
    assert np.abs(scores).max() < 4


@pytest.mark.parametrize("options", [("--key", "-7"), ("--key", "7", "--count", "-1"), ("--key", "7")])
def test_the_example_refuses_numbers_below_0_and_images_without_its_frequencies(tmp_path, options):
    write_image(tmp_path / "small.png", np.zeros((4, 4, 3)))
    refused = run_example("detect", *options, tmp_path)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "expected" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_the_example_refuses_an_image_that_cannot_be_read(tmp_path):
    (tmp_path / "broken.png").write_text("no image")
    refused = run_example("detect", "--key", 7, tmp_path)
    assert (refused.returncode, "Traceback" in refused.stderr) == (2, False)
    assert "broken.png" in refused.stderr
