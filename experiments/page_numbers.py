"""The measured numbers of the pages: the text around them, where ``#`` stands for each, and what committed tables say.

``python -m experiments.page_numbers`` prints them; a test compares them with the pages.
"""

import csv
import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from gspure.metrics.proof import SIGNIFICANCE
from gspure.text import p_value
from gspure.workflow.config import DEFAULT_VARIANTS
from tests.comparison import FLIP, TIGHT

ROOT = Path(__file__).parents[1]
SUITES = ROOT / "gspure" / "workflow" / "suites"
NUMBER = re.compile(r"-?\d[\d,]*(?:\.\d+)?(?:e[+-]\d+)?")


@cache
def rows_of(table: str) -> list[dict[str, str]]:
    """Return the rows of a table of experiments/tables/ or, named by a path, of experiments/results/ or benchmarks/."""
    places = [ROOT / "experiments" / "results" / table, ROOT / table] if "/" in table else []
    places.append(ROOT / "experiments" / "tables" / table)
    path = next(place.with_suffix(".csv") for place in places if place.with_suffix(".csv").is_file())
    with path.open(newline="", encoding="utf-8") as file:
        return [*csv.DictReader(file)]


def cells(table: str, column: str, *keys: str, place: int = 0) -> list[float]:
    """Return the numbers of a column, by their place in its cells, in the rows that have all keys among their cells."""
    texts = [row[column] for row in rows_of(table) if {*keys} <= {*row.values()}]
    return [float(NUMBER.findall(text)[place].replace(",", "")) for text in texts]


def cell(table: str, column: str, *keys: str, place: int = 0) -> float:
    """Return the number of the only row that has all keys among its cells."""
    (number,) = cells(table, column, *keys, place=place)
    return number


def across(table: str, columns: str, *keys: str) -> list[float]:
    """Return the numbers of several columns in one row; `columns` are separated by ``|``."""
    return [cell(table, column, *keys) for column in columns.split("|")]


def down(table: str, column: str, *keys: str) -> list[float]:
    """Return the numbers of one column in the rows that have one of the keys each."""
    return [cell(table, column, key) for key in keys]


def same(numbers: list[float]) -> list[float]:
    """Return the one number that all share."""
    (number,) = {*numbers}
    return [number]


@cache
def benchmark(title: str, name: str, kind: str = "") -> float:
    """Return a time of a benchmark in ms (CPU time per core; of GPUs, wall time), else its figure of this name."""
    found: list[dict[str, Any]] = json.loads((ROOT / "benchmarks" / f"results{kind}.json").read_text())["found"]
    (benchmark,) = [one for one in found if one["title"] == title]
    if name in benchmark["times_ms"]:
        return float(benchmark["times_ms"][name]["wall_median" if kind else "cpu_per_core_median"])
    return float(next(figure["value"] for figure in benchmark["figures"] if figure["name"] == name))


def on_both(title: str, name: str, gpu_name: str = "") -> list[float]:
    """Return a number on CPU and GPU."""
    return [benchmark(title, name), benchmark(title, gpu_name or name, "-gpu")]


def patterns(*keys: str) -> list[float]:
    """Return damage and readings of a keyed pattern after an attack."""
    return across("keyed_pattern", "damage|z rows|z clean model|z bank", *keys)


def messages_of(*keys: str) -> list[float]:
    """Return the PSNR of GS-Hider's messages in two pairs, of the authors' program or of ours."""
    return [cell("authors", "message_psnr", pair, "gs_hider", *keys) for pair in ("room", "land")]


def over_scenes(attack: str) -> list[float]:
    """Return, over scenes, the least and largest damage of an attack, the number of proven scenes, and the fewest bits.

    `attack` is a variant of the audit, or an attack or its strength in survival.csv.
    """
    known = [*rows_of("survival/results"), *rows_of("survival_weaker/results"), *rows_of("survival")]
    rows = [row for row in known if attack in (row.get("variant", row["attack"]), row.get("strength"))]
    damages = [float(row["damage"]) for row in rows]
    proven = sum(float(row["p"]) <= SIGNIFICANCE for row in rows)
    bits = [float(row.get("correct") or row["correct bits of 32"]) for row in rows]
    return [min(damages), max(damages), proven, min(bits)]


def trained_longer(scheme: str) -> float:
    """Return how far the PSNR of a model trained on renders is above the public model's, dB."""
    before, after = (cell("price", "scene PSNR", scheme, iterations) for iterations in ("0", "4000"))
    return after - before


def faster(table: str) -> list[float]:
    """Return the PSNR of the fast schedule minus that of the vanilla one, dB, by seed."""
    pairs = zip(cells(table, "PSNR", "fast"), cells(table, "PSNR", "vanilla"), strict=True)
    return [fast - vanilla for fast, vanilla in pairs]


def gauged(scheme: str) -> list[float]:
    """Return the least PSNR of the message before `gauge`, and the largest after it, dB."""
    before, after = (cells("free_attacks", "published_psnr", scheme, attack) for attack in ("unattacked", "gauge"))
    return [min(before), max(after)]


def finetuned() -> list[float]:
    """Return how far fine-tuning lowers the PSNR of the message of Splats in Splats, dB, by scene."""
    tables = [f"large/{scene}_shared" for scene in ("land", "lands", "object", "rooms_2", "rooms", "view")]
    before, after = (
        [cell(table, "message_psnr", variant) for table in tables] for variant in ("unattacked", "finetune")
    )
    return [high - low for high, low in zip(before, after, strict=True)]


def wrong_messages(column: str, twins: str) -> float:
    """Return the sum of a column over the wrong messages in published extractions, tested with this many twins."""
    published = [row for row in rows_of("wrong_claims") if (row["owner"], row["twins"]) == ("published", twins)]
    return sum(float(row[column]) for row in published if row["group"] == "wrong message")


def shown_by_the_demo(variant: str) -> list[float]:
    """Return a row of the demo's verdict: damage, PSNR, legible blocks in percent, p-value."""
    published = [row for row in rows_of("demo/results") if row["owner"] == "published"]
    (row,) = [row for row in published if (row["scheme"], row["variant"]) == ("splats_in_splats", variant)]
    return [
        float(row["damage"]),
        float(row["message_psnr"]),
        100 * float(row["legibility"]),
        float(p_value(float(row["p"]))),
    ]


def attacks_of(suite: str) -> float:
    """Return the number of attacks of a suite, each strength counted."""
    variants = yaml.safe_load((SUITES / f"{suite}.yaml").read_text())["variants"]
    return sum(len(settings.get("damage", [None])) for name, settings in variants.items() if name != "unattacked")


def graded_alike(least: float, word: str) -> float:
    """Return the number of extractions for which a least legibility and the word of the first viewer agree."""
    return sum((float(row["legibility"]) >= least) == (row["viewer_1"] == word) for row in rows_of("legibility"))


def whole_bits(attack: str) -> list[float]:
    """Return the strengths of an attack after which held-out views show all bits of both schemes."""
    columns = [f"{scheme}: held-out views, %" for scheme in ("marked_clones", "rendered_bits")]
    whole = [row for row in rows_of("image-attacks") if all(row[column] == "100.0" for column in columns)]
    return [float(NUMBER.findall(row["strength"])[0]) for row in whole if row["attack"] == attack]


SMALL, LARGE = "100k @960x540", "1M @1600x1063"
TRAINED_SMALL, TRAINED = "100k @320x240", "200k @640x480"
CASES, TRAININGS = (SMALL, LARGE), (TRAINED_SMALL, TRAINED)
PER_SECOND = ("iterations per second, CPU / cores", "iterations per second, wall")


def stages(figure: str) -> list[float]:
    return [benchmark(f"stages [{case}-ewa]", figure) for case in CASES]


def training(figure: str, benchmarks: str = "stages of training") -> list[float]:
    return [benchmark(f"{benchmarks} [{case}]", figure) for case in TRAININGS]


def gsplat(figure: str) -> list[float]:
    return [benchmark(f"gsplat [{case}]", figure, "-gpu") for case in CASES]


def growth(figure: str, *counts: str) -> list[float]:
    return [benchmark("clustering with gaussians", f"{count} Gaussians: {figure}") for count in counts]


COUNTS = ("50,000", "1,000,000", "6,000,000")
PURIFIED = ("purify [1M]", "purify [6M]")
OWNERS = "GS-Hider, own poses"
PROGRAMS = "benchmarks/cuda_free"
UNRELATED = "30 unrelated models"
FIRST_STEPS = "first 3000 of 30000"
INRIAS = "liruilong940607/gaussian-splatting"
AUDITED = float(len(DEFAULT_VARIANTS) - 1)
SEEN = [float(row["legibility"]) for row in rows_of("legibility") if row["viewer_1"] != "nothing"]

INTERLEAVED = "16 copies, interleave,"
FINER = "bank also of clip=0.005, clip=0.0075"

NUMBERS: dict[str, dict[str, list[float]]] = {
    "README.md": {
        "proof) is at most #. Photographed": same(
            [float(row["level"]) for row in rows_of("demo/results") if row["level"]]
        ),
        "`audit` runs # [attacks](docs/attacks.md) (# with a key)": [AUDITED, attacks_of("small-1")],
        "GOF # # #% # traces": shown_by_the_demo("gof"),
        "feature scaling # # #% # gone": shown_by_the_demo("feature_scaling"),
        "GSPure # # #% # key-only": shown_by_the_demo("gspure"),
        "random pruning # # #% # readable": shown_by_the_demo("random_pruning"),
        "gone at # dB of damage (feature scaling)": shown_by_the_demo("feature_scaling")[:1],
        "image of 1M Gaussians at 1600x1063 | # ms | # ms": on_both(f"views [{LARGE}]", "image (ewa)"),
        "contributions to that view | # ms | # ms": on_both(f"views [{LARGE}]", "contributions (ray)"),
        "200k Gaussians | # steps/s | # steps/s": on_both(f"iteration [{TRAINED}]", *PER_SECOND),
    },
    "config/README.md": {
        "--key KEY`): # attacks": [attacks_of("small-1")],
        "`gspure audit` runs the # attacks of the default": [AUDITED],
    },
    "benchmarks/README.md": {
        "image, `ewa`, 100k Gaussians @960x540, ms | # | #": on_both(f"views [{SMALL}]", "image (ewa)"),
        "contributions, `ray`, 100k @960x540, ms | # | #": on_both(f"views [{SMALL}]", "contributions (ray)"),
        "image, `ewa`, 1M @1600x1063, ms | # | #": on_both(f"views [{LARGE}]", "image (ewa)"),
        "contributions, `ray`, 1M @1600x1063, ms | # | #": on_both(f"views [{LARGE}]", "contributions (ray)"),
        "per second, 100k @320x240 | # | #": on_both(f"iteration [{TRAINED_SMALL}]", *PER_SECOND),
        "per second, 200k @640x480 | # | #": on_both(f"iteration [{TRAINED}]", *PER_SECOND),
        "image, 100k and 1M | – | #, #": gsplat("gspure / gsplat, image, wall"),
        "image and gradients, 100k and 1M | – | #, #": gsplat("gspure / gsplat, image and gradients, wall"),
        "contributions, `ray`, @1600x1063 (another benchmark), ms | # | # | #": [
            benchmark("contributions with gaussians", f"{count} Gaussians") for count in COUNTS
        ],
        "CPU seconds per million Gaussians | # | # | #": growth("CPU seconds per million Gaussians", *COUNTS),
        "20 views, CPU seconds | | # | #": [
            benchmark(title, "20 views, clusters, pruning, metrics, figures: CPU seconds") for title in PURIFIED
        ],
        "peak memory, GB | | # | #": [benchmark(title, "peak memory, GB") for title in PURIFIED],
        "FMA peak, 100k, 1M | .40, .33 | #, #": [
            benchmark(f"blending against the peak [{case}]", "blend, share of FMA, OpenCL") for case in CASES
        ],
        "`ray` / `ewa`, 100k, 1M | 1.15 | #, #": [
            benchmark(f"views [{case}]", "contributions (ray) / contributions (ewa)") for case in CASES
        ],
        "(sort + bin) / blend, 100k, 1M | .45 | #, #": stages("(sort + bin) / blend"),
        "project / blend, 100k, 1M | .2 | #, #": stages("project / blend"),
        "200k @640x480 | 2.0 | #, #": training("blend backward / blend"),
        "(loss + Adam) / backward, same cases | .6 | #, #": training("(loss + Adam) / blend backward"),
        "iteration / frame, same cases | 2.6, 2.5 | #, #": training("iteration / frame", "iteration"),
        "gsplat's, wall, 100k, 1M | 1.5 | #, #": gsplat("gspure / gsplat, image, wall"),
        "| steps | 1.6, 1.3 | # | # |": cells(PROGRAMS, "step"),
        "than gspure's passes | | # | # |": cells(PROGRAMS, "step, with gspure's passes"),
        "| rasterizer / gspure's passes | | # | # |": cells(PROGRAMS, "rasterizer"),
    },
    "docs/attacks.md": {
        "`densify` costs # dB, `split` # dB, `distil` # dB and `remesh` # dB": down(
            "arsenal", "damage", "densify", "split", "distil", "remesh"
        ),
        "by up to # (at most # of # pixels)": [
            max(cells("free_attacks", column, "gauge")) for column in ("largest_change", "changed_pixels", "pixels")
        ],
        "from at least # to at most # dB for GS-Hider": gauged("gs_hider"),
        "from # to # for SecureGS": gauged("secure_gs"),
        "and from # to # for KeySS": gauged("keyss"),
        "cropping to # % of the area, or # times the": [
            100 * min(whole_bits("resized_crop")),
            max(whole_bits("brightness")),
        ],
        "is # to #; that of the audited seed (# to #) proves": [
            min(cells("free_attacks", "least_trace", "gs_hider", "gauge")),
            max(cells("free_attacks", "largest_trace", "gs_hider", "gauge")),
            min(cells("free_attacks", "published_trace", "gs_hider", "gauge")),
            max(cells("free_attacks", "published_trace", "gs_hider", "gauge")),
        ],
        "Splats in Splats (PSNR at most # dB), and lowers the scene's PSNR by at most # dB": [
            max(cells("free_attacks", "published_psnr", "splats_in_splats", "half_precision")),
            max(cells("free_attacks", "damage", "half_precision")),
        ],
    },
    "docs/cuda-free.md": {
        "ConcealGS 3c3c3d7c, inria-2023: # dB, # CPU s": across("programs", "psnr|cpu_seconds", "zxk1212/ConcealGS"),
        "gsplat-1.4: # dB, # CPU s": across("programs", "psnr|cpu_seconds", "room", INRIAS),
        "6c570d6e, feature-3dgs: # dB, # CPU s": across("programs", "psnr|cpu_seconds", "ShijieZhou-UCLA/feature-3dgs"),
        "iterations, reaches # dB in # CPU s": across("programs", "psnr|cpu_seconds", "room", "gspure, own schedule"),
        "(in the fork with gsplat) reaches # dB": [cell("programs", "psnr", "room", INRIAS)],
        "takes [# to # times]": sorted(cells(PROGRAMS, "step")),
        "room and # dB on photographs of a figure": [cell("programs", "psnr", "plush", INRIAS)],
        "(../experiments/inria_schedule.py) # and #": [
            cell("programs", "psnr", scene, "gspure, INRIA's schedule") for scene in ("room", "plush")
        ],
    },
    "docs/limits.md": {
        "`distil` for #, #, # and # iterations": cells("price", "iterations", "splats_in_splats")[1:],
        "4000 iterations (# to # CPU seconds)": [
            least_or_most(cells("price", "CPU-s", "4000")) for least_or_most in (min, max)
        ],
        "its PSNR is # dB below the public model's for Splats in Splats, # dB for SecureGS and # dB for KeySS": [
            -trained_longer(scheme) for scheme in ("splats_in_splats", "secure_gs", "keyss")
        ],
        "and # and # dB above for Marked Clones and GS-Hider": [*map(trained_longer, ("marked_clones", "gs_hider"))],
    },
    "docs/marks-that-survive.md": {
        **{
            f"{title} | # to # | # | # |": over_scenes(attack)
            for title, attack in {
                "embedding alone": "embedding",
                "`gspure`": "gspure",
                "`distil`, 1500 steps": "distil",
                "the same, then rotated by 30°, scaled by 1.1": "distil, rigid_transform",
                "`warp` for 2 dB": "warp@2dB",
                "`crop` to 0.9": "crop",
                "`gaussian_noise`, until the proof ends": "noise_until_gone",
                "`unmark`, clip 0.03, four passes": "clip=0.03 passes=4",
                "`unmark`, clip 0.015, two passes, then `distil`": "unmark, distil",
                "collusion), mean": "16 copies, mean",
                "16 copies, interleaved": "16 copies, interleave",
                "the same, then `unmark`, clip 0.006, one pass": f"{INTERLEAVED} clip=0.006 passes=1",
                "the same, two more references": f"{INTERLEAVED} clip=0.006 passes=1, {FINER}",
            }.items()
        },
        "noise ends the proof at the least damage, # to # dB": over_scenes("noise_until_gone")[:2],
        "a weak `unmark` end the proof** in all scenes at # to # dB, in five at # to # (clip": [
            *over_scenes(f"{INTERLEAVED} clip=0.006 passes=1")[:2],
            *over_scenes(f"{INTERLEAVED} clip=0.004 passes=1")[:2],
        ],
        "blinds the reading of rows (z #)": [abs(patterns("distil", "2000 steps")[1])],
        "clean model (#), not that against the bank (#)": patterns("unmark", "clip=0.02 passes=3")[2:],
        "only the reading of rows survives (#)": [cell("keyed_pattern", "z rows", "fraction=0.5")],
        "Of # pairs of key and unmarked model": [
            cell("keyed_pattern-keys", "value", "models without a mark") * cell("keyed_pattern-keys", "value", "keys")
        ],
        "# have $p \\le 0.001$ (95 %, if independent: # to #": [
            cell("keyed_pattern-keys", "value", "false positives at p <= 0.001"),
            *(cell("keyed_pattern-keys", "value", "their rate", place=place) for place in (1, 2)),
        ],
        "message read from the model, has $p = #$": same(cells("forgery", "p", "keyed_pattern", "searched key")),
        "forger's mark reach $p$ # and #;": cells("forgery", "p", "subtracted"),
        "keys ignored the clean model, $#$": same(cells("forgery", "p", "subtracted, keys without digest")),
        "shows that owner's key ($p = #$)": same(cells("forgery", "p", "keyed_pattern", "copied mark")),
        "damage-and-fidelity) # and # dB": cells("forgery", "fidelity dB", "keyed_pattern", "copied mark"),
        "resist this ($p$ #, #)": cells("forgery", "p", "rendered_bits", "copied mark"),
        "in all # held-out ones": [cell("bits-renders", "renders", "keyed_pattern", "32", "the marked model")],
        "of # from # unrelated models, # and # have $p < 0.01$": [
            *(cell("bits-renders", column, "keyed_pattern", "32", UNRELATED) for column in ("renders", "renders of")),
            *cells("bits-renders", "above 0.01", "keyed_pattern", UNRELATED),
        ],
        "has $p < 0.001$ in # and #, $p < 10^{-6}$ in # and #;": [
            number
            for rate in ("0.001", "1e-06")
            for number in cells("bits-renders", f"above {rate}", "rendered_bits", "the marked model")
        ],
        "in 12 views takes # CPU seconds, ranking a million keys #": down(
            "keyed_pattern-keys", "value", "CPU s: renders and cells", "CPU s: rank among 1000000 keys"
        ),
    },
    "docs/numerics.md": {
        "or order) may differ by #.": [FLIP],
        "relative error of # in the mean, # at the 99 % quantile and # at most": [TIGHT / 5, TIGHT, 20 * TIGHT],
    },
    "docs/scan.md": {
        "come from # clean files: # models of # procedural scenes, # to # rows": [
            sum(cells("scan", "models", "clean")),
            cell("scan", "models", "clean", "unattacked"),
            float(len({row["scene"] for row in rows_of("scan/models") if row["family"] == "clean"})),
            min(cells("scan/models", "rows", "clean", "unattacked")),
            max(cells("scan/models", "rows", "clean", "unattacked")),
        ],
        "they flag # % by the file alone and # % with cameras": [
            100 * sum(cells("scan", column, "clean")) / sum(cells("scan", "models", "clean"))
            for column in ("detected", "detected with cameras")
        ],
        "reveals all Splats in Splats (#, and #": [
            cell("scan", "detected", family, "unattacked")
            for family in ("splats_in_splats", "splats_in_splats_hardened")
        ],
        "models (#), also after random pruning": [cell("scan", "detected", "marked_clones", "unattacked")],
        "are no longer flagged (AUC # to #)": [
            least_or_most(
                cell("scan", "AUC", family, "gspure") for family in ("keyss", "marked_clones", "encrypted_bits")
            )
            for least_or_most in (min, max)
        ],
        "KeySS (# of #; AUC #)": across("scan", "detected|models|AUC", "keyss", "unattacked"),
        "encrypted bits (# of #; AUC #)": across("scan", "detected|models|AUC", "encrypted_bits", "unattacked"),
        "after fine-tuning, # of # and # of #": [
            number
            for family in ("keyss", "encrypted_bits")
            for number in across("scan", "detected|models", family, "finetune")
        ],
        "none of # is detected": [cell("scan", "models", "secure_gs", "unattacked")],
        "Of # downloaded": [float(len(cells("scan/models", "rows", "found")))],
        "one is unlike (# rows)": [cell("scan/models", "rows", "found", "unlike the calibration models")],
        "in #, 8-bit colours": [
            float(sum(not row["bit_entropy"] for row in rows_of("scan/models") if row["verdict"] == "nothing found"))
        ],
    },
    "docs/schemes.md": {
        "messages have # and # dB after the first": messages_of("authors"),
        "program, # to # and # to # dB after the same steps": [
            extreme(cells("authors", "message_psnr", pair, "gs_hider", "ours", FIRST_STEPS))
            for pair in ("room", "land")
            for extreme in (min, max)
        ],
        "of ours, and # and # dB by our": messages_of("ours", "scaled to 3000"),
        "the room has # dB by Scaffold-GS's": [cell("authors", "scene_psnr", "secure_gs", "authors")],
        "# dB by the same steps of SecureGS's base": [cell("authors", "scene_psnr", f"{FIRST_STEPS}, their voxels")],
        "(# with larger voxels": [cell("authors", "scene_psnr", "secure_gs", "ours", FIRST_STEPS)],
        "and # dB by its default schedule": [cell("authors", "scene_psnr", "secure_gs", "scaled to 3000")],
        "costs it # to # dB": [min(finetuned()), max(finetuned())],
        "from # to # dB after GSPure": [cell("owners-adaptive", OWNERS, "gspure", place=i) for i in (1, 2)],
        "from # to # dB on the clean model": [cell("owners-adaptive", OWNERS, "clean model", place=i) for i in (1, 2)],
        "Splats in Splats its # dB, and an unhardened one # of # dB": [
            cell("owners-hardening", "Splats in Splats (hardened)", "gspure", place=1),
            *(cell("owners-hardening", "Splats in Splats", attack, place=1) for attack in ("gspure", "unattacked")),
        ],
    },
    "docs/statistics.md": {
        "# of # wrong messages pass (# by candidates alone)": [
            wrong_messages("proven", twins="8"),
            wrong_messages("claims", twins="8"),
            wrong_messages("proven", twins="0"),
        ],
        "is right in # of # extractions": [graded_alike(0.8, "readable"), float(len(rows_of("legibility")))],
        "In # of the 40, they saw at least traces; # of these have": [
            float(len(SEEN)),
            float(sum(part < 0.4 for part in SEEN)),
        ],
    },
    "docs/tutorial.md": {
        "This runs # attacks": [AUDITED],
        "after each of # attacks": [attacks_of("small-1")],
    },
    "docs/training.md": {
        "it reaches # to # dB more than": [min(faster("schedules-plush")), max(faster("schedules-plush"))],
        "and # to # dB more": [min(faster("schedules-fox")), max(faster("schedules-fox"))],
    },
}


if __name__ == "__main__":
    for page, texts in NUMBERS.items():
        for text, numbers in texts.items():
            print(f"{page}: {text}: {', '.join(f'{number:.6g}' for number in numbers)}")
