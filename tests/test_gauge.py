"""The symmetries of public files: what they leave as it is, and how owners read through them."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.attacks import find_attack
from gspure.constants import Energy
from gspure.metrics.targets import MESSAGE
from gspure.model import Gaussians
from gspure.public_model import PublicModel
from gspure.renderer import WHITE
from gspure.schemes.matching import registered
from gspure_torch.gs_hider.model import COLUMNS, SCENE_DECODER, DecoderFile, FeatureModel
from gspure_torch.keyss.key import NetworkKey
from gspure_torch.keyss.network import SHAPES, random_key
from gspure_torch.reference import Reference
from tests.anchor_cases import random_public
from tests.models import blobs, camera, joined, tilted_camera

COUNT = 40
INVISIBLE = 2e-6
CHANGED = {"features": "semantic_0", "anchors": "f_anchor_feat_0"}
VIEWS = (camera(), tilted_camera())


def harmonics(seed: int, degree: int) -> PublicModel:
    """Gaussians with quaternions of any norm; each of the last has the centre of the first, and other colours."""
    model = blobs(COUNT, seed, sh_degree=degree)
    others = blobs(COUNT, seed + 1, sh_degree=degree)[: COUNT // 2]
    return PublicModel(joined(model, others.with_columns({name: model.table[name][: COUNT // 2] for name in "xyz"})))


def features(seed: int) -> FeatureModel:
    pytest.importorskip("torch")
    from gspure_torch.gs_hider.decoder import untrained

    model = blobs(COUNT, seed, sh_degree=0)
    raw = np.random.default_rng(seed).normal(size=(COUNT, 16)).astype(np.float32)
    table = np.zeros(COUNT, [(name, "<f4") for name in COLUMNS])
    for name in COLUMNS:
        table[name] = model.table[name] if name in model.names else raw[:, int(name.split("_")[1])]
    (decoder,) = untrained(1, seed)
    return FeatureModel(Gaussians(table), DecoderFile.from_network(decoder, 1, SCENE_DECODER))


def public(kind: str, seed: int) -> PublicModel:
    """A public model: of Gaussians with harmonics of a degree or with features, or of anchors."""
    if kind == "features":
        return features(seed)
    return random_public(COUNT, seed=seed) if kind == "anchors" else harmonics(seed, int(kind))


def gauged(model: PublicModel, seed: int) -> PublicModel:
    return find_attack("gauge").apply(model, seed=seed).published(model)


@pytest.mark.parametrize("energy", ["ewa", "ray"])
@pytest.mark.parametrize("kind", ["0", "1", "2", "3", "features", "anchors"])
@settings(max_examples=3)
@given(seed=st.integers(0, 99))
def test_no_render_shows_other_frames_orders_or_bases_of_features(kind: str, energy: Energy, seed: int) -> None:
    before = public(kind, seed)
    after = gauged(before, seed)
    column = CHANGED.get(kind, "rot_0")
    assert (np.sort(after.model.table[column]) != np.sort(before.model.table[column])).any()
    for view in VIEWS:
        shown = [model.scene(None, WHITE, energy)(view) for model in (before, after)]
        assert np.abs(shown[0] - shown[1]).max() <= INVISIBLE


@pytest.mark.parametrize("kind", ["3", "features", "anchors"])
def test_an_owner_who_adapts_gets_frames_and_features_back(kind: str) -> None:
    original = public(kind, 0).model[:COUNT]
    back = registered(gauged(public(kind, 0).with_model(original), 3), original).model
    order = [np.flatnonzero(back.table["x"] == x)[0] for x in original.table["x"]]
    for name in original.names:
        np.testing.assert_allclose(back.table[name][order], original.table[name], atol=1e-4, err_msg=name)


@pytest.mark.parametrize("kind", ["features", "anchors"])
def test_a_key_with_published_rows_reads_through_a_mix_of_features(kind: str, tmp_path: Path) -> None:
    published = public(kind, 0)
    Reference.of(published).write(tmp_path)
    attacked = gauged(published, 3)
    back = Reference.read(tmp_path).read_through(attacked).features
    order = [np.flatnonzero(attacked.model.table["x"] == x)[0] for x in published.model.table["x"]]
    np.testing.assert_allclose(back[order], published.features, atol=1e-4)
    assert np.abs(Reference.read(tmp_path / "none").read_through(attacked).features - back).max() > 0.1


def test_a_canonical_key_reads_the_same_message_in_any_frames(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    layers = {name: rng.normal(0, 0.03, shape).astype(np.float32) for name, shape in SHAPES.items()}
    keys = [NetworkKey(random_key(rng), layers, is_canonical) for is_canonical in (True, False)]
    before = PublicModel(blobs(COUNT))
    after = gauged(before, 0)
    changes = []
    for key in keys:
        key.write(tmp_path / str(key.is_canonical))
        same_key = NetworkKey.read(tmp_path / str(key.is_canonical))
        shown = [same_key.message(model, MESSAGE)(VIEWS[0]) for model in (before, after)]
        changes.append(np.abs(shown[0] - shown[1]).max())
    assert changes[0] < 1e-4
    assert changes[1] > 0.1
