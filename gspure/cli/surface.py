"""``gspure surface``: the distance of every row from the visible surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gspure.cli.options import add_device, add_scheme, add_views, read_device, read_views
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gspure.cameras import Camera
    from gspure.files import Float32
    from gspure.opencl.device import Device
    from gspure.public_model import PublicModel

EXAMPLES = """\
  gspure surface --model point_cloud.ply --cameras cameras.json --out surface.npy --mesh mesh.ply
  gspure surface --model point_cloud.ply --cameras cameras.json --out surface.npy --method depth
"""

METHODS = ("mesh", "depth")
MOST_OPAQUE = 250_000  # for which a mesh is the default; tetrahedra then take a few minutes and gigabytes; ours


def add_arguments(parser: Parser) -> None:
    parser.reads("--model", "MODEL", "the model's file")
    add_scheme(parser)
    add_views(parser, split="train")
    parser.writes("--out", "NPY", "distances in scales: float32 [K]")
    parser.choice(
        "--method",
        METHODS,
        "mesh: from the level set of the opacity field; depth: from the views' median depths (default: mesh; "
        f"depth of anchors, and of models with more than {MOST_OPAQUE} opaque Gaussians)",
    )
    parser.writes("--mesh", "PLY", "also write the mesh", required=False)
    add_device(parser)


def run(args: Arguments) -> None:
    from gspure.artifacts import save_array, write_record
    from gspure.attacks.pruning import TOLERANCE
    from gspure.model import model_file
    from gspure.schemes.registry import geometry_of, read_public_model
    from gspure.surface.distances import depth_distances

    stored = read_public_model(args.model, args.scheme)
    public = stored.drawable(args.model)
    method = args.method or _default_method(public)
    if method == "depth" and args.mesh:
        raise InputError(args.model, "--mesh", expected="method mesh", found="method depth, which has none")
    views, device = read_views(args), read_device(args)
    distances = _from_mesh(args, public, views, device) if method == "mesh" else depth_distances(public, views, device)
    save_array(args.out, distances)
    inputs, geometry = {"model": model_file(args.model), "cameras": args.cameras}, geometry_of(args.model)
    settings = {"split": args.split, "method": method}
    for path in filter(None, (args.out, args.mesh)):
        write_record(path, inputs=inputs, settings=settings, geometry=geometry, kind="surface")
    near = int((distances <= TOLERANCE).sum())
    print(f"method {method}: {near} of {len(distances)} rows within {TOLERANCE:g} scales of the surface")


def _default_method(public: PublicModel) -> str:
    from gspure.surface.meshing import opaque

    return "mesh" if public.rows_are_gaussians and opaque(public.model).sum() <= MOST_OPAQUE else "depth"


def _from_mesh(args: Arguments, public: PublicModel, views: Sequence[Camera], device: Device) -> Float32:
    """Return the distances from the mesh, and write it if ``--mesh`` is set."""
    from gspure.model.points import write_mesh_ply
    from gspure.surface.distances import mesh_distances
    from gspure.surface.meshing import extract_mesh, smoothed

    if not public.rows_are_gaussians:
        hint = "the Gaussians of anchors depend on the view; use method depth"
        raise InputError(args.model, "rows", expected="Gaussians, for a mesh", found="anchors", hint=hint)
    model = smoothed(public.model, views)
    mesh = extract_mesh(model, views, device)
    if args.mesh:
        write_mesh_ply(args.mesh, mesh)
    return mesh_distances(model, mesh)
