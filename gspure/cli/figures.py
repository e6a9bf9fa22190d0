"""``gspure figures``: point clouds of a model, renderings side by side, and charts of outcomes."""

import math

from gspure.cli import image_figures, scheme_figures
from gspure.cli.image_figures import Drawn
from gspure.cli.method_options import add_factors
from gspure.cli.options import add_cameras, add_device, add_scheme, read_device, read_source
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError

_WHITE = (1.0, 1.0, 1.0)

EXAMPLES = """\
  gspure figures model --model point_cloud.ply --weights weights.npy --clusters clusters.npz \\
      --cameras cameras.json --out figures
  gspure figures panels --column before=before --column after=after --difference --out figures/views.png
  gspure figures attacks --table results.csv --name keyss/room --column truth=truth \\
      --column unattacked=unattacked/renders --column gspure=gspure/renders --out attacks.png
  gspure figures outcomes --table results.csv --name keyss/room --out figures/outcomes.png
  gspure figures sweep --table results.csv --condition keyss --point gspure=4,4 --point tau_n_1=1,4 --out sweep.png
  gspure figures tradeoff --table results.csv --condition keyss --out tradeoff.png
"""


def add_arguments(parser: Parser) -> None:
    """Add the kinds of figures, and the options of each."""
    kinds = parser.add_subparsers(title="figures", metavar="KIND", required=True)
    for name, (summary, add) in {**KINDS, **image_figures.KINDS, **scheme_figures.KINDS}.items():
        add(kinds.add_parser(name, help=summary))


def _add_model(parser: Parser) -> None:
    parser.reads("--model", "PLY", "the model that was purified")
    parser.reads("--weights", "NPY", "from `gspure weights`")
    parser.reads("--clusters", "NPZ", "from `gspure cluster`")
    add_factors(parser)
    parser.reads("--hidden", "NPY", "weights of the message, from `gspure hidden`", required=False)
    add_cameras(parser, "views for up direction and viewpoint", required=False)
    add_scheme(parser)
    add_device(parser)
    parser.writes(
        "--out",
        "DIR",
        "folder for clusters, ranks and kept (with --hidden also hidden) as .png, .gltf and .vtp; weights as .png and "
        ".svg; with --hidden purification.png; with --cameras splats.png; viewer.json for the report; the caption of "
        "each .png in its .png.json",
    )
    parser.set_defaults(draw=_draw_model)


def _add_outcomes(parser: Parser) -> None:
    parser.reads("--table", "CSV", "from `gspure table`")
    parser.text("--name", "SCHEME/SCENE", "the model whose variants to show", required=True)
    parser.writes("--out", "PNG|SVG|PDF", "the figure")
    parser.set_defaults(draw=_draw_outcomes)


def run(args: Arguments) -> None:
    """Draw the figures; write the caption, inputs and settings of each beside it, and print its path."""
    from gspure.artifacts import write_record

    captions, inputs, settings = args.draw(args)
    for path, caption in captions.items():
        write_record(path, inputs=inputs, settings={**settings, "caption": caption})
    print("\n".join(f"{path}: {caption}" for path, caption in captions.items()))


def _draw_model(args: Arguments) -> Drawn:
    import numpy as np

    from gspure.artifacts import filling, load_array, require_kind, write_record
    from gspure.figures.gallery import NAMES, Evidence, drawings
    from gspure.figures.splats import splats
    from gspure.figures.viewer import write_viewer
    from gspure.figures.viewpoint import world_axes
    from gspure.method.clustering.store import read_clusters
    from gspure.method.pruning import prune_mask
    from gspure.model.gaussians import COLOUR
    from gspure.model.signature import Signature
    from gspure.schemes.registry import read_public_model

    public = read_public_model(args.model, args.scheme).drawable(args.model)
    model = public.model
    shape = (len(model),)
    labels = read_clusters(args.clusters).labels
    if labels.shape != shape:
        raise InputError(args.clusters, "labels", expected=f"{len(model)}, as in {args.model}", found=str(len(labels)))
    require_kind(args.weights, "weights")
    if args.hidden:
        require_kind(args.hidden, "hidden")
    weights = load_array(args.weights, dtype=np.float32, shape=shape, least=0)
    evidence = Evidence(
        model.means,
        labels,
        weights,
        prune_mask(labels, weights, args.tau_c, args.tau_n),
        hidden=load_array(args.hidden, dtype=np.float32, shape=shape, least=0) if args.hidden else None,
        tau_c=args.tau_c,
        tau_n=args.tau_n,
        rows=Signature.of(model.names).rows,
    )
    cameras = read_source(args.cameras, args.model, up=args.up) if args.cameras else []
    sh_dc = model.columns(*COLOUR) if model.sh_degree >= 0 else None
    with filling(args.out, "viewer.json", *NAMES) as folder:
        write_viewer(folder / "viewer.json", evidence, world_axes(model.means, cameras), sh_dc)
        device = read_device(args) if cameras and public.visible else None
        figures = [*drawings(folder, evidence, cameras, public.scene(device, _WHITE) if device else None)]
        figures += [splats(folder, public, cameras, labels, evidence.pruned, device)] if device else []
        for figure in figures:
            figure.draw()
    names = ("model", "weights", "clusters", "hidden", "cameras")
    inputs = {name: path for name in names if (path := getattr(args, name))}
    captions = {args.out / figure.path.name: figure.caption for figure in figures}
    settings = {"tau_c": args.tau_c, "tau_n": args.tau_n}
    write_record(args.out / "viewer.json", inputs=inputs, settings=settings)
    return captions, inputs, settings


def _draw_outcomes(args: Arguments) -> Drawn:
    from gspure.evaluation.results import read_results
    from gspure.figures.plots import write_outcomes

    outcomes = [o for o in read_results(args.table) if f"{o.scheme}/{o.folder}" == args.name]
    if not outcomes:
        raise InputError(args.table, "scheme, scene", expected=args.name, found="no such row")
    write_outcomes(args.out, outcomes)
    against = "photographs" if all(o.against_truth for o in outcomes) else "renders of the unattacked model"
    caption = f"PSNR of every variant against {against}, mean over the views"
    if any(not math.isnan(o.score) for o in outcomes):
        caption += ", and its Score: drop of the message minus drop of the scene, in dB"
    elif any(not math.isnan(o.pruned_share) for o in outcomes):
        caption += ", and the share of the rows that it removed"
    return {args.out: caption + "."}, {"table": args.table}, {"name": args.name}


KINDS = {
    "model": ("point clouds (.png, .gltf, .vtp) and the histogram of weights", _add_model),
    "outcomes": ("PSNR of scene and message, and Score, of every variant", _add_outcomes),
}
