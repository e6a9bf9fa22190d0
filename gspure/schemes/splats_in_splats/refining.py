"""Training of colours alone, for Gaussians whose other attributes are given."""

from dataclasses import replace
from typing import Final

from gspure.opencl.adam import LearningRates
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState
from gspure.public_model import Lesson
from gspure.training.schedule import SH_DC_RATE, SH_REST_RATE, shuffled

RATES: Final = LearningRates(0.0, 0.0, 0.0, 0.0, SH_DC_RATE, SH_REST_RATE)


def refined(parameters: Parameters, lesson: Lesson) -> Parameters:
    """Return `parameters` with colours that learned a lesson; everything else is bit-identical."""
    model = TrainableModel(TrainState.fresh(parameters), device=lesson.device)
    model.set_targets(lesson.images)
    order = shuffled(len(lesson.views), lesson.rng)
    for _ in range(lesson.steps):
        view = next(order)
        model.step(lesson.views[view], view, RATES)
    return replace(parameters, sh_coeffs=model.state().parameters.sh_coeffs)
