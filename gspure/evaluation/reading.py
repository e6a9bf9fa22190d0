"""The long table of outcomes, read back."""

from __future__ import annotations

import csv
import math
from itertools import groupby
from pathlib import Path

from gspure.artifacts import verify
from gspure.errors import InputError, reading
from gspure.evaluation.comparison import ViewMetrics
from gspure.evaluation.outcomes import Outcome, referred
from gspure.evaluation.tables import HEADER

Row = dict[str, str]


def read_table(path: Path) -> list[Outcome]:
    """Return the outcomes of a table that `gspure.evaluation.tables.write_table` has written, in its order.

    Raises
    ------
    InputError
        If the file is not such a table.

    """
    verify(path)
    with (
        reading(path, "a table of outcomes"),
        path.open(encoding="utf-8", newline="") as stream,
    ):
        table = csv.DictReader(stream, strict=True)
        if tuple(table.fieldnames or ()) != HEADER:
            raise InputError(path, "header", expected=",".join(HEADER), found=",".join(table.fieldnames or ()))
        variants = [list(rows) for _, rows in groupby(table, key=lambda row: [row[name] for name in HEADER[:4]])]
        outcomes = [_outcome(rows) for rows in variants]
    models = groupby(outcomes, key=lambda o: (o.scheme, o.asset))
    return [o for _, variants in models for o in referred(list(variants))]


def _outcome(rows: list[Row]) -> Outcome:
    targets = {row["target"]: _mean(row) for row in rows if row["psnr"]}
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
        off_path={row["target"]: _mean(row, "off_path_") for row in rows if row["off_path_psnr"]},
        seed=int(first["seed"]),
    )


def _mean(row: Row, views: str = "") -> ViewMetrics:
    psnr, ssim = float(row[f"{views}psnr"]), float(row[f"{views}ssim"])
    return ViewMetrics(row["target"], "mean", psnr, ssim, row["reference"])


def _number(cell: str) -> float:
    return float(cell) if cell else math.nan
