"""Gaussians at the limits of float32: flat ones seen edge-on, needles, tiny, huge and distant ones."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from experiments.extreme import SHAPES, VIEW, Cell, agreement
from gspure.constants import ALPHA_MAX
from gspure.model.gaussians import Gaussians
from gspure.renderer import Renderer
from tests.models import blobs, camera, gaussians
from tests.reference.blending import render

SHARED_FIXTURES = {"deadline": None, "suppress_health_check": [HealthCheck.function_scoped_fixture]}
COLUMNS = ("x", "y", "z", "opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4)))


def aimed(rng, means):
    """Rotations whose first or last axis points at the camera, or whose plane holds it, up to 0 to 1 radian."""
    towards = means / np.linalg.norm(means, axis=1, keepdims=True)
    across = np.cross(towards, rng.normal(size=means.shape))
    first = across + towards * rng.choice([0.0, 1e-9, 1e-6, 1e-3, 1.0], (len(means), 1))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(first, towards + 1e-3 * first)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    axes = np.stack([first, second, np.cross(first, second)], axis=2)[:, :, rng.permutation(3)]
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]
    return Rotation.from_matrix(axes).as_quat(scalar_first=True)


def extreme(seed: int, count: int) -> Gaussians:
    """`count` Gaussians in view of `VIEW` of extreme shapes, some with columns of any finite number, among others."""
    rng = np.random.default_rng(seed)
    depths = rng.choice([0.2001, 0.21, 1.0, 4.0, 1e3], count) * rng.uniform(1, 2, count)
    slopes = rng.uniform(-0.5, 0.5, (2, count)) * rng.choice([1.0, 1.0, 30.0, 1e4], (2, count))
    means = np.stack([slopes[0] * depths, slopes[1] * depths, depths], axis=1)
    log_scales = (
        rng.uniform(-2, 2, (count, 3)) * rng.choice([1.0, 5.0, 20.0, 44.0], (count, 1)) + np.log(depths)[:, None]
    )
    quats = np.where(rng.random((count, 1)) < 0.7, aimed(rng, means), rng.normal(size=(count, 4)))
    rows = np.concatenate([means, rng.uniform(-3, 9, (count, 1)), log_scales, quats], axis=1).astype(np.float32)
    any_bits = rng.integers(0, 2**32, rows.shape, dtype=np.uint32).view(np.float32)
    replaced = (rng.random(rows.shape) < rng.choice([0.0, 0.05])) & np.isfinite(any_bits)
    rows[replaced] = any_bits[replaced]
    model = blobs(count + 20, 6, sh_degree=1)
    values = {name: model.table[name].copy() for name in COLUMNS}
    for name, column in zip(COLUMNS, rows.T, strict=True):
        values[name][:count] = column
    return model.with_columns(values)


SEEDS = st.integers(0, 2**32)


@settings(max_examples=50, **SHARED_FIXTURES)
@given(seed=SEEDS, count=st.integers(1, 60), focal=st.floats(5.0, 600.0))
def test_any_finite_rows_give_shares(device, style, energy, seed, count, focal):
    """Every weight and transmittance is a share, and together they are everything."""
    renderer, view = Renderer(extreme(seed, count), device, energy=energy, style=style), camera(33, 31, focal=focal)
    contributions, transmittance = renderer.contributions(view), renderer.transmittance(view)
    for share in (transmittance, contributions["max"]):
        assert ((share >= 0) & (share <= 1)).all()
    assert (contributions["max"] <= np.float32(ALPHA_MAX)).all()
    assert np.isfinite(contributions["sum"]).all()
    blended = (1 - transmittance.astype(np.float64)).sum()
    assert contributions["sum"].sum(dtype=np.float64) == pytest.approx(blended, rel=1e-4, abs=1e-4)
    assert np.isfinite(renderer.image(view)).all()
    assert not np.isnan(renderer.depth(view)).any()


@settings(max_examples=25, **SHARED_FIXTURES)
@given(seed=SEEDS, colour=st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_any_finite_rows_and_colours_give_finite_images_and_gradients(device, style, seed, colour):
    model = extreme(seed, 40)
    model = model.with_columns({name: np.full(len(model), colour) for name in ("f_dc_1", "f_rest_0")})
    image, pullback = Renderer(model, device, style=style).vjp(VIEW)
    assert np.isfinite(image).all()
    for name, gradient in vars(pullback(np.ones_like(image))).items():
        assert np.isfinite(gradient).all(), name


@settings(max_examples=100, **SHARED_FIXTURES)
@given(
    shape=st.sampled_from(SHAPES),
    log_aspect=st.floats(0, 8),
    log_angle=st.one_of(st.floats(-9, 0), st.just(-np.inf)),
    log_depth=st.floats(-0.69, 3.3),
    seed=SEEDS,
)
def test_alpha_errs_no_more_than_one_more_rounding_of_the_row(
    device, style, energy, shape, log_aspect, log_angle, log_depth, seed
):
    cell = Cell(shape, 10**log_aspect, 10**log_angle, 10**log_depth)
    error, condition = agreement(cell.gaussian(np.random.default_rng(seed)), VIEW, energy, device, style)
    assert error <= 5e-6 + 2 * condition


OUT_OF_RANGE = {
    "far": {"x": 2e15, "z": 4e15},
    "infinite scale": {"scale_1": 89.0},
    "huge scale": {"scale_1": 70.0},
    "small quaternion": {f"rot_{i}": 1e-31 for i in range(4)},
    "large quaternion": {f"rot_{i}": 1e31 for i in range(4)},
    "two scales of zero": {"scale_0": -200.0, "scale_1": -200.0},
}


@pytest.mark.parametrize("case", OUT_OF_RANGE)
def test_rows_out_of_range_are_not_drawn(device, style, energy, case):
    """Only a 2-D splat, which is dilated, may have no extent."""
    model = gaussians(means=[[0, 0, 4], [0.1, 0, 5]], scales=0.5)
    values = {name: [value, model.table[name][1]] for name, value in OUT_OF_RANGE[case].items()}
    model = model.with_columns(values)
    drawn = [0, 1] if (case, energy) == ("two scales of zero", "ewa") else [1]
    assert render(model, VIEW, energy).pixels.nonzero()[0].tolist() == drawn
    assert Renderer(model, device, energy=energy, style=style).contributions(VIEW)["index"].tolist() == drawn
