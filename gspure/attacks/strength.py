"""The strength of an attack, and the search for the strength that does a given damage to the scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np

from gspure import __version__
from gspure.arrays import Float32, Float64
from gspure.attacks.attacked import Retouch
from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.images import read_back
from gspure.metrics.damage import Shown, covered, damage
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE, psnr
from gspure.public_model import PublicModel
from gspure.renderer import BLACK, WHITE

if TYPE_CHECKING:
    from gspure.opencl.device import Device

Images = Sequence[Float32]
Damage = Callable[..., float]  # of an attacked model, its rigid transform and `Attacked.retouched`, if any: dB
EVALUATIONS: Final = 10  # most models that a search renders, besides that at the weak end


@dataclass(frozen=True)
class Strength:
    """The setting that makes an attack stronger, and the range in which to search."""

    setting: str
    weak: float  # whole numbers, if the setting is one; above 0 on a logarithmic scale
    strong: float
    scale: Literal["linear", "log"] = "linear"  # how to divide the range
    sweep: str = ""  # name of the attack whose sweep includes its strengths, by default its own

    def at(self, position: float) -> float:
        """Return the value at a position between the weak end (0) and the strong end (1)."""
        if self.scale == "log":
            return float(self.weak * (self.strong / self.weak) ** position)
        value = self.weak + position * (self.strong - self.weak)
        return round(value) if isinstance(self.weak, int) else value


class Match(NamedTuple):
    """A value of a strength's setting, and the damage that it does."""

    setting: str
    value: float
    damage: float  # drop of the scene's PSNR, dB

    def misses(self, wanted: float) -> bool:
        """Return whether the damage is farther from `wanted` dB than `DAMAGE_TOLERANCE`."""
        return abs(self.damage - wanted) > DAMAGE_TOLERANCE

    def comment(self, wanted: float) -> str:
        """Return the comment line of a model attacked with it, for a search for a damage of `wanted` dB."""
        return f"gspure {__version__} damage {self.damage:.3f} dB of {wanted:g} dB"


def search(strength: Strength, damage_at: Callable[[float], float], wanted: float) -> Match:
    """Return the value whose damage is nearest to `wanted` dB, by bisection.

    `damage_at` maps a value to the drop of the scene's PSNR. It is called at most `EVALUATIONS` times, and once more at
    the weak end if all these values do too much damage. A value that it refuses with `InputError` is too strong; at the
    weak end, the refusal is raised. A damage above `wanted` + `DAMAGE_TOLERANCE` is the last choice.
    """
    matches: list[Match] = []
    low = 0.0
    high = 1.0
    position = 1.0
    while len(matches) < EVALUATIONS:
        value = strength.at(position)
        try:
            damage = damage_at(value)
        except InputError:
            damage = np.inf
        matches.append(Match(strength.setting, value, damage))
        strongest_is_too_weak = position == 1 and damage < wanted
        if strongest_is_too_weak or abs(damage - wanted) < DAMAGE_TOLERANCE / 2:
            break
        if damage < wanted:
            low = position
        else:
            high = position
        position = (low + high) / 2
    if all(match.damage > wanted + DAMAGE_TOLERANCE for match in matches):
        weakest = strength.at(0.0)
        matches.append(Match(strength.setting, weakest, damage_at(weakest)))
    return min(matches, key=lambda match: (match.damage > wanted + DAMAGE_TOLERANCE, abs(match.damage - wanted)))


def scene_renders(
    public: PublicModel, views: Iterable[Camera], device: Device | None = None, retouched: Retouch | None = None
) -> Shown:
    """Return the renders of a model as 8-bit images show them, and the pixels that it covers."""
    background = public.model.background
    scenes = {colour: public.scene(device, colour) for colour in (BLACK, WHITE, background)}
    images = []
    masks = []
    for view in views:
        shown = {colour: scene(view) for colour, scene in scenes.items()}
        image = read_back(shown[background])
        images.append(retouched(image, view.name) if retouched else image)
        masks.append(covered((shown[WHITE] - shown[BLACK]).mean(axis=2)))
    return Shown(images, masks)


def scene_damage(
    public: PublicModel, views: Sequence[Camera], photographs: Images, device: Device | None = None
) -> Damage:
    """Return the function that measures the damage to the scene in some views (`gspure.metrics.damage`).

    Views move with the model, by the transform of the attack. Raise `InputError` if every photograph equals the
    unattacked render, so that no PSNR can drop.
    """
    before = scene_renders(public, views, device)
    if not np.isfinite(list(map(psnr, photographs, before.images))).any():
        raise InputError("attack", "photographs", expected="images that are no renders of it", found="its renders")

    def damage_of(model: PublicModel, transform: Float64 | None = None, retouched: Retouch | None = None) -> float:
        moved = views if transform is None else [view.moved(transform) for view in views]
        return damage(photographs, before, scene_renders(model, moved, device, retouched))

    return damage_of
