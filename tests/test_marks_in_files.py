"""The examples of marks: bits in opacities, and in a statistic of positions."""

import shlex
import subprocess
import sys

import numpy as np

from gspure.cli import main
from gspure.files import read_json
from gspure.metrics.csv_tables import read_table
from gspure.metrics.readings import MODEL, Reading
from gspure.model import write_model
from tests.attack_cases import changed
from tests.documentation import ROOT
from tests.models import blobs


def test_a_model_without_the_mark_or_another_key_shows_other_bits(trained):
    marked = trained("lsb_opacities")
    clean, _ = marked.scheme.embed(marked.pair, 0, message_weight=0, **marked.settings)
    assert changed(clean.model, marked.public.model) == {"opacity"}
    np.testing.assert_allclose(marked.public.model.opacities, clean.model.opacities, rtol=1e-6)
    wrong = marked.key.wrong(np.random.default_rng(1))
    assert max(marked.key.model_readings(clean)[0].level, wrong.model_readings(marked.public)[0].level) < 80


def test_commands_embed_bits_and_read_them_from_the_file_only(pair_folder, tmp_path, capsys):
    settings = ["--set=iterations=30", "--set=max_gaussians=400"]
    assert main(["embed", "lsb_opacities", str(pair_folder), "--out", str(tmp_path / "marked"), *settings]) == 0
    assert read_json(tmp_path / "marked" / "key" / "readability.json")["readable"]
    out = tmp_path / "bits.csv"
    key = ["--key", str(tmp_path / "marked" / "key"), "--out", str(out)]
    for model in ("marked/public", "marked/public/point_cloud.ply"):
        assert main(["detect", str(tmp_path / model), *key]) == 0
        (read,) = read_table(out, Reading)
        assert (read.view, read.level, read.bits, len(read.decoded)) == (MODEL, 100.0, 32, 32)
    cameras = ["--cameras", str(pair_folder / "cameras.json"), "--out", str(tmp_path / "renders")]
    assert main(["render", str(tmp_path / "marked/public"), *cameras]) == 0
    assert main(["detect", str(tmp_path / "renders"), *key]) == 2
    assert "expected bits that images show, found none" in capsys.readouterr().err


def test_a_detector_reads_bits_in_a_statistic_of_positions(tmp_path):
    bits = "0110100110010110"
    write_model(tmp_path / "clean.ply", blobs(2000))
    script = shlex.join([sys.executable, str(ROOT / "examples" / "position_statistics.py")])
    words = f"{script} embed --key 7 --bits {bits} {tmp_path / 'clean.ply'} {tmp_path / 'marked.ply'}"
    subprocess.run(shlex.split(words), check=True)

    def level(name, key):
        command = f"{script} detect --key {key} --count 16"
        words = ["detect", str(tmp_path / name), "--command", command, "--message", bits, "--out"]
        assert main([*words, str(tmp_path / "bits.csv")]) == 0
        return read_table(tmp_path / "bits.csv", Reading)[0].level

    assert level("marked.ply", 7) == 100
    assert max(level("clean.ply", 7), level("marked.ply", 8)) < 90
