"""Candidates of a ray-traced message: random scenes of its kind, photographed from its compared views at half size.

A message is proven by its rank among candidates (`gspure.metrics.proof`), so they must be drawn like the message:
scenes of one builder at one placement, each once, in the right views. Pictures of other kinds, or of other views,
correlate less with any extraction than a wrong message does.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from gspure.arrays import UInt8
from gspure.cameras import Camera
from gspure.cameras.splits import views_of_split
from gspure.images import levels
from gspure.metrics.proof import compared_views
from gspure.progress import track
from gspure.scenes.lighting import bake
from gspure.scenes.photography import path_cameras, trace
from gspure.scenes.procedural import PROCEDURAL, scene_builder
from gspure.scenes.rooms import PLACEMENTS

COARSENESS: Final = 4  # of the light (`bake`), whose gradients correlate with those of full light by 0.97 to 0.99; ours
FIRST_SEED: Final = 1 << 32  # above all seeds of a message, so that it is none of its candidates


class Kind(NamedTuple):
    """What a ray-traced message and its candidates share."""

    builder: str  # of `PROCEDURAL`
    placement: str  # of `PLACEMENTS`


def kind_of(message: str, placement: str) -> Kind | None:
    """Return the kind of a message by its name, as `gspure pair` records it; None if it is not ray-traced.

    ``room`` and ``vault`` are of the kind of random interiors: furnished rooms with the same walls.
    """
    if scene_builder(message) is None:
        return None
    builder = message.partition("-")[0]
    return Kind(builder if builder in PROCEDURAL else "interior", placement)


def candidate_cameras(views: int, width: int, height: int, split: str = "test") -> list[Camera]:
    """Return the `compared_views` of a split of a pair's views, at half size, in the message's own frame."""
    of_split = views_of_split(path_cameras(views, width, height), split, "candidates")
    return [of_split[i].resized(width // 2, height // 2) for i in compared_views(len(of_split))]


def candidates(kind: Kind, cameras: Sequence[Camera], count: int) -> UInt8:
    """Return photographs [N,V,H,W,3] of `count` scenes of a kind, from cameras of one size."""
    pictures = np.empty((count, len(cameras), cameras[0].height, cameras[0].width, 3), np.uint8)
    for index in track(range(count), f"candidates {kind.builder}"):
        scene = PROCEDURAL[kind.builder](FIRST_SEED + index, PLACEMENTS[kind.placement])
        lit = bake(scene, coarseness=COARSENESS)
        pictures[index] = [levels(trace(lit, camera)[0]) for camera in cameras]
    return pictures
