"""Keys fitted to an attacked model: what they improve, and what they leave unchanged."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch")

from gspure.cli import extract, main
from gspure.images import read_image, write_image
from gspure.metrics.targets import ADAPTIVE
from gspure.public_model import Lesson
from gspure.schemes.pair import Capture
from tests.scheme_cases import quality


@pytest.fixture(scope="module", params=["gs_hider", "secure_gs", "keyss"])
def marked(request, trained) -> SimpleNamespace:
    return trained(request.param)


def lesson(capture: Capture, steps: int = 40) -> Lesson:
    return Lesson(capture.views, capture.images, (), steps, np.random.default_rng(0))


def test_a_fitted_key_reads_an_attacked_model_better_in_held_out_views(marked: SimpleNamespace) -> None:
    columns = marked.public.columns["colour"]
    pairs = zip(columns, columns[::-1], strict=True)
    swapped = {column: marked.public.model.table[opposite] for column, opposite in pairs}
    attacked = marked.public.with_model(marked.public.model.with_columns(swapped))
    fitted = marked.key.fitted(attacked, lesson(marked.pair.message, 150))
    before = quality(marked.key.message(attacked, ADAPTIVE), marked.pair.message)
    after = quality(fitted.message(attacked, ADAPTIVE), marked.pair.message)
    assert after > before + 0.5


def test_fitting_leaves_model_and_key_alone_and_gives_the_same_bits(marked: SimpleNamespace) -> None:
    camera = marked.pair.scene.views[0]
    table = marked.public.model.table.tobytes()

    def shown() -> list[bytes]:
        views = (marked.public.scene(), marked.key.message(marked.public, ADAPTIVE))
        return [view(camera).tobytes() for view in views]

    before = shown()
    fitted = [marked.key.fitted(marked.public, lesson(marked.pair.message, 6)) for _ in range(2)]
    images = [key.message(marked.public, ADAPTIVE)(camera).tobytes() for key in fitted]
    assert images[0] == images[1]
    assert images[0] != before[1]
    assert marked.public.model.table.tobytes() == table
    assert shown() == before


def test_the_command_fits_to_training_views_and_shows_held_out_ones(
    marked: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(extract, "FIT_STEPS", 12)
    marked.public.write(tmp_path / "public" / "point_cloud.ply")
    marked.key.write(tmp_path / "key")
    words = ["extract", tmp_path / "public", "--scheme", marked.scheme.name, "--key", tmp_path / "key"]
    words += ["--cameras", marked.folder / "message" / "cameras.json", "--split", "test", "--extraction", ADAPTIVE]

    def shown(name: str, *options: object) -> bytes:
        assert main([*map(str, (*words, "--out", tmp_path / name, *options))]) == 0
        return b"".join(path.read_bytes() for path in sorted((tmp_path / name).glob("*.png")))

    fitted = shown("fitted", "--photographs", marked.folder / "message")
    for kind, capture in (("test", marked.pair.message.dataset.test), ("train", marked.pair.message.views)):
        shutil.copytree(marked.folder / "message", tmp_path / kind, ignore=shutil.ignore_patterns("rendered.json"))
        for camera in capture:
            file = tmp_path / kind / f"{camera.name}.png"
            write_image(file, 1 - read_image(file))
    assert shown("without_held_out_photographs", "--photographs", tmp_path / "test") == fitted
    assert shown("with_other_photographs", "--photographs", tmp_path / "train") != fitted
    assert main([*map(str, (*words, "--out", tmp_path / "nothing"))]) == 2
    assert "--photographs: expected photographs of the message" in capsys.readouterr().err
