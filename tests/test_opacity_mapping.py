"""The autoencoder of opacities: its gradients, what it learns, and that it is the same every time."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from gspure.schemes.splats_in_splats import opacity_mapping
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping, fit


def sequence(count, seed=0):
    rng = np.random.default_rng(seed)
    shown = rng.uniform(0, 1, count).astype(np.float32)
    return shown, (0.9 - 0.6 * shown).astype(np.float32)


def as_double(mapping):
    return OpacityMapping(
        *(tuple(a.astype(np.float64) for a in layers) for layers in (mapping.kernels, mapping.biases))
    )


@pytest.mark.parametrize("count", [1, 4, 13, 30])
def test_gradients_agree_with_differences(count):
    mapping = as_double(OpacityMapping.fresh(np.random.default_rng(1)))
    shown, hidden = sequence(count)
    gradients = opacity_mapping._gradients(mapping, shown, hidden)
    weights = [*mapping.kernels, *mapping.biases]
    rng = np.random.default_rng(2)
    for array, gradient in zip(weights, gradients, strict=True):
        place = tuple(rng.integers(n) for n in array.shape)
        losses = []
        for step in (1e-5, -1e-5):
            array[place] += step
            losses.append(np.mean((mapping(shown) - hidden) ** 2))
            array[place] -= step
        assert gradient[place] == pytest.approx((losses[0] - losses[1]) / 2e-5, rel=1e-3, abs=1e-7)


def test_the_opacity_mapping_is_learned():
    shown, hidden = sequence(400)
    found = fit(shown, hidden, np.random.default_rng(0))(shown)
    assert np.sqrt(np.mean((found - hidden) ** 2)) < 0.15 * hidden.std()


def test_the_number_of_threads_changes_no_bit(monkeypatch):
    monkeypatch.setattr(opacity_mapping, "STEPS", 5)
    shown, hidden = sequence(1000)  # of this length, several threads of OpenBLAS add in another order
    found = []
    for threads in (1, 4):
        with threadpool_limits(threads, "blas"):
            mapping = fit(shown, hidden, np.random.default_rng(0))
            found.append([array.tobytes() for array in (*mapping.arrays().values(), mapping(shown))])
    assert found[0] == found[1]
