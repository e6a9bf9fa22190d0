"""Adapters, with a stand-in for an author's checkout: its programs hide a picture, or bits, and read them again."""

import ctypes
import re
import subprocess
import sys

import numpy as np
import pytest
import yaml

from gspure.cli import main
from gspure.files import read_json
from gspure.images import read_image, write_image
from gspure.metrics.comparison import read_metrics
from gspure.metrics.csv_tables import read_table
from gspure.metrics.readings import Reading
from gspure.model import read_model
from gspure.schemes.registry import find_scheme
from gspure.training.dataset import read_dataset
from tests.workflow_cases import ROOT

PROGRAM = """
import json, pathlib, shutil, sys
import numpy as np
from PIL import Image

def poses(project):
    lines = (project / "sparse/0/images.txt").read_text().splitlines()[::2]
    return np.array([line.split()[1:8] for line in lines], float)

def count(ply):
    return int(ply.read_bytes().partition(b"element vertex ")[2].split()[0])

program = sys.argv[1]
folders = [pathlib.Path(folder) for folder in sys.argv[2:]]
if program == "embed":
    model, message, out = folders
    (ply,) = model.glob("point_cloud/*/point_cloud.ply")
    shutil.copy(ply, out / "public")
    shutil.copytree(message, out / "key/message")
    (out / "key/count.txt").write_text(str(count(ply)))
    for name in ("message", "decoder"):
        (out / f"key/{name}.txt").write_text("01100101")
elif program == "extract":  # the photograph of the nearest pose, darker the more rows are missing
    key, model, cameras, out = folders
    brightness = 0.9 * count(model / "point_cloud.ply") / int((key / "count.txt").read_text())
    photographed = poses(key / "message")
    for number, pose in enumerate(poses(cameras)):
        nearest = np.abs(photographed - pose).sum(axis=1).argmin()
        image = Image.open(key / f"message/images/{nearest:05d}.png")
        image.point(lambda value: round(brightness * value)).save(out / f"{number:05d}.png")
elif program == "wrong":
    key, out = folders
    shutil.copytree(key, out, dirs_exist_ok=True)
    for image in (out / "message/images").glob("*.png"):
        Image.open(image).rotate(180).save(image)
else:  # detect
    key, images = folders
    bits = (key / "decoder.txt").read_text()
    zeros = "0" * len(bits)
    print(json.dumps({file.stem: bits if np.any(Image.open(file)) else zeros for file in images.glob("*.png")}))
"""
PICTURE = f"""
extract = "{sys.executable} program.py extract {{key}} {{model}} {{cameras}} {{out}}"
wrong = "{sys.executable} program.py wrong {{key}} {{out}}"
"""
BITS = f'detect = "{sys.executable} program.py detect {{key}}"'
SETTINGS = ["--set=iterations=30", "--set=max_gaussians=300"]


@pytest.fixture
def adapters(tmp_path, monkeypatch):
    """A folder with the adapters ``picture`` and ``marker``, and the checkout that both name."""
    checkout = tmp_path / "checkout"
    checkout.mkdir()
    (checkout / "program.py").write_text(PROGRAM)
    git = ["git", "-C", str(checkout), "-c", "user.name=a", "-c", "user.email=a@b"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "Publish"]):
        subprocess.run([*git, *words], check=True)
    commit = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True).stdout.strip()
    common = f'checkout = "../checkout"\ncommit = "{commit}"\n'
    common += f'embed = "{sys.executable} program.py embed {{scene_model}} {{message}} {{out}}"\n'
    (tmp_path / "adapters").mkdir()
    for name, reads in {"picture": PICTURE, "marker": BITS}.items():
        (tmp_path / "adapters" / f"{name}.toml").write_text(common + reads)
    monkeypatch.setenv("GSPURE_ADAPTERS", str(tmp_path / "adapters"))
    return tmp_path / "adapters"


def test_programs_of_a_checkout_hide_a_picture_and_show_it_in_any_view(adapters, pair_folder, tmp_path, capsys):
    out = tmp_path / "marked"
    assert main(["embed", "picture", str(pair_folder), "--out", str(out), *SETTINGS]) == 0
    assert read_json(out / "key" / "readability.json")["readable"]
    extract = ["extract", str(out / "public"), "--key", str(out / "key"), "--split", "train"]
    assert main([*extract, "--out", str(tmp_path / "message")]) == 0
    assert main([*extract, "--out", str(tmp_path / "wrong"), "--wrong-key", "1"]) == 0
    views = read_dataset(pair_folder / "message", "native").train
    for camera in views:
        expected = 0.9 * read_image(camera.image)
        message = read_image(tmp_path / "message" / f"{camera.name}.png")
        with_wrong_key = read_image(tmp_path / "wrong" / f"{camera.name}.png")
        assert np.abs(message - expected).max() < 0.005
        assert np.abs(with_wrong_key - expected).max() > 0.005
    copied = read_dataset(out / "key" / "message", "native")  # COLMAP's format is read as it was written
    cameras = sorted([*copied.train, *copied.test], key=lambda camera: camera.name)
    np.testing.assert_allclose([c.numbers for c in cameras], [c.numbers for c in views], rtol=1e-6, atol=1e-6)
    assert len(copied.xyz) == len(read_dataset(pair_folder / "message", "native").xyz)
    file = adapters / "picture.toml"
    file.write_text(file.read_text().replace("program.py extract", "-V #"))
    assert main([*extract, "--out", str(tmp_path / "nothing")]) == 2
    assert "extract: 00000.png: expected (36, 48, 3), found no such file" in capsys.readouterr().err
    unmarked = tmp_path / "clean"
    assert main(["embed", "picture", str(pair_folder), f"--out={unmarked}", "--set=message_weight=0", *SETTINGS]) == 0
    clean, marked = (read_model(folder / "public") for folder in (unmarked, out))
    assert clean.table.tobytes() == marked.table.tobytes()  # of the stand-in, which changes nothing


def test_programs_of_a_checkout_read_bits(adapters, pair_folder, tmp_path):
    out = tmp_path / "marked"
    assert main(["embed", "marker", str(pair_folder), "--out", str(out), *SETTINGS]) == 0
    marker = find_scheme("marker")
    assert marker.redrawn(marker.read_public(out / "public"), np.random.default_rng(0)) is None  # columns unknown
    for name, level in {"render": 1.0, "black": 0.0}.items():
        write_image(tmp_path / "images" / f"{name}.png", np.full((4, 4, 3), level))
    detect = ["detect", str(tmp_path / "images"), "--key", str(out / "key"), "--out", str(tmp_path / "bits.csv")]
    assert main(detect) == 0
    assert read_table(tmp_path / "bits.csv", Reading) == [
        Reading("black", 50.0, 8, "00000000"),
        Reading("render", 100.0, 8, "01100101"),
    ]
    assert main([*detect, "--wrong-key", "1"]) == 0
    assert read_table(tmp_path / "bits.csv", Reading)[1].level < 100
    assert main(["extract", *detect[1:-1], str(tmp_path / "message"), "--cameras", str(pair_folder)]) == 2


@pytest.mark.workflow
def test_the_workflow_evaluates_an_adapter_and_trains_again_after_an_edit(adapters, tmp_path):
    small = {"iterations": 30, "max_gaussians": 300}
    config = {"pairs": {"raised": {"views": 9, "width": 32, "height": 24}}, "threads": 1}
    config |= {"schemes": {"picture": small, "marker": small}, "variants": {"unattacked": {}, "gspure": {}}}
    config |= {"method": {"min_samples": 3, "min_cluster_size": 5}}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    run = [sys.executable, "-m", "snakemake", "-s", str(ROOT / "Snakefile"), "--configfile", "config.yaml", "--cores=2"]
    parts = "picture/raised/controls.json picture/raised/gspure/metrics.csv marker/raised/unattacked/metrics.csv"
    run += [f"results/{part}" for part in parts.split()]
    subprocess.run(run, cwd=tmp_path, check=True, capture_output=True)
    tables = [read_metrics(tmp_path / f"results/picture/raised/{name}/metrics.csv") for name in ("gspure", "wrong_key")]
    right, wrong = (np.mean([row.psnr for row in rows if row.target == "message"]) for rows in tables)
    assert right > wrong + 1
    readings = read_table(tmp_path / "results/marker/raised/unattacked/detections/bits.csv", Reading)
    assert {reading.level for reading in readings} == {100.0}
    with (adapters / "picture.toml").open("a") as stream:
        stream.write("# edited")
    planned = subprocess.run([*run, "--dry-run"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert {*re.findall(r"^embed_message +(\d+)$", planned, re.MULTILINE)} == {"1"}  # of the two schemes


FOR_CUDA = """
import torch
print("CUDA:", torch.cuda.is_available(), torch.zeros(1).cuda().device)
raise SystemExit("no message")
"""


def test_a_program_for_cuda_runs_without_a_driver_and_its_output_is_shown(
    adapters, pair_folder, tmp_path, capsys, monkeypatch
):
    pytest.importorskip("torch")
    load = ctypes.CDLL
    monkeypatch.setattr(ctypes, "CDLL", lambda name: load("none" if name == "libcuda.so.1" else name))
    (adapters.parent / "checkout" / "for_cuda.py").write_text(FOR_CUDA)
    file = adapters / "marker.toml"
    text = file.read_text().replace("program.py embed {scene_model} {message} {out}", "for_cuda.py")
    file.write_text(f"cuda = true\n{text}")
    assert main(["embed", "marker", str(pair_folder), "--out", str(tmp_path / "out"), *SETTINGS]) == 2
    errors = capsys.readouterr().err
    assert "embed: CUDA: True cpu" in errors
    assert errors.splitlines()[-1].endswith("embed: expected success, found no message")


FAULTS = {
    "commit": ('commit = "', 'commit = "0', "commit: expected 0"),
    "edited": ("", "", "changes: M program.py"),
    "no git": ('checkout = "../checkout"', 'checkout = "nowhere"', "cannot change to"),
    "failed": ("embed {scene", "{scene", "embed: expected success, found "),
    "placeholder": ("{message}", "{massage}", "embed: expected no placeholders but"),
    "nothing": ("program.py embed {scene_model} {message} {out}", "-V", "expected public/point_cloud.ply in {out}"),
    "field": ("detect =", "decode =", "decode: expected one of checkout, commit"),
    "type": ("commit = ", "cuda = 1\ncommit = ", "cuda: expected a text, or of `cuda` true or false"),
    "no reader": ("detect =", 'wrong = "" #', "fields: expected `extract` or `detect`"),
    "public": ("detect =", 'public = "none" #', "public: expected one of splats_in_splats"),
    "quote": ("program.py embed", "'program.py embed", "marker.toml: "),
    "TOML": ("commit = ", "commit ", "the description of an adapter"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_cannot_run_is_refused_in_one_line(fault, adapters, pair_folder, tmp_path, capsys):
    before, after, reason = FAULTS[fault]
    file = adapters / "marker.toml"
    file.write_text(file.read_text().replace(before, after, 1))
    if fault == "edited":
        (adapters.parent / "checkout" / "program.py").write_text("")
    assert main(["embed", "marker", str(pair_folder), "--out", str(tmp_path / "out"), *SETTINGS, "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert reason in line
    assert not [*tmp_path.glob("out/*")]
