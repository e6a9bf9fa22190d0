"""Two folders of images, compared view by view, and the table ``metrics.csv`` of the result."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.artifacts import verify, write_text
from gspure.cameras.off_path import PREFIX
from gspure.errors import InputError, reading
from gspure.evaluation.controls import BLACK
from gspure.evaluation.metrics import psnr, ssim
from gspure.images import read_image

HEADER: Final = ("target", "view", "reference", "psnr", "ssim")

TRUTH, RENDER = "truth", "render"
REFERENCES: Final = (TRUTH, RENDER)
"""What images are compared with: photographs of what is to be seen, or what an unattacked model shows."""


class ViewMetrics(NamedTuple):
    """One compared view."""

    target: str
    """What the image shows: its folder below the compared ones (``scene``, ``message``), or ``.``."""

    view: str
    psnr: float
    ssim: float

    reference: str = RENDER
    """One of `REFERENCES`."""


class Pair(NamedTuple):
    """Two images of the same target and view."""

    target: str
    view: str
    reference: Path
    other: Path


def pair_images(reference: Path, other: Path, against: Mapping[str, str] | None = None) -> tuple[list[Pair], int]:
    """Pair the PNG files below two folders by their relative paths.

    Parameters
    ----------
    reference, other : Path
    against : mapping, optional
        Targets of `other` (subfolders) that stand beside another target of `reference` than that of their own name.

    Returns
    -------
    pairs : list of Pair
        One per image of `other`, sorted by target and view.
    surplus : int
        Images of `reference` without counterpart; a reference may cover more views than were rendered.

    Raises
    ------
    InputError
        If a folder holds no PNG file, or `other` has one that `reference` lacks.

    """
    ours = _png_files(reference)
    theirs = {path: _target(path, against or {}) / path.name for path in _png_files(other)}
    for path, counterpart in sorted(theirs.items()):
        if counterpart not in ours:
            found = f"a counterpart of {other / path}"
            raise InputError(reference / counterpart, "file", expected=found, found="nothing")
    pairs = [Pair(p.parent.as_posix(), p.stem, reference / q, other / p) for p, q in theirs.items()]
    return sorted(pairs), len(ours - {*theirs.values()})


def compare(pair: Pair, reference: str = RENDER, floor: str | None = None) -> ViewMetrics:
    """Compare two images; `reference` says which of `REFERENCES` the first of them is.

    With a `floor`, one of `gspure.evaluation.controls.FLOORS`, a picture without content takes the place of the second.

    Raises
    ------
    InputError
        If one cannot be read, or their sizes differ.

    """
    a, b = read_image(pair.reference), read_image(pair.other)
    if a.shape != b.shape:
        expected = f"{a.shape[1]}x{a.shape[0]}, as {pair.reference}"
        raise InputError(pair.other, "size", expected=expected, found=f"{b.shape[1]}x{b.shape[0]}")
    if floor is not None:
        b = np.zeros_like(a) if floor == BLACK else np.broadcast_to(a.mean(axis=(0, 1)), a.shape)
    return ViewMetrics(pair.target, pair.view, psnr(a, b), ssim(a, b), reference)


def on_path(rows: Iterable[ViewMetrics]) -> list[ViewMetrics]:
    """Return the rows of views on the path of the cameras."""
    return [row for row in rows if not row.view.startswith(PREFIX)]


def off_path(rows: Iterable[ViewMetrics]) -> list[ViewMetrics]:
    """Return the rows of views beside it (`gspure.cameras.off_path_cameras`)."""
    return [row for row in rows if row.view.startswith(PREFIX)]


def means(rows: Iterable[ViewMetrics]) -> list[ViewMetrics]:
    """Return one row per target: the mean over its views, with the view named ``mean``.

    Views in which nothing differs have infinite PSNR. They count in its mean only if there are no others: one untouched
    view would else make all the damage to the others invisible.
    """
    found = []
    for target, group in groupby(sorted(rows), key=lambda row: row.target):
        views = list(group)
        psnrs = [view.psnr for view in views if np.isfinite(view.psnr)] or [np.inf]
        ssims = [view.ssim for view in views]
        found.append(ViewMetrics(target, "mean", float(np.mean(psnrs)), float(np.mean(ssims)), views[0].reference))
    return found


def write_metrics(path: Path, rows: Iterable[ViewMetrics]) -> None:
    """Write ``metrics.csv``: one row per target and view, whole or not at all."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADER)
    table.writerows((row.target, row.view, row.reference, f"{row.psnr:.6f}", f"{row.ssim:.8f}") for row in rows)
    write_text(path, text.getvalue())


def read_metrics(path: Path) -> list[ViewMetrics]:
    """Read ``metrics.csv``, or raise `InputError`."""
    verify(path)
    with (
        reading(path, "a metrics table"),
        path.open(encoding="utf-8", newline="") as stream,
    ):
        header, *rows = list(csv.reader(stream)) or [[]]
        if tuple(header) != HEADER or not rows:
            raise InputError(path, "header", expected=",".join(HEADER) + " and rows", found=",".join(header))
        found = [ViewMetrics(target, view, float(a), float(b), reference) for target, view, reference, a, b in rows]
    for reference in sorted({row.reference for row in found} - set(REFERENCES)):
        raise InputError(path, "reference", expected=" or ".join(REFERENCES), found=repr(reference))
    return found


def as_text(rows: Sequence[ViewMetrics]) -> list[str]:
    """Return aligned lines, the means of every target last."""
    aside = [row._replace(view="mean off the path") for row in means(off_path(rows))]
    rows = [*rows, *means(on_path(rows)), *aside]
    names = [row.view if row.target == "." else f"{row.target}/{row.view}" for row in rows]
    width = max(map(len, names))
    lines = [f"{'view':<{width}}  {'PSNR':>8}  {'SSIM':>7}"]
    return lines + [f"{n:<{width}}  {row.psnr:8.3f}  {row.ssim:7.4f}" for n, row in zip(names, rows, strict=True)]


def _target(path: Path, against: Mapping[str, str]) -> Path:
    return Path(against.get(path.parent.as_posix(), path.parent))


def _png_files(folder: Path) -> set[Path]:
    files = {path.relative_to(folder) for path in folder.rglob("*.png")}
    if not files:
        raise InputError(folder, "folder", expected="PNG files", found="none" if folder.is_dir() else "no such folder")
    return files
