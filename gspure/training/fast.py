"""The fast schedule: small photographs and few Gaussians first, larger steps, no resets of opacities.

Small photographs show coarse structure at a fraction of the cost, and need few Gaussians (DashGaussian, Chen et al.
2025); the number of Gaussians grows within a budget (Taming 3DGS, Mallick et al. 2024). All numbers are ours.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, NamedTuple, Self

from gspure.errors import InputError
from gspure.opencl.adam import LearningRates
from gspure.settings import SCHEDULES
from gspure.training.initialization import LEAST_POINTS
from gspure.training.schedule import ITERATIONS, Schedule


class Stage(NamedTuple):
    """A part of a run, up to the share `until` of its iterations.

    The sides of photographs are divided by `reduction`; Gaussians grow to `budget`, a share of the most allowed.
    """

    until: float
    reduction: int
    budget: float


STAGES: Final = (Stage(0.1, 4, 0.4), Stage(0.35, 2, 0.8), Stage(1.0, 1, 1.0))
GROWS: Final = 0.5  # share of the run with densification, into the stage of full size
DEGREES: Final = (0.2, 0.4, 0.5)  # shares of the run after which the degree of harmonics rises: late, since cheap
LARGEST_FACTOR: Final = 5.0  # of learning rates, relative to 3DGS's
SSIM_OF_PHOTOGRAPHS: Final = 0.35  # share of 1 - SSIM in the loss; for renders, 3DGS's is better


@dataclass(frozen=True)
class FastSchedule(Schedule):
    """A schedule in stages; opacities are never reset, which suits points on surfaces."""

    pixels_per_gaussian: ClassVar[int] = 5
    needs_surfaces: ClassVar[bool] = True

    stages: tuple[Stage, ...] = STAGES

    @classmethod
    def scaled(cls, iterations: int) -> Self:
        """Return the fast schedule of a run of this length."""
        vanilla = vars(Schedule.scaled(iterations))
        return cls(**vanilla | {"densify_until": round(GROWS * iterations), "reset_every": iterations + 1})

    def of_photographs(self) -> Self:
        """Return the schedule of a run that learns from photographs, not from renders."""
        return replace(self, ssim_weight=SSIM_OF_PHOTOGRAPHS)

    def rates(self, iteration: int, extent: float) -> LearningRates:
        """Return the learning rates of one iteration; `extent` is the scene's, in world units.

        Fewer iterations than 3DGS's take larger steps, as the square root of their ratio. The rates of positions fall
        as in 3DGS, all others linearly to 0.
        """
        factor = min(LARGEST_FACTOR, (ITERATIONS / self.iterations) ** 0.5)
        falling = factor * (self.iterations + 1 - iteration) / self.iterations
        means, *others = vars(super().rates(iteration, extent)).values()
        return LearningRates(factor * means, *(falling * rate for rate in others))

    def sh_degree(self, iteration: int) -> int:
        """Return the degree of the spherical harmonics in one iteration."""
        return sum(iteration > share * self.iterations for share in DEGREES)

    def reduction(self, iteration: int) -> int:
        """Return the factor by which the sides of photographs are smaller in one iteration."""
        return self._stage(iteration).reduction

    def budget(self, most: int, iteration: int) -> int:
        """Return the largest number of Gaussians after one iteration, if the run allows `most` in all."""
        return max(LEAST_POINTS, round(self._stage(iteration).budget * most))

    @property
    def full_size_from(self) -> float:
        """The share of the run after which photographs have their full size."""
        return self.stages[-2].until

    def _stage(self, iteration: int) -> Stage:
        return next(stage for stage in self.stages if iteration <= stage.until * self.iterations)


def schedule_of(name: str, iterations: int, stages: tuple[Stage, ...] = STAGES) -> Schedule:
    """Return one of the `SCHEDULES`, for a run of this length; the fast one has stages."""
    if name not in SCHEDULES:
        raise InputError("training", "schedule", expected=" or ".join(SCHEDULES), found=repr(name))
    if name == "fast":
        return replace(FastSchedule.scaled(iterations), stages=stages)
    return Schedule.scaled(iterations)
