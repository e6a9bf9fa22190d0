"""The figures of one model, and the command that draws them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gspure.artifacts import record_of, save_array
from gspure.cameras import orbit_cameras, write_cameras
from gspure.cli import main
from gspure.figures import clouds, gallery, portrait, splats, style
from gspure.images import write_image
from gspure.method.clustering.store import Clusters, write_clusters
from gspure.model import write_model
from gspure.public_model import PublicModel
from gspure.renderer import Renderer
from tests.models import blobs, camera, gaussians, points_of

RNG = np.random.default_rng(3)
BALL = RNG.normal(size=(400, 3)).astype(np.float32)
PNG = b"\x89PNG\r\n"


def draw(*arguments) -> dict[Path, str]:
    """Draw all figures of a model; return their captions."""
    captions = {}
    for drawing in gallery.drawings(*arguments):
        drawing.draw()
        captions[drawing.path] = drawing.caption
    return captions


@pytest.fixture
def evidence(monkeypatch: pytest.MonkeyPatch) -> gallery.Evidence:
    monkeypatch.setattr(gallery, "PICTURE_WIDTH", 120)
    monkeypatch.setattr(gallery, "PAGE_WIDTH", 480)
    labels = np.repeat([-1, 0, 1, -1], 100).astype(np.int32)
    weights = np.where(np.arange(400) < 50, 0, RNG.random(400)).astype(np.float32)
    return gallery.Evidence(BALL, labels, weights, weights < 0.1, hidden=weights[::-1].copy())


def test_without_opengl_all_figures_are_drawn_and_say_why(
    tmp_path: Path, evidence: gallery.Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gallery, "gl_problem", lambda: "no driver: install one")
    monkeypatch.setattr(portrait, "_draw_balls", None)
    captions = draw(tmp_path / "figures", evidence)
    clouds = ("clusters", "ranks", "kept", "hidden")
    expected = {f"{name}{suffix}" for name in clouds for suffix in (".png", ".gltf", ".vtp")}
    expected |= {"purification.png", "weights.png", "weights.svg"}
    expected |= {f"{path}.json" for path in expected}
    assert {path.name for path in (tmp_path / "figures").iterdir()} == expected
    assert {path.stem for path in captions} == {*clouds, "purification", "weights"}
    for path, caption in captions.items():
        assert path.read_bytes().startswith(PNG)
        assert ("Drawn without OpenGL (no driver: install one)." in caption) == (path.stem != "weights")


def test_captions_name_the_rows_and_the_weight_that_pruning_removes(tmp_path: Path, evidence) -> None:
    hidden = np.where(evidence.pruned, 3 * evidence.weights.max(), 0).astype(np.float32)
    anchors = replace(evidence, hidden=hidden, rows="anchors")
    captions = {path.stem: caption for path, caption in draw(tmp_path, anchors).items()}
    assert captions.keys() == {"clusters", "ranks", "kept", "hidden", "purification", "weights"}
    assert "Pruning removes 100.0% of the weight in the message" in captions["purification"]
    assert not any("Gaussians" in caption for caption in captions.values())
    nowhere = draw(tmp_path, replace(evidence, hidden=np.zeros_like(hidden)))
    assert "No row holds weight of the message" in nowhere[tmp_path / "purification.png"]


def test_without_a_message_its_figures_are_left_out(tmp_path: Path, evidence) -> None:
    unmarked = draw(tmp_path, replace(evidence, hidden=None))
    assert {path.stem for path in unmarked} == {"clusters", "ranks", "kept", "weights"}


def test_a_purification_begins_with_a_render_from_the_viewpoint_of_its_clouds(tmp_path: Path, evidence, monkeypatch):
    plates, rendered = {}, []
    monkeypatch.setattr(gallery, "write_plate", lambda path, *rest: plates.update({path.stem: rest}))

    def render(view):
        rendered.append(view)
        return np.full((view.height, view.width, 3), 0.5)

    draw(tmp_path, evidence, [camera()], render)
    (view,) = rendered
    (picture, *others), clouds_shown, titles = plates["purification"]
    assert (picture == 128).all()
    assert {other.shape for other in others} == {picture.shape} == {(view.height, view.width, 3)}
    assert len(titles) == len(clouds_shown) == 4
    draw(tmp_path, evidence)
    assert plates["purification"][2] == titles[1:]


def test_a_fully_pruned_model_is_drawn(tmp_path: Path, evidence) -> None:
    draw(tmp_path, replace(evidence, pruned=np.ones(400, np.bool_)))
    assert (tmp_path / "purification.png").read_bytes().startswith(PNG)


def test_figures_are_the_same_bytes_again(tmp_path: Path, evidence: gallery.Evidence) -> None:
    for folder in "ab":
        draw(tmp_path / folder, evidence)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes(), path.name


def test_splats_show_clusters_in_their_colours_and_the_pruned_rows_alone(tmp_path: Path, monkeypatch) -> None:
    images = []
    monkeypatch.setattr(splats, "show", lambda axes, image, label: images.append(image))
    model, (labels, pruned) = PublicModel(blobs(40)), np.zeros((2, 40), np.int32)
    splats.splats(tmp_path, model, [camera()], labels, pruned.astype(bool), None).draw()
    model_image, clusters, alone = images
    passing = Renderer(blobs(40)).transmittance(camera())[..., None]
    colour = style.rgb(style.tint(style.CLUSTERS[0], clouds._PALE)) / 255  # of a kept cluster
    np.testing.assert_allclose(clusters, (1 - passing) * colour + passing, atol=1e-3)
    assert (alone == 1).all()
    splats.splats(tmp_path, model, [camera()], labels - 1, ~pruned.astype(bool), None).draw()
    *_, noise, alone = images
    np.testing.assert_allclose(alone, model_image + passing, atol=1e-3)
    assert noise.mean() > clusters.mean()


@pytest.fixture
def inputs(tmp_path: Path, evidence: gallery.Evidence) -> list[str]:
    files = {name: tmp_path / name for name in ("model.ply", "weights.npy", "clusters.npz", "cameras.json")}
    write_model(files["model.ply"], gaussians(means=BALL, scales=0.1))
    save_array(files["weights.npy"], evidence.weights)
    write_clusters(files["clusters.npz"], Clusters(evidence.labels, 0), {})
    write_cameras(files["cameras.json"], orbit_cameras(points_of(BALL, np.ones(400)), count=4, width=32, height=24))
    options = ("--model", "--weights", "--clusters", "--cameras")
    words = [word for pair in zip(options, map(str, files.values()), strict=True) for word in pair]
    return ["figures", "model", *words, "--out", str(tmp_path / "figures")]


def test_figures_of_a_model_have_their_captions_beside_them(tmp_path: Path, inputs: list[str]) -> None:
    assert main(inputs) == 0
    assert (tmp_path / "figures" / "kept.gltf").exists()
    note = json.loads((tmp_path / "figures" / "kept.png.json").read_text())
    assert "Gaussians are pruned" in note["settings"]["caption"]
    assert note["inputs"].keys() == {"model", "weights", "clusters", "cameras"}
    assert record_of(tmp_path / "figures" / "viewer.json")["inputs"] == note["inputs"]
    assert (tmp_path / "figures" / "splats.png").exists()


def test_the_figures_show_the_pruning_of_the_factors_in_their_captions(tmp_path: Path, inputs: list[str]) -> None:
    pruned = {}
    for tau in ("1", "100"):
        assert main([*inputs[:-1], str(tmp_path / tau), "--tau-n", tau, "--tau-c", tau]) == 0
        notes = [json.loads((tmp_path / tau / f"{name}.png.json").read_text()) for name in ("kept", "weights")]
        kept, weights = (note["settings"]["caption"] for note in notes)
        assert f"below ω̄/{tau}," in weights
        pruned[tau] = int(kept.partition(" of ")[0])
    assert pruned["1"] > pruned["100"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (["--weights", "{}/short.npy"], "short.npy: array: expected float32 [400], found float32 [3]"),
        (["--hidden", "{}/absent.npy"], "absent.npy: no such file"),
    ],
)
def test_files_that_do_not_fit_the_model_are_refused_in_one_line(tmp_path: Path, inputs, capsys, change, told) -> None:
    save_array(tmp_path / "short.npy", np.zeros(3, np.float32))
    assert main([*inputs, *(word.format(tmp_path) for word in change)]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert not (tmp_path / "figures").exists()


def test_panels_take_the_views_that_all_columns_have(tmp_path: Path, capsys) -> None:
    for folder, names in (("before", "abcde"), ("after", "bcdef")):
        for name in names:
            write_image(tmp_path / folder / f"{name}.png", np.full((6, 8, 3), ord(name) / 255, np.float32))
    columns = [f"--column={folder}={tmp_path / folder}" for folder in ("before", "after")]
    assert main(["figures", "panels", *columns, "--rows", "2", "--out", str(tmp_path / "panels.png")]) == 0
    note = json.loads((tmp_path / "panels.png.json").read_text())
    assert note["inputs"].keys() == {"before b", "before e", "after b", "after e"}
    assert "2 of 4 views" in note["settings"]["caption"]
    with Image.open(tmp_path / "panels.png") as image:
        assert image.width == style.PAGE * style.DPI

    (tmp_path / "empty").mkdir()
    assert main(["figures", "panels", *columns, f"--column=x={tmp_path / 'empty'}", "--out", "x.png"]) == 2
    assert "expected a view of all columns" in capsys.readouterr().err
    assert main(["figures", "panels", columns[0], "--out", "x.png"]) == 2
    assert "--column: expected a reference and another" in capsys.readouterr().err
