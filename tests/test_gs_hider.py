"""GS-Hider: one feature map, two decoders; what is embedded, and its files."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from gspure.evaluation.metrics import psnr, ssim  # noqa: E402
from gspure.files import digest  # noqa: E402
from gspure.opencl.losses import Photographs  # noqa: E402
from gspure.schemes.gs_hider import HARDENED, SCHEME  # noqa: E402
from gspure.schemes.gs_hider.decoder import differentiated, untrained  # noqa: E402
from gspure.schemes.gs_hider.files import CHANNELS  # noqa: E402
from gspure.schemes.hidden_weight import low_rows  # noqa: E402
from gspure.schemes.pair import read_pair  # noqa: E402
from gspure.schemes.scheme import hide  # noqa: E402
from tests.models import without  # noqa: E402

ITERATIONS = 40


@pytest.fixture(scope="module")
def pair(pair_folder):
    return read_pair(pair_folder)


@pytest.fixture(scope="module")
def hidden(pair):
    return hide(SCHEME, pair, iterations=ITERATIONS)


def quality(view, pair, which):
    probes = (pair.scene, pair.message)[which].probes
    return np.mean([psnr(view(camera).clip(0, 1), photograph) for camera, photograph in probes])


def test_scene_and_message_are_learned_from_one_map(hidden, pair):
    def qualities(public, key):
        return np.array([quality(public.scene(), pair, 0), quality(key.message(public, "message"), pair, 1)])

    public, key = hidden
    assert (qualities(public, key) > qualities(*hide(SCHEME, pair, iterations=1)) + 3).all()
    stranger = key.wrong(np.random.default_rng(0)).message(public, "message")
    assert quality(stranger, pair, 1) < quality(key.message(public, "message"), pair, 1) - 3


def test_bits_do_not_depend_on_the_number_of_pytorch_threads(pair):
    def digests(threads):
        before = torch.get_num_threads()
        torch.set_num_threads(threads)
        try:
            public, key = hide(SCHEME, pair, iterations=3)
            assert torch.get_num_threads() == threads
        finally:
            torch.set_num_threads(before)
        return digest(public.model.table, public.decoder.content, key.decoder.content)

    assert digests(1) == digests(2)


def test_a_hardened_message_outlives_the_pruning_of_rows_of_low_weight(own_pair_folder):
    pair = read_pair(own_pair_folder)

    def lost(scheme):
        public, key = hide(scheme, pair, iterations=200, max_gaussians=2000)
        low, shown = (
            low_rows(public, pair.scene.views, 2.0, None),
            zip(pair.message.views, pair.message.images, strict=True),
        )
        views = [key.message(kept, "message") for kept in (public, without(public, low))]
        before, after = np.mean([[psnr(view(c).clip(0, 1), image) for view in views] for c, image in shown], axis=0)
        return before - after

    assert lost(HARDENED) < lost(SCHEME) - 1


def test_the_gradient_of_a_feature_map_descends_the_loss_of_its_image(monkeypatch):
    rng = np.random.default_rng(0)
    features, photograph = (rng.random((30, 41, channels), dtype=np.float32) for channels in (CHANNELS, 3))
    (decoder,) = untrained(1, seed=0)
    photographs = Photographs([photograph])

    def of(feature_map, bfloat16):
        monkeypatch.setattr("gspure.schemes.gs_hider.decoder.BFLOAT16", bfloat16)
        return differentiated(decoder, feature_map, photographs, 0, weight=2.0)

    image = decoder(torch.from_numpy(features)).detach().numpy()
    expected = 2 * (0.8 * np.abs(image - photograph).mean() + 0.2 * (1 - ssim(image, photograph)))
    loss, gradient = of(features, bfloat16=False)
    assert loss == pytest.approx(expected, rel=1e-6)
    step = 1e-3 * loss / np.square(gradient).sum()
    assert of(features - step * gradient, bfloat16=False)[0] == pytest.approx((1 - 1e-3) * loss, rel=2e-4)
    coarse_loss, coarse_gradient = of(features, bfloat16=True)
    assert coarse_loss == pytest.approx(loss, rel=1e-3)
    assert np.linalg.norm(coarse_gradient - gradient) < 0.2 * np.linalg.norm(gradient)
