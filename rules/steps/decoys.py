"""Ray-trace random rooms, as false candidates of the retrieval, with coarser lighting than a pair has."""

from pathlib import Path

from gspure.images import write_image
from gspure.progress import track
from gspure.scenes import photography
from gspure.scenes.lighting import bake
from gspure.scenes.procedural import DECOYS, interior
from gspure.scenes.rooms import PLACEMENTS
from gspure.workflow.step import run

COARSENESS = 2


def trace(folder: Path, views: int, width: int, height: int) -> None:
    cameras = photography.path_cameras(views, width, height)
    for seed in track(DECOYS, "decoys"):
        room = bake(interior(seed, PLACEMENTS["coincident"]), coarseness=COARSENESS)
        for camera in cameras:
            write_image(folder / str(seed) / f"{camera.name}.png", photography.trace(room, camera)[0])


run(trace)
