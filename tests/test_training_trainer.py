"""The training loop, on a recorder."""

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.opencl.trainable import Parameters
from gspure.training.schedule import Schedule
from gspure.training.trainer import Trainer, beginning
from tests.training_cases import parameters, ring, statistics

BRISK = Schedule(iterations=60, sh_every=10, densify_from=8, densify_until=45, densify_every=6, reset_every=18)
"""Everything that a long run does, in few iterations."""


class Recorder:
    """Stands in for the model: learns nothing, notes what it is asked for."""

    def __init__(self, state):
        self.replace(state)
        self.steps, self.degrees, self.replaced = [], [], []

    def step(self, camera, target, rates, *, background):
        assert camera.name == f"orbit_{target:03}"
        self.steps.append(target)
        self.degrees.append(self.sh_degree_active)
        return 0.5

    def state(self):
        return self.kept

    def statistics(self):
        return statistics(np.zeros(len(self.kept.parameters)))

    def replace(self, state):
        self.kept = state


def recorded(schedule, *, views=7, logits=2.0, seed=0):
    start = parameters(10)
    start = Parameters(**{**vars(start), "opacity_logits": np.full(10, logits, np.float32)})
    snapshot = beginning(start, seed)
    model = Recorder(snapshot.state)
    return Trainer(model, ring(views), schedule, snapshot, extent=1.0), model


def test_every_view_is_taken_once_before_any_is_taken_again():
    trainer, model = recorded(BRISK)
    assert list(trainer) == [0.5] * 60
    rounds = [tuple(model.steps[i : i + 7]) for i in range(0, 56, 7)]
    assert all(sorted(taken) == list(range(7)) for taken in rounds)
    assert len(set(rounds)) > 1


def test_a_run_without_remaining_gaussians_ends_with_an_error():
    trainer, _ = recorded(BRISK, logits=-9.0)
    with pytest.raises(InputError, match="training: Gaussians: expected at least one, found none after iteration 12"):
        list(trainer)
