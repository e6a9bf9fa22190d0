"""What commands write: each once on small inputs, with its provenance and the run ID of the embedding; and filters."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import read_cameras, split
from gspure.cli import main
from gspure.files import alone_in, file_digest, read_json
from gspure.images import read_image, write_image
from gspure.metrics.comparison import read_metrics
from gspure.metrics.legibility import READABLE
from gspure.model import read_model, write_model
from gspure.model.finite import FILTER, filtered
from gspure.provenance import run_of
from gspure.renderer import Renderer
from tests.models import blobs, covariances, with_column

EXTRACT = "extract marked/public --scheme planted --cameras pair --split test"


def gspure(line: str, *words: str) -> int:
    return main([*line.split(), *words])


@pytest.fixture(scope="module")
def embedded(pair_folder, tmp_path_factory):
    """A pair, a marked model and another one."""
    folder = tmp_path_factory.mktemp("embedded")
    shutil.copytree(pair_folder, folder / "pair")
    for name, seed in (("marked", 0), ("other", 1)):
        assert gspure(f"embed planted {folder}/pair --set gaussians=300 --seed {seed} --out {folder}/{name}") == 0
    return folder


@pytest.fixture
def folder(embedded, asset):
    """A copy of it, with a vanilla model and its cameras; it is the current folder."""
    return shutil.copytree(embedded, asset, dirs_exist_ok=True)


def record(path):
    """The provenance of a folder, without its settings."""
    provenance = read_json(Path(path) / "provenance.json")
    inputs = {name: entry["path"] for name, entry in provenance["inputs"].items()}
    return provenance["command"], inputs, provenance.get("run")


def test_public_model_key_and_results_have_one_run_and_only_the_key_names_the_seed(folder, capsys):
    run = run_of(Path("marked"))
    assert run == file_digest(Path("marked/public/point_cloud.ply"))[: len(run)]
    assert run_of(Path("marked/public")) == run_of(Path("marked/key")) == run != run_of(Path("other/key"))
    assert read_json(Path("marked/key/provenance.json"))["settings"]["seed"] == 0
    assert read_json(Path("marked/public/provenance.json"))["settings"] == {"scheme": "planted"}
    check = read_json(Path("marked/key/readability.json"))
    is_above = check["message"] > check["controls"]["wrong_key"]
    assert check["readable"] == (is_above and check["message"] >= 100 * READABLE)
    assert gspure("attack random_pruning --model marked/public/point_cloud.ply --out attacked/point_cloud.ply") == 0
    assert record("attacked") == ("attack", {"model": "marked/public/point_cloud.ply"}, run)
    assert gspure("render attacked/point_cloud.ply --cameras pair --split test --out after") == 0
    assert gspure("render marked/public --cameras pair --split test --out before") == 0
    assert gspure("metrics before after --out measured/metrics.csv") == 0
    assert {run_of(Path(name)) for name in ("after", "before", "measured")} == {run}
    assert gspure("info marked/public/point_cloud.ply") == 0
    assert f"  run {run}\n" in capsys.readouterr().out


def test_extract_takes_the_key_of_another_run_only_as_a_control(folder, capsys):
    runs = [run_of(Path(name)) for name in ("marked", "other")]
    assert gspure(EXTRACT, "--key", "marked/key", "--out", "message") == 0
    command, inputs, run = record("message")
    assert (command, inputs["model"], run) == ("extract", "marked/public/point_cloud.ply", runs[0])
    in_views_of_scene = re.findall("readable: .*", capsys.readouterr().err)
    assert gspure(EXTRACT.replace("--cameras pair", "--key marked/key --out of_message")) == 0
    assert in_views_of_scene == re.findall("readable: .*", capsys.readouterr().err) != []
    assert {path.stem for path in Path("message").glob("*.png")} == {v.name for v in split(read_cameras("pair"))[1]}
    capsys.readouterr()
    assert gspure(EXTRACT, "--key", "other/key", "--out", "refused") == 2
    assert f"other/key: run: expected {runs[0]}, as of the model, found {runs[1]}" in capsys.readouterr().err
    assert not Path("refused").exists()
    assert gspure(EXTRACT, "--key", "marked/key", "--extraction", "guess", "--out", "refused") == 2
    assert "scheme planted: --extraction: expected one of message, found 'guess'" in capsys.readouterr().err
    assert gspure(EXTRACT, "--key", "other/key", "--out", "control", "--control") == 0
    assert gspure(EXTRACT, "--key", "marked/key", "--out", "wrong", "--wrong-key", "1") == 0
    images = [read_image(next(Path(name).glob("*.png"))) for name in ("message", "wrong")]
    assert (images[0] != images[1]).any()


def test_render_names_images_after_views(folder):
    assert gspure("render model.ply --cameras cameras.json --split test --npy --background 0 0.5 1 --out renders") == 0
    held_out = split(read_cameras("cameras.json"))[1]
    images = {f"{view.name}.{kind}" for view in held_out for kind in ("npy", "png")}
    assert {path.name for path in Path("renders").iterdir()} == {*images, "provenance.json"}
    floats = np.load(f"renders/{held_out[0].name}.npy")
    np.testing.assert_array_equal(floats, Renderer(blobs(30)).image(held_out[0], background=(0, 0.5, 1)))
    image = read_image(f"renders/{held_out[0].name}.png")
    np.testing.assert_allclose(image, np.clip(floats, 0, 1), atol=0.5 / 255 + 1e-6)


def test_a_moved_model_looks_the_same_in_views_that_move_with_it(folder):
    words = "attack rigid_transform --model model.ply --set angle=40 --set scale=1.5 --out moved.ply"
    assert gspure(words, "--transform", "transform.npy") == 0
    for name, options in (("model", ""), ("moved", "--transform transform.npy")):
        assert gspure(f"render {name}.ply --cameras cameras.json --split test --out {name} {options}") == 0
    assert gspure("metrics model moved --out metrics.csv") == 0
    assert min(row.psnr for row in read_metrics(Path("metrics.csv"))) > 40


def test_attack_writes_the_mask_of_removed_rows_and_its_settings(folder, capsys):
    words = "attack lowest_weight --model model.ply --weights weights.npy --set fraction={} --out out.ply"
    np.save("weights.npy", np.arange(30, dtype=np.float32))
    assert gspure(words.format(1)) == 2
    assert "attack lowest_weight: not applicable: none of 30 rows would remain" in capsys.readouterr().err
    assert gspure(words.format(0.5), "--removed", "removed.npy") == 0
    np.testing.assert_array_equal(np.load("removed.npy"), np.arange(30) < 15)
    assert read_model("out.ply").table.tobytes() == blobs(30).table[15:].tobytes()
    assert read_json(Path("provenance.json"))["settings"]["set"] == {"fraction": 0.5}
    with alone_in(Path.cwd()):
        assert gspure(words.format(0.5)) == 2
    assert "expected no other run here" in capsys.readouterr().err


def test_attack_searches_for_a_damage_against_photographs_only(folder, capsys):
    words = "attack random_pruning --model model.ply --damage 1 --cameras cameras.json --out damaged/model.ply"
    assert gspure(words) == 2
    assert "attack: --photographs: expected photographs of the views, found none" in capsys.readouterr().err
    assert not Path("damaged/model.ply").exists()
    for view in split(read_cameras("cameras.json"))[1]:
        write_image(Path("photographs", f"{view.name}.png"), 0.95 * Renderer(blobs(30)).image(view))
    assert gspure(words, "--photographs", "photographs") == 0
    assert 0 < read_json(Path("damaged/provenance.json"))["settings"]["set"]["fraction"] < 1


ROWS = 60


def test_a_filter_widens_gaussians_and_keeps_their_mass():
    sizes = np.linspace(0, 0.3, ROWS)
    stored = with_column(blobs(ROWS), FILTER, sizes)
    drawn = filtered(stored)
    expected = covariances(stored) + sizes[:, None, None] ** 2 * np.eye(3)
    np.testing.assert_allclose(covariances(drawn), expected, rtol=1e-4, atol=1e-6)
    mass = [model.opacities * np.sqrt(np.linalg.det(covariances(model))) for model in (stored, drawn)]
    np.testing.assert_allclose(*mass, rtol=1e-3)
    assert not drawn.table[FILTER].any()
    assert drawn.table[0] == stored.table[0], "a filter of 0 changes nothing"
    assert filtered(drawn) is drawn


def test_commands_draw_and_attack_what_the_filter_makes_of_a_model(asset):
    stored = with_column(blobs(ROWS), FILTER, 0.2)
    write_model("stored.ply", stored)
    write_model("fused.ply", filtered(stored))
    assert main(["attack", "unattacked", "--model", "stored.ply", "--out", "attacked.ply"]) == 0
    assert read_model("stored.ply").table.tobytes() == stored.table.tobytes()
    for name in ("stored", "fused", "attacked"):
        assert main(f"render {name}.ply --cameras cameras.json --split test --out {name}".split()) == 0
    images = [read_image(f"{name}/view_0.png") for name in ("stored", "fused", "attacked")]
    assert all((image == images[0]).all() for image in images)
    write_model("plain.ply", blobs(ROWS))
    assert main(["render", "plain.ply", "--cameras", "cameras.json", "--split", "test", "--out", "plain"]) == 0
    assert np.abs(read_image("plain/view_0.png") - images[0]).max() > 0.05
