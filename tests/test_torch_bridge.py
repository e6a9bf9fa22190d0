"""The torch bridge: gradients of the renderer as autograd carries them, and networks trained over them."""

import numpy as np
import pytest

from gspure.renderer import Renderer
from tests.models import blobs, camera, gaussians, tilted_camera

torch = pytest.importorskip("torch")

from gspure.training.torch_bridge import TorchRenderer  # noqa: E402

NAMES = ("means", "quats", "scales", "opacities", "features", "sh_coeffs", "background")


def tensors(model, *, features=None, background=None, grad=True):
    """What a model is rendered from, each a leaf."""
    arrays = {name: getattr(model, name) for name in NAMES[:4]}
    arrays |= {"sh_coeffs": model.sh_coeffs} if features is None else {"features": features}
    if background is not None:
        arrays["background"] = np.asarray(background, np.float32)
    return {name: torch.tensor(array, requires_grad=grad) for name, array in arrays.items()}


def random_features(count, channels, seed=0):
    return np.random.default_rng(seed).normal(size=(count, channels)).astype(np.float32)


def glass():
    """Large panes before the camera: no pixel is near a cut-off of alpha, and none is near opaque."""
    rng = np.random.default_rng(4)
    means = np.column_stack([rng.uniform(-0.4, 0.4, (6, 2)), np.linspace(4, 8, 6)])
    model = gaussians(
        means=means,
        quats=rng.normal(size=(6, 4)),
        scales=rng.uniform(1.5, 3.0, (6, 3)),
        opacities=rng.uniform(0.2, 0.6, 6),
        colors=rng.uniform(0.2, 0.8, (6, 3)),
    )
    return model, camera(20, 14, focal=30.0)


def gradients_of(leaves):
    return {name: leaf.grad.numpy() for name, leaf in leaves.items()}


def assert_same_bits(found, expected):
    assert found.keys() == expected.keys()
    for name, array in found.items():
        assert np.ascontiguousarray(array).tobytes() == np.ascontiguousarray(expected[name]).tobytes(), name


def as_named(gradients, channels):
    named = {name: getattr(gradients, name) for name in NAMES[:4]}
    return named | {channels: gradients.channels}


def test_colours_and_their_gradients_are_those_of_the_renderer(device, style):
    model, view = blobs(300), tilted_camera()
    expected, pullback = Renderer(model, device, style=style).vjp(view, background=(0.1, 0.5, 0.9))
    leaves = tensors(model)
    image = TorchRenderer(device, style)(view, **leaves, background=(0.1, 0.5, 0.9))
    assert image.numpy(force=True).tobytes() == expected.tobytes()
    weights = random_features(expected.size, 1).reshape(expected.shape)
    image.backward(torch.from_numpy(weights))
    assert_same_bits(gradients_of(leaves), as_named(pullback(weights), "sh_coeffs"))


@pytest.mark.parametrize("channels", [1, 3, 16])
def test_features_and_their_gradients_are_those_of_the_renderer(device, style, channels):
    model, view, features = blobs(300, 1), tilted_camera(), random_features(300, channels)
    expected, pullback = Renderer(model, device, style=style).vjp(view, features)
    leaves = tensors(model, features=features)
    feature_map = TorchRenderer(device, style)(view, **leaves)
    assert feature_map.numpy(force=True).tobytes() == expected.tobytes()
    (feature_map * 2).sum().backward()
    assert_same_bits(gradients_of(leaves), as_named(pullback(np.full_like(expected, 2)), "features"))


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "features", "background"])
def test_a_gradient_predicts_how_a_loss_changes(name):
    model, view = glass()
    leaves = tensors(model, features=random_features(6, 4), background=(0.3, -0.2, 0.8, 0.1))
    render, weights = TorchRenderer(), torch.from_numpy(random_features(14 * 20, 4, 1).reshape(14, 20, 4))

    def loss(**moved):
        return (render(view, **leaves | moved).double().square() * weights).sum()

    loss().backward()
    direction = torch.from_numpy(random_features(leaves[name].numel(), 1, 2).reshape(leaves[name].shape))
    step = 1e-2 * direction
    with torch.no_grad():
        change = loss(**{name: leaves[name] + step}) - loss(**{name: leaves[name] - step})
    predicted = 2 * (leaves[name].grad.double() * step).sum()
    assert change.item() == pytest.approx(predicted.item(), rel=2e-3)
