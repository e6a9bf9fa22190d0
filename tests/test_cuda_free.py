"""Programs written for CUDA: the modules that they import, and the command that runs them."""

import math
import subprocess
import sys
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from gspure.cli import main
from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.metrics.image_metrics import ssim
from gspure.renderer import Renderer
from tests.documentation import ROOT
from tests.models import blobs, camera, gaussians, tilted_camera
from tests.reference.projection import project

torch = pytest.importorskip("torch")

from gspure_torch.cuda_free import gsplat  # noqa: E402
from gspure_torch.cuda_free.dialects import DIALECTS, SETTINGS, Dialect, find_wrapper, read_dialect  # noqa: E402
from gspure_torch.cuda_free.neighbours import distCUDA2  # noqa: E402
from gspure_torch.cuda_free.projection import world_covariances  # noqa: E402
from gspure_torch.cuda_free.rasterizer import interface  # noqa: E402
from gspure_torch.cuda_free.replacement import extensions_of  # noqa: E402
from gspure_torch.cuda_free.similarity import fused_ssim  # noqa: E402

VIEW = tilted_camera(40, 30)
EVERYTHING = Dialect((*SETTINGS, "antialiasing"), outputs=("color", "radii", "depth", "inverse_depth", "alpha"))


def rasterizer(dialect=EVERYTHING, view=VIEW, sh_degree=1, **changes):
    """Return the rasterizer of a view, with the matrices that 3DGS computes."""
    tangents = np.array([view.width / view.K[0, 0], view.height / view.K[1, 1]]) / 2
    projection = np.diag([*1 / tangents, 100 / 99.99, 0])
    projection[2:, 2:] += [[0, -1 / 99.99], [1, 0]]
    matrices = [torch.from_numpy(matrix.T.astype(np.float32)) for matrix in (view.viewmat, projection @ view.viewmat)]
    centre = torch.from_numpy(view.centre.astype(np.float32))
    values = (view.height, view.width, *tangents.tolist(), torch.tensor([0.1, 0.5, 0.9]), 1.0, *matrices)
    settings, made = interface(dialect)
    return made(settings(*values, sh_degree, centre, False, False)._replace(**changes))


def inputs(model):
    """Return the tensors of a model by the rasterizer's names, and `means2D`."""
    names = {"means": "means3D", "quats": "rotations", "scales": "scales", "sh_coeffs": "shs", "opacities": "opacities"}
    leaves = {ours: torch.tensor(getattr(model, name), requires_grad=True) for name, ours in names.items()}
    return leaves | {"means2D": torch.zeros(len(model), 3, requires_grad=True)}


def weights(image, seed=0):
    return torch.from_numpy(np.random.default_rng(seed).normal(size=image.shape).astype(np.float32))


def soft():
    """Gaussians that cover the image at every pixel: no edge, nothing clamped."""
    rng = np.random.default_rng(3)
    means = np.stack([rng.uniform(-0.2, 0.2, 4), rng.uniform(-0.2, 0.2, 4), np.linspace(3.5, 5, 4)], axis=1)
    return gaussians(means=means, quats=rng.normal(size=(4, 4)), scales=rng.uniform(1.2, 2.2, (4, 3)), colors=0.6)


def test_outputs_and_gradients_are_those_of_the_renderer():
    model = blobs(200, sh_degree=1)
    tensors = inputs(model)
    color, radii, depth, inverse_depth, alpha = rasterizer()(**tensors)
    renderer = Renderer(model)
    z = (model.means @ VIEW.viewmat[2, :3] + VIEW.viewmat[2, 3]).astype(np.float32)[:, None]
    tight = {"rtol": 0, "atol": 2e-5}
    for output, features in ((depth, z), (inverse_depth, 1 / np.maximum(z, 0.2)), (alpha, np.ones_like(z))):
        expected = renderer.feature_map(VIEW, features)
        np.testing.assert_allclose(output.detach().numpy()[0], expected[..., 0], **tight)
    expected, pullback = renderer.vjp(VIEW, background=[0.1, 0.5, 0.9])
    np.testing.assert_allclose(color.detach().numpy().transpose(1, 2, 0), expected, **tight)
    gradient = weights(color)
    color.backward(gradient)
    gradients = pullback(gradient.numpy().transpose(1, 2, 0))
    in_halves = np.pad(gradients.means2d * [VIEW.width / 2, VIEW.height / 2], ((0, 0), (0, 1)))
    pairs = [("means3D", gradients.means), ("means2D", in_halves), ("shs", gradients.channels)]
    pairs += [("scales", gradients.scales), ("rotations", gradients.quats), ("opacities", gradients.opacities)]
    for name, expected in pairs:
        error = np.abs(tensors[name].grad.numpy() - expected).max()
        assert error < 2e-4 * np.abs(expected).max(), name
    assert not radii.requires_grad


NAMES = ("means3D", "opacities", "scales", "rotations", "shs", "colors_precomp", "cov3D_precomp")


@pytest.mark.parametrize(("name", "is_round"), [*((name, False) for name in NAMES), ("cov3D_precomp", True)])
def test_gradients_are_slopes_and_precomputed_inputs_draw_the_same(name, is_round):
    """Of all outputs, antialiased; float32 holds three digits of a difference. Round ones have any eigenvectors."""
    tensors = {key: tensor.detach() for key, tensor in inputs(soft()).items()}
    if is_round:
        tensors["scales"] = tensors["scales"][:, :1].repeat(1, 3)
    draw = rasterizer(sh_degree=0, antialiasing=True)
    before = draw(**tensors)
    if name == "colors_precomp":
        tensors[name] = tensors.pop("shs")[:, 0] * SH_DC + 0.5
    if name == "cov3D_precomp":
        tensors[name] = world_covariances(tensors.pop("rotations"), tensors.pop("scales")).T
    torch.testing.assert_close(draw(**tensors), before, rtol=1e-5, atol=2e-5)

    def images(step):
        outputs = draw(**tensors | {name: tensors[name] + step})
        return torch.cat([outputs[0], *outputs[2:]])

    direction = weights(tensors[name], 1) * tensors[name].abs().mean()
    leaf = torch.zeros_like(tensors[name], requires_grad=True)
    drawn = images(leaf)
    gradient = weights(drawn, 2)
    drawn.backward(gradient)
    size = 1e-2
    difference = (images(size * direction) - images(-size * direction)).double()
    slope = (difference * gradient).sum() / (2 * size)
    terms = leaf.grad * direction
    assert float(terms.sum()) == pytest.approx(float(slope), abs=3e-3 * float(terms.norm()) + 1e-4)


def test_radii_are_three_deviations_of_what_touches_a_tile():
    model = blobs(200, sh_degree=0, size=(0.01, 0.6))
    tensors = {name: tensor.detach() for name, tensor in inputs(model).items()}
    draw = rasterizer()
    splats = project(model, VIEW, "ewa")
    expected = np.zeros(len(model))
    for row, centre, covariance in zip(splats.rows, splats.means2d - 0.5, splats.covs2d, strict=True):
        low, high = np.linalg.eigvalsh(covariance)
        radius = math.ceil(3 * math.sqrt((low + high) / 2 + max((high - low) / 2, math.sqrt(0.1))))
        first, end = np.floor((centre - radius) / 16), np.floor((centre + radius + 15) / 16)
        touches = (np.minimum(end, [3, 2]) > np.maximum(first, 0)).all()
        expected[row] = radius if touches else 0
    radii = draw.visible_filter(tensors["means3D"], tensors["scales"], tensors["rotations"]).numpy()
    assert 20 < np.count_nonzero(radii) < 200
    assert np.count_nonzero(radii != expected) <= 1  # rounding up
    assert np.array_equal(np.flatnonzero(draw.markVisible(tensors["means3D"]).numpy()), np.sort(splats.rows))


def test_features_are_blended_as_those_dialects_return_them():
    model = blobs(60, sh_degree=1)
    features = weights(torch.empty(60, 1, 6))
    tensors = inputs(model)
    color, feature_map, _, _ = rasterizer(DIALECTS["feature-3dgs"])(**tensors, semantic_feature=features[..., :5])
    del tensors["shs"]
    alone, _ = rasterizer(DIALECTS["gs-hider"])(**tensors, semantic_feature=features)
    expected = Renderer(model).feature_map(VIEW, features[:, 0].numpy()).transpose(2, 0, 1)
    np.testing.assert_allclose(alone.detach().numpy(), expected, rtol=0, atol=5e-5)
    assert (color.shape, feature_map.shape) == ((3, 30, 40), (5, 30, 40))
    with pytest.raises(ValueError, match="either shs or colors_precomp"):
        rasterizer(DIALECTS["inria-2023"])(**tensors)
    with pytest.raises(TypeError, match="takes no normals"):
        rasterizer()(**tensors, normals=features)


@pytest.fixture
def rasterization():
    """gsplat's function, with its tensors of `blobs` and two views by name; further arguments replace them."""
    model = blobs(120, sh_degree=1)
    tensors = gsplat_tensors(model)
    tensors["viewmats"] = torch.tensor(np.stack([VIEW.viewmat, camera().viewmat]), dtype=torch.float32)
    tensors["Ks"] = torch.tensor(np.stack([VIEW.K, VIEW.K]), dtype=torch.float32)
    fixed = tensors | {"width": 40, "height": 30, "sh_degree": 1, "packed": False}
    draw = partial(gsplat.rasterization, True)
    return SimpleNamespace(model=model, draw=lambda **changes: draw(**fixed | changes), **tensors)


def gsplat_tensors(model):
    names = {"means": "means", "quats": "quats", "scales": "scales", "opacities": "opacities", "sh_coeffs": "colors"}
    return {theirs: torch.tensor(getattr(model, ours), requires_grad=True) for ours, theirs in names.items()}


def test_gsplat_draws_the_images_of_the_renderer_from_each_of_its_planes(rasterization):
    model = rasterization.model
    renderer = Renderer(model)
    backgrounds = torch.tensor([[0.1, 0.5, 0.9], [0.0, 0.0, 0.0]])
    images, covers, further = rasterization.draw(backgrounds=backgrounds, near_plane=0.01)
    np.testing.assert_allclose(covers[0, ..., 0].detach(), 1 - renderer.transmittance(VIEW), rtol=0, atol=2e-6)
    expected, pullback = renderer.vjp(VIEW, background=[0.1, 0.5, 0.9])
    np.testing.assert_allclose(images[0].detach().numpy(), expected, rtol=0, atol=2e-5)
    gradient = weights(images)
    gradient[1] = 0
    images.backward(gradient)
    gradients = pullback(gradient[0].numpy())
    assert not further["means2d"].grad[1].any()
    pairs = [(further["means2d"].grad[0], gradients.means2d), (rasterization.means.grad, gradients.means)]
    pairs += [(rasterization.scales.grad, gradients.scales), (rasterization.colors.grad, gradients.channels)]
    for actual, wanted in pairs:
        assert np.abs(actual.numpy() - wanted).max() < 2e-4 * np.abs(wanted).max()
    depths = further["depths"][0].detach()
    near = float(depths.median())
    shown = (depths > near).numpy()
    cut, _, cut_further = rasterization.draw(near_plane=near, far_plane=2 * near)
    kept = shown & (depths < 2 * near).numpy()
    expected = Renderer(model[kept]).image(VIEW)
    np.testing.assert_allclose(cut[0].detach(), expected, rtol=0, atol=2e-5)
    assert not (cut_further["radii"][0, ~kept] > 0).all(dim=-1).any()


def test_gsplat_blends_depths_and_features_and_lists_what_views_show(rasterization):
    depth_of = {}
    for mode in ("RGB", "D", "ED", "RGB+D", "RGB+ED"):
        image, covers, further = rasterization.draw(render_mode=mode, packed=True)
        depth_of[mode] = image
        assert len(further["means2d"]) == len(further["gaussian_ids"]) < 2 * len(rasterization.model)
    torch.testing.assert_close(depth_of["ED"] * covers.clamp_min(1e-10), depth_of["D"])
    for depth in ("D", "ED"):
        both = torch.cat([depth_of["RGB"], depth_of[depth]], dim=-1)
        torch.testing.assert_close(depth_of[f"RGB+{depth}"], both, rtol=1e-5, atol=1e-5)
    features = torch.zeros(2, len(rasterization.model), 5)
    features[further["camera_ids"], further["gaussian_ids"], 4] = further["depths"].detach()
    blended, _, _ = rasterization.draw(colors=features, sh_degree=None)
    torch.testing.assert_close(blended[..., 4:], depth_of["D"], rtol=1e-4, atol=1e-4)
    image.sum().backward()
    image, _, unpacked = rasterization.draw(render_mode="RGB+ED")
    image.sum().backward()
    rows = (further["camera_ids"], further["gaussian_ids"])
    torch.testing.assert_close(unpacked["means2d"].grad[rows], further["means2d"].grad)
    refused = ({"absgrad": True}, {"camera_model": "ortho"}, {"with_ut": True}, {"render_mode": "normal"})
    refused += ({"viewmats": rasterization.viewmats.requires_grad_()},)
    for changes in refused:
        with pytest.raises(ValueError, match=next(iter(changes))):
            rasterization.draw(**changes)


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities"])
def test_gradients_of_gsplat_are_slopes_through_expected_depths_and_antialiasing(name, rasterization):
    tensors = {key: tensor.detach() for key, tensor in gsplat_tensors(soft()).items()}
    leaf = torch.zeros_like(tensors[name], requires_grad=True)
    modes = {"render_mode": "RGB+ED", "rasterize_mode": "antialiased", "sh_degree": 0}
    modes |= {key: getattr(rasterization, key)[:1] for key in ("viewmats", "Ks")}

    def image(step):
        return rasterization.draw(**modes, **tensors | {name: tensors[name] + step})[0]

    drawn = image(leaf)
    gradient = weights(drawn, 2)
    drawn.backward(gradient)
    direction = weights(leaf, 1) * tensors[name].abs().mean()
    slope = ((image(0.01 * direction) - image(-0.01 * direction)).double() * gradient).sum() / 0.02
    terms = leaf.grad * direction
    assert float(terms.sum()) == pytest.approx(float(slope), abs=3e-3 * float(terms.norm()) + 1e-4)


def test_gsplat_projects_as_its_own_reference_does(rasterization):
    reference = pytest.importorskip(
        "gsplat.cuda._torch_impl", reason="gsplat, whose reference is PyTorch, is not installed"
    )
    with torch.no_grad():
        shapes = (rasterization.quats, rasterization.scales, True, False)
        covariances, _ = reference._quat_scale_to_covar_preci(*shapes, triu=False)
        views = (rasterization.viewmats, rasterization.Ks, 40, 30)
        radii, centres, depths, *_ = reference._fully_fused_projection(rasterization.means, covariances, *views)
    _, _, further = rasterization.draw(opacities=torch.ones(len(radii[0])))
    shown = (radii > 0).all(dim=-1)
    assert torch.equal(shown, (further["radii"] > 0).all(dim=-1))
    assert (radii != further["radii"])[shown].float().mean() < 0.01  # at opacity 1, alpha reaches 1 / 255 at 3.329
    torch.testing.assert_close(further["means2d"][shown].detach(), centres[shown], rtol=1e-5, atol=1e-4)
    torch.testing.assert_close(further["depths"][shown], depths[shown])


def test_ssim_and_distances_are_those_of_3dgs():
    images = torch.from_numpy(np.random.default_rng(0).random((2, 3, 20, 24), np.float32))
    a, b = (image.numpy().transpose(1, 2, 0) for image in images)
    assert float(fused_ssim(images[:1], images[1:])) == pytest.approx(ssim(a, b), abs=1e-5)
    points = np.random.default_rng(1).normal(size=(50, 3)).astype(np.float32)
    squares = np.sort(((points[:, None] - points[None]) ** 2).sum(axis=2), axis=1)[:, 1:4]
    np.testing.assert_allclose(distCUDA2(torch.from_numpy(points)), squares.mean(axis=1), rtol=1e-5)


WRAPPER = """
from . import _C
class _RasterizeGaussians(torch.autograd.Function):
    def forward(ctx, *args):
        return color, radii, {last}
class GaussianRasterizationSettings(NamedTuple):
    {fields}
class GaussianRasterizer(nn.Module):
    def forward(self, means3D, means2D, opacities, shs=None, scales=None, rotations=None):
        return rasterize_gaussians()
"""


def test_the_dialect_is_read_from_the_wrapper_of_a_checkout(tmp_path):
    folder = tmp_path / "submodules" / "rasterizer"
    wrapper = folder / "diff_gaussian_rasterization" / "__init__.py"
    wrapper.parent.mkdir(parents=True)
    (folder / "setup.py").write_text(
        "setup(ext_modules=[CUDAExtension(name='pointops._C'), CUDAExtension('simple_knn._C')])"
    )
    fields = "\n    ".join(f"{name}: int" for name in SETTINGS)
    wrapper.write_text(WRAPPER.format(last="invdepths", fields=fields))
    assert find_wrapper(tmp_path) == wrapper
    assert read_dialect(wrapper).outputs == ("color", "radii", "inverse_depth")
    assert read_dialect(wrapper).inputs == ("means3D", "means2D", "opacities", "shs", "scales", "rotations")
    assert extensions_of(tmp_path) == ("pointops",)
    for last, more in (("normals", ""), ("depth", "\n    kernel_size: float")):
        wrapper.write_text(WRAPPER.format(last=last, fields=fields + more))
        with pytest.raises(InputError, match=r"(normals|kernel_size) \("):
            read_dialect(wrapper)


REFUSED = """
import torch

def refused(act):
    try:
        act()
    except (ImportError, RuntimeError) as error:
        print(error)

refused(lambda: __import__("pointops"))
refused(lambda: torch.distributed.init_process_group("nccl"))
refused(lambda: __import__("torch.utils.cpp_extension").utils.cpp_extension.load(name="jit_kernels", sources=[]))
"""
CHECKED = """
assert torch.cuda.is_available()
torch.cuda.set_device(torch.device("cuda:0"))
torch.cuda.empty_cache()
assert optimizer.defaults["fused"]
parallel = torch.nn.DataParallel(torch.nn.Linear(3, 2).cuda(), device_ids=[0], output_device=0)
assert torch.equal(parallel(torch.ones(1, 3, device="cuda")), parallel.module(torch.ones(1, 3)))
import gsplat, gsplat.csrc
assert gsplat.KEPT and gsplat.rasterization
assert len(torch.load("model.pth", map_location="cuda", weights_only=False)) == 5
raise SystemExit(3)
"""


def test_a_trainer_for_cuda_runs_as_it_is(tmp_path):
    trainer = (ROOT / "examples" / "train_for_cuda.py").read_text()
    (tmp_path / "train.py").write_text(REFUSED + trainer + CHECKED)
    (tmp_path / "setup.py").write_text("setup(ext_modules=[CUDAExtension('pointops')])")
    (tmp_path / "gsplat").mkdir()
    (tmp_path / "gsplat" / "__init__.py").write_text("from .rendering import KEPT, rasterization")
    (tmp_path / "gsplat" / "rendering.py").write_text("KEPT = True\nrasterization = None")
    command = [sys.executable, "-m", "gspure", "cuda-free", "--", "python", "train.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 3, done.stderr  # the program's own
    line = done.stderr.splitlines()[0]
    assert "diff_gaussian_rasterization, fused_ssim, gsplat, simple_knn are gspure's" in line
    assert "not replaced: pointops" in line
    lines = done.stdout.splitlines()
    names = ("pointops", "NCCL", "jit_kernels")
    assert all(f"gspure cuda-free: {name}" in text for name, text in zip(names, lines, strict=False))
    (loss_before, norm_before), (loss_after, _) = (map(float, text.split()) for text in (lines[3], lines[-2]))
    assert loss_after < 0.6 * loss_before
    assert norm_before > 0


@pytest.mark.parametrize(
    ("words", "line"), [("", "command line: program: expected one after"), ("-- none", "none: program:")]
)
def test_a_missing_program_is_refused(words, line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["cuda-free", "--quiet", *words.split()]) == 2
    assert line in capsys.readouterr().err


def test_the_modules_are_not_importable_without_the_command():
    code = "import gspure, importlib.util as u; print(*map(u.find_spec, ['diff_gaussian_rasterization', 'simple_knn']))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["None", "None"]
