"""Outcomes of attacks over scenes and seeds, with controls, from what each removes and leaves."""

from collections.abc import Mapping

from gspure.evaluation.comparison import TRUTH, ViewMetrics
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.outcomes import Outcome

BEFORE = {"scene": 30.0, "message": 28.0}
CONTROLS = {"clean": 8.0, "wrong_key": 7.0, "other_scene": 6.0, "black": 5.0, "mean_colour": 10.0}


def measured(target: str, psnr: float, others: float = 0.9, reference: str = TRUTH, view: str = "mean") -> ViewMetrics:
    """The metrics of one view, or their means; all but PSNR have the same value."""
    return ViewMetrics(target, view, reference, {**dict.fromkeys(METRICS, others), "psnr": psnr})


def outcome(variant: str, scene: str = "room", seed: int = 0, *, scheme: str = "sis", **known) -> Outcome:
    """One variant whose `targets` are given as PSNR by name; a variant without any has failed."""
    targets = {target: measured(target, psnr) for target, psnr in known.pop("targets", {}).items()}
    reference = {target: measured(target, BEFORE[target.partition("_")[0]]) for target in targets}
    views = dict.fromkeys(targets, 3)
    return Outcome(scheme, scene, variant, targets, views, reference=reference, seed=seed, **known)


def attacked(variant: str, of_scene: float, of_message: float, *where: str | int, **known) -> Outcome:
    """One variant by how far it lowers the PSNR of scene and message, dB."""
    targets = {"scene": BEFORE["scene"] - of_scene, "message": BEFORE["message"] - of_message}
    return outcome(variant, *where, targets=targets, **known)


def benchmark(drops: Mapping[str, Mapping[str, tuple[float, float]]], seeds: int = 1, **known) -> list[Outcome]:
    """Return outcomes of variants by scene; a second seed loses a tenth of a dB more of the message."""
    outcomes = []
    for scene, variants in drops.items():
        for seed in range(seeds):
            cell = (scene, seed)
            outcomes += [attacked("unattacked", 0.0, 0.0, *cell, **known)]
            outcomes += [attacked(name, a, b + seed / 10, *cell, **known) for name, (a, b) in variants.items()]
            outcomes += [outcome(name, *cell, targets={"message": psnr}, **known) for name, psnr in CONTROLS.items()]
    return outcomes
