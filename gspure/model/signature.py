"""Kinds of models, recognized by their columns."""

from __future__ import annotations

from collections.abc import Collection
from enum import Enum

from gspure.model.filtered import FILTER


class Signature(Enum):
    """Kinds of models with their characteristic columns; the first kind whose columns are present applies."""

    SCAFFOLD_GS = ("Scaffold-GS or SecureGS (rows are anchors)", ("f_anchor_feat_0", "f_offset_0"))
    GS_HIDER = ("GS-Hider", ("semantic_0",))
    GOF = ("GOF or Mip-Splatting (3-D filter)", (FILTER,))
    VANILLA = ("vanilla 3DGS (Splats in Splats looks the same)", ("f_dc_0",))
    UNKNOWN = ("unknown", ())

    def __init__(self, title: str, columns: tuple[str, ...]) -> None:
        self.title = title
        self.columns = columns

    @property
    def rows(self) -> str:
        """What its rows are."""
        return "anchors" if self is Signature.SCAFFOLD_GS else "Gaussians"

    @classmethod
    def of(cls, columns: Collection[str]) -> Signature:
        """Return the signature of a table with these columns."""
        return next(kind for kind in cls if set(kind.columns) <= set(columns))
