"""The common style of all figures: sizes, fonts, colours, and writing of PNG and SVG files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from gspure.arrays import UInt8
from gspure.files import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMN: Final = 3.4  # width of a figure in one column of a two-column paper, inches
PAGE: Final = 7.0  # width of a figure across both columns, inches
DPI: Final = 300

INK: Final = "#222222"
FAINT: Final = "#8a8a8a"

# Colour-blind safe. Meanings keep their colour in all figures.
KEPT: Final = "#9fb4c7"
PRUNED: Final = "#d55e00"  # Okabe and Ito's vermilion
SCENE: Final = "#4d7ea8"
MESSAGE: Final = "#aa3377"  # Tol's bright purple
NOISE: Final = "#c4c4c4"
RANKS: Final = "viridis"

CLUSTERS: Final = ("#332288", "#88ccee", "#117733", "#ddcc77", "#cc6677", "#44aa99", "#aa4499", "#999933", "#882255")
"""Paul Tol's muted scheme, ordered so that neighbours in the list differ in lightness."""

Picture = tuple[int, int, UInt8]
"""Left and top pixel of an image [H,W,3]."""

_TICKS: Final = {"color": INK, "major.width": 0.6, "labelsize": 6.5}
_LEGEND: Final = {"frameon": False, "fontsize": 6.5, "handletextpad": 0.3, "handlelength": 1.2, "columnspacing": 0.7}
_LAYOUT: Final = {"h_pad": 0.02, "w_pad": 0.02, "hspace": 0.0, "wspace": 0.0}
_RC: Final[dict[str, Any]] = {
    "font.family": "DejaVu Sans",  # ships with matplotlib, so it is the same on every machine
    "font.size": 7,
    "mathtext.fontset": "dejavusans",
    "text.parse_math": False,  # names from files are not formulas
    "text.usetex": False,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 7,
    "svg.hashsalt": "gspure",
    **{f"{axis}tick.{name}": value for axis in "xy" for name, value in _TICKS.items()},
    **{f"legend.{name}": value for name, value in _LEGEND.items()},
    **{f"figure.constrained_layout.{name}": value for name, value in _LAYOUT.items()},
}


@contextmanager
def page(
    path: Path,
    width: float,
    height: float,
    layout: Literal["constrained"] | None = "constrained",
    *,
    vector: bool = False,
    pictures: Sequence[Picture] = (),
) -> Iterator[Figure]:
    """Yield an empty figure of this size in inches, and write it to `path`, a PNG, after the block.

    A `vector` figure, a chart without pictures, is also written as an SVG beside it. The `pictures`
    lie below what matplotlib draws, which is slow with them.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    with mpl.rc_context(_RC):
        figure = Figure(figsize=(width, height), dpi=DPI, layout=layout, facecolor="none")
        yield figure
        engine = figure.get_layout_engine()
        if figure.axes and engine:
            engine.execute(figure)
            figure.set_layout_engine(None)  # with one, savefig would draw all pictures twice
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        drawn = Image.fromarray(np.asarray(canvas.buffer_rgba()))
        sheet = Image.new("RGB", drawn.size, "white")
        for left, top, pixels in pictures:
            sheet.paste(Image.fromarray(pixels), (left, top))
        sheet.paste(drawn, mask=drawn)
        with replacing(path) as temporary:  # to PNG, pictures are noise: higher levels take long and save a few percent
            sheet.save(temporary, format="PNG", dpi=(DPI, DPI), compress_level=1)
        if vector:
            with replacing(path.with_suffix(".svg")) as temporary:
                figure.savefig(temporary, format="svg", facecolor="white", metadata={"Creator": None, "Date": None})


def rgb(colour: str) -> UInt8:
    """Return a ``#rrggbb`` colour as uint8 [3]."""
    return np.frombuffer(bytes.fromhex(colour.removeprefix("#")), np.uint8)


def tint(colour: str, share: float) -> str:
    """Return `colour` mixed with this share of white."""
    mixed = np.rint(rgb(colour) * (1 - share) + 255 * share)
    return "#" + bytes(mixed.astype(np.uint8)).hex()
