"""The store of per-view contributions: what is computed again, and what is not."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from gspure import public_model
from gspure.arrays import save_array
from gspure.errors import InputError
from gspure.method import contributions
from gspure.method.contributions import contribute, contribution_key, read_contributions
from gspure.public_model import PublicModel
from gspure.renderer import CONTRIBUTION
from tests.models import blobs, camera


@dataclass
class CountingRenderer:
    """Stands for the renderer: remembers which views it was asked for, and can fail at one of them."""

    built: int = 0
    asked: list[str] = field(default_factory=list)
    failing_view: str | None = None

    def __call__(self, model, device=None, *, energy):
        self.built += 1
        return self

    def contributions(self, view):
        if view.name == self.failing_view:
            raise KeyboardInterrupt
        self.asked.append(view.name)
        return np.array([(3, 1.0, 0.5, 3)], CONTRIBUTION)


@pytest.fixture
def renderer(monkeypatch):
    counting = CountingRenderer()
    monkeypatch.setattr(public_model, "Renderer", counting)
    return counting


def views(count=4):
    return [camera(32, 24, name=f"view_{i}") for i in range(count)]


def test_every_view_is_computed_once(tmp_path, renderer):
    first = contribute(PublicModel(blobs(5)), views(), tmp_path)
    again = contribute(PublicModel(blobs(5)), views(), tmp_path)
    assert again == first
    assert renderer.asked == [view.name for view in views()]


def test_an_edited_camera_recomputes_its_view_alone(tmp_path, renderer):
    cameras = views()
    contribute(PublicModel(blobs(5)), cameras, tmp_path)
    renderer.asked.clear()
    viewmat = cameras[1].viewmat.copy()
    viewmat[2, 3] += 1e-9
    contribute(PublicModel(blobs(5)), [cameras[0], replace(cameras[1], viewmat=viewmat), *cameras[2:]], tmp_path)
    assert renderer.asked == ["view_1"]


@pytest.mark.parametrize("column", ["x", "rot_3", "scale_1", "opacity", "f_dc_0"])
def test_geometry_and_opacity_of_any_gaussian_are_in_the_key_and_colour_is_not(column):
    model = blobs(5)
    edited = model.table[column].copy()
    edited[-1] = np.nextafter(edited[-1], np.float32(9))
    same = PublicModel(model.with_columns({column: edited})).geometry_digest() == PublicModel(model).geometry_digest()
    assert same == (column == "f_dc_0")


def test_the_energy_the_device_and_the_rendering_code_are_in_the_key(monkeypatch):
    keys = {contribution_key("geometry", camera(), energy, device) for energy in ("ray", "ewa") for device in "ab"}
    monkeypatch.setattr(contributions, "rendering_digest", lambda: "edited kernels")
    keys |= {contribution_key("geometry", camera(), "ray", "a")}
    assert len(keys) == 5


def test_an_interrupted_job_keeps_its_finished_views_and_the_next_one_computes_the_rest(tmp_path, renderer):
    renderer.failing_view = "view_2"
    with pytest.raises(KeyboardInterrupt):
        contribute(PublicModel(blobs(5)), views(), tmp_path)
    assert sorted(path.name.split(".")[0] for path in tmp_path.glob("*.npy")) == ["view_0", "view_1"]
    renderer.failing_view = None
    renderer.asked.clear()
    contribute(PublicModel(blobs(5)), views(), tmp_path)
    assert renderer.asked == ["view_2", "view_3"]


DAMAGES = {"cut": lambda content: content[:-5], "another dtype": lambda content: content.replace(b"pixels", b"texels")}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_file_counts_as_missing(tmp_path, renderer, damage):
    path = contribute(PublicModel(blobs(5)), views(), tmp_path)["view_2"]
    good = path.read_bytes()
    path.write_bytes(damage(good))
    with pytest.raises(InputError, match=path.name):
        read_contributions(path)
    renderer.asked.clear()
    contribute(PublicModel(blobs(5)), views(), tmp_path)
    assert renderer.asked == ["view_2"]
    assert path.read_bytes() == good


def test_a_row_that_the_model_does_not_have_is_refused_by_file_row_and_range(tmp_path):
    records = np.array([(0, 1.5, 0.5, 4), (3, 0.25, 0.25, 1), (4, 2.0, 0.99, 9)], CONTRIBUTION)
    save_array(tmp_path / "view_0.key.npy", records)
    assert len(read_contributions(tmp_path / "view_0.key.npy", 5)) == 3
    with pytest.raises(InputError, match=r"view_0\.key\.npy: index: expected rows 0 to 3 of the model, found row 4"):
        read_contributions(tmp_path / "view_0.key.npy", 4)
    save_array(tmp_path / "view_1.key.npy", records[::-1])
    with pytest.raises(InputError, match="ascending"):
        read_contributions(tmp_path / "view_1.key.npy", 5)
