"""Anchors, the rows of a Scaffold-GS file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.finite import non_finite_rows

STORED_OPACITY: Final = np.float32(-2.1972246)  # logit(0.1): Scaffold-GS does not train the opacities that it stores

SCALINGS: Final = 6


@dataclass(frozen=True, eq=False)
class Anchors:
    """M anchors of k Gaussians each; arrays of numpy or torch."""

    positions: Any  # [M,3], world units; training does not move them
    offsets: Any  # [M,k,3] of the Gaussians, in multiples of the first three scalings
    features: Any  # [M,F], input of the networks
    log_scalings: Any  # [M,6], of the unit of the offsets (3), and of the scales before the network's factor (3)

    @property
    def k(self) -> int:
        """Gaussians per anchor."""
        return int(self.offsets.shape[1])

    @property
    def feat_dim(self) -> int:
        """Length of a feature."""
        return int(self.features.shape[1])

    def at(self, rows: Any) -> Anchors:
        """Return some of the anchors."""
        parts = (self.positions, self.offsets, self.features, self.log_scalings)
        return Anchors(*(rows_of(part, rows) for part in parts))


def rows_of(array: Any, rows: Any) -> Any:
    """Return ``array[rows]``; PyTorch's indexing is slower than its selection, forward and backward."""
    return array[rows] if isinstance(array, np.ndarray) else array.index_select(0, rows)


def anchors_of(table: Gaussians) -> Anchors:
    """Return a table's anchors; ``f_offset_*`` is coordinate-major: column c k + i is coordinate c of Gaussian i."""
    names = table.columns_named("f_offset_")
    offsets = table.columns(*names).reshape(len(table), 3, len(names) // 3)
    return Anchors(
        positions=table.means,
        offsets=np.ascontiguousarray(offsets.transpose(0, 2, 1)),
        features=table.columns(*table.columns_named("f_anchor_feat_")),
        log_scalings=table.columns(*(f"scale_{i}" for i in range(SCALINGS))),
    )


def table_of(anchors: Anchors) -> Gaussians:
    """Return the table of anchors with the columns of Scaffold-GS, in its order."""
    count = len(anchors.positions)
    offsets = anchors.offsets.transpose(0, 2, 1).reshape(count, -1)
    named: dict[str, Any] = dict(zip("xyz", anchors.positions.T, strict=True))
    named |= dict.fromkeys(("nx", "ny", "nz"), 0)
    named |= {f"f_offset_{i}": column for i, column in enumerate(offsets.T)}
    named |= {f"f_anchor_feat_{i}": column for i, column in enumerate(anchors.features.T)}
    named["opacity"] = STORED_OPACITY
    named |= {f"scale_{i}": column for i, column in enumerate(anchors.log_scalings.T)}
    named |= {f"rot_{i}": float(i == 0) for i in range(4)}
    table = np.empty(count, [(name, "<f4") for name in named])
    for name, column in named.items():
        table[name] = column
    return Gaussians(table)


def require_anchors(source: Path, table: Gaussians) -> None:
    """Refuse a table with other columns than Scaffold-GS's, or with numbers that are not finite."""
    offsets, features = (table.columns_named(prefix) for prefix in ("f_offset_", "f_anchor_feat_"))
    if not offsets or len(offsets) % 3:
        expected = "three properties per Gaussian of an anchor"
        raise InputError(source, "f_offset_*", expected=expected, found=f"{len(offsets)}", hint="a Scaffold-GS .ply?")
    if not features:
        raise InputError(source, "f_anchor_feat_*", expected="an anchor's features", found="no such property")
    scalings = tuple(f"scale_{i}" for i in range(SCALINGS))
    numbered = [
        f"{prefix}{i}"
        for prefix, columns in (("f_offset_", offsets), ("f_anchor_feat_", features))
        for i in range(len(columns))
    ]
    for name in (*numbered, *scalings):
        if name not in table.names or table.table.dtype[name] != np.float32:
            found = str(table.table.dtype[name]) if name in table.names else "no such property"
            raise InputError(source, name, expected="a float32 property", found=found)
    geometry = ("x", "y", "z", *numbered, *scalings, "rot_0", "rot_1", "rot_2", "rot_3")
    for name, rows in non_finite_rows(table, geometry).items():
        found = f"infinity or not-a-number in {len(rows)} of {len(table)} rows, first in row {rows[0]}"
        raise InputError(source, name, expected="finite numbers", found=found)
