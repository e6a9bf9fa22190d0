"""Ray-trace random scenes of a message's kind, with coarser light than a pair has."""

from pathlib import Path

from gspure.arrays import save_array
from gspure.evaluation.plan import Candidates
from gspure.scenes.candidates import Kind, candidate_cameras
from gspure.scenes.candidates import candidates as traced_candidates
from gspure.workflow.step import run


def trace(settings: Candidates, candidates: Path) -> None:
    cameras = candidate_cameras(settings.views, settings.width, settings.height, settings.split)
    kind = Kind(settings.builder, settings.placement)
    save_array(candidates, traced_candidates(kind, cameras, settings.count))


run(trace)
