"""``gspure features``: standardized position, opacity and weight of every Gaussian."""

from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure features --model point_cloud.ply --weights weights.npy --out features.npy
  gspure features --model point_cloud.ply --weights weights.npy --opacities opacities.npy --out features.npy
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--model", "MODEL", "file of a 3DGS model")
    parser.reads("--weights", "NPY", "weights, from `gspure weights`")
    parser.reads("--opacities", "NPY", "from `gspure opacities` (default: as stored in the model)", required=False)
    parser.writes("--out", "NPY", "features: float64 [K,5]")


def run(args: Arguments) -> None:
    import numpy as np

    from gspure.artifacts import load_array, require_kind, save_array, write_record
    from gspure.method.features import features
    from gspure.model import model_file
    from gspure.schemes.registry import read_public_model

    public = read_public_model(args.model)
    model = public.drawable(args.model).model
    weights = load_array(args.weights, dtype=np.float32, shape=(len(model),), least=0)
    evidence = {"weights": args.weights}
    opacities = model.opacities
    if args.opacities:
        evidence["opacities"] = args.opacities
        opacities = load_array(args.opacities, dtype=np.float32, shape=(len(model),), least=0)
    for kind, path in evidence.items():
        require_kind(path, kind)
    save_array(args.out, features(model.means, opacities, weights))
    inputs = {"model": model_file(args.model), **evidence}
    write_record(args.out, inputs=inputs, settings={}, geometry=public.geometry_digest())
