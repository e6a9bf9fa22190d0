"""Fine-tuning that also grows and prunes rows, as 3DGS does in training (Kerbl et al. 2023)."""

from typing import Final

import numpy as np

from gspure.arrays import Indices
from gspure.attacks.attack import Rng, Teacher
from gspure.attacks.attacked import Attacked, NotApplicable
from gspure.model.gaussians import Gaussians
from gspure.opencl.trainable import DensificationStatistics, Parameters, TrainableModel, TrainState
from gspure.public_model import PublicModel
from gspure.settings import Share, Steps
from gspure.training.dataset import extent
from gspure.training.densification import GRADIENT_THRESHOLD, grow, plan
from gspure.training.output import as_gaussians
from gspure.training.schedule import Schedule, shuffled

ITERATIONS: Final = 600  # ours
GROWING: Final = 0.1  # share of the rows that grow in each round; ours
ROUNDS: Final = 4  # of growth, evenly spaced; ours


def densify(
    model: Gaussians, rng: Rng, teacher: Teacher, *, iterations: Steps = ITERATIONS, share: Share = GROWING
) -> Attacked:
    """Train a model of harmonics on its own renders for `iterations` steps, and let it grow and shrink.

    Four times, 3DGS's rule clones or splits the `share` of the rows that have the largest gradients, and removes
    transparent ones. Its threshold would let nothing grow: the renders are the model's own. Rates are 3DGS's, so all
    rows move.

    Source: ours.
    """
    if type(teacher.public).attributes is not PublicModel.attributes:
        raise NotApplicable("densify", "colours come from a network")
    parameters = Parameters(model.means, model.quats, model.log_scales, model.table["opacity"], model.sh_coeffs)
    student = TrainableModel(TrainState.fresh(parameters), device=teacher.device)
    student.set_targets(teacher.images)
    schedule = Schedule.scaled(iterations)
    size = extent(teacher.cameras)
    every = -(-iterations // (ROUNDS + 1))
    rows = np.arange(len(model))
    views = shuffled(len(teacher.cameras), rng)
    for step in range(1, iterations + 1):
        view = next(views)
        student.step(teacher.cameras[view], view, schedule.rates(step, size), background=model.background)
        if step % every == 0 and step < iterations:
            rows = rows[_grown(student, share, size, rng)]
    trained = as_gaussians(student.state().parameters)
    names = [name for attribute in teacher.public.columns.values() for name in attribute]
    return Attacked.copied(model, rows, {name: trained.table[name] for name in names})


def _grown(student: TrainableModel, share: float, size: float, rng: Rng) -> Indices:
    """Grow the rows of a student [K] with the largest gradients; return the parents [K'] of the new rows."""
    statistics = student.statistics()
    gradients = statistics.gradient_norms / np.maximum(statistics.views, 1)
    least = max(float(np.quantile(gradients, 1 - share)), float(np.finfo(np.float32).tiny))
    norms = gradients * (GRADIENT_THRESHOLD / least)  # of one view
    scaled = DensificationStatistics(norms.astype(np.float32), np.ones_like(statistics.views))
    state = student.state()
    growth = plan(state.parameters, scaled, extent=size, prune_big=False, rng=rng)
    if not len(growth.rows):
        raise NotApplicable("densify", "every row is transparent")
    student.replace(grow(state, growth))
    return growth.rows
