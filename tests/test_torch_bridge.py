"""The torch bridge: gradients of the renderer as autograd carries them."""

import numpy as np
import pytest

from gspure.renderer import Renderer
from tests.models import blobs, tilted_camera

torch = pytest.importorskip("torch")

from gspure_torch.bridge import BlendInputs, TorchRenderer  # noqa: E402

GEOMETRY = ("means", "quats", "scales", "opacities")


@pytest.mark.parametrize("channels", [None, 1, 16], ids=["colours", "1 feature", "16 features"])
def test_images_and_their_gradients_are_those_of_the_renderer(device, style, channels):
    rng = np.random.default_rng(0)
    model = blobs(300)
    view = tilted_camera()
    features = channels and rng.normal(size=(300, channels)).astype(np.float32)
    background = rng.random(channels or 3, np.float32)
    renderer = Renderer(model, device, style=style)
    expected, pullback = renderer.vjp(view, features, background=background)
    weights = rng.normal(size=expected.shape).astype(np.float32)
    gradients = pullback(weights)
    blended = {"sh_coeffs": model.sh_coeffs} if features is None else {"features": features}
    arrays = {name: getattr(model, name) for name in GEOMETRY} | blended | {"background": background}
    leaves = {name: torch.tensor(array, requires_grad=True) for name, array in arrays.items()}
    image = TorchRenderer(device, style)(view, **leaves)
    assert image.numpy(force=True).tobytes() == expected.tobytes()
    image.backward(torch.from_numpy(weights))
    for name in GEOMETRY:
        assert leaves[name].grad.numpy().tobytes() == getattr(gradients, name).tobytes(), name
    (channel_leaf,) = (leaves[name] for name in blended)
    assert channel_leaf.grad.numpy().tobytes() == gradients.channels.tobytes()
    shown = (renderer.transmittance(view)[..., None] * weights.astype(np.float64)).sum(axis=(0, 1))
    np.testing.assert_allclose(leaves["background"].grad.numpy(), shown, rtol=1e-3, atol=1e-3)


def test_the_channel_behind_colours_is_the_inverse_depth(device, style):
    model, view = blobs(120, sh_degree=1), tilted_camera(33, 31)
    render = TorchRenderer(device, style)
    axis, offset = (torch.tensor(view.viewmat[2, part], dtype=torch.float32) for part in (slice(3), 3))
    images, gradients = [], []
    for background in (torch.zeros(4), torch.zeros(1)):
        leaves = [torch.tensor(getattr(model, name), requires_grad=True) for name in GEOMETRY]
        features = 1 / (leaves[0] @ axis + offset)[:, None]
        channels = features if len(background) == 1 else torch.tensor(model.sh_coeffs)
        image = render.blend(view, BlendInputs(background, *leaves, channels))[..., -1]
        image.square().sum().backward()
        images.append(image.detach())
        gradients.append([leaf.grad for leaf in leaves])
    torch.testing.assert_close(*images, rtol=1e-5, atol=1e-6)
    for behind, alone in zip(*gradients, strict=True):
        torch.testing.assert_close(behind, alone, rtol=1e-3, atol=1e-4 * float(alone.abs().max()))
