"""Attacks that learn on models with networks: GS-Hider's decoder and SecureGS's networks stay, features change."""

import numpy as np
import pytest

pytest.importorskip("torch")

from gspure.attacks import Measurements, find_attack
from gspure.attacks.strength import scene_damage
from gspure.public_model import PublicModel
from gspure.schemes.gs_hider.decoder import untrained
from gspure.schemes.gs_hider.files import FEATURES, SCENE_DECODER, DecoderFile
from gspure.schemes.gs_hider.model import FeatureModel
from gspure.schemes.gs_hider.training import Field
from gspure.training.initialization import gaussians_at
from tests.anchor_cases import random_public
from tests.attack_cases import changed
from tests.models import camera, tilted_camera

VIEWS = [camera(name="a"), tilted_camera(name="b")]


def gs_hider() -> FeatureModel:
    rng = np.random.default_rng(0)
    depths = rng.uniform(3, 9, 60)
    points = np.stack([*(rng.uniform(-0.6, 0.6, (2, 60)) * depths), depths], axis=1)
    rows = Field(gaussians_at(points, np.zeros((60, 3), np.uint8)), None).model()
    columns = {name: rng.normal(0, 2, 60).astype(np.float32) for name in FEATURES}
    opaque = rows.with_columns({**columns, "opacity": np.full(60, 3, np.float32)})
    (decoder,) = untrained(1, 0)
    for name, parameter in decoder.named_parameters():
        parameter.data *= 2.4 if name.endswith("weight") else 1  # else its image hardly depends on the features
    decoder.conv5.bias.data += 0.5
    return FeatureModel(opaque, DecoderFile.of(decoder, 1, SCENE_DECODER))


MODELS = {"gs_hider": gs_hider, "secure_gs": lambda: random_public(60)}


def attacked_by(name: str, public: PublicModel, **settings) -> PublicModel:
    attacked = find_attack(name).apply(public, Measurements(), cameras=VIEWS, **settings)
    return public.with_model(attacked.model)


@pytest.mark.parametrize("scheme", MODELS)
def test_reestimate_learns_every_feature_again_through_the_frozen_networks(scheme: str) -> None:
    public = MODELS[scheme]()
    files = public.decoder.content if scheme == "gs_hider" else {n: dict(net) for n, net in public.networks.items()}
    attacked = attacked_by("reestimate", public, iterations=120)
    features = set(public.columns["colour"])
    assert changed(public.model, attacked.model) == features
    blank = public.model.with_columns(dict.fromkeys(features, np.zeros(len(public.model), np.float32)))
    damage_of = scene_damage(public, VIEWS)
    assert damage_of(attacked) < 0.5 * damage_of(public.with_model(blank))
    if scheme == "gs_hider":
        assert DecoderFile.of(public.decoder.network, 1, SCENE_DECODER).content == files
    else:
        for name, network in files.items():
            for part, array in network.items():
                np.testing.assert_array_equal(attacked.networks[name][part], array)


@pytest.mark.parametrize(("scheme", "kept"), [("gs_hider", {"scale_0", "x", "rot_0"}), ("secure_gs", {"x", "rot_0"})])
def test_finetuning_everything_learns_what_the_networks_read(scheme: str, kept: set[str]) -> None:
    public = MODELS[scheme]()
    one, other = (attacked_by("finetune", public, iterations=6) for _ in range(2))
    assert one.model.table.tobytes() == other.model.table.tobytes()
    difference = changed(public.model, one.model)
    assert difference & set(public.columns["colour"])
    assert not difference & kept
    if scheme == "secure_gs":
        assert difference & {f"f_offset_{i}" for i in range(12)}
