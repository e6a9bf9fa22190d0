"""Which columns of a model an attack on its attributes touches.

Attributes are named by what they mean, whichever columns hold them. Columns that nothing reads, such as the opacities
and rotations that Scaffold-GS stores with its anchors, belong to none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from gspure.errors import InputError
from gspure.model.gaussians import COLOUR, Gaussians

Columns = tuple[str, ...]


def columns_of(model: Gaussians, attributes: str, allowed: Sequence[str] = ()) -> Columns:
    """Return the columns behind a setting such as ``colour`` or ``colour,opacity``, in that order.

    Parameters
    ----------
    model : Gaussians
    attributes : str
        Names by commas, each once.
    allowed : sequence of str
        The names that the attack takes; default: all.

    Raises
    ------
    InputError
        A name is unknown or given twice, or the model has none of these attributes.

    """
    names, known = attributes.split(","), allowed or tuple(ATTRIBUTES)
    if not set(names) <= set(known) or len(set(names)) != len(names):
        expected = f"one or more of {','.join(known)}, by commas"
        raise InputError("attack", "attributes", expected=expected, found=repr(attributes))
    columns = tuple(column for name in names for column in ATTRIBUTES[name](model))
    if not columns:
        raise InputError("attack", attributes, expected="columns that its images depend on", found="none")
    return columns


def colour_columns(model: Gaussians) -> Columns:
    """Return the columns that hold colour, in whichever form the model stores it.

    These are the spherical harmonics ``f_dc_*`` and ``f_rest_*`` of 3DGS, the features ``semantic_*`` of GS-Hider, or
    ``f_anchor_feat_*`` of Scaffold-GS and SecureGS (the paper's feature attacks act on those there).
    """
    for prefixes in (("semantic_",), ("f_anchor_feat_",), ("f_dc_", "f_rest_")):
        found = tuple(name for prefix in prefixes for name in model.columns_named(prefix))
        if found:
            return found
    raise InputError("attack", "colour", expected="columns f_dc_*, semantic_* or f_anchor_feat_*", found="none of them")


def holds_anchors(model: Gaussians) -> bool:
    """Return whether rows are anchors, from which networks make Gaussians."""
    return bool(model.columns_named("f_anchor_feat_"))


def require_gaussians(attack: str, model: Gaussians, what: str) -> None:
    """Refuse anchors, which have no `what` of their own."""
    if holds_anchors(model):
        expected = f"rows with {what} of their own"
        raise InputError(f"attack {attack}", "f_anchor_feat_*", expected=expected, found="anchors, which have none")


def _base_colour(model: Gaussians) -> Columns:
    colour = colour_columns(model)
    return COLOUR if set(COLOUR) <= set(colour) else colour


def _opacity(model: Gaussians) -> Columns:
    return () if holds_anchors(model) else ("opacity",)


def _rotation(model: Gaussians) -> Columns:
    return () if holds_anchors(model) else model.columns_named("rot_")


def _position(model: Gaussians) -> Columns:
    return ("x", "y", "z", *model.columns_named("f_offset_"))


ATTRIBUTES: Final[dict[str, Callable[[Gaussians], Columns]]] = {
    "colour": colour_columns,
    "base_colour": _base_colour,
    "opacity": _opacity,
    "scale": lambda model: model.columns_named("scale_"),
    "rotation": _rotation,
    "position": _position,
}
"""``base_colour`` is what of the colour does not depend on the direction: the zeroth harmonics, or all features."""
