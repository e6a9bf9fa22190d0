"""Which kind of model a table holds, told by its columns."""

from __future__ import annotations

from collections.abc import Collection
from enum import Enum


class Signature(Enum):
    """Kinds of models, each with the columns that give it away; the first that fits is the one."""

    SCAFFOLD_GS = ("Scaffold-GS or SecureGS (rows are anchors)", ("f_anchor_feat_0", "f_offset_0"))
    GS_HIDER = ("GS-Hider", ("semantic_0",))
    GOF = ("GOF or Mip-Splatting (3-D filter)", ("filter_3D",))
    VANILLA = ("vanilla 3DGS (Splats in Splats looks the same)", ("f_dc_0",))
    UNKNOWN = ("unknown", ())

    def __init__(self, title: str, columns: tuple[str, ...]) -> None:
        self.title = title
        self.columns = columns

    @property
    def rows(self) -> str:
        """What the rows of such a model are called."""
        return "anchors" if self is Signature.SCAFFOLD_GS else "Gaussians"

    @classmethod
    def of(cls, columns: Collection[str]) -> Signature:
        """Return the signature of a table with these columns."""
        return next(kind for kind in cls if set(kind.columns) <= set(columns))
