"""What attacks return and raise, and whether they affected the columns that a message is read from."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import filter as matching
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float32, Float64, Indices
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians
from gspure.public_model import Columns, PublicModel
from gspure.text import Described

Retouch = Callable[[Float32, str], Float32]


class NotApplicable(InputError):  # noqa: N818
    """An attack has nothing to act on in a model, or leaves nothing of it: an outcome, not a mistake."""

    def __init__(self, attack: str, reason: str) -> None:
        self.attack = attack
        self.reason = reason
        super().__init__(f"attack {attack}", "model", expected="one that it applies to", found=reason)

    def __str__(self) -> str:
        return f"{self.source}: not applicable: {self.reason}"


@dataclass(frozen=True, eq=False, repr=False)
class Attacked(Described):
    """An attacked model, and where its rows come from.

    Parameters
    ----------
    model : Gaussians
        K' rows.
    rows : array [K'], int
        Index of the row of the public model that each row is, or was copied from; -1 if it is new.
    count : int
        Number K of rows of the public model.
    transform : array [4,4], optional
        Rigid transform applied to the whole model; views move with it (`gspure.cameras.camera.Camera.moved`).
    removed : str
        Why no extraction of the scheme can read the model, which is vanilla 3DGS; empty if the format is unchanged.
    retouched : callable
        From a render of the scene [H,W,3] and the name of its view to the attacked render, for attacks on renders.
    networks : PublicModel, optional
        A model whose public networks replace those of the public model.

    """

    model: Gaussians
    rows: Indices
    count: int
    transform: Float64 | None = None
    removed: str = ""
    retouched: Retouch = lambda image, _view: image
    networks: PublicModel | None = None

    def published(self, public: PublicModel, comment: str = "") -> PublicModel:
        """Return the public model to publish in place of `public`, with the networks beside that one, or others."""
        model = self.model.with_comment(comment) if comment else self.model
        model = model.with_background(public.model.background)
        return PublicModel(model) if self.removed else (self.networks or public).with_model(model)

    @property
    def facts(self) -> dict[str, str]:
        """How many rows remain."""
        kept = self.count - int(self.prune_mask.sum())
        return {"rows": f"{len(self.model):,}", "kept": f"{kept:,} of {self.count:,}"}

    @property
    def prune_mask(self) -> Bools:
        """True where a row of the public model [K] was removed; the order and copies of the others do not matter."""
        mask = np.ones(self.count, np.bool_)
        mask[self.rows[self.rows >= 0]] = False
        return mask

    @classmethod
    def without(cls, model: Gaussians, prune_mask: Bools) -> Self:
        """Return `model` without the rows where `prune_mask` [K] is true."""
        return cls(model[~prune_mask], np.flatnonzero(~prune_mask), len(model))

    @classmethod
    def changed(cls, model: Gaussians, values: Mapping[str, NDArray[Any]]) -> Self:
        """Return `model` with new `values` (each [K]) in the named columns."""
        return cls(model.with_columns(values), np.arange(len(model)), len(model))

    @classmethod
    def copied(cls, model: Gaussians, rows: Indices, values: Mapping[str, NDArray[Any]] | None = None) -> Self:
        """Return copies of the given `rows` [K'] of `model`, with new `values` (each [K']) in the named columns."""
        return cls(Gaussians(model.table[rows], model.comments).with_columns(values or {}), rows, len(model))


def affected(before: Gaussians, after: Attacked, reads: Sequence[str]) -> bool:
    """Return whether an attack removed a row of the public model or changed a bit of the columns that are read.

    `reads` are names, or patterns such as ``f_rest_*``; if there are none, only removed rows count. Order does not
    count. Added rows count where they differ from the row they were copied from.

    Raise `InputError` if a pattern matches no column of the public model.
    """
    for pattern in reads:
        if not matching(before.names, pattern):
            raise InputError("extraction", pattern, expected="columns of the public model", found="none of this name")
    if after.prune_mask.any():
        return True

    def differs(name: str) -> bool:
        if name not in after.model.names:
            return True
        return before.table[name][after.rows].tobytes() != after.model.table[name].tobytes()

    return any(differs(name) for pattern in reads for name in matching(before.names, pattern))


def require(attack: str, setting: str, value: object, expected: str, *, fits: bool) -> None:
    """Raise `InputError` for a setting unless it `fits`."""
    if not fits:
        raise InputError(f"attack {attack}", setting, expected=expected, found=str(value))


def require_attribute(attack: str, columns: Columns, attribute: str) -> None:
    """Refuse models whose rows do not store an attribute, such as the opacity of anchors."""
    if not columns.get(attribute):
        raise NotApplicable(attack, f"rows do not store {attribute}")


def select_columns(attack: str, columns: Columns, attributes: str, allowed: tuple[str, ...]) -> tuple[str, ...]:
    """Return the columns behind a setting such as ``colour`` or ``colour,opacity``, in that order.

    Raise `InputError` if a name is not `allowed` or given twice, `NotApplicable` if the model stores none of these
    attributes.
    """
    names = attributes.split(",")
    if not set(names) <= set(allowed) or len(set(names)) != len(names):
        expected = f"one or more of {','.join(allowed)}, separated by commas"
        raise InputError(f"attack {attack}", "attributes", expected=expected, found=repr(attributes))
    selected = tuple(column for name in names for column in columns.get(name, ()))
    if not selected:
        raise NotApplicable(attack, f"rows do not store {attributes}")
    return selected
