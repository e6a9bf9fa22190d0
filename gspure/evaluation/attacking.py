"""One attack on one public model: measurements, the search for a strength, the attacked model, and what it changed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gspure.arrays import Float64
from gspure.attacks import Attack, Attacked, Measurements, NotApplicable, affected, find_attack
from gspure.attacks.strength import Damage, Match
from gspure.cameras import Camera
from gspure.evaluation.attack_record import Applied, StrengthValue
from gspure.evaluation.plan import AttackSpec
from gspure.metrics.targets import BITS
from gspure.opencl.device import Device
from gspure.public_model import PublicModel
from gspure.schemes.scheme import Scheme
from gspure.settings import Setting


@dataclass(frozen=True)
class Context:
    """What an attack may use beside the model: public views, a device, and for a search the damage to the scene."""

    views: Sequence[Camera] = ()
    device: Device | None = None
    measure_damage: Callable[[PublicModel], Damage] | None = None


@dataclass(frozen=True)
class AttackResult:
    """An attacked model, and how it came about."""

    attack: Attack
    settings: Mapping[str, Setting]  # all of them, a searched strength included
    match: Match | None
    attacked: Attacked
    public: PublicModel  # the attacked model in place of the public one

    @property
    def transform(self) -> Float64:
        """The rigid transform [4,4] of the whole model."""
        return np.eye(4) if self.attacked.transform is None else self.attacked.transform

    @property
    def strength(self) -> StrengthValue | None:
        """The strength of the attack, if it has one."""
        if self.attack.strength is None:
            return None
        setting = self.attack.strength.setting
        return StrengthValue(setting, float(self.settings[setting]))

    @property
    def sentence(self) -> str:
        """How many rows are left."""
        kept = int((~self.attacked.prune_mask).sum())
        return f"{self.attack.name}: kept {kept} of {self.attacked.count} rows, {len(self.attacked.model)} in all"

    def applied(self, before: PublicModel, scheme: Scheme | None) -> Applied:
        """Return what the attack changed for the extractions of a scheme."""
        affects = {}
        for extraction, columns in (scheme.extractions if scheme else {}).items():
            reads_renders = self.attack.of_renders and extraction == BITS
            affects[extraction] = reads_renders or affected(before.model, self.attacked, columns)
        search_damage = self.match.damage if self.match else None
        return Applied(self.strength, search_damage, affects, self.attacked.removed)


def attacked(public: PublicModel, spec: AttackSpec, context: Context) -> AttackResult:
    """Attack a public model, after a search for the strength of a given damage.

    Raise `NotApplicable` if the attack has nothing to act on or leaves no row, `InputError` if a setting or measurement
    does not fit.
    """
    attack = find_attack(spec.name)
    if spec.until is not None:
        raise NotApplicable(attack.name, "`until` needs a message, and this model has none that can be read")
    measurements = Measurements.read(public, spec.measured)
    known: dict[str, Any] = {"seed": spec.seed, "cameras": [], "device": None}
    if learns(attack):
        known |= {"cameras": context.views, "device": context.device}
    settings: dict[str, Any] = dict(spec.settings)
    match = None
    comment = ""
    if spec.damage is not None and context.measure_damage is not None:
        damage_of = context.measure_damage(public)
        match = attack.matching(public, measurements, spec.damage, damage_of, **known, **settings)
        settings[match.setting] = match.value
        comment = match.comment(spec.damage)
    outcome = attack.apply(public, measurements, **known, **settings)
    if not len(outcome.model):
        raise NotApplicable(attack.name, f"none of {outcome.count} rows would remain")
    return AttackResult(attack, {**attack.settings, **settings}, match, outcome, outcome.published(public, comment))


def learns(attack: Attack) -> bool:
    """Return whether an attack trains on renders of public views."""
    return "teacher" in attack.parameters
