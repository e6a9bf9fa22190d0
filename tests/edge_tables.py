"""Random tables of results at the edges: failures, identical images, unknown numbers, few and unequal scenes."""

import math
from random import Random
from typing import Any, Final

from gspure.evaluation.comparison import RENDER, TRUTH, ViewMetrics
from gspure.evaluation.controls import BASELINES, CLEAN, CONTROLS
from gspure.evaluation.detection import Detection
from gspure.evaluation.names import UNATTACKED
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.retrieval import Retrieval

VARIANTS: Final = (
    UNATTACKED,
    "gspure",
    "random_matched",
    "gspure_scaled@1dB",
    "random_pruning@1dB",
    "finetune",
    "crop",
)
SCHEMES: Final = ("splats_in_splats", "gs_hider", "marked_clones", "planted", "vanilla")
BITS: Final = {"bits": 32, "alpha": 6, "zeta": 0}


def edge_outcomes(seed: int) -> list[Outcome]:
    """Return the outcomes of one to three conditions."""
    random = Random(seed)  # noqa: S311
    schemes = random.sample(SCHEMES, random.choice((1, 1, 2, 3)))
    outcomes = [o for scheme in schemes for o in _of_scheme(random, scheme)]
    return sorted(outcomes, key=lambda o: (o.scheme, o.scene, o.seed, o.variant != UNATTACKED))


def _of_scheme(random: Random, scheme: str) -> list[Outcome]:
    is_own, hides_bits = scheme == "vanilla", scheme == "marked_clones"
    trained = {} if is_own else {"protocol": random.choice(("own", "shared")), "initialization": "both"}
    extractions = [] if is_own or hides_bits else ["message", *["message_adaptive"] * random.randint(0, 1)]
    detectors = ["bits"] if hides_bits else ["alpha", "zeta"][: random.randint(0, 2)] if is_own else []
    outcomes = []
    for scene in "abcdefg"[: random.choice((1, 1, 2, 2, 3, 5, 6, 7))]:
        for repetition in range(random.choice((1, 1, 2))):
            for variant in (*VARIANTS, *(CONTROLS if not is_own else [CLEAN])):
                failed = random.random() < random.choice((0.05, 0.05, 0.05, 0.7))
                known = {"failure": "out of memory"} if failed else _measured(random, variant, extractions, detectors)
                if failed or known["targets"] or known["detections"]:
                    nothing: dict[str, Any] = {"targets": {}, "views": {}}
                    outcomes.append(Outcome(scheme, scene, variant, seed=repetition, **trained, **{**nothing, **known}))
    return outcomes


def _measured(random: Random, variant: str, extractions: list[str], detectors: list[str]) -> dict[str, Any]:
    is_control, is_own = variant in CONTROLS, "alpha" in detectors or not (extractions or detectors)
    reference = RENDER if is_own else TRUTH
    levels = {"scene": math.inf if is_own and variant == UNATTACKED else _level(random, 30.0)} if not is_control else {}
    levels |= {name: _level(random, 9.0 if is_control else 28.0) for name in extractions if random.random() < 0.95}
    targets = {name: ViewMetrics(name, "mean", reference, _values(random, psnr)) for name, psnr in levels.items()}
    read = {name: _detection(random, BITS[name]) for name in detectors if variant not in BASELINES}
    known = {
        "targets": targets,
        "views": {name: random.randint(1, 3) for name in targets},
        "detections": {name: reading for name, reading in read.items() if random.random() < 0.9},
        "retrieval": {
            name: Retrieval(random.choice((0.0, 0.5, 1.0)), 0.5, 0.0, 4, 17) for name in levels.keys() & {"message"}
        },
    }
    if is_control:
        return known
    return known | {
        "off_path": targets if random.random() < 0.5 else {},
        "pruned_share": random.choice((math.nan, 0.0, 1e-5, 0.33, 0.9999, 1.0)),
        "precision": random.choice((math.nan, 0.0, 1.0)),
        "recall": random.choice((math.nan, 0.99996)),
        "reached": {name: random.random() < 0.9 for name in (*extractions, *detectors)},
        "strength": random.choice(("", "fraction=0.25")),
    }


def _level(random: Random, ordinary: float) -> float:
    if random.random() < 0.2:
        return random.choice((math.inf, ordinary, 0.0, -0.0, ordinary + 1e-9, 150.0))
    return (
        ordinary + random.choice((0, 0.003, -0.003, 0.04, -0.04, 1, -1, -2, -8)) + random.choice((0.0, random.random()))
    )


def _values(random: Random, psnr: float) -> dict[str, float]:
    others = {"ssim": (1.0, 0.99996, -0.0001), "ms_ssim": (1.0, 0.3), "nc": (0.0, 1.0, -1e-5), "structure": (0.0, 0.5)}
    return {"psnr": psnr, "region": random.choice((psnr, math.inf))} | {n: random.choice(v) for n, v in others.items()}


def _detection(random: Random, bits: int) -> Detection:
    level = random.choice((0.0, 53.2, 99.97, 100.0) if bits else (0.0, -1e-9, 0.0043, 1e30))
    present = random.choice((True, False) if bits else (True, False, None))
    return Detection(level, 0.1, random.choice((math.nan, 0.9996)), math.nan, present, 3, bits)
