"""Ray-trace random rooms, as false candidates of the retrieval, with coarser lighting than a pair has."""

from pathlib import Path

from gspure.progress import track
from gspure.scenes.lighting import bake
from gspure.scenes.photography import path_cameras, picture
from gspure.scenes.procedural import DECOYS, Interior
from gspure.scenes.rooms import PLACEMENTS
from gspure.workflow.step import run

COARSENESS = 2


def trace(folder: Path, views: int, width: int, height: int) -> None:
    cameras = path_cameras(views, width, height)
    for seed in track(DECOYS, "decoys"):
        picture(bake(Interior(seed)(PLACEMENTS["coincident"]), coarseness=COARSENESS), cameras, folder / str(seed))


run(trace)
