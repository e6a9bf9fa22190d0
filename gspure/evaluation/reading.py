"""The long table of outcomes, read back."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from gspure.errors import InputError, reading
from gspure.evaluation.comparison import ViewMetrics
from gspure.evaluation.outcomes import REFERENCE, Outcome
from gspure.evaluation.tables import HEADER

Row = dict[str, str]


def read_table(path: Path) -> list[Outcome]:
    """Return the outcomes of a table that `gspure.evaluation.tables.write_table` has written, in its order.

    Raises
    ------
    InputError
        If the file is not such a table.

    """
    with (
        reading(path, "a table of outcomes", ValueError, TypeError, csv.Error),  # missing cells are None
        path.open(encoding="utf-8", newline="") as stream,
    ):
        table = csv.DictReader(stream, strict=True)
        if tuple(table.fieldnames or ()) != HEADER:
            raise InputError(path, "header", expected=",".join(HEADER), found=",".join(table.fieldnames or ()))
        variants = [list(rows) for _, rows in groupby(table, key=lambda row: [row[name] for name in HEADER[:4]])]
        outcomes = [_outcome(rows) for rows in variants]
    references = {(o.scheme, o.asset): o.targets for o in outcomes if o.variant == REFERENCE}
    return [replace(o, reference=references.get((o.scheme, o.asset), {})) for o in outcomes]


def _outcome(rows: list[Row]) -> Outcome:
    targets = {
        row["target"]: ViewMetrics(row["target"], "mean", float(row["psnr"]), float(row["ssim"]), row["reference"])
        for row in rows
        if not row["failure"]
    }
    first = rows[0]
    return Outcome(
        first["scheme"],
        first["scene"],
        first["variant"],
        targets,
        {target: int(row["views"]) for target, row in zip(targets, rows, strict=False)},
        pruned_share=_number(first["pruned_share"]),
        precision=_number(first["precision"]),
        recall=_number(first["recall"]),
        reached={row["target"]: row["reached"] == "true" for row in rows if row["reached"]},
        failure=first["failure"],
        seed=int(first["seed"]),
    )


def _number(cell: str) -> float:
    return float(cell) if cell else math.nan
