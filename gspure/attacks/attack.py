"""What an attack is: the form in which built-in attacks and those of other packages are given."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from gspure import __version__
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians

Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]
Weights = NDArray[np.float32]
Opacities = NDArray[np.float32]
Distances = NDArray[np.float32]
World = NDArray[np.float64]
Rng = np.random.Generator
Setting = float | int | str

EVIDENCE: Final = frozenset({"weights", "prune_mask", "opacities", "surface"})


@dataclass(frozen=True)
class Evidence:
    """What an attacker has measured on the public model beforehand.

    Parameters
    ----------
    weights : array [K], float32, optional
        View-accumulated weights ω_k.
    prune_mask : array [K], bool, optional
        GSPure's decision, true where pruned.
    opacities : array [K], float32, optional
        Opacity of each row, 0 to 1: of a Gaussian the stored one, of an anchor what its networks give it.
    surface : array [K], float32, optional
        Distance of each row from the surface that the views see, in the row's own scales (`gspure.surface`).

    """

    weights: Weights | None = None
    prune_mask: Mask | None = None
    opacities: Opacities | None = None
    surface: Distances | None = None


@dataclass(frozen=True, eq=False)
class Attacked:
    """An attacked model, and where it came from.

    Parameters
    ----------
    model : Gaussians
        K' rows.
    rows : array [K'], int
        For each of them, the row of the public model that it is, or is made from.
    count : int
        Number K of rows of the public model.
    world : array [4,4], optional
        The rigid motion by which the whole model was moved; views of it are moved along
        (`gspure.cameras.camera.Camera.moved`). Default: it stands where it stood.

    """

    model: Gaussians
    rows: Rows
    count: int
    world: World | None = None

    @property
    def kept(self) -> Mask:
        """Which rows [K] of the public model are left, in whatever place or number."""
        mask = np.zeros(self.count, np.bool_)
        mask[self.rows] = True
        return mask

    @classmethod
    def pruned(cls, model: Gaussians, kept: Mask) -> Self:
        """Return `model` without the rows where `kept` [K] is false."""
        return cls(model.subset(kept), np.flatnonzero(kept), len(model))

    @classmethod
    def changed(cls, model: Gaussians, values: Mapping[str, NDArray[Any]], world: World | None = None) -> Self:
        """Return `model` with other `values` (each [K]) in some columns."""
        return cls(model.with_columns(values), np.arange(len(model)), len(model), world)

    @classmethod
    def taken(cls, model: Gaussians, rows: Rows, values: Mapping[str, NDArray[Any]] | None = None) -> Self:
        """Return copies of the given `rows` [K'] of `model`, with other `values` (each [K']) in some columns."""
        return cls(Gaussians(model.table[rows], model.comments).with_columns(values or {}), rows, len(model))


@dataclass(frozen=True)
class Attack:
    """An attack that any scheme can be put to.

    Parameters
    ----------
    name : str
        Unique name; the variant's name in every table.
    function : callable
        ``function(model, rng, [evidence, ...], *, setting=default, ...) -> Attacked``: pure, deterministic in its
        arguments. It names the evidence that it needs (fields of `Evidence`), and its keyword-only parameters are its
        settings.

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
            If a setting is unknown or out of range, evidence is missing or of another model, or the model has nothing
            that the attack acts on.

        """
        for name in settings.keys() - self.settings.keys():
            known = ", ".join(self.settings) or "none (it has no settings)"
            raise InputError(f"attack {self.name}", "setting", expected=f"one of {known}", found=name)
        if seed < 0:
            raise InputError(f"attack {self.name}", "seed", expected="at least 0", found=str(seed))
        given = {name: self._evidence(name, evidence, len(model)) for name in self.needs}
        attacked = self.function(model, np.random.default_rng(seed), **given, **settings)
        self._check_rows(attacked, len(model))
        if attacked.model is model:
            return attacked
        said = " ".join(f"{key}={value}" for key, value in {**self.settings, **settings, "seed": seed}.items())
        return replace(attacked, model=attacked.model.with_comment(f"gspure {__version__} attack {self.name} {said}"))

    def _check_rows(self, attacked: Attacked, count: int) -> None:
        """Refuse an attacked model that does not say truly which rows it has."""
        rows = attacked.rows
        fits = rows.shape == (len(attacked.model),) and attacked.count == count
        if not (fits and ((rows >= 0) & (rows < count)).all()):
            expected = f"for each of {len(attacked.model)} rows, one of {count}"
            found = f"{list(rows.shape)} of {attacked.count}"
            raise InputError(f"attack {self.name}", "rows", expected=expected, found=found)

    def _evidence(self, name: str, evidence: Evidence, count: int) -> NDArray[Any]:
        array: NDArray[Any] | None = getattr(evidence, name)
        if array is None:
            raise InputError(f"attack {self.name}", name, expected="an array", found="nothing", hint="it needs this")
        if array.shape != (count,):
            found = f"{list(array.shape)}"
            raise InputError(f"attack {self.name}", name, expected=f"[{count}], one per Gaussian", found=found)
        return array
