"""PSNR, SSIM, folders of images, and agreement with a known truth."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gspure.cli import main
from gspure.errors import InputError
from gspure.images import read_image, write_image
from gspure.metrics import image_metrics as metrics
from gspure.metrics.comparison import as_text, compare, means, pair_images, read_metrics
from gspure.metrics.image_metrics import METRICS, ms_ssim, psnr, ssim
from tests.outcome_cases import measured

SCIKIT_IMAGE = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
SCIKIT_IMAGE |= {"data_range": 1.0, "channel_axis": -1}


def image(seed: int, height: int = 40, width: int = 50) -> np.ndarray:
    """Bytes over 255, as read from PNG: smooth, with some noise."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width] / 10
    smooth = np.stack([np.sin(x + seed), np.cos(y), np.sin(x * y / 3)], axis=-1) / 2 + 0.5
    return np.round(255 * np.clip(smooth + rng.normal(0, 0.1, smooth.shape), 0, 1)) / 255


def test_equation_of_psnr_is_over_all_pixels_and_channels_at_once() -> None:
    a = np.zeros((1, 2, 3))
    b = np.zeros((1, 2, 3))
    b[0, 0, 0] = 0.6  # mean square error 0.06; a mean over three channels would be infinite
    assert psnr(a, b) == pytest.approx(-10 * np.log10(0.06))


@pytest.mark.parametrize("metric", [psnr, ssim, ms_ssim])
def test_images_that_numpy_would_broadcast_are_refused(metric) -> None:
    with pytest.raises(InputError, match=r"images: shape: expected \[20, 20, 3\], found \[20, 20, 1\]"):
        metric(np.eye(20)[..., None].repeat(3, axis=2), np.zeros((20, 20, 1)))


def test_ssim_agrees_with_scikit_image_under_its_settings() -> None:
    from skimage.metrics import structural_similarity

    a = image(3)
    b = image(4)
    # Framed by zeros wider than the window, scikit-image meets zeros beyond the border as 3DGS's SSIM does.
    framed_a, framed_b = (np.pad(x, ((11, 11), (11, 11), (0, 0))) for x in (a, b))
    _, theirs = structural_similarity(framed_a, framed_b, full=True, **SCIKIT_IMAGE)
    assert ssim(a, b) == pytest.approx(theirs[11:-11, 11:-11].mean(), abs=1e-12)


@pytest.mark.parametrize("side", [11, 21])
def test_one_scale_of_ms_ssim_is_scikit_image_s_ssim(side: int) -> None:
    from skimage.metrics import structural_similarity

    a = image(3, side, 30)
    b = (a + image(4, side, 30)) / 2
    assert ms_ssim(a, b) == pytest.approx(structural_similarity(a, b, **SCIKIT_IMAGE), abs=1e-9)


def test_five_scales_of_ms_ssim_agree_with_another_implementation() -> None:
    a = image(5, 192, 256)
    b = (a + image(6, 192, 256)) / 2
    assert ms_ssim(a, b) == pytest.approx(0.921504, abs=2e-5)  # of pytorch-msssim 1.0.0


@pytest.mark.parametrize("side", [1, 10, 11, 21, 22, 43, 44, 175, 176])
def test_ms_ssim_of_any_size_is_one_for_equal_images_only(side: int) -> None:
    a = image(7, side, side + 3)
    assert ms_ssim(a, a) == pytest.approx(1.0)
    assert ms_ssim(a, 0.8 * a) < 1.0
    assert ms_ssim(a, 1 - a) < ms_ssim(a, 0.8 * a)


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
    first = read_image(a / "scene" / "002.png")
    second = read_image(b / "scene" / "002.png")
    assert rows[3].psnr == pytest.approx(psnr(first, second), abs=1e-6)
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    (mean,) = [words for words in printed if words[0] == "scene/mean"]
    assert float(mean[1]) == pytest.approx(np.mean([row.psnr for row in rows[2:]]), abs=1e-3)
    write_image(b / "scene" / "002.png", image(0, 20, 31))
    assert main(["metrics", str(a), str(b)]) == 2
    assert "size: expected 30x20, as " in capsys.readouterr().err


def test_images_of_a_view_may_have_other_suffixes(tmp_path: Path) -> None:
    a, b = folders(tmp_path, "scene")
    for file in a.rglob("*.png"):
        file.rename(file.with_suffix(".PNG"))
    Image.open(b / "scene" / "002.png").save(b / "scene" / "002.jpg")
    (b / "scene" / "002.png").unlink()
    pairs, _ = pair_images(a, b)
    suffixes = {pair.view: (pair.reference.suffix, pair.image.suffix) for pair in pairs}
    assert suffixes == {"001": (".PNG", ".png"), "002": (".PNG", ".jpg")}


def test_targets_that_are_not_chosen_are_left_out(tmp_path: Path) -> None:
    a, b = folders(tmp_path, "scene")
    write_image(b / "message_adaptive" / "000.png", np.zeros((4, 4, 3)))  # of an earlier configuration
    with pytest.raises(InputError, match="message_adaptive"):
        pair_images(a, b)
    assert {pair.target for pair in pair_images(a, b, targets=["scene"])[0]} == {"scene"}
    with pytest.raises(InputError, match="found 'message'"):
        pair_images(a, b, targets=["scene", "message"])


def test_mean_psnr_is_that_of_the_views_that_differ() -> None:
    same = measured("scene", np.inf, 1.0, view="1")
    changed = measured("scene", 31.25, 0.5, view="2")
    assert means([same, changed]) == [measured("scene", 31.25, 0.75)]
    assert means([same, same]) == [measured("scene", np.inf, 1.0)]


def test_a_view_far_below_the_mean_is_named_in_a_warning() -> None:
    hidden = [measured("scene", psnr, view=str(i)) for i, psnr in enumerate((49.0, 27.2, 30.8))]
    even = [measured("message", psnr, view=str(i)) for i, psnr in enumerate((35.8, 39.5, 30.5))]
    lines = as_text([*hidden, *even])
    worst = [line.split()[:3] for line in lines if "worst" in line]
    assert worst == [["message/worst:", "2", "30.5000"], ["scene/worst:", "1", "27.2000"]]
    (warning,) = [line for line in lines if line.startswith("warning: ")]
    assert "scene/1" in warning
    assert "8.5 dB" in warning


def test_transparent_photographs_are_compared_on_the_background_of_the_renders(tmp_path):
    rgba = np.random.default_rng(0).random((24, 32, 4))
    write_image(tmp_path / "photographs" / "view.png", rgba)
    for name, background in (("white", 1.0), ("black", 0.0)):
        write_image(tmp_path / name / "view.png", rgba[..., :3] * rgba[..., 3:] + background * (1 - rgba[..., 3:]))
        (pair,), _ = pair_images(tmp_path / "photographs", tmp_path / name, background=[background] * 3)
        assert compare(pair).psnr > 50


@pytest.mark.parametrize("shape", [(1, 1, 3), (5, 40, 3), (12, 11, 1), (47, 23, 3), (200, 61, 3)])
@pytest.mark.parametrize("values", [1, 700, 5000])
def test_metrics_do_not_depend_on_the_strips_they_are_computed_in(shape, values, monkeypatch) -> None:
    a, b = np.random.default_rng(4).random((2, *shape), np.float32)
    whole = [metric.compute(a, b) for metric in METRICS.values()]
    monkeypatch.setattr(metrics, "_STRIP", values)
    np.testing.assert_allclose([metric.compute(a, b) for metric in METRICS.values()], whole, rtol=1e-12, atol=1e-15)
