"""Two folders of images compared view by view, and the table ``metrics.csv`` of the result."""

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np

from gspure.cameras.orbit import UP_SHEET
from gspure.errors import InputError
from gspure.grouping import grouped
from gspure.images import SUFFIXES, mean_colour, read_image
from gspure.metrics.csv_tables import Values, read_table, write_table
from gspure.metrics.image_metrics import METRICS, measured
from gspure.metrics.names import BLACK
from gspure.text import decimal

Reference = Literal["truth", "render"]
TRUTH: Final = "truth"
RENDER: Final = "render"
REFERENCES: Final[tuple[Reference, ...]] = (TRUTH, RENDER)  # photographs, or renders of the unattacked model
FAR_BELOW: Final = 6.0  # dB below the mean PSNR beyond which a view is warned of


class ViewMetrics(NamedTuple):
    """The metrics of one view of one target."""

    target: str  # subfolder of the image (`scene`, `message`), or `.`
    view: str
    reference: Reference
    values: Values  # by name in `METRICS`

    @property
    def psnr(self) -> float:
        """The metric of the Score, dB."""
        return self.values["psnr"]


class ImagePair(NamedTuple):
    """Two images of the same target and view."""

    target: str
    view: str
    reference: Path
    image: Path
    background: tuple[float, ...] = (0.0, 0.0, 0.0)  # colour of transparent pixels, as in the renders


def pair_images(
    reference: Path,
    images: Path,
    against: Mapping[str, str] | None = None,
    targets: Iterable[str] = (),
    background: Sequence[float] = (0.0, 0.0, 0.0),
) -> tuple[list[ImagePair], int]:
    """Pair the images below two folders by their relative paths without suffix, sorted by target and view.

    A target is a subfolder. `against` maps a target of `images` to the target of `reference` that it is compared with,
    if that has another name. `targets` select targets of `images`; without any, all are compared. Also return the
    number of images of `reference` without a counterpart. Raise `InputError` if a folder holds no image, or `images`
    lacks a target or has a file that `reference` lacks.
    """
    renamed = against or {}
    chosen = frozenset(targets)
    available = _image_files(reference)
    compared = _image_files(images, chosen)
    present = {path.parent.as_posix() for path in compared}
    for target in sorted((renamed.keys() | chosen) - present):
        raise InputError(images, "target", expected=f"one of {', '.join(sorted(present))}", found=repr(target))
    counterparts = {path: Path(renamed.get(path.parent.as_posix(), path.parent)) / path.name for path in compared}
    for path, counterpart in sorted(counterparts.items()):
        if counterpart not in available:
            expected = f"a counterpart of {compared[path]}"
            place = reference / counterpart.with_name(compared[path].name)
            raise InputError(place, "file", expected=expected, found="nothing")
    pairs = [
        ImagePair(path.parent.as_posix(), path.name, available[counterpart], compared[path], tuple(background))
        for path, counterpart in counterparts.items()
    ]
    return sorted(pairs), len(available.keys() - {*counterparts.values()})


def compare(pair: ImagePair, reference: Reference = RENDER, baseline: str | None = None) -> ViewMetrics:
    """Compare two images; `baseline`, one of `gspure.metrics.names.BASELINES`, replaces the second one.

    A photograph larger than the image is reduced, as for training. Raise `InputError` if an image cannot be read, or is
    larger than its photograph, or of another size than its render.
    """
    b = read_image(pair.image, background=pair.background)
    size = (b.shape[1], b.shape[0]) if reference == TRUTH else None
    a = read_image(pair.reference, size, pair.background)
    if a.shape != b.shape:
        expected = f"{a.shape[1]}x{a.shape[0]}, as {pair.reference}"
        raise InputError(pair.image, "size", expected=expected, found=f"{b.shape[1]}x{b.shape[0]}")
    if baseline is not None:
        b = np.zeros_like(a) if baseline == BLACK else mean_colour(a)
    return ViewMetrics(pair.target, pair.view, reference, measured(a, b))


def means(rows: Iterable[ViewMetrics]) -> list[ViewMetrics]:
    """Return one row per target: the mean over its views, with the view named ``mean``.

    Identical views have infinite PSNR. They count only if there are no others, since one untouched view would otherwise
    hide all damage to the rest.
    """
    averages = []
    in_order = sorted(rows, key=lambda row: (row.target, row.view))
    for target, views in grouped(in_order, lambda row: row.target).items():
        values = {}
        for name in METRICS:
            finite = [row.values[name] for row in views if np.isfinite(row.values[name])]
            values[name] = float(np.mean(finite or [np.inf]))
        averages.append(ViewMetrics(target, "mean", views[0].reference, values))
    return averages


def worst(rows: Iterable[ViewMetrics]) -> list[ViewMetrics]:
    """Return one row per target: the view of lowest PSNR."""
    by_psnr = sorted(rows, key=lambda row: (row.target, row.psnr, row.view))
    return [views[0] for views in grouped(by_psnr, lambda row: row.target).values()]


def far_below(rows: Sequence[ViewMetrics]) -> list[str]:
    """Return one sentence per target whose worst view is far below the mean PSNR, which hides that view."""
    return [
        f"{_named(low)} has {decimal(low.psnr, 1)} dB, {decimal(mean.psnr - low.psnr, 1)} dB less than the mean PSNR: "
        "do the other views show the same surfaces?"
        for low, mean in zip(worst(rows), means(rows), strict=True)
        if low.psnr < mean.psnr - FAR_BELOW  # False if all views are identical: both are infinite
    ]


def identical(rows: Iterable[ViewMetrics]) -> Counter[str]:
    """Return the number of identical views per target: those with infinite PSNR."""
    return Counter(row.target for row in rows if np.isinf(row.psnr))


def write_metrics(path: Path, rows: Iterable[ViewMetrics]) -> None:
    """Write ``metrics.csv``: one row per target and view, whole or not at all."""
    write_table(path, ViewMetrics, rows)


def read_metrics(path: Path) -> list[ViewMetrics]:
    """Read ``metrics.csv``, or raise `InputError` if it cannot be read, is empty, or lacks a metric of a view."""
    rows = read_table(path, ViewMetrics)
    if not rows or any(row.values.keys() != METRICS.keys() for row in rows):
        raise InputError(path, "rows", expected="some, with all metrics", found="none" if not rows else "empty cells")
    return rows


def as_text(rows: Sequence[ViewMetrics], *, per_view: bool = False) -> list[str]:
    """Return aligned lines: mean and worst view of every target, then remarks; `per_view` puts all views first."""
    views = Counter(row.target for row in rows)
    remarks = []
    for target, count in identical(rows).items():
        if count < views[target]:
            prefix = "" if target == "." else f"{target}: "
            remarks.append(f"{prefix}{count} of {views[target]} views are identical; mean PSNR: the others")
    remarks += [f"warning: {sentence}" for sentence in far_below(rows)]
    listed = [*rows] if per_view else []
    listed += means(rows)
    listed += [row._replace(view=f"worst: {row.view}") for row in worst(rows)]
    width = max(len(_named(row)) for row in listed)
    titles = "".join(f"{metric.title:>12}" for metric in METRICS.values())
    lines = [f"{'view':<{width}}{titles}"]
    for row in listed:
        numbers = "".join(f"{decimal(row.values[name], 4):>12}" for name in METRICS)
        lines.append(f"{_named(row):<{width}}{numbers}")
    return lines + remarks


def _named(row: ViewMetrics) -> str:
    return row.view if row.target == "." else f"{row.target}/{row.view}"


def _image_files(folder: Path, targets: Container[str] = ()) -> dict[Path, Path]:
    """Return the images below a folder by their relative paths without suffix; of several, the PNG file."""
    files = {path.relative_to(folder) for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES}
    if any(path.name.startswith(("orbit_", "shell_")) for path in files):  # generated views, perhaps with candidates
        files.discard(Path(UP_SHEET))
    files = {path for path in files if not targets or path.parent.as_posix() in targets}
    files = {path for path in files if not path.parts[0].startswith(".")}  # left by a killed process
    if not files:
        raise InputError(folder, "folder", expected="PNG files", found="none" if folder.is_dir() else "no such folder")
    png_last = sorted(files, key=lambda path: path.suffix.lower() == ".png")
    return {path.with_suffix(""): folder / path for path in png_last}
