"""A message that is a small object over black, in a wide scene: it is hidden readably."""

from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import orbit_cameras
from gspure.constants import SH_DC
from gspure.model import Gaussians
from gspure.renderer import Renderer
from gspure.schemes.pair import Capture, Pair
from gspure.schemes.readability import readability
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import hide
from gspure.training.dataset import Dataset
from tests.models import points_of


def photographed(means, scale, colours) -> Capture:
    """Photographs of round Gaussians over black, from all sides."""
    count = len(means)
    model = Gaussians.from_parameters(
        means=means.astype(np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        scales=np.full((count, 3), scale, np.float32),
        opacities=np.full(count, 0.9, np.float32),
        sh_coeffs=((colours - 0.5) / SH_DC)[:, None].astype(np.float32),
    )
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), axis=-1).reshape(-1, 3)
    views = orbit_cameras(points_of(corners, np.ones(8)), count=24, width=48, height=36)
    images = [Renderer(model).image(view).clip(0, 1) for view in views]
    dataset = Dataset(Path("object"), views, [], means, np.round(255 * colours).astype(np.uint8))
    return Capture(dataset, images, list(zip(views, images, strict=True))[:2])


@pytest.fixture(scope="module")
def pair():
    rng = np.random.default_rng(1)
    walls, ball = rng.normal(size=(600, 3)), rng.normal(size=(200, 3))
    walls /= np.abs(walls).max(axis=1, keepdims=True) / 3
    ball /= np.linalg.norm(ball, axis=1, keepdims=True) / 0.2
    colours = np.where(ball[:, 2:] > 0, (0.9, 0.5, 0.2), (0.2, 0.1, 0.05))
    return Pair(photographed(walls, 0.25, rng.random((600, 3))), photographed(ball, 0.02, colours))


@pytest.fixture(scope="module")
def anchors(pair):
    pytest.importorskip("torch")
    return hide(find_scheme("secure_gs"), pair, seed=3, iterations=150, max_anchors=600)


def test_anchors_hide_it_readably(pair, anchors):
    check = readability(pair.message, *anchors)
    assert check.readable
    assert check.message > check.controls["black"] + 5


def test_splats_hide_it_readably(pair):
    scheme = find_scheme("splats_in_splats")
    assert readability(pair.message, *hide(scheme, pair, seed=3, iterations=150, max_gaussians=2000)).readable


def test_another_key_reads_no_message(pair, anchors):
    public, key = anchors
    assert not readability(pair.message, public, key.wrong(np.random.default_rng(1))).readable
