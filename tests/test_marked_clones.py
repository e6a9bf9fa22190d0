"""Marked Clones and Rendered Bits: the decoder learns, the model shows its bits, and the owner reads them."""

import numpy as np
import pytest
from marked_clones import SCHEME, rendered_bits

from gspure.attacks.renders import jpeg
from gspure.images import read_back
from gspure.schemes.scheme import hide
from tests.attack_cases import changed

pytest.importorskip("torch")

SETTINGS = {"iterations": 200, "max_gaussians": 800, "bits": 8}


def correct(key, images):
    """The share of correct bits in images."""
    return np.mean([key.read_bits(image) == key.bits for image in images])


def renders(model, cameras):
    return [read_back(model.scene()(camera)) for camera in cameras]


def marked_and_clean(scheme, pair, settings, steps):
    """Return both models and the key, after a check that its bits are read where they are and nowhere else."""
    public, key = hide(scheme, pair, **settings, **steps)
    clean, _ = hide(scheme, pair, **settings | {"message_weight": 0})
    train = pair.scene.views
    assert correct(key, renders(public, train)) > 0.95
    assert correct(key, renders(public, pair.scene.dataset.test)) > 0.75
    assert correct(key, renders(clean, train)) < 0.85
    assert correct(key.wrong(np.random.default_rng(1)), renders(public, train)) < 0.85
    return public, clean, key


def test_bits_are_read_from_held_out_renders_and_not_from_a_clean_model_or_with_a_wrong_key(pair):
    marked_and_clean(SCHEME, pair, SETTINGS | {"cloned": 0.5}, {"decoder_steps": 250, "marking_steps": 150})


def test_colours_alone_show_bits_in_held_out_renders_also_after_jpeg(pair):
    settings = SETTINGS | {"message_weight": 1.0}
    steps = {"decoder_steps": 250, "colour_steps": 100}
    public, clean, key = marked_and_clean(rendered_bits.SCHEME, pair, settings, steps)
    assert changed(clean.model, public.model) <= {n for n in clean.model.names if n.startswith("f_")}
    assert correct(key, [jpeg(image, None, quality=80) for image in renders(public, pair.scene.views)]) > 0.85
