"""Models of authors' programs beside ours, by schedule and bound on rows: tables/authors.csv.

GS-Hider, by the adapter of examples/adapters (``land`` is a pair):

gspure pair landscape-1 interior-3 --width 208 --height 156 --out land
gspure embed gs_hider_authors land --initialization scene --set iterations=3000 --out FOLDER/gs_hider
python -m experiments.authors gs_hider land FOLDER

Scaffold-GS, which SecureGS extends, in its checkout, on the COLMAP project that `experiments.programs` writes; it loads
weights for LPIPS, which no number here depends on:

gspure cuda-free -- python train.py -s CAPTURE -m FOLDER/scaffold_gs --eval --iterations 3000 --save_iterations 3000 \
    --appearance_dim 0
python -m experiments.authors scaffold_gs land FOLDER

The last command trains ours in FOLDER, unless they are there: by our schedule, which scales the authors' to the run,
and by the first steps of the authors'. Rows of other pairs and programs stay in the table.
"""

import csv
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple
from unittest.mock import patch

import numpy as np

from experiments.inria_schedule import NO_BOUND, first_of_inrias
from gspure.arrays import Float32, Float64
from gspure.files import write_text
from gspure.images import read_back, read_image
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.image_metrics import psnr
from gspure.metrics.targets import MESSAGE
from gspure.model import read_model
from gspure.public_model import RenderView
from gspure.schemes.pair import Capture, Pair, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import hide
from gspure.training.dataset import read_photographs
from gspure.training.schedule import ITERATIONS, Schedule
from gspure_torch.secure_gs.growing import AnchorSchedule

TABLE: Final = Path(__file__).resolve().parent / "tables" / "authors.csv"
STEPS: Final = 3000
VOXEL: Final = 1e-3  # side, world units


class Row(NamedTuple):
    """A row of the table: a model, and the PSNR of what it shows in held-out views."""

    pair: str
    scheme: str
    program: str
    schedule: str
    bound: str  # on rows
    rows: str
    scene_psnr: str  # dB
    message_psnr: str  # dB; empty without a message


class Ours(NamedTuple):
    """A training of ours: what it runs by, in place of parts of ours, and the settings of its scheme."""

    folder: str
    schedule: str
    parts: dict[str, Callable[..., Any]]  # by their place
    settings: dict[str, Any]

    @property
    def bound(self) -> str:
        """The bound on rows; empty without one."""
        bound = self.settings.get("max_gaussians") or self.settings["max_anchors"]
        return "" if bound == NO_BOUND else str(bound)


OWN: Final = f"scaled to {STEPS}"
FIRST: Final = f"first {STEPS} of {ITERATIONS}"

SCALED: Final = Schedule.scaled(STEPS)
WITHOUT_RESETS: Final = replace(SCALED, reset_every=STEPS)


def gs_hider(folder: str, title: str, schedule: Schedule, most: int) -> Ours:
    """Return a training of GS-Hider, with decoders at a constant rate as the authors'."""
    settings = {"max_gaussians": most, "constant_rate": 1}
    return Ours(folder, title, {"gspure_torch.rows.schedule_of": lambda *_, **__: schedule}, settings)


class EndedEarly(AnchorSchedule):
    """The first steps of a schedule; Scaffold-GS's model is evaluated before it grows."""

    def adjusts(self, iteration: int) -> bool:
        """Return whether anchors grow and are pruned after this iteration."""
        return iteration < STEPS and super().adjusts(iteration)


def secure_gs(folder: str, title: str, iterations: int, **parts: Callable[..., Any]) -> Ours:
    """Return a training of SecureGS's clean model, which is one of Scaffold-GS, by the first steps of so many."""
    schedule = {"training.AnchorSchedule": lambda *_: EndedEarly(iterations)}
    settings = {"max_anchors": NO_BOUND, "message_weight": 0}
    return Ours(
        folder, title, {f"gspure_torch.secure_gs.{place}": part for place, part in (schedule | parts).items()}, settings
    )


def voxels(xyz: Float64, _: int) -> tuple[Float64, float]:
    """Return the occupied voxels [C,3] of points [P,3], in units of their side, and the side: Scaffold-GS's default."""
    return np.unique(np.rint(xyz / VOXEL), axis=0), VOXEL


OURS: Final = {
    "gs_hider": (
        gs_hider("scaled", OWN, SCALED, 30_000),
        gs_hider("no_resets", f"{OWN}, no resets", WITHOUT_RESETS, 30_000),
        gs_hider("first_30000", FIRST, first_of_inrias(STEPS), 30_000),
        gs_hider("first", FIRST, first_of_inrias(STEPS), NO_BOUND),
    ),
    "secure_gs": (
        secure_gs("anchors_scaled", OWN, STEPS),
        secure_gs("anchors_first", FIRST, ITERATIONS),
        secure_gs("anchors_fine", f"{FIRST}, their voxels", ITERATIONS, **{"initialization._voxels": voxels}),
    ),
}


def train(scheme: str, ours: Ours, pair: Pair, folder: Path) -> None:
    """Train ours, and write it to a folder."""
    with ExitStack() as stack:
        for place, part in ours.parts.items():
            stack.enter_context(patch(place, part))
        public, key = hide(find_scheme(scheme), pair, iterations=STEPS, **ours.settings)
    (folder / "public").mkdir(parents=True)
    public.write(folder / "public" / "point_cloud.ply")
    if key:
        (folder / "key").mkdir()
        key.write(folder / "key")


def measured(scheme: str, folder: Path, pair: Pair) -> tuple[str, str, str]:
    """Return the rows of a model, and the PSNR of scene and message in held-out views."""
    public = find_scheme(scheme).read_public(folder / "public")
    message = ""
    if (folder / "key").is_dir():
        render = find_scheme(scheme).read_key(folder / "key").message(public, MESSAGE)
        message = rendered_level(render, pair.message)
    return str(len(public.model)), rendered_level(public.scene(), pair.scene), message


def rendered_level(render: RenderView, capture: Capture) -> str:
    """Return the mean PSNR of a model in held-out views, dB."""
    return level([read_back(render(view)) for view in capture.dataset.test], capture)


def level(images: list[Float32], capture: Capture) -> str:
    """Return the mean PSNR of images of held-out views, dB."""
    photographs = read_photographs(capture.dataset.test)
    return f"{np.mean([psnr(*both) for both in zip(images, photographs, strict=True)]):.2f}"


def measured_scaffold_gs(folder: Path, pair: Pair) -> tuple[str, str, str]:
    """Return the anchors of a model of Scaffold-GS, and the PSNR of its own images of held-out views."""
    anchors = read_model(folder / f"point_cloud/iteration_{STEPS}/point_cloud.ply")
    files = sorted((folder / f"test/ours_{STEPS}/renders").glob("*.png"))
    return str(len(anchors)), level([read_image(file) for file in files], pair.scene), ""


THEIRS: Final[dict[str, tuple[str, Callable[[Path, Pair], tuple[str, str, str]]]]] = {
    "gs_hider": ("gs_hider", partial(measured, "gs_hider")),
    "scaffold_gs": ("secure_gs", measured_scaffold_gs),
}
"""Programs of authors: the scheme of ours that they stand beside, and how their models are measured."""


def compared(program: str, name: str, folder: Path) -> Iterator[Row]:
    """Yield the rows of a pair: of a program's model in a folder, and of ours."""
    pair = read_pair(Path(name), "scene")
    scheme, measure = THEIRS[program]
    yield Row(Path(name).name, scheme, "authors", FIRST, "", *measure(folder / program, pair))
    for ours in OURS[scheme]:
        if not (folder / ours.folder).is_dir():
            train(scheme, ours, pair, folder / ours.folder)
        yield Row(
            Path(name).name, scheme, "ours", ours.schedule, ours.bound, *measured(scheme, folder / ours.folder, pair)
        )


def main(program: str, name: str, folder: str) -> None:
    """Put the rows of a pair into the table, in place of older ones."""
    new = [*compared(program, name, Path(folder))]
    with TABLE.open(newline="", encoding="utf-8") as file:
        known = [Row(**row) for row in csv.DictReader(file)]
    others = [row for row in known if row[:2] != new[0][:2]]
    write_text(TABLE, csv_text(Row._fields, [*others, *new]))


if __name__ == "__main__":
    main(*sys.argv[1:])
