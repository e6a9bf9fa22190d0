"""The authors' GS-Hider beside ours on one pair, by schedule and bound on rows: tables/authors.csv.

gspure pair room vault --width 208 --height 156 --out pair
gspure embed gs_hider_authors pair --initialization scene --set iterations=3000 --out FOLDER/authors
python -m experiments.authors pair FOLDER

The second command needs the adapter of examples/adapters; the third trains ours in FOLDER, unless it is there: by our
schedule, which scales that of 3DGS to the run, and by the first steps of 3DGS's, as the authors' program.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple
from unittest.mock import patch

import numpy as np

from experiments.inria_schedule import NO_BOUND, first_of_inrias
from gspure.files import write_text
from gspure.images import read_back
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.image_metrics import psnr
from gspure.metrics.targets import MESSAGE
from gspure.public_model import RenderView
from gspure.schemes.pair import Capture, Pair, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import hide
from gspure.training.dataset import read_photographs
from gspure.training.schedule import ITERATIONS, Schedule

TABLE: Final = Path(__file__).resolve().parent / "tables" / "authors.csv"
STEPS: Final = 3000
COLUMNS: Final = ("program", "schedule of 3DGS", "bound on rows", "rows", "scene dB", "message dB")


class Ours(NamedTuple):
    """A training of ours."""

    folder: str
    title: str  # of the schedule
    schedule: Schedule
    most: int  # rows


SCALED: Final = Schedule.scaled(STEPS)
FIRST: Final = f"first {STEPS} of {ITERATIONS}"
OURS: Final = (
    Ours("scaled", f"scaled to {STEPS}", SCALED, 30_000),
    Ours("no_resets", f"scaled to {STEPS}, no resets", replace(SCALED, reset_every=STEPS), 30_000),
    Ours("first_30000", FIRST, first_of_inrias(STEPS), 30_000),
    Ours("first", FIRST, first_of_inrias(STEPS), NO_BOUND),
)


def train(one: Ours, pair: Pair, folder: Path) -> None:
    """Train ours, with decoders at a constant rate as the authors', and write it to a folder."""
    scheme = find_scheme("gs_hider")
    with patch("gspure_torch.rows.schedule_of", lambda *_, **__: one.schedule):
        public, key = hide(scheme, pair, iterations=STEPS, max_gaussians=one.most, constant_rate=1)
    assert key is not None
    for part in ("public", "key"):
        (folder / part).mkdir(parents=True)
    public.write(folder / "public" / "point_cloud.ply")
    key.write(folder / "key")


def measured(folder: Path, pair: Pair) -> list[str]:
    """Return the rows of a model, and the PSNR of scene and message in held-out views."""
    scheme = find_scheme("gs_hider")
    public = scheme.read_public(folder / "public")
    message = scheme.read_key(folder / "key").message(public, MESSAGE)
    levels = [level(public.scene(), pair.scene), level(message, pair.message)]
    return [str(len(public.model)), *(f"{value:.2f}" for value in levels)]


def level(render: RenderView, capture: Capture) -> float:
    """Return the mean PSNR of held-out views, dB."""
    views = capture.dataset.test
    pairs = zip(views, read_photographs(views), strict=True)
    return float(np.mean([psnr(read_back(render(view)), photograph) for view, photograph in pairs]))


def rows(pair: Pair, folder: Path) -> Iterator[list[str]]:
    """Yield the rows of the table."""
    yield ["authors", FIRST, "", *measured(folder / "authors", pair)]
    for one in OURS:
        place = folder / one.folder
        if not place.is_dir():
            train(one, pair, place)
        bound = "" if one.most == NO_BOUND else str(one.most)
        yield ["gspure", one.title, bound, *measured(place, pair)]


if __name__ == "__main__":
    write_text(TABLE, csv_text(COLUMNS, rows(read_pair(Path(sys.argv[1]), "scene"), Path(sys.argv[2]))))
