"""Small models of every kind that attacks meet, and measurements of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import settings

from gspure.arrays import Float32
from gspure.attacks import Attacked, Measurements, find_attack
from gspure.cameras import Camera
from gspure.images import read_back
from gspure.model import Gaussians
from gspure.public_model import PublicModel
from gspure_torch.gs_hider.model import FeatureModel
from gspure_torch.secure_gs.model import AnchorModel
from tests.models import blobs

unhurried = settings(max_examples=40, deadline=None)  # a busy machine is no failure


def features(count: int, seed: int = 0) -> Gaussians:
    """Gaussians that colour by features, as GS-Hider's."""
    return _renamed(blobs(count, seed, sh_degree=1), {f"f_dc_{i}": f"semantic_{i}" for i in range(3)})


def anchors(count: int, seed: int = 0) -> Gaussians:
    """Anchors of one Gaussian each, as Scaffold-GS's; their opacities are all the same."""
    names = {f"f_dc_{i}": f"f_anchor_feat_{i}" for i in range(3)} | {f"f_rest_{i}": f"f_offset_{i}" for i in range(3)}
    model = _renamed(blobs(count, seed, sh_degree=1), names)
    return model.with_columns({"opacity": np.full(count, -2.1972246, np.float32)})


KINDS = {"harmonics": blobs, "features": features, "anchors": anchors}


class FeatureRows(PublicModel):
    """The rows of a GS-Hider model, without its decoder."""

    attributes = FeatureModel.attributes


class AnchorRows(PublicModel):
    """The rows of a Scaffold-GS model, without its networks."""

    attributes = AnchorModel.attributes
    rows_are_gaussians = False


def public(model: Gaussians) -> PublicModel:
    """Return a public model of the kind that the columns of `model` say."""
    if model.columns_named("f_anchor_feat_"):
        return AnchorRows(model)
    return FeatureRows(model) if model.columns_named("semantic_") else PublicModel(model)


def measurements(count: int, seed: int = 1) -> Measurements:
    """Weights, a decision, opacities, distances and clusters, all random."""
    rng = np.random.default_rng(seed)
    weights = rng.lognormal(0, 2, count).astype(np.float32)
    opacities, distances = rng.uniform(size=(2, count)).astype(np.float32)
    labels = rng.permutation(np.arange(count, dtype=np.int32) % 4) - 1
    return Measurements(weights, weights < 1, opacities, 6 * distances, labels)


def photographs(public: PublicModel, views: Sequence[Camera]) -> list[Float32]:
    """Return photographs near the renders of a model: at 30 dB."""
    rng = np.random.default_rng(0)
    renders = [read_back(public.scene()(view)) for view in views]
    return [render + rng.normal(0, 10**-1.5, render.shape).astype(np.float32) for render in renders]


def apply(name: str, model: Gaussians, seed: int = 0, **settings: Any) -> Attacked:
    """Attack a model of any kind with all measurements of it."""
    return find_attack(name).apply(public(model), measurements(len(model)), seed=seed, **settings)


def changed(before: Gaussians, after: Gaussians) -> set[str]:
    """Return the columns that differ between two models of the same rows."""
    return {name for name in before.names if (before.table[name] != after.table[name]).any()}


def _renamed(model: Gaussians, names: dict[str, str]) -> Gaussians:
    """Return the model with other names for some columns, without the further harmonics."""
    columns = {names.get(name, name): model.table[name] for name in model.names}
    columns = {name: column for name, column in columns.items() if not name.startswith("f_rest_")}
    table = np.empty(len(model), [(name, "<f4") for name in columns])
    for name, column in columns.items():
        table[name] = column
    return Gaussians(table)
