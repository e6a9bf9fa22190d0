"""Measure the distance of every row from the visible surface: from a mesh or, of anchors and large models, by depth."""

from pathlib import Path

from gspure.arrays import save_array
from gspure.cameras.splits import read_split
from gspure.model import model_file
from gspure.opencl.device import choose_device
from gspure.provenance import bind_rows
from gspure.schemes.registry import read_public_model
from gspure.surface.distances import depth_distances, mesh_distances
from gspure.surface.meshing import extract_mesh, opaque, smoothed
from gspure.workflow.step import run

MOST_OPAQUE = 250_000  # Gaussians for a mesh; their tetrahedra take a few minutes and gigabytes


def measure(model: Path, cameras: Path, surface: Path, scheme: str | None) -> None:
    public = read_public_model(model, scheme).drawable(model)
    views = read_split(cameras, "train")
    device = choose_device()
    if public.rows_are_gaussians and opaque(public.model).sum() <= MOST_OPAQUE:
        smooth = smoothed(public.model, views)
        distances = mesh_distances(smooth, extract_mesh(smooth, views, device))
    else:
        distances = depth_distances(public, views, device)
    save_array(surface, distances)
    bind_rows(model_file(model), surface)


run(measure)
