"""Did an attack affect what the message is read from?"""

import numpy as np
import pytest

from gspure.attacks import Attacked, find_attack
from gspure.attacks.attacked import affected
from gspure.model import Gaussians
from tests.attack_cases import anchors, features, measurements, public
from tests.models import blobs

COUNT = 30
BITS = ("f_dc_*", "f_rest_*", "opacity")  # Splats in Splats, read from the public colours
PLACES = ("x", "y", "z")  # the same, with the owner's own colours and opacities
BLEND = ("semantic_*", "x", "y", "z", "opacity", "scale_*", "rot_*")  # GS-Hider
FEATURES = ("f_anchor_feat_*",)  # SecureGS


def affects(name: str, model: Gaussians, reads: tuple[str, ...], **settings) -> bool:
    return affected(model, find_attack(name).apply(public(model), measurements(COUNT), **settings), reads)


@pytest.mark.parametrize(
    ("name", "settings", "bits", "places"),
    [
        ("unattacked", {}, False, False),
        ("feature_scaling", {}, True, False),
        ("feature_scaling", {"factor": 1.0}, False, False),
        ("gaussian_noise", {}, True, False),
        ("gaussian_noise", {"sigma": 0.0}, False, False),
        ("gaussian_noise", {"attributes": "opacity"}, True, False),
        ("quantize", {}, True, False),
        ("sh_truncation", {"degree": 2}, True, False),
        ("position_noise", {}, False, True),
        ("random_pruning", {"fraction": 0.1}, True, True),
        ("random_pruning", {"fraction": 0.0}, False, False),
        ("reorder", {}, False, False),
        ("inject", {}, False, True),
        ("densify_clone", {}, True, False),
    ],
)
def test_an_attack_affects_what_it_changes_or_loses(name: str, settings: dict, bits: bool, places: bool) -> None:
    assert affects(name, blobs(COUNT), BITS, **settings) == bits
    assert affects(name, blobs(COUNT), PLACES, **settings) == places


def test_where_all_rows_are_blended_further_ones_affect_the_message() -> None:
    assert affects("inject", features(COUNT), BLEND)
    assert not affects("inject", anchors(COUNT), FEATURES)
    assert not affects("reorder", features(COUNT), BLEND)


def test_a_removed_row_affects_the_message_whatever_it_reads() -> None:
    model = blobs(COUNT)
    assert affected(model, Attacked.without(model, np.arange(COUNT) == 0), ())
