"""SecureGS as it is trained, for a moment: both branches improve, and the same seed gives the same bits."""

import numpy as np
import pytest

from gspure.evaluation.metrics import psnr
from gspure.schemes.hidden_weight import low_rows
from gspure.schemes.pair import read_pair
from gspure.schemes.scheme import hide
from gspure.schemes.secure_gs import HARDENED, SCHEME

torch = pytest.importorskip("torch")

from tests.models import without  # noqa: E402

SHORT = {"iterations": 120, "max_anchors": 600}


@pytest.fixture(scope="module")
def pair(pair_folder):
    return read_pair(pair_folder)


@pytest.fixture(scope="module")
def embedded(pair):
    return hide(SCHEME, pair, seed=3, **SHORT)


def quality(view, capture):
    return np.mean([psnr(view(c).clip(0, 1), photo) for c, photo in zip(capture.views, capture.images, strict=True)])


def mean_colour(photographs):
    mean = np.mean(photographs, axis=(0, 1, 2))
    return np.mean([psnr(np.broadcast_to(mean, photo.shape), photo) for photo in photographs])


def test_scene_and_message_are_learned_over_the_same_anchors(pair, embedded):
    public, key = embedded
    scene, message = public.scene(), key.message(public, "message")
    assert quality(scene, pair.scene) > mean_colour(pair.scene.images) + 2
    assert quality(message, pair.message) > mean_colour(pair.message.images) + 2
    wrong = key.wrong(np.random.default_rng(0)).message(public, "message")
    assert quality(wrong, pair.message) < quality(message, pair.message) - 2


def test_a_hardened_message_outlives_the_pruning_of_anchors_of_low_weight(own_pair_folder):
    pair = read_pair(own_pair_folder)

    def lost(scheme):
        public, key = hide(scheme, pair, **SHORT)
        kept = without(public, low_rows(public, pair.scene.views, 2.0, None))
        before, after = (quality(key.message(model, "message"), pair.message) for model in (public, kept))
        return before - after

    assert lost(HARDENED) < lost(SCHEME) - 1


def test_bits_do_not_depend_on_the_number_of_pytorch_threads(pair):
    before, tables = torch.get_num_threads(), []
    for threads in (1, 3):
        torch.set_num_threads(threads)
        public, _ = hide(SCHEME, pair, iterations=8, max_anchors=200)
        assert torch.get_num_threads() == threads
        tables.append(public.model.table.tobytes())
    torch.set_num_threads(before)
    assert tables[0] == tables[1]
