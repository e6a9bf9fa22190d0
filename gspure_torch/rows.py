"""Rows in training, in memory: their values, Adam's moments, and the statistics of densification."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.opencl.adam import adam_step
from gspure.opencl.trainable import DensificationStatistics, Parameters, TrainState
from gspure.schemes.scheme import Run
from gspure.training.fast import Stage, schedule_of
from gspure.training.trainer import densified

ENDS: Final = (3, 7, 10, 11)
"""Ends of the columns of means, quaternions, log-scales and the opacity logit in a row; channels follow."""

STAGES: Final = (Stage(0.2, 4, 0.5), Stage(0.55, 2, 0.8), Stage(1.0, 1, 1.0))
"""Of GS-Hider's fast schedule: long ones of small photographs, since its decoders cost most, and by the pixel. Ours."""

CACHED: Final = 1500  # number of rows that fit a CPU's cache, with their moments and gradients


class TrainedRows:
    """The rows of a run; their `values` [K,11 + C] are raw parameters, with C channels."""

    def __init__(self, begin: Parameters, run: Run, rng: np.random.Generator) -> None:
        self.schedule = schedule_of(run.schedule, run.iterations, stages=STAGES)
        self._run = run
        self._rng = rng
        self._replace(TrainState.fresh(begin))

    def __len__(self) -> int:
        return len(self.values)

    def count_view(self, norms: Float32) -> None:
        """Add the norms [K] of a view's gradients of projected centres, and count it for the rows above 0."""
        self._norms += norms
        self._views += norms > 0

    def step(self, iteration: int, gradient: Float32, rates: float | Float32, columns: slice = slice(None)) -> None:
        """Take an optimizer step in some columns against a gradient [K,11 + C], with one rate or one per column."""
        for start in range(0, len(self), CACHED):
            block = slice(start, start + CACHED)
            adam_step(
                self.values[block, columns],
                self._first[block, columns],
                self._second[block, columns],
                gradient[block, columns],
                rates,
                iteration,
            )

    def densify(self, iteration: int, opacities: Float32 | None = None) -> None:
        """Clone, split and prune rows; `opacities` [K] decide about pruning, by default their own."""
        state = TrainState(parameters_of(self.values), parameters_of(self._first), parameters_of(self._second))
        (after,) = densified(
            [state],
            DensificationStatistics(self._norms, self._views),
            self.schedule,
            iteration,
            extent=self._run.pair.extent,
            rng=self._rng,
            max_gaussians=self._run.most_rows,
            opacities=opacities,
        )
        self._replace(after)

    def _replace(self, state: TrainState) -> None:
        self.values = rows_of(state.parameters)
        self._first = rows_of(state.first)
        self._second = rows_of(state.second)
        self._norms = np.zeros(len(self), np.float32)
        self._views = np.zeros(len(self), np.uint32)


def rows_of(parameters: Parameters) -> Float32:
    """Return parameters as rows [K,11 + C]."""
    return np.concatenate([parameters.geometry, parameters.sh_coeffs.reshape(len(parameters), -1)], axis=1)


def parameters_of(rows: Float32) -> Parameters:
    """Return rows as parameters; their colours are the channels [K,C]."""
    means, quats, log_scales, logits, channels = np.split(rows, ENDS, axis=1)
    return Parameters(means, quats, log_scales, logits[:, 0], channels)


def screen_norms(camera: Camera, means: NDArray[Any], gradients: NDArray[Any]) -> Float32:
    """Return the norms [A] of dL/d(projected centre), in 3DGS's NDC units, for gradients dL/d(centre) [A,3].

    They are approximate: the part of a gradient along the view is left out.
    """
    rotation = camera.viewmat[:3, :3]
    depths = means @ rotation[2] + camera.viewmat[2, 3]
    across = gradients @ rotation[:2].T * depths[:, None] / np.diag(camera.K)[:2]
    half_size = np.array([camera.width / 2, camera.height / 2])
    return np.asarray(np.linalg.norm(across * half_size, axis=1), np.float32)
