"""Which columns of a model an attack on its attributes touches."""

from __future__ import annotations

from gspure.errors import InputError
from gspure.model.gaussians import Gaussians

ATTRIBUTES = ("colour", "opacity")


def parse_attributes(attributes: str) -> tuple[str, ...]:
    """Return the attributes that a setting such as ``colour`` or ``colour,opacity`` names."""
    names = tuple(attributes.split(","))
    if not set(names) <= set(ATTRIBUTES) or len(set(names)) != len(names):
        expected = f"one or more of {','.join(ATTRIBUTES)}, by commas"
        raise InputError("attack", "attributes", expected=expected, found=repr(attributes))
    return names


def colour_columns(model: Gaussians) -> tuple[str, ...]:
    """Return the columns that hold colour, in whichever form the model stores it.

    These are the spherical harmonics ``f_dc_*`` and ``f_rest_*`` of 3DGS, the features ``semantic_*`` of GS-Hider, or
    ``f_anchor_feat_*`` of Scaffold-GS and SecureGS (the paper's feature attacks act on those there).
    """
    for prefixes in (("semantic_",), ("f_anchor_feat_",), ("f_dc_", "f_rest_")):
        found = tuple(name for prefix in prefixes for name in model.columns_named(prefix))
        if found:
            return found
    raise InputError("attack", "colour", expected="columns f_dc_*, semantic_* or f_anchor_feat_*", found="none of them")
