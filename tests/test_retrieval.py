"""Retrieval of the message among candidates: by what a picture shows, not by how bright it is."""

from pathlib import Path

import numpy as np
import pytest

from gspure.images import write_image
from gspure.metrics.comparison import pair_images
from gspure.metrics.retrieval import Retrieval, compare_candidates, false_candidates, retrieval

VIEWS = 4


def picture(seed: int, view: int) -> np.ndarray:
    """A smooth picture without symmetries, different for every seed and view."""
    coarse = np.random.default_rng((seed, view)).random((6, 8, 3))
    return np.kron(coarse, np.ones((4, 4, 1))).astype(np.float32)


def photographs(folder: Path, seed: int, change=lambda image: image) -> Path:
    for view in range(VIEWS):
        write_image(folder / f"view_{view}.png", change(picture(seed, view)))
    return folder


def retrieval_of(message: Path, extraction: Path, decoys: list[Path]) -> Retrieval:
    pairs, _ = pair_images(message, extraction)
    return retrieval([compare_candidates(pair, false_candidates(pair, i, decoys)) for i, pair in enumerate(pairs)])


def retrieved(tmp_path: Path, change, decoys: list[Path] | None = None) -> Retrieval:
    """Retrieve a changed message among its flips, the scene, and four others."""
    scene = photographs(tmp_path / "pair" / "scene", 1)
    message = photographs(tmp_path / "pair" / "message", 0)
    if decoys is None:
        decoys = [photographs(tmp_path / f"decoy_{seed}", seed) for seed in range(2, 6)]
    return retrieval_of(message, photographs(tmp_path / "extraction", 0, change), [scene, *decoys])


def noise(image: np.ndarray) -> np.ndarray:
    return np.random.default_rng(int(1e6 * image.mean())).random(image.shape)


@pytest.mark.parametrize(
    "fade",
    [lambda image: image, lambda image: 0.1 * image, lambda image: 0.9 + 0.1 * image**2],
    ids=["faithful", "dark", "pale"],
)
def test_a_faded_message_is_retrieved(tmp_path: Path, fade) -> None:
    measured = retrieved(tmp_path, fade)
    assert measured == (1.0, 1.0, 1.0, VIEWS, 1 + 3 + 1 + 4)
    assert measured.succeeds


@pytest.mark.parametrize(
    "change",
    [noise, lambda image: image[:, ::-1], lambda image: image[::-1], lambda image: 1 - image, np.zeros_like],
    ids=["noise", "mirrored", "upside down", "inverted", "black"],
)
def test_an_image_without_the_message_is_not_retrieved(tmp_path: Path, change) -> None:
    assert not retrieved(tmp_path, change).succeeds


def test_the_scene_in_place_of_the_message_is_not_retrieved(tmp_path: Path) -> None:
    views = iter(range(VIEWS))
    assert retrieved(tmp_path, lambda _: picture(1, next(views))).top1 == 0


def test_a_message_with_views_of_its_own_is_compared_with_other_photographs_of_the_scene(tmp_path: Path) -> None:
    alone = retrieved(tmp_path, lambda image: image)
    for view in range(VIEWS):
        (tmp_path / "pair" / "scene" / f"view_{view}.png").rename(tmp_path / "pair" / "scene" / f"desk_{view}.png")
    decoys = [tmp_path / "pair" / "scene", *(tmp_path / f"decoy_{seed}" for seed in range(2, 6))]
    assert retrieval_of(tmp_path / "pair" / "message", tmp_path / "extraction", decoys) == alone


def test_equation_of_top_1_auc_and_tpr() -> None:
    views = [np.array(row) for row in ([0.9, 0.1, 0.2], [0.3, 0.3, 0.1], [0.25, 0.0, 0.1], [0.05, 0.2, 0.1])]
    false = np.concatenate([row[1:] for row in views])
    wins = [np.sum(row[0] > false) + np.sum(row[0] == false) / 2 for row in views]
    assert retrieval(views) == pytest.approx((0.5, sum(wins) / 32, 0.25, 4, 3))


def test_views_retrieved_by_chance_are_no_success() -> None:
    assert not Retrieval(0.25, 0.5, 0.0, 4, 17).succeeds  # one of four: p = 0.22
    assert Retrieval(0.5, 0.5, 0.0, 4, 17).succeeds  # two of four: p = 0.02
    assert not Retrieval(0.5, 0.5, 0.0, 4, 5).succeeds  # of fewer candidates: p = 0.18
    assert not Retrieval(0.0, 0.0, 0.0, 4, 17).succeeds
    assert not Retrieval(1.0, 1.0, 1.0, 1, 15).decides  # p = 1/15
    assert Retrieval(0.0, 0.0, 0.0, 1, 20).decides
