"""PSNR, SSIM, folders of images, and agreement with a known truth."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gspure.cli import main
from gspure.evaluation.comparison import as_text, read_metrics
from gspure.evaluation.metrics import (
    gradient_correlation,
    ms_ssim,
    normalized_correlation,
    psnr,
    region_psnr,
    ssim,
)
from gspure.images import read_image, write_image
from tests.contest_cases import measured

IMAGES = hnp.arrays(np.uint8, st.tuples(st.integers(1, 16), st.integers(1, 16), st.just(3))).map(lambda a: a / 255.0)


def image(seed: int, height: int = 40, width: int = 50) -> np.ndarray:
    """Bytes over 255, as read from PNG: smooth, with some noise."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width] / 10
    smooth = np.stack([np.sin(x + seed), np.cos(y), np.sin(x * y / 3)], axis=-1) / 2 + 0.5
    return np.round(255 * np.clip(smooth + rng.normal(0, 0.1, smooth.shape), 0, 1)) / 255


def test_equation_of_psnr_is_over_all_pixels_and_channels_at_once() -> None:
    a, b = np.zeros((1, 2, 3)), np.zeros((1, 2, 3))
    b[0, 0, 0] = 0.6  # mean square error 0.06; a mean over three channels would be infinite
    assert psnr(a, b) == pytest.approx(-10 * np.log10(0.06))


def test_equal_images_have_infinite_psnr_and_ssim_one() -> None:
    assert psnr(image(0), image(0)) == np.inf
    assert ssim(image(0), image(0)) == pytest.approx(1.0)


def test_ssim_agrees_with_scikit_image_under_its_settings() -> None:
    from skimage.metrics import structural_similarity

    a, b = image(3), image(4)
    # Framed by zeros wider than the window, scikit-image meets zeros beyond the border as 3DGS's SSIM does.
    framed_a, framed_b = (np.pad(x, ((11, 11), (11, 11), (0, 0))) for x in (a, b))
    _, theirs = structural_similarity(
        framed_a,
        framed_b,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1.0,
        channel_axis=-1,
        full=True,
    )
    assert ssim(a, b) == pytest.approx(theirs[11:-11, 11:-11].mean(), abs=1e-12)


def test_one_scale_of_ms_ssim_is_scikit_image_s_ssim() -> None:
    from skimage.metrics import structural_similarity

    a, b = image(3, 21, 30), (image(3, 21, 30) + image(4, 21, 30)) / 2
    settings = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    expected = structural_similarity(a, b, data_range=1.0, channel_axis=-1, **settings)
    assert ms_ssim(a, b) == pytest.approx(expected, abs=1e-9)


def test_five_scales_of_ms_ssim_agree_with_another_implementation() -> None:
    a, b = image(5, 192, 256), (image(5, 192, 256) + image(6, 192, 256)) / 2
    assert ms_ssim(a, b) == pytest.approx(0.921504, abs=2e-5)  # of pytorch-msssim 1.0.0


def test_the_background_of_the_reference_is_no_part_of_its_region() -> None:
    a = np.zeros((8, 9, 3))
    a[2:5, 3:7] = 0.5 + image(8, 3, 4) / 2
    brightened = np.where(a == 0, 0.4, a)
    assert region_psnr(a, brightened) == np.inf
    assert psnr(a, brightened) < 10
    darkened = 0.9 * a
    assert region_psnr(a, darkened) == pytest.approx(psnr(a[2:5, 3:7], darkened[2:5, 3:7]))
    assert region_psnr(a, np.zeros_like(a)) < psnr(a, np.zeros_like(a))


def test_equation_of_gradient_correlation_by_a_loop_over_neighbours() -> None:
    a, b = np.random.default_rng(0).random((2, 4, 5, 3))
    steps = [
        [
            image[y + dy, x + dx] - image[y, x]
            for y, x in np.ndindex(4, 5)
            for dy, dx in ((0, 1), (1, 0))
            if y + dy < 4 and x + dx < 5
        ]
        for image in (a, b)
    ]
    first, second = (np.ravel(step) for step in steps)
    expected = first @ second / np.sqrt((first @ first) * (second @ second))
    assert gradient_correlation(a, b) == pytest.approx(expected)


def test_normalized_correlation_is_that_of_all_pixels_without_their_channels_means() -> None:
    a, b = np.random.default_rng(0).random((2, 4, 5, 3))
    b = 0.5 * a + 0.5 * b
    centred = [np.concatenate([image[..., c].ravel() - image[..., c].mean() for c in range(3)]) for image in (a, b)]
    assert normalized_correlation(a, b) == pytest.approx(np.corrcoef(centred)[0, 1])
    assert normalized_correlation(a, np.roll(a, 2, axis=0)) < normalized_correlation(a, b) < 1


@settings(deadline=None)
@given(IMAGES, st.integers(0, 2**32 - 1))
def test_metrics_are_symmetric_and_ssim_is_at_most_one(a: np.ndarray, seed: int) -> None:
    b = np.random.default_rng(seed).integers(0, 256, a.shape) / 255
    assert psnr(a, b) == psnr(b, a)
    assert ssim(a, b) == pytest.approx(ssim(b, a), abs=1e-12)
    assert -1 - 1e-9 <= ssim(a, b) <= 1 + 1e-9


def folders(tmp_path: Path, *targets: str) -> tuple[Path, Path]:
    for target in targets:
        for seed, name in enumerate(("001", "002")):
            write_image(tmp_path / "a" / target / f"{name}.png", image(seed, 20, 30))
            write_image(tmp_path / "b" / target / f"{name}.png", image(seed + 7, 20, 30))
    return tmp_path / "a", tmp_path / "b"


def test_command_writes_every_view_and_prints_the_means(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = folders(tmp_path, "scene", "message")
    assert main(["metrics", str(a), str(b), "--reference", "truth", "--out", str(tmp_path / "metrics.csv")]) == 0
    rows = read_metrics(tmp_path / "metrics.csv")
    assert [f"{row.target}/{row.view}" for row in rows] == ["message/001", "message/002", "scene/001", "scene/002"]
    assert {row.reference for row in rows} == {"truth"}
    one, other = read_image(a / "scene" / "002.png"), read_image(b / "scene" / "002.png")
    assert rows[3].psnr == pytest.approx(psnr(one, other), abs=1e-6)
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    (mean,) = [words for words in printed if words[0] == "scene/mean"]
    assert float(mean[1]) == pytest.approx(np.mean([row.psnr for row in rows[2:]]), abs=1e-3)
    write_image(b / "scene" / "002.png", image(0, 20, 31))
    assert main(["metrics", str(a), str(b)]) == 2
    assert "size: expected 30x20, as " in capsys.readouterr().err


@pytest.mark.parametrize(("psnrs", "low"), [([math.inf] * 3, "∞"), ([math.inf, 20.0, math.inf], "20.0000")])
def test_identical_views_give_no_warning(psnrs: list[float], low: str) -> None:
    rows = [measured("scene", psnr, view=str(i)) for i, psnr in enumerate(psnrs)]
    lines = as_text(rows)
    assert [line.split()[2] for line in lines if "worst" in line] == [low]
    assert not any("warning" in line or "nan" in line for line in lines)
