"""``gspure prune``: the prune mask, and a diagnosis of the clustering."""

from gspure.cli.method_options import add_factors
from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure prune --clusters clusters.npz --weights weights.npy --out prune_mask.npy
  gspure prune --clusters clusters.npz --weights weights.npy --model point_cloud.ply --out prune_mask.npy \\
      --diagnosis diagnosis.json
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--clusters", "NPZ", "clusters, from `gspure cluster`")
    parser.reads(
        "--weights", "NPY", "weights, from `gspure weights`; or opacities, from `gspure opacities`, to prune by opacity"
    )
    add_factors(parser)
    parser.writes("--out", "NPY", "bool [K], true where pruned")
    parser.writes("--diagnosis", "JSON", "also write the diagnosis here", required=False)
    parser.reads("--model", "PLY", "also list the suspicious rows of this model in the diagnosis", required=False)


def run(args: Arguments) -> None:
    import numpy as np

    from gspure.artifacts import facts_of, load_array, require_kind, save_array, write_json, write_record
    from gspure.method.clusters import read_clusters
    from gspure.method.diagnosis import diagnose
    from gspure.method.pruning import prune_mask
    from gspure.model import model_file, read_model
    from gspure.model.suspicious import suspicious_rows, to_json

    model = read_model(args.model) if args.model else None
    quantity = require_kind(args.weights, "weights", "opacities")
    labels, coincident = read_clusters(args.clusters)
    geometry = facts_of(args.clusters).get("model") or facts_of(args.weights).get("model", "")
    weights = load_array(args.weights, dtype=np.float32, shape=(len(labels),), least=0)
    diagnosis = diagnose(labels, weights, args.tau_c, args.tau_n, coincident, quantity)
    inputs = {"clusters": args.clusters, "weights": args.weights}
    if args.model:
        inputs["model"] = model_file(args.model)
    settings = {"tau_c": args.tau_c, "tau_n": args.tau_n}
    if args.diagnosis:
        suspects = {"suspicious": to_json(suspicious_rows(model))} if model else {}
        write_json(args.diagnosis, diagnosis.to_json() | suspects)
        write_record(args.diagnosis, inputs=inputs, settings=settings, geometry=geometry)
    save_array(args.out, prune_mask(labels, weights, args.tau_c, args.tau_n))
    write_record(args.out, inputs=inputs, settings=settings, geometry=geometry, kind="prune_mask")
    print("\n".join(diagnosis.lines()))
