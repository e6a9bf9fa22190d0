"""The checks of an attack: it is applied to a small model, twice, and at both ends of its strength."""

import inspect
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from gspure.attacks import Attack, Attacked, Measurements
from gspure.attacks.strength import Strength, scene_damage
from gspure.cameras import Camera
from gspure.certificate.check import Check, check, name_check, require
from gspure.method.purify import purify
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.model.gaussians import Table
from gspure.public_model import PublicModel
from gspure.settings import Setting
from gspure.surface.distances import depth_distances
from gspure.training.dataset import read_photographs

STEPS: Final = 2  # of attacks that train


class Trial:
    """An attack on a small model, with the measurements that it asks for."""

    def __init__(self, attack: Attack, public: PublicModel, train: Sequence[Camera], test: Sequence[Camera]) -> None:
        self.attack = attack
        self.public = public
        self.train = train
        self.render = public.scene()(test[0])
        self.damage_of = scene_damage(public, test, read_photographs(test))
        self.measurements = self._measured()

    def _measured(self) -> Measurements:
        needs = self.attack.needs
        measurements = Measurements(opacities=self.public.model.opacities)
        if "surface" in needs:
            measurements = replace(measurements, surface=depth_distances(self.public, self.train))
        if not needs & {"weights", "prune_mask", "labels"}:
            return measurements
        purification = purify(self.public, self.train)
        return replace(
            measurements,
            weights=purification.weights,
            prune_mask=purification.prune_mask,
            labels=purification.labels,
        )

    def attacked(self, **settings: Setting) -> Attacked:
        """Return the attacked model."""
        if "iterations" in self.attack.settings:
            settings = {"iterations": STEPS, **settings}
        known: dict[str, Any] = {"cameras": self.train, **settings}
        return self.attack.apply(self.public, self.measurements, **known)

    def damage(self, **settings: Setting) -> float:
        """Return what the attack costs the scene, dB."""
        outcome = self.attacked(**settings)
        return self.damage_of(outcome.published(self.public), outcome.transform, outcome.retouched)


def attack_checks(trial: Trial) -> Iterator[Check]:
    """Yield the checks of an attack."""
    applied: list[Attacked] = []
    before = trial.public.model.table.copy()
    yield name_check(trial.attack.name)
    yield check("explains its settings, and names its source", lambda: _explains_itself(trial.attack))
    if trial.attack.of_renders:
        yield check("returns finite images of the same shape", lambda: _returns_image(trial))
        yield check("leaves renders as they are", lambda: _leaves_render(trial))
    yield check("applies to a vanilla model", lambda: applied.append(trial.attacked()))
    if not applied:
        return
    (first,) = applied
    yield check("leaves its input as it is", lambda: _leaves_input(trial, before))
    yield check("says where its rows come from", lambda: _names_rows(first))
    yield check("gives the same result with the same seed", lambda: _repeats(trial, first))
    strength = trial.attack.strength
    if strength:
        yield check("does no less damage at the strong end", lambda: _is_stronger(trial, strength))


def _explains_itself(attack: Attack) -> None:
    text = inspect.getdoc(attack.function) or ""
    unnamed = sorted({*attack.settings} - {*re.findall(r"`(\w+)`", text)})
    require(not unnamed, f"its docstring does not name {', '.join(unnamed)} in backquotes")
    require(re.search(r"^Source: .*\w", text, re.MULTILINE) is not None, "its docstring has no line `Source: ...`")


def _returns_image(trial: Trial) -> None:
    image = np.asarray(trial.attack.function(trial.render.copy(), np.random.default_rng(0)))
    require(image.shape == trial.render.shape, f"{list(image.shape)}, not {list(trial.render.shape)}")
    require(bool(np.isfinite(image).all()), "some numbers are not finite")


def _leaves_render(trial: Trial) -> None:
    render = trial.render.copy()
    trial.attack.function(render, np.random.default_rng(0))
    require(np.array_equal(render, trial.render), "the render that was given has changed")


def _leaves_input(trial: Trial, before: Table) -> None:
    require(np.array_equal(trial.public.model.table, before), "the model that was given has changed")


def _names_rows(first: Attacked) -> None:
    require(len(first.rows) == len(first.model), f"{len(first.rows)} indices for {len(first.model)} rows")
    require(bool(np.all((first.rows >= -1) & (first.rows < first.count))), "some indices are of no row")


def _repeats(trial: Trial, first: Attacked) -> None:
    again = trial.attacked()
    require(np.array_equal(first.model.table, again.model.table), "rows differ")
    image = first.retouched(trial.render, "view")
    image_again = again.retouched(trial.render, "view")
    require(np.array_equal(image, image_again), "attacked renders differ")


def _is_stronger(trial: Trial, strength: Strength) -> None:
    weak = trial.damage(**{strength.setting: strength.at(0.0)})
    strong = trial.damage(**{strength.setting: strength.at(1.0)})
    is_less = strong < weak - DAMAGE_TOLERANCE  # as in the search for a strength
    require(not is_less, f"{weak:.2f} dB at the weak end, {strong:.2f} dB at the strong one")
