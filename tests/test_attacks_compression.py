"""Round trips through compressed formats."""

import sys

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.rotations import rotation_matrices
from tests.attack_cases import apply
from tests.models import blobs

COUNT = 300


@pytest.mark.parametrize("codec", ["compressed_ply", "spz"])
@pytest.mark.parametrize("degree", range(4))
def test_rows_come_back_nearly_as_they_were_and_the_same_way_each_time(codec: str, degree: int) -> None:
    pytest.importorskip("gsply", reason="gspure[compression] is not installed")
    before = blobs(COUNT, sh_degree=degree)
    attacked = apply("compression", before, codec=codec)
    assert sorted(attacked.rows.tolist()) == list(range(COUNT))
    origin, after = Gaussians(before.table[attacked.rows]), attacked.model
    np.testing.assert_allclose(after.means, origin.means, atol=np.ptp(before.means, axis=0).max() / 1000)
    np.testing.assert_allclose(after.scales, origin.scales, rtol=1 / 16)
    np.testing.assert_allclose(after.opacities, origin.opacities, atol=1 / 255)
    np.testing.assert_allclose(rotation_matrices(after.quats), rotation_matrices(origin.quats), atol=0.02)
    assert 0 < np.median(np.abs(after.sh_coeffs - origin.sh_coeffs)) < 1 / 50
    assert after.sh_degree == degree
    assert after.table.tobytes() == apply("compression", before, codec=codec).model.table.tobytes()


def test_without_the_package_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gsply", None)
    with pytest.raises(InputError, match=r"attack compression: gsply: .*pip install gspure\[compression\]"):
        apply("compression", blobs(COUNT))
