"""``gspure table``: one table of all variants of all models."""

from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path

from gspure.cli.options import add_files
from gspure.cli.parser import Arguments, Parser
from gspure.evaluation.names import model_name
from gspure.progress import warn

EXAMPLES = """\
  gspure table --metrics results/*/*/*/metrics.csv --out results.csv --markdown results.md
  gspure table --metrics results/keyss/room/*/metrics.csv --prune-masks results/keyss/room/*/prune_mask.npy \\
      --keys results/keyss/room/key --out results.csv --markdown results.md
  gspure table --metrics results/*/*/*/metrics.csv --out results.csv --markdown results.md \\
      --summary summary.csv --latex summary.tex                        # means over scenes, with intervals
"""


_FILES = {
    "--prune-masks": ("NPY", "masks of removed rows, below SCHEME/SCENE/VARIANT"),
    "--keys": (
        "DIR",
        "owners' keys, below SCHEME/SCENE; message_rows.npy in them gives precision and recall",
    ),
    "--verdicts": ("JSON", "verdict.json of `gspure attack`, below SCHEME/SCENE/VARIANT"),
    "--failures": ("JSON", "statuses of failed jobs of the workflow: the reasons for missing metrics"),
    "--retrievals": ("CSV", "retrieval.csv of `gspure retrieve`, in folders SCHEME/SCENE"),
    "--detections": ("CSV", "readings of `gspure detect`, in folders SCHEME/SCENE/VARIANT/detections"),
}


def add_arguments(parser: Parser) -> None:
    parser.reads("--metrics", "CSV", "files SCHEME/SCENE/VARIANT/metrics.csv", nargs="*")
    add_files(parser, _FILES)
    meaning = "how a model was trained: only equal conditions are averaged and compared"
    parser.pairs("--condition", "SCHEME/SCENE=PROTOCOL,INITIALIZATION", meaning, _condition)
    parser.writes("--out", "CSV", "one row per variant and target")
    parser.writes("--markdown", "MD", "the same as readable tables")
    parser.writes("--summary", "CSV", "means over scenes, with intervals", required=False)
    parser.writes("--latex", "TEX", "the summary as a LaTeX table", required=False)


def _condition(text: str) -> tuple[str, str]:
    protocol, initialization = text.split(",")
    return protocol, initialization


def run(args: Arguments) -> None:
    from gspure.artifacts import write_record, write_text
    from gspure.attacks.registry import BUILT_IN
    from gspure.evaluation.csv_tables import write_table
    from gspure.evaluation.origins import measured_images, recorded_attacks, recorded_models
    from gspure.evaluation.outcomes import collect
    from gspure.evaluation.recall import MESSAGE_ROWS
    from gspure.evaluation.results import write_results
    from gspure.evaluation.summary import Summary, summarize
    from gspure.evaluation.survival import not_embedded
    from gspure.report.tables import results_markdown, summary_table

    truth = [mask for key in args.keys if (mask := key / MESSAGE_ROWS).is_file()]
    files = (args.prune_masks, truth, args.verdicts, args.failures, args.retrievals, args.detections)
    outcomes = collect(args.metrics, *files, conditions=args.condition, attacks=[a.name for a in BUILT_IN])
    write_results(args.out, outcomes)
    inputs = {path.as_posix(): path for path in (*args.metrics, *chain(*files))}
    images = measured_images(args.metrics)
    settings = {"conditions": args.condition, "images": images}
    settings |= {"attacks": recorded_attacks(args.metrics), "models": recorded_models(args.metrics)}
    write_record(args.out, inputs=inputs, settings=settings, kind="table")
    write_text(args.markdown, results_markdown(outcomes), checksum=True)
    _warn_of_repeated_scenes(images, args.metrics, args.condition)
    for o in outcomes:
        for extraction in filter(o.contradicts, o.reached):
            warn(
                f"{model_name(o.scheme, o.folder)}, {o.variant}: the extraction {extraction} changed, although no "
                "column of its declared carrier did. Add the missing columns to the carrier. The attack counts as "
                "having reached the message"
            )
    for scheme, folder in not_embedded(outcomes):
        warn(
            f"{model_name(scheme, folder)}: no message is embedded, or the key does not match the model: even before "
            "any attack, the extracted message is a single colour, is not better than every negative control, or is "
            "not retrieved. Attacks on this model show nothing; look at the extraction."
        )
    if args.summary:
        write_table(args.summary, Summary, summarize(outcomes))
        write_record(args.summary, inputs={"table": args.out}, settings={})
    if args.latex:
        write_text(args.latex, summary_table(outcomes).latex(), checksum=True)


def _warn_of_repeated_scenes(
    images: Mapping[str, Sequence[str]],
    metrics: Sequence[Path],
    conditions: Mapping[str, tuple[str, str]],
) -> None:
    """Warn of models with identical renders before any attack, and of scenes with the same reference images."""
    from gspure.artifacts import settings_of
    from gspure.evaluation.names import UNATTACKED

    first: dict[tuple[str, ...], str] = {}
    for name, digests in images.items():
        scheme, folder, variant = name.rsplit("/", 2)
        alike = (scheme, *conditions.get(f"{scheme}/{folder}", ()), *digests)
        if digests and variant == UNATTACKED and (twin := first.setdefault(alike, folder)) != folder:
            counted = "both count as scenes, so intervals are too narrow; remove one model"
            if folder.partition("@")[0] == twin.partition("@")[0]:
                counted = "the repetition adds no evidence, and the scheme may ignore its seed"
            warn(f"{model_name(scheme, folder)}: the renders are identical to those of {twin}; {counted}")
    scene_of: dict[tuple[str, ...], str] = {}
    for table in (path for path in metrics if path.resolve().parent.name == UNATTACKED):
        scheme, folder = table.resolve().parts[-4:-2]
        scene, references = folder.partition("@")[0], settings_of(table).get("references", {})
        alike = (scheme, *conditions.get(f"{scheme}/{folder}", ()), *map(str, sorted(references.items())))
        if references and (twin := scene_of.setdefault(alike, scene)) != scene:
            counted = "count as separate scenes, so intervals are too narrow"
            warn(f"{model_name(scheme, folder)} and {twin} have the same reference images, but {counted}")
