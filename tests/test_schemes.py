"""Properties of every scheme: the built-in ones, and the examples of the guide; and the network of KeySS."""

from fnmatch import filter as matching
from functools import partial

import numpy as np
import pytest

from gspure.metrics.image_metrics import psnr
from gspure.metrics.proof import trace
from gspure.metrics.targets import is_picture
from gspure.model import Gaussians, write_model
from gspure.opencl.losses import Photographs
from gspure.public_model import PublicModel
from gspure.renderer import CONTRIBUTION
from gspure.schemes.hidden_weight import low_rows
from gspure.schemes.pair import read_pair
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.schemes.scheme import hide
from gspure_torch.gs_hider.model import COLUMNS, FeatureModel
from gspure_torch.keyss.key import NetworkKey
from gspure_torch.keyss.network import SHAPES, added, random_key
from tests.models import blobs, without
from tests.scheme_cases import NEEDS_TORCH, SETTINGS, held_out, quality


@pytest.fixture(scope="module", params=SETTINGS)
def embedded(request, trained):
    """A scheme, a pair, and the public model and key of that pair."""
    return trained(request.param)


def message_views(public, key, scheme):
    """The renderers of all pictures of the message."""
    return [key.message(public, extraction) for extraction in filter(is_picture, scheme.extractions)]


@pytest.mark.parametrize("name", ["splats_in_splats", "gs_hider", "secure_gs", "keyss"])
def test_a_message_is_learned_at_poses_of_its_own(name, own_pair_folder):
    if name in NEEDS_TORCH:
        pytest.importorskip("torch")
    pair = read_pair(own_pair_folder)
    settings = SETTINGS[name] | {"iterations": 200}
    if name == "secure_gs":
        settings |= {"max_anchors": 800}
    public, key = hide(find_scheme(name), pair, **settings)
    view = key.message(public, "message")
    camera, photograph = held_out(pair.message)[0]
    assert trace([view(camera)], [photograph]) > 0.3
    elsewhere, of_scene = held_out(pair.scene)[0]
    assert trace([view(elsewhere)], [photograph]) < 0.2
    assert trace([public.scene()(elsewhere)], [of_scene]) > 0.3


@pytest.mark.parametrize(("name", "most"), [("gs_hider", "max_gaussians"), ("secure_gs", "max_anchors")])
def test_networks_learn_small_photographs_first_by_the_fast_schedule(name, most, own_pair_folder, monkeypatch):
    pytest.importorskip("torch")
    pair = read_pair(own_pair_folder)
    compare = Photographs.compare
    widths = []

    def recorded(photographs, number, image):
        widths.append(image.shape[1])
        return compare(photographs, number, image)

    monkeypatch.setattr(Photographs, "compare", recorded)
    public, key = hide(find_scheme(name), pair, schedule="fast", iterations=200, **{most: 800})
    assert widths == sorted(widths)
    assert {*widths} == {12, 24, 48}
    for view, capture in ((public.scene(), pair.scene), (key.message(public, "message"), pair.message)):
        camera, photograph = held_out(capture)[0]
        assert trace([view(camera)], [photograph]) > 0.3


@pytest.mark.parametrize(
    ("name", "settings"),
    [("gs_hider", {"iterations": 200, "max_gaussians": 2000}), ("secure_gs", {"iterations": 120, "max_anchors": 600})],
)
def test_a_hardened_message_outlives_the_pruning_of_rows_of_low_weight(name, settings, own_pair_folder):
    pytest.importorskip("torch")
    pair = read_pair(own_pair_folder)

    def drop(scheme):
        public, key = hide(find_scheme(scheme), pair, **settings)
        pruned = without(public, low_rows(public, pair.scene.views, 2.0, None))
        before, after = (quality(key.message(model, "message"), pair.message) for model in (public, pruned))
        return before - after

    assert drop(f"{name}_hardened") < drop(name) - 1


def test_a_written_model_renders_the_same_images(embedded, tmp_path):
    embedded.public.write(tmp_path / "public" / "point_cloud.ply")
    embedded.key.write(tmp_path / "key")
    public = embedded.scheme.read_public(tmp_path / "public")
    key = embedded.scheme.read_key(tmp_path / "key")
    camera = embedded.pair.scene.views[0]
    assert public.model.table.tobytes() == embedded.public.model.table.tobytes()
    assert public.geometry_digest() == embedded.public.geometry_digest()
    assert public.scene()(camera).tobytes() == embedded.public.scene()(camera).tobytes()
    views = message_views(embedded.public, embedded.key, embedded.scheme)
    views_of_files = message_views(public, key, embedded.scheme)
    for view, view_of_files in zip(views, views_of_files, strict=True):
        assert view(camera).tobytes() == view_of_files(camera).tobytes()


def test_a_wrong_key_shows_something_else(embedded):
    if not any(map(is_picture, embedded.scheme.extractions)):
        pytest.skip("hides bits")
    camera = embedded.pair.scene.views[0]
    extraction = next(iter(embedded.scheme.extractions))

    def shown_with(key):
        return key.message(embedded.public, extraction)(camera).tobytes()

    right = shown_with(embedded.key)
    wrong = [shown_with(embedded.key.wrong(np.random.default_rng(seed))) for seed in (1, 1, 2)]
    assert wrong[0] == wrong[1]
    assert right not in wrong


def test_the_owner_reads_the_bits_of_the_example_in_any_view(trained):
    glint = trained("glint")
    camera, _ = held_out(glint.pair.scene)[0]
    image = glint.public.scene()(camera).clip(0, 1)
    assert glint.key.read_bits(image).tolist() == glint.key.bits.tolist()
    assert 2 <= (glint.key.wrong(np.random.default_rng(0)).read_bits(image) == glint.key.bits).sum() <= 14
    assert psnr(image, PublicModel(glint.key.clean).scene()(camera)) > 20


def test_units_can_be_pruned_and_the_rest_is_untouched(embedded):
    pruned = np.random.default_rng(0).random(len(embedded.public.model)) < 0.5
    smaller = without(embedded.public, pruned)
    assert smaller.model.table.tobytes() == embedded.public.model.table[~pruned].tobytes()
    camera = embedded.pair.scene.views[0]
    assert np.isfinite(smaller.scene()(camera)).all()
    for view in message_views(smaller, embedded.key, embedded.scheme):
        assert np.isfinite(view(camera)).all()


def test_contributions_of_units_add_up_to_those_of_their_gaussians(embedded, energy):
    from gspure.renderer import Renderer

    camera = embedded.pair.scene.views[1]
    by_unit = embedded.public.contributions(energy=energy)(camera)
    gaussians, owners = embedded.public.gaussians(camera)
    by_gaussian = Renderer(gaussians, energy=energy).contributions(camera)
    assert by_unit.dtype == CONTRIBUTION
    assert (np.diff(by_unit["index"].astype(int)) > 0).all()
    assert set(by_unit["index"]) == set(owners[by_gaussian["index"]])
    assert by_unit["sum"].sum() == pytest.approx(by_gaussian["sum"].sum(), rel=1e-4)


def test_every_unit_has_an_opacity_to_cluster_by(embedded):
    opacities = embedded.public.opacities(embedded.pair.scene.views)
    assert opacities.shape == (len(embedded.public.model),)
    assert opacities.dtype == np.float32
    assert ((opacities >= 0) & (opacities <= 1)).all()
    assert opacities.std() > 0


def test_a_redrawn_twin_differs_in_the_carriers_of_the_message_only(embedded):
    twin = embedded.scheme.redrawn(embedded.public, np.random.default_rng(0))
    if twin is None:
        assert not embedded.scheme.carriers
        return
    before, after = embedded.public.model.table, twin.model.table
    changed = {name for name in before.dtype.names if not np.array_equal(before[name], after[name])}
    assert changed == {name for carrier in embedded.scheme.carriers for name in matching(before.dtype.names, carrier)}
    camera, _ = held_out(embedded.pair.message)[0]
    published, redrawn = (embedded.key.message(model, "message")(camera) for model in (embedded.public, twin))
    assert not np.array_equal(published, redrawn)


def test_no_message_gives_the_clean_model_of_the_same_form_and_no_key(embedded):
    public, key = hide(embedded.scheme, embedded.pair, message_weight=0, **few_steps(embedded))
    assert key is None
    assert type(public) is type(embedded.public)
    assert public.model.table.dtype == embedded.public.model.table.dtype


def test_the_same_seed_gives_the_same_bits_for_any_number_of_threads(embedded, tmp_path, request):
    written = []
    for number, seed in enumerate((3, 3, 4)):
        if embedded.scheme.name in NEEDS_TORCH:
            from gspure_torch.pytorch import torch

            request.addfinalizer(partial(torch.set_num_threads, torch.get_num_threads()))
            torch.set_num_threads(number + 1)
        public, key = hide(embedded.scheme, embedded.pair, seed=seed, **few_steps(embedded))
        public.write(tmp_path / f"{number}" / "point_cloud.ply")
        key.write(tmp_path / f"{number}")
        written.append([path.read_bytes() for path in sorted((tmp_path / f"{number}").iterdir())])
    assert written[0] == written[1]
    assert written[0] != written[2]


def few_steps(embedded):
    """Settings of a short training."""
    if "iterations" in embedded.settings:
        return embedded.settings | {"iterations": 6}
    return embedded.settings


def test_a_model_is_opened_by_its_columns(tmp_path):
    write_model(tmp_path / "point_cloud.ply", blobs(5, sh_degree=0))
    assert type(read_public_model(tmp_path)) is PublicModel
    write_model(tmp_path / "hider.ply", Gaussians(np.ones(5, [(name, "<f4") for name in COLUMNS])))
    assert type(read_public_model(tmp_path / "hider.ply")) is FeatureModel


def test_numpy_and_pytorch_add_the_same_offsets_of_keyss():
    torch = pytest.importorskip("torch")
    from gspure_torch.keyss.training import Learner

    rng = np.random.default_rng(0)
    layers = {name: rng.normal(0, 0.05, shape).astype(np.float32) for name, shape in SHAPES.items()}
    key = NetworkKey(random_key(rng), layers)
    rows = rng.normal(size=(20, 59)).astype(np.float32)
    by_torch = Learner(key.network).added(torch.from_numpy(rows), key.vector).detach().numpy()
    np.testing.assert_allclose(by_torch, added(key.network, key.vector, rows), rtol=1e-4, atol=1e-5)
