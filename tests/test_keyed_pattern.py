"""Keyed patterns: what their owner proves, and what nobody else can."""

import numpy as np
import pytest

from gspure.attacks import find_attack
from gspure.cli import main
from gspure.files import read_json, write_json
from gspure.images import write_image
from gspure.metrics.image_metrics import psnr
from gspure.metrics.sign_ranks import KEYS, certificate, largest_sums
from gspure.model import write_model
from gspure.model.rotations import moved, rotation
from gspure.public_model import PublicModel
from gspure.schemes.keyed_pattern.key import KeyedPatternKey
from gspure.schemes.keyed_pattern.pattern import Pattern
from gspure.schemes.keyed_pattern.registration import closest_points
from tests.models import blobs

LEAST_P = 1 / (KEYS + 1)


@pytest.fixture(scope="module")
def owned(trained):
    return trained("keyed_pattern")


def proof(owned, public):
    (reading,) = owned.key.model_readings(public)
    return reading.level, reading.p


def attacked(owned, name, **settings):
    return PublicModel(find_attack(name).apply(owned.public, **settings).model)


def test_the_owner_proves_a_marked_model_and_a_wrong_key_or_a_clean_model_proves_nothing(owned):
    assert proof(owned, owned.public) == (100.0, LEAST_P)
    (wrong,) = owned.key.wrong(np.random.default_rng(1)).model_readings(owned.public)
    assert wrong.p > 0.01
    assert wrong.level < 90
    clean, _ = owned.scheme.embed(owned.pair, 5, message_weight=0, **owned.settings)
    nothing = PublicModel(owned.public.model[:0])
    assert min(proof(owned, model)[1] for model in (clean, PublicModel(owned.key.clean), nothing)) > 0.01


def test_embedding_costs_the_training_views_at_most_what_is_allowed(owned):
    def quality(model):
        view = PublicModel(model).scene()
        pairs = zip(owned.pair.scene.views, owned.pair.scene.images, strict=True)
        return np.mean([psnr(view(camera).clip(0, 1), photograph) for camera, photograph in pairs])

    assert 0.25 < quality(owned.key.clean) - quality(owned.public.model) <= 0.3


@pytest.mark.parametrize(
    ("attack", "settings"),
    [
        ("quantize", {"bits": 8}),
        ("rigid_transform", {"angle": 70.0, "scale": 1.3, "translation": "1,0,2"}),
        ("feature_scaling", {"factor": 1.2}),
        ("unmark", {}),
    ],
)
def test_bits_are_proven_after_what_would_hide_them(attack, settings, owned):
    level, p = proof(owned, attacked(owned, attack, **settings))
    assert p == LEAST_P
    assert level > 90


def test_cells_that_are_made_like_their_neighbours_show_no_mark_in_their_rows_alone(owned):
    def blind(public):
        findings = owned.key.findings(public)
        return certificate(findings.tries[:1].reshape(1, -1), owned.key.pattern.mark(findings.cells).ravel()).z

    assert blind(owned.public) > 6
    assert blind(attacked(owned, "unmark", clip=0.1)) < blind(owned.public) / 2


def test_p_values_of_a_model_without_the_mark_are_uniform_over_keys(owned):
    from scipy.stats import kstest

    noisy = PublicModel(find_attack("gaussian_noise").apply(owned.key.clean, sigma=0.02).model)
    cells, tries = owned.key.findings(noisy)
    values = tries.reshape(len(tries), -1)
    others = largest_sums(values, 999)
    marks = [Pattern.of(bytes([number % 256, number // 256]), b"", owned.key.bits).mark(cells) for number in range(500)]
    ranks = [(1 + np.count_nonzero(others >= np.max(values @ mark.ravel()))) / 1000 for mark in marks]
    assert kstest(ranks, "uniform").pvalue > 0.01


def test_a_key_for_another_clean_model_has_another_pattern(owned):
    clean = owned.key.clean
    nearly = clean.with_columns({"x": np.nextafter(clean.table["x"], np.float32(9))})
    same = KeyedPatternKey(owned.key.secret, owned.key.bits, nearly, owned.key.views)
    cells = np.arange(1000, dtype=np.uint64)
    assert np.abs(np.mean(same.pattern.signs(cells)[0] * owned.key.pattern.signs(cells)[0])) < 0.1


def test_renders_of_some_of_the_keys_views_are_enough(owned, tmp_path):
    scene = owned.public.scene()
    for view in owned.key.views[:4]:
        write_image(tmp_path / f"{view.name}.png", scene(view))
    (reading,) = owned.key.readings(tmp_path)
    assert reading.p == LEAST_P
    assert reading.level > 90


def test_new_rows_are_registered_by_their_shape():
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 600)).astype(np.float32)
    surface = blobs(600).with_columns({"x": x, "y": y, "z": x * x + x * y + y**3 / 2})
    rotvec = np.array([0.4, 1.9, -0.8])
    motion = closest_points(surface, moved(surface[200:], rotvec, np.array([3.0, 0, -1]), 1.7))
    np.testing.assert_allclose(motion.rotation, rotation(rotvec).T, atol=1e-3)
    assert motion.scale == pytest.approx(1 / 1.7, rel=1e-3)


def test_detect_certifies_and_says_whether_the_key_is_the_committed_one(owned, pair_folder, tmp_path, capsys):
    words = ["embed", "keyed_pattern", str(pair_folder), "--set=iterations=60", "--set=max_gaussians=800"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    words = ["detect", str(tmp_path / "public"), "--key", str(tmp_path / "key"), "--out", str(tmp_path / "bits.csv")]
    assert main([*words, "--certify", "99999"]) == 0
    said = capsys.readouterr().out
    assert "p = 1e-05" in said
    assert "commitment" in said
    assert "holds" in said
    write_model(tmp_path / "key" / "clean.ply", owned.public.model)
    assert main(words) == 0
    streams = capsys.readouterr()
    assert "other than committed: the key" in streams.err
    assert "holds" not in streams.out
    write_json(tmp_path / "commitment.json", {"scheme": read_json(tmp_path / "commitment.json")["scheme"]})
    assert main(words) == 2
