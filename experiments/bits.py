"""How many bits single renders hold, and how often unrelated models seem to hold them: tables/bits-renders.csv.

pip install ./examples/marked_clones
gspure pair room vault --views 24 --width 160 --height 120 --out pair
python -m experiments.bits pair

Each scheme hides 32 and 48 bits in the room, and the key reads every render alone: of the marked model in held-out
views, of another training of the room without a mark, and of unrelated models, short trainings of random scenes. A
render is *above* a rate if so many of its bits are correct that, by the binomial distribution, fewer than this share of
random messages agree with it as well.
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import Bools, Float32
from gspure.cameras import Camera
from gspure.files import write_text
from gspure.images import read_back
from gspure.metrics.csv_tables import csv_text
from gspure.metrics.detection import Threshold
from gspure.opencl.device import choose_device
from gspure.public_model import PublicModel
from gspure.scenes.lighting import bake
from gspure.scenes.photography import path_cameras, trace, visible_points
from gspure.scenes.procedural import PROCEDURAL
from gspure.scenes.rooms import PLACEMENTS
from gspure.schemes.keyed_pattern.key import KeyedPatternKey
from gspure.schemes.pair import Pair, read_pair
from gspure.schemes.registry import find_scheme
from gspure.schemes.scheme import Key, hide
from gspure.settings import SCHEDULES
from gspure.training.dataset import extent
from gspure.training.fast import schedule_of
from gspure.training.initialization import gaussians_at
from gspure.training.trainer import beginning, train

TABLE = Path(__file__).resolve().parent / "tables" / "bits-renders.csv"
SCHEMES = ("keyed_pattern", "rendered_bits")
LENGTHS = (32, 48)
SETTINGS: dict[str, Any] = {"iterations": 1000, "max_gaussians": 8000}
RATES = (0.01, 0.001, 1e-6)
HELD_OUT = 200  # views
UNRELATED = 10  # models of each kind of random scene
FIRST_SEED = 900
PER_MODEL = 34  # renders of an unrelated model
PHOTOGRAPHS = 12  # of it
STEPS = 200  # of its training
COLUMNS = ("scheme", "bits", "renders of", "renders", "correct %", *(f"above {rate:g}" for rate in RATES))

Renders = list[tuple[Camera, Float32]]


def held_out(pair: Pair, count: int) -> list[Camera]:
    """Return views along the path of a pair's cameras, none of them a training view."""
    first = pair.scene.views[0]
    known = {view.viewmat.tobytes() for view in pair.scene.views}
    views = path_cameras(count + len(known), first.width, first.height)
    return [view for view in views if view.viewmat.tobytes() not in known][:count]


def renders(public: PublicModel, views: Sequence[Camera]) -> Renders:
    """Return the 8-bit renders of a model, each with its view."""
    scene = public.scene()
    return [(view, read_back(scene(view))) for view in views]


def unrelated(width: int, height: int) -> Iterator[PublicModel]:
    """Yield models of random scenes, trained for a short time."""
    views = path_cameras(PHOTOGRAPHS, width, height)
    for build in PROCEDURAL.values():
        for seed in range(FIRST_SEED, FIRST_SEED + UNRELATED):
            rng = np.random.default_rng(seed)
            lit = bake(build(seed, PLACEMENTS["coincident"]), coarseness=4)
            photographs = [trace(lit, view) for view in views]
            points = [visible_points(view, *seen, rng) for view, seen in zip(views, photographs, strict=True)]
            xyz, rgb = (np.concatenate(part) for part in zip(*points, strict=True))
            model = train(
                views,
                [image for image, _ in photographs],
                beginning(gaussians_at(xyz, rgb), seed),
                schedule=schedule_of(SCHEDULES[0], STEPS),
                extent=extent(views),
                max_gaussians=len(xyz),
                device=choose_device(),
            )
            yield PublicModel(model)


def read(key: Key, seen: Renders) -> Iterator[Bools]:
    """Yield the bits [N] that a key reads in each render alone."""
    if not isinstance(key, KeyedPatternKey):
        yield from (key.read_bits(image) for _, image in seen)
        return
    views = list({view.name: view for view, _ in seen}.values())
    of_views = KeyedPatternKey(key.secret, key.bits, key.clean, views)
    yield from (of_views.decoded(of_views.findings_in(image[None], [view])) for view, image in seen)


def rows(pair: Pair) -> Iterator[list[Any]]:
    """Yield the rows of the table."""
    views = held_out(pair, HELD_OUT)
    some = views[:: HELD_OUT // PER_MODEL][:PER_MODEL]
    width, height = views[0].width, views[0].height
    strange = [shown for model in unrelated(width, height) for shown in renders(model, some)]
    clean, _ = hide(find_scheme(SCHEMES[0]), pair, seed=1, message_weight=0, **SETTINGS)
    unmarked = renders(clean, views)
    for scheme in SCHEMES:
        for length in LENGTHS:
            public, key = hide(find_scheme(scheme), pair, bits=length, **SETTINGS)
            assert key
            for source, seen in (
                ("the marked model", renders(public, views)),
                ("another training", unmarked),
                (f"{UNRELATED * len(PROCEDURAL)} unrelated models", strange),
            ):
                correct = np.array([np.count_nonzero(bits == key.bits) for bits in read(key, seen)])
                above = [np.count_nonzero(correct > Threshold.at_rate(rate, length).value) for rate in RATES]
                row = [scheme, length, source, len(seen), f"{100 * correct.mean() / length:.1f}", *above]
                print(*row, flush=True)
                yield row


if __name__ == "__main__":
    write_text(TABLE, csv_text(COLUMNS, rows(read_pair(Path(sys.argv[1])))))
