"""What an attack is: the form in which built-in attacks and those of other packages are given."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure import __version__
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians

Mask = NDArray[np.bool_]
Weights = NDArray[np.float32]
Rng = np.random.Generator
Setting = float | int | str

EVIDENCE: Final = frozenset({"weights", "prune_mask"})


@dataclass(frozen=True)
class Evidence:
    """What an attacker has measured on the public model beforehand.

    Parameters
    ----------
    weights : array [K], float32, optional
        View-accumulated weights ω_k.
    prune_mask : array [K], bool, optional
        GSPure's decision, true where pruned.

    """

    weights: Weights | None = None
    prune_mask: Mask | None = None


@dataclass(frozen=True)
class Attacked:
    """An attacked model, and which rows [K] of the public one it kept (in order)."""

    model: Gaussians
    kept: Mask


@dataclass(frozen=True)
class Attack:
    """An attack that any scheme can be put to.

    Parameters
    ----------
    name : str
        Unique name; the variant's name in every table.
    function : callable
        ``function(model, rng, [weights], [prune_mask], *, setting=default, ...) -> Attacked``: pure, deterministic in
        its arguments. It names the evidence that it needs, and its keyword-only parameters are its settings.

    """

    name: str
    function: Callable[..., Attacked]

    @property
    def needs(self) -> frozenset[str]:
        """Which fields of the evidence it needs."""
        return frozenset(p.name for p in self._parameters[2:] if p.kind is not p.KEYWORD_ONLY)

    @property
    def settings(self) -> dict[str, Setting]:
        """Its settings and their defaults."""
        return {p.name: p.default for p in self._parameters if p.kind is p.KEYWORD_ONLY}

    @property
    def _parameters(self) -> list[inspect.Parameter]:
        return list(inspect.signature(self.function).parameters.values())

    def apply(self, model: Gaussians, evidence: Evidence, *, seed: int = 0, **settings: Setting) -> Attacked:
        """Attack `model`; an attacked model says so in one comment line.

        Parameters
        ----------
        model : Gaussians
            The public model.
        evidence : Evidence
            At least what the attack needs.
        seed : int
            Seed of `numpy.random.default_rng`.
        **settings : float, int or str
            Any of `self.settings`.

        Raises
        ------
        InputError
            If a setting is unknown or out of range, or if evidence is missing or of another model.

        """
        for name in settings.keys() - self.settings.keys():
            known = ", ".join(self.settings) or "none (it has no settings)"
            raise InputError(f"attack {self.name}", "setting", expected=f"one of {known}", found=name)
        if seed < 0:
            raise InputError(f"attack {self.name}", "seed", expected="at least 0", found=str(seed))
        given = {name: self._evidence(name, evidence, len(model)) for name in self.needs}
        attacked = self.function(model, np.random.default_rng(seed), **given, **settings)
        if attacked.kept.shape != (len(model),) or np.count_nonzero(attacked.kept) != len(attacked.model):
            expected = f"a mask over {len(model)} rows that keeps {len(attacked.model)}"
            found = f"{np.count_nonzero(attacked.kept)} of {list(attacked.kept.shape)}"
            raise InputError(f"attack {self.name}", "kept", expected=expected, found=found)
        if attacked.model is model:
            return attacked
        said = " ".join(f"{key}={value}" for key, value in {**self.settings, **settings, "seed": seed}.items())
        return Attacked(attacked.model.with_comment(f"gspure {__version__} attack {self.name} {said}"), attacked.kept)

    def _evidence(self, name: str, evidence: Evidence, count: int) -> NDArray[Any]:
        array: NDArray[Any] | None = getattr(evidence, name)
        if array is None:
            raise InputError(f"attack {self.name}", name, expected="an array", found="nothing", hint="it needs this")
        if array.shape != (count,):
            found = f"{list(array.shape)}"
            raise InputError(f"attack {self.name}", name, expected=f"[{count}], one per Gaussian", found=found)
        return array
