"""Round trips through compressed formats."""

import sys

import numpy as np
import pytest

from gspure.attacks import Measurements, find_attack
from gspure.errors import InputError
from gspure.model.rotations import rotation_matrices
from tests.models import blobs, camera
from tests.reference.blending import render

COUNT = 300
CODECS = ["compressed_ply", "spz"]


@pytest.fixture
def gsply():
    return pytest.importorskip("gsply", reason="gspure[compression] is not installed")


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("degree", range(4))
def test_rows_come_back_nearly_as_they_were(gsply, codec: str, degree: int) -> None:
    before = blobs(COUNT, sh_degree=degree)
    attacked = find_attack("compression").apply(before, Measurements(), codec=codec)
    assert sorted(attacked.rows.tolist()) == list(range(COUNT))
    origin, after = before.table[attacked.rows], attacked.model
    origin = type(before)(origin)
    np.testing.assert_allclose(after.means, origin.means, atol=np.ptp(before.means, axis=0).max() / 1000)
    np.testing.assert_allclose(after.scales, origin.scales, rtol=1 / 16)
    np.testing.assert_allclose(after.opacities, origin.opacities, atol=1 / 255)
    np.testing.assert_allclose(rotation_matrices(after.quats), rotation_matrices(origin.quats), atol=0.02)
    assert np.median(np.abs(after.sh_coeffs - origin.sh_coeffs)) < 1 / 50
    assert after.sh_degree == degree


@pytest.mark.parametrize("codec", CODECS)
def test_images_change_a_little_and_the_same_way_each_time(gsply, codec: str) -> None:
    one, other = (find_attack("compression").apply(blobs(COUNT), Measurements(), codec=codec).model for _ in range(2))
    assert one.table.tobytes() == other.table.tobytes()
    images = [render(model, camera(), "ewa").channels for model in (one, blobs(COUNT))]
    assert 0 < np.abs(images[0] - images[1]).mean() < 0.02


def test_without_the_package_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gsply", None)
    with pytest.raises(
        InputError, match=r"attack compression: gsply: .*the package gsply.*pip install gspure\[compression\]"
    ):
        find_attack("compression").apply(blobs(COUNT), Measurements())
