"""Marked Clones and Rendered Bits: the decoder learns, the model shows its bits, and the owner reads them."""

from types import SimpleNamespace

import numpy as np
import pytest
from marked_clones import SCHEME, rendered_bits

from gspure.arrays import load_arrays
from gspure.attacks.renders import jpeg
from gspure.cli import main
from gspure.files import read_json
from gspure.images import read_back, write_image
from gspure.metrics.csv_tables import read_table
from gspure.metrics.readings import Reading, as_digits
from gspure.schemes.pair import read_pair
from gspure.schemes.scheme import hide
from tests.attack_cases import changed

torch = pytest.importorskip("torch")


SETTINGS = {"iterations": 200, "max_gaussians": 800, "bits": 8, "cloned": 0.5}
STEPS = {"decoder_steps": 250, "marking_steps": 150}


@pytest.fixture(scope="module")
def marked(pair_folder):
    pair = read_pair(pair_folder)
    public, key = hide(SCHEME, pair, **SETTINGS, **STEPS)
    clean, _ = hide(SCHEME, pair, message_weight=0, **SETTINGS)
    return SimpleNamespace(pair=pair, public=public, key=key, clean=clean)


def correct(key, model, cameras):
    """The share of correct bits in renders of a model."""
    return np.mean([key.read_bits(read_back(model.scene()(camera))) == key.bits for camera in cameras])


def test_bits_are_read_from_held_out_renders_and_not_from_a_clean_model_or_with_a_wrong_key(marked):
    train = marked.pair.scene.views
    assert correct(marked.key, marked.public, train) > 0.95
    assert correct(marked.key, marked.public, marked.pair.scene.dataset.test) > 0.75
    assert correct(marked.key, marked.clean, train) < 0.85
    assert correct(marked.key.wrong(np.random.default_rng(1)), marked.public, train) < 0.85


def test_colours_alone_show_bits_in_held_out_renders_also_after_jpeg(pair_folder):
    pair = read_pair(pair_folder)
    settings = {"iterations": 200, "max_gaussians": 800, "bits": 8}
    steps = {"decoder_steps": 250, "colour_steps": 100}
    public, key = hide(rendered_bits.SCHEME, pair, message_weight=1.0, **settings, **steps)
    clean, _ = hide(rendered_bits.SCHEME, pair, message_weight=0, **settings)
    train = pair.scene.views
    assert changed(clean.model, public.model) <= {n for n in clean.model.names if n.startswith("f_")}
    assert correct(key, public, train) > 0.95
    assert correct(key, public, pair.scene.dataset.test) > 0.75
    compressed = [jpeg(read_back(public.scene()(camera)), None, quality=80) for camera in train]
    assert np.mean([key.read_bits(image) == key.bits for image in compressed]) > 0.85
    assert correct(key, clean, train) < 0.85
    assert correct(key.wrong(np.random.default_rng(1)), public, train) < 0.85


def test_commands_embed_and_detect(pair_folder, tmp_path, capsys):
    short = SETTINGS | {"decoder_steps": 2, "marking_steps": 2}
    settings = [f"--set={name}={value}" for name, value in short.items()]
    assert main(["embed", "marked_clones", str(pair_folder), "--out", str(tmp_path / "marked"), *settings]) == 0
    check = read_json(tmp_path / "marked" / "key" / "readability.json")
    assert check["controls"].keys() == {"chance", "wrong_key"}
    assert ("readable: no" in capsys.readouterr().err) != check["readable"]
    key = SCHEME.read_key(tmp_path / "marked" / "key")
    model = SCHEME.read_public(tmp_path / "marked" / "public")
    assert load_arrays(tmp_path / "marked" / "key" / "marked_clones.npz", {"bits": (np.bool_, (8,))}, "a key")
    camera = read_pair(pair_folder).scene.views[0]
    write_image(tmp_path / "renders" / f"{camera.name}.png", model.scene()(camera))
    words = ["detect", str(tmp_path / "renders"), "--key", str(tmp_path / "marked" / "key")]
    out = tmp_path / "bits.csv"
    assert main([*words, "--scheme", "marked_clones", "--out", str(out)]) == 0
    decoded = as_digits(key.read_bits(read_back(model.scene()(camera))))
    assert read_table(out, Reading) == [Reading(camera.name, 100 * correct(key, model, [camera]), 8, decoded)]
    assert main([*words, "--scheme", "marked_clones", "--wrong-key", "1", "--out", str(out)]) == 0
    wrong = key.wrong(np.random.default_rng(1))
    assert read_table(out, Reading)[0].level == 100 * correct(wrong, model, [camera])
    extract = ["extract", str(tmp_path / "marked" / "public"), "--scheme", "marked_clones", *words[2:]]
    assert main([*extract, "--cameras", str(pair_folder / "cameras.json"), "--out", str(tmp_path / "message")]) == 2
    assert "expected a picture, found bits" in capsys.readouterr().err
