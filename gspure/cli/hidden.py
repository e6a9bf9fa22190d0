"""``gspure hidden``: the share of the message's weight on rows that plain_weight prunes."""

from gspure.cli.options import add_device, add_energy, add_views, read_device, read_views
from gspure.cli.parser import Arguments, Parser
from gspure.cli.weights import add_reduction
from gspure.settings import FACTOR

EXAMPLES = """\
  gspure hidden --model marked/public/point_cloud.ply --scheme splats_in_splats --key marked/key \\
      --cameras pair/cameras.json --weights weights.npy --out hidden.json

The message is the scheme's last extraction, the most complete one (Splats in Splats: message_oracle).
"""


def add_arguments(parser: Parser) -> None:
    parser.reads("--model", "MODEL", "the watermarked model's file")
    parser.text("--scheme", "NAME", "the watermarking scheme", required=True)
    parser.reads("--key", "DIR", "the owner's key")
    add_views(parser, split="train")
    parser.reads("--weights", "NPY", "weights, from `gspure weights`")
    parser.writes("--out", "JSON", "the share, 0 to 1, or null")
    parser.writes("--hidden", "NPY", "also write the message's weight of every row: [K]", required=False)
    parser.number("--tau-n", "TAU", "weights below the mean weight / TAU are low (default: the scheme's tau_n)", FACTOR)
    add_reduction(parser)
    add_energy(parser, "ray", "ewa", "center_ray")
    add_device(parser)


def run(args: Arguments) -> None:
    """Measure, print and write."""
    import numpy as np

    from gspure.artifacts import (
        embedding_of,
        load_array,
        require_agreement,
        require_embedding,
        require_kind,
        save_array,
        settings_of,
        write_json,
        write_record,
    )
    from gspure.model import model_file
    from gspure.model.finite import undrawable_rows
    from gspure.progress import percent, warn
    from gspure.schemes.hidden_weight import hidden_weights, share_on_low
    from gspure.schemes.registry import find_scheme, geometry_of, read_public_model

    scheme = find_scheme(args.scheme)
    views = read_views(args)
    require_embedding(embedding_of(model_file(args.model)), args.key)
    public, key = read_public_model(args.model, args.scheme), scheme.read_key(args.key)
    weights = load_array(args.weights, dtype=np.float32, shape=(len(public.model),), least=0)
    require_kind(args.weights, "weights")
    settings = {name: getattr(args, name) for name in ("energy", "reduction", "split")}
    hint = "measure the message as the weights"
    require_agreement(args.out, args.weights, settings, settings_of(args.weights), hint)
    extraction = list(scheme.extractions)[-1]  # the most complete
    drawn = np.delete(np.arange(len(weights)), undrawable_rows(public.model))
    hidden, public = np.zeros(len(weights), np.float32), public.drawn(args.model)
    hidden[drawn] = hidden_weights(public, key, extraction, views, args.energy, read_device(args), args.reduction)
    tau_n = scheme.tau_n if args.tau_n is None else args.tau_n
    share = share_on_low(weights, hidden, tau_n) if hidden.any() else None
    inputs = {"model": model_file(args.model), "cameras": args.cameras}
    settings |= {"scheme": scheme.name, "tau_n": tau_n}
    write_json(args.out, {"hidden_low_share": share})
    write_record(args.out, inputs={**inputs, "weights": args.weights}, settings=settings)
    if args.hidden:
        save_array(args.hidden, hidden)
        write_record(args.hidden, inputs=inputs, settings=settings, geometry=geometry_of(args.model), kind="hidden")
    if share is None:
        warn("no row holds weight of the message: no message is embedded, or the key does not match the model")
    else:
        print(f"{percent(share)} of the message's weight is on rows that plain_weight prunes")
