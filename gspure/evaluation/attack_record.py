"""The record of an attack on a model: what it changed, or why it cannot apply."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

ATTACK_RECORD: Final = "attack.json"  # file of a variant


class StrengthValue(NamedTuple):
    """The value of the setting that makes an attack stronger."""

    setting: str
    value: float

    def __str__(self) -> str:
        return f"{self.setting}={self.value:.4g}"


@dataclass(frozen=True)
class Applied:
    """What an attack changed.

    `search_damage` is the drop of the scene's PSNR, dB, at which the search for a strength ended. `affects` tells for
    each extraction whether the attack changed what it reads. `removed` says why no extraction can read the model; it is
    empty if one can.
    """

    strength: StrengthValue | None = None
    search_damage: float | None = None
    affects: Mapping[str, bool] = field(default_factory=dict)
    removed: str = ""


@dataclass(frozen=True)
class Refused:
    """Why an attack cannot apply to a model."""

    reason: str


@dataclass(frozen=True)
class AttackRecord:
    """The content of `ATTACK_RECORD`."""

    attack: Applied | Refused
