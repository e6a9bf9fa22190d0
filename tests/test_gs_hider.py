"""GS-Hider: one feature map, two decoders; what is embedded, and its files."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from gspure.metrics.image_metrics import ssim  # noqa: E402
from gspure.model import Gaussians, write_model  # noqa: E402
from gspure.opencl.losses import Photographs  # noqa: E402
from gspure.schemes.scheme import hide  # noqa: E402
from gspure_torch.gs_hider import SCHEME  # noqa: E402
from gspure_torch.gs_hider.decoder import differentiated, untrained  # noqa: E402
from gspure_torch.gs_hider.model import CHANNELS, COLUMNS, ROLES, DecoderFile  # noqa: E402
from tests.scheme_cases import quality  # noqa: E402


def test_a_wrong_key_shows_less_of_the_message(pair):
    public, key = hide(SCHEME, pair, iterations=40)
    stranger = key.wrong(np.random.default_rng(0)).message(public, "message")
    assert quality(stranger, pair.message) < quality(key.message(public, "message"), pair.message) - 3


def test_the_gradient_of_a_feature_map_descends_the_loss_of_its_image(monkeypatch):
    rng = np.random.default_rng(0)
    features = rng.random((30, 41, CHANNELS), dtype=np.float32)
    photograph = rng.random((30, 41, 3), dtype=np.float32)
    (decoder,) = untrained(1, seed=0)
    photographs = Photographs([photograph])

    def loss_and_gradient(feature_map, bfloat16):
        monkeypatch.setattr("gspure_torch.gs_hider.decoder.BFLOAT16", bfloat16)
        return differentiated(feature_map, 0, decoder, photographs, weight=2.0)

    image = decoder(torch.from_numpy(features)).detach().numpy()
    expected = 2 * (0.8 * np.abs(image - photograph).mean() + 0.2 * (1 - ssim(image, photograph)))
    loss, gradient = loss_and_gradient(features, bfloat16=False)
    assert loss == pytest.approx(expected, rel=1e-6)
    step = 1e-3 * loss / np.square(gradient).sum()
    lower_loss, _ = loss_and_gradient(features - step * gradient, bfloat16=False)
    assert lower_loss == pytest.approx((1 - 1e-3) * loss, rel=2e-4)
    coarse_loss, coarse_gradient = loss_and_gradient(features, bfloat16=True)
    assert coarse_loss == pytest.approx(loss, rel=1e-3)
    assert np.linalg.norm(coarse_gradient - gradient) < 0.2 * np.linalg.norm(gradient)


def decoder_state(last_bias=0.1):
    """A state dict as the authors' code makes it, written out by hand."""
    rng = np.random.default_rng(0)
    shapes = {"conv1": (64, 16, 3, 3), **{f"conv{i}": (64, 64, 3, 3) for i in (2, 3, 4)}, "conv5": (3, 64, 3, 3)}
    arrays = {f"{name}.weight": 0.05 * rng.standard_normal(shape) for name, shape in shapes.items()}
    arrays |= {f"{name}.bias": 0.05 * rng.standard_normal(shape[0]) for name, shape in shapes.items()}
    arrays["conv5.bias"] = np.full(3, last_bias)
    return {name: torch.tensor(array, dtype=torch.float32) for name, array in arrays.items()}


def test_the_authors_layout_is_read(tmp_path):
    cloud = tmp_path / "point_cloud"
    for iteration in (30, 200):
        rows = Gaussians(np.ones(5, [(name, "<f4") for name in COLUMNS]))
        write_model(cloud / f"iteration_{iteration}" / "point_cloud.ply", rows)
        for number, role in enumerate(ROLES):
            torch.save(decoder_state(iteration + number), tmp_path / f"chkpnt{iteration}_{role}.pth")
    for path, iteration in ((tmp_path, 200), (cloud / "iteration_30", 30)):
        decoders = [SCHEME.read_public(path).decoder, SCHEME.read_key(path).decoder]
        assert [decoder.network.conv5.bias[0].item() for decoder in decoders] == [iteration, iteration + 1]


def test_a_decoder_computes_its_convolutions(tmp_path):
    from scipy.signal import correlate

    tensors = decoder_state()
    x = np.random.default_rng(1).random((6, 7, 16), dtype=np.float32)
    hidden = x.transpose(2, 0, 1).astype(np.float64)
    for i in range(1, 6):
        weight = tensors[f"conv{i}.weight"].double().numpy()
        bias = tensors[f"conv{i}.bias"].double().numpy()
        padded = np.pad(hidden, ((0, 0), (1, 1), (1, 1)))
        hidden = np.stack([correlate(padded, w, "valid")[0] for w in weight]) + bias[:, None, None]
        hidden = hidden if i == 5 else np.maximum(hidden, 0)
    torch.save(tensors, tmp_path / "decoder.pth")
    with torch.inference_mode():
        image = DecoderFile.read(tmp_path / "decoder.pth").network(torch.from_numpy(x)).numpy()
    np.testing.assert_allclose(image, hidden.transpose(1, 2, 0), atol=1e-5)
