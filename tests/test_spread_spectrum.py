"""The example of a detector: it reads what it embeds, and nothing else."""

import shlex
import subprocess
import sys

import numpy as np
import pytest

from gspure.images import write_image
from gspure.metrics.readings import read_marks
from tests.documentation import ROOT


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
