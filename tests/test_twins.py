"""Two models of one geometry: they stay together, learn what a single one would, and are counted together."""

import numpy as np
import pytest

from gspure.opencl.trainable import TrainableModel, TrainState
from gspure.opencl.twins import TwinModel
from tests.test_trainable import RATES, VIEWS, arrays, bits, parameters, photographs, scene

SHARED = slice(0, 3)  # means, quats, log_scales


def states(count=20):
    """Two scenes over the geometry of the first."""
    one, other = scene(count), scene(count, seed=5)
    other = one.with_columns({name: other.table[name] for name in other.table.dtype.names if name[:2] in ("f_", "op")})
    return tuple(TrainState.fresh(parameters(model)) for model in (one, other))


def twins(device, style, weight=0.5, begin=None, targets=(1, 9)):
    found = TwinModel(begin or states(), weight, device, style)
    found.set_targets(*(photographs(seed) for seed in targets))
    return found


def test_geometry_stays_the_same_and_the_rest_does_not(device, style):
    model = twins(device, style)
    for i in range(6):
        model.step((VIEWS[i % 2],) * 2, (i % 2,) * 2, RATES)
    first, second = map(arrays, model.states())
    for a, b in zip(first, second, strict=True):
        assert [x.tobytes() for x in a[SHARED]] == [x.tobytes() for x in b[SHARED]]
        assert all((x != y).any() for x, y in zip(a[3:], b[3:], strict=True))


def test_with_weight_zero_the_scene_trains_as_if_alone(device, style):
    model, alone = twins(device, style, weight=0.0), TrainableModel(states()[0], device=device, style=style)
    alone.set_targets(photographs(1))
    for i in range(4):
        model.step((VIEWS[i % 2],) * 2, (i % 2,) * 2, RATES)
        alone.step(VIEWS[i % 2], i % 2, RATES)
    assert bits(model.states()[0]) == bits(alone.state())
    assert vars(model.statistics())["gradient_norms"].tobytes() == alone.statistics().gradient_norms.tobytes()


def test_twins_train_like_one_model_on_the_sum_of_both_losses(device, style):
    begin, weight = states()[0], 0.5
    model = twins(device, style, weight, (begin, begin), targets=(1, 1))
    alone = TrainableModel(begin, device=device, style=style)
    alone.set_targets(photographs(1))
    for i in range(2):
        loss = model.step((VIEWS[i],) * 2, (i,) * 2, RATES)
        assert loss == pytest.approx((1 + weight) * alone.step(VIEWS[i], i, RATES), rel=1e-5)
    # Adam does not see the size of a gradient, the statistics do.
    np.testing.assert_allclose(model.states()[0].parameters.means, alone.state().parameters.means, atol=1e-5)
    both, one = model.statistics(), alone.statistics()
    np.testing.assert_allclose(both.gradient_norms, (1 + weight) * one.gradient_norms, rtol=1e-3, atol=1e-9)
    assert (both.views == one.views).all()


def test_a_gaussian_visible_in_one_twin_counts_as_visible(device, style):
    first, second = states()
    first.parameters.opacity_logits[:] = -9.0  # below 1/255: not drawn
    model = twins(device, style, begin=(first, second))
    model.step((VIEWS[0],) * 2, (0,) * 2, RATES)
    alone = TrainableModel(second, device=device, style=style)
    alone.set_targets(photographs(9))
    alone.step(VIEWS[0], 0, RATES)
    assert (model.statistics().views == alone.statistics().views).all()
    assert model.statistics().views.any()


def test_runs_agree_to_the_last_bit(device, style):
    def run():
        model = twins(device, style)
        losses = [model.step((VIEWS[i % 2],) * 2, (i % 2,) * 2, RATES) for i in range(3)]
        return losses, [bits(state) for state in model.states()]

    assert run() == run()
