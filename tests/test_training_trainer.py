"""The training loop: on a recorder, and on the device."""

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.opencl.trainable import Parameters, TrainableModel
from gspure.renderer import Renderer
from gspure.training.checkpoints import read_checkpoint, write_checkpoint
from gspure.training.initialization import gaussians_at
from gspure.training.schedule import Schedule
from gspure.training.trainer import Trainer, beginning
from tests.models import gaussians
from tests.training_cases import parameters, ring, same_bits, statistics

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


@pytest.fixture(scope="module")
def scene():
    """Views of three blobs, and points near them."""
    rng = np.random.default_rng(3)
    means = np.array([[-0.25, 0, 0], [0.2, 0.2, 0], [0.1, -0.2, 0.2]])
    colors = np.array([[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.3, 0.9]])
    return gaussians(means=means, scales=[0.1, 0.15, 0.08], opacities=0.95, colors=colors), rng.normal(
        scale=0.25, size=(60, 3)
    )


def trained(scene, device, *, stop=None, resume=None):
    """Train on pictures of the scene; up to a stop, or from a snapshot on."""
    model, points = scene
    views = ring()
    images = [Renderer(model, device).image(view) for view in views]
    start = resume or beginning(gaussians_at(points, np.full(points.shape, 128, np.uint8)), seed=0)
    learner = TrainableModel(start.state, start.iteration, device)
    learner.set_targets(images)
    trainer = Trainer(learner, views, BRISK, start, extent=1.0, max_gaussians=200)
    losses = []
    for loss in trainer:
        losses.append(loss)
        if trainer.iteration == stop:
            break
    return trainer, losses


@pytest.mark.parametrize("stop", [18, 30, 52])
def test_a_killed_and_resumed_run_ends_like_an_uninterrupted_one(tmp_path, scene, device, stop):
    whole, losses = trained(scene, device)
    killed, before = trained(scene, device, stop=stop)
    write_checkpoint(tmp_path / "checkpoint.npz", killed.snapshot(), {})
    resumed, after = trained(scene, device, resume=read_checkpoint(tmp_path / "checkpoint.npz", {}))
    assert before + after == losses
    assert same_bits(resumed.model.state(), whole.model.state())


def test_training_grows_gaussians_and_brings_the_images_closer(scene, device):
    trainer, losses = trained(scene, device)
    assert len(scene[1]) < trainer.model.count <= 200
    assert np.mean(losses[-9:]) < 0.5 * np.mean(losses[:9])
