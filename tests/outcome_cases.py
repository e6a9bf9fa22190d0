"""Outcomes of variants from the PSNR of scene and message, and the files of a model whose attacks add errors."""

from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.codec import plain
from gspure.evaluation.attack_record import ATTACK_RECORD, Applied, AttackRecord, StrengthValue
from gspure.evaluation.evidence import EVIDENCE, Evidence, JobEvidence, SceneChange, evidence_of
from gspure.evaluation.identity import Condition, ModelId
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.plan import AttackSpec, Control, Job, ModelPlan, Views
from gspure.files import write_json
from gspure.images import read_image, write_image
from gspure.metrics.bit_evidence import BitEvidence
from gspure.metrics.comparison import TRUTH, Reference, ViewMetrics, compare, pair_images, write_metrics
from gspure.metrics.detection import Detection
from gspure.metrics.image_metrics import METRICS
from gspure.metrics.names import CONTROLS, UNATTACKED

BEFORE = {"scene": 30.0, "message": 28.0}


def measured(
    target: str, psnr: float, others: float = 0.9, reference: Reference = TRUTH, view: str = "mean"
) -> ViewMetrics:
    """The metrics of one view, or their means; all but PSNR have the same value."""
    return ViewMetrics(target, view, reference, {**dict.fromkeys(METRICS, others), "psnr": psnr})


def outcome(variant: str, scene: str = "room", seed: int = 0, *, scheme: str = "sis", **known: Any) -> Outcome:
    """One variant, with the PSNR of its `targets` by name; a variant without targets has failed.

    ``gof@1dB`` is the entry ``gof`` at the strength searched for 1 dB of damage.
    """
    entry, _, damage = variant.removesuffix("dB").partition("@")
    if damage:
        known |= {"entry": entry, "wanted": float(damage)}
    levels = known.pop("targets", {})
    targets = {target: measured(target, psnr) for target, psnr in levels.items()}
    if "scene" in levels and variant not in CONTROLS:
        known = {"change": SceneChange(BEFORE["scene"] - levels["scene"], None, 0.0)} | known
    reference = {target: measured(target, BEFORE[target.partition("_")[0]]) for target in targets}
    views = dict.fromkeys(targets, 3)
    return Outcome(
        scheme, scene, variant, targets, views, before=Outcome(scheme, scene, UNATTACKED, reference), seed=seed, **known
    )


def attacked(variant: str, of_scene: float, of_message: float, *where: Any, **known: Any) -> Outcome:
    """One variant by how far it lowers the PSNR of scene and message, dB."""
    targets = {"scene": BEFORE["scene"] - of_scene, "message": BEFORE["message"] - of_message}
    return outcome(variant, *where, targets=targets, **known)


NULL = tuple(np.random.default_rng(0).normal(0.0, 0.03, 199).tolist())
TWINS = tuple(np.random.default_rng(1).normal(0.0, 0.03, 8).tolist())
PROTOCOL: dict[str, Any] = {"protocol": "shared", "initialization": "both"}


def shown(trace: float, legible: float, twins: Sequence[float] = TWINS, **known: Any) -> Evidence:
    """Evidence among 199 candidates."""
    return Evidence(trace, legible, NULL, tuple(twins), **known)


def with_evidence(variant: str, damage: float, *where: Any, **evidence: Evidence) -> Outcome:
    """A variant that costs the scene some dB, with evidence by extraction."""
    targets = {"scene": 30.0 - damage} | dict.fromkeys(evidence, 20.0)
    return outcome(variant, *where, targets=targets, evidence=evidence, **PROTOCOL)


PLAIN = shown(0.95, 1.0)
NOTHING = shown(0.01, 0.0)


def read(variant: str, correct: int, bits: int, damage: float = 0.0) -> Outcome:
    """A variant whose bits are read."""
    p = BITS_P[correct, bits]
    detection = Detection(100.0 * correct / bits, 0.0, nan, nan, 0.0, 0.0, 4, bits)
    evidence = BitEvidence(p, correct, bits, 4)
    levels = {"scene": 30.0 - damage}
    return outcome(variant, targets=levels, detections={"bits": detection}, bits={"bits": evidence}, **PROTOCOL)


BITS_P = {(32, 32): 2.0**-32, (30, 32): 529 / 2**32, (17, 32): 0.43, (4, 4): 2.0**-4, (8, 8): 2.0**-8}


VIEWS = ("view_0", "view_1", "view_2")
TARGETS = ("scene", "message")


def photograph(view: int, target: str) -> NDArray[np.float32]:
    """A smooth picture [24,32,3], different for every view and target."""
    return _blocks(np.random.default_rng((view, len(target))).random((6, 8, 3)), 4).astype(np.float32)


def _blocks(coarse: NDArray[np.float64], side: int) -> NDArray[np.float64]:
    return np.asarray(np.kron(coarse, np.ones((side, side, 1))), np.float64)


def candidates(count: int) -> NDArray[np.uint8]:
    """Pictures like the photographs of other messages, at half size."""
    rng = np.random.default_rng(0)
    pictures = [[_blocks(rng.random((6, 8, 3)), 2) for _ in VIEWS] for _ in range(count)]
    return (255 * np.array(pictures)).astype(np.uint8)


def write_model(
    results: Path, name: str, attacks: Mapping[str, tuple[float, float]], *, adapts: bool = False
) -> ModelPlan:
    """Write renders, metrics, evidence and verdicts of a model whose attacks add these errors to scene and message.

    An owner who adapts halves the error of the message. Its control is a clean model without the message.
    """
    truth = results / "pairs" / name.rpartition("/")[2]
    errors = {"unattacked": (0.05, 0.02), **attacks, "clean": (0.05, 1.0)}
    before = nan
    for variant, of_targets in errors.items():
        folder = results / name / variant
        by_target = dict(zip(TARGETS, of_targets, strict=True))
        if adapts:
            by_target["message_adaptive"] = by_target["message"] / 2
        for target, error in by_target.items():
            kind = target.partition("_")[0]
            for i, view in enumerate(VIEWS):
                image = photograph(i, kind)
                write_image(truth / kind / f"{view}.png", image)
                noise = np.random.default_rng(i).random(image.shape, np.float32)
                write_image(folder / "renders" / target / f"{view}.png", (1 - error) * image + error * noise)
        against = {target: "message" for target in by_target if target not in TARGETS}
        rows = [compare(pair, TRUTH) for pair in pair_images(truth, folder / "renders", against)[0]]
        write_metrics(folder / "metrics.csv", rows)
        psnr = float(np.mean([row.psnr for row in rows if row.target == "scene"]))
        before = psnr if variant == "unattacked" else before
        messages = [photograph(i, "message") for i in range(len(VIEWS))]
        of_message = {}
        for target in [*by_target][1:]:
            extractions = [read_image(folder / "renders" / target / f"{view}.png") for view in VIEWS]
            of_message[target] = evidence_of(extractions, messages, candidates(19))
        change = None if variant == "clean" else SceneChange(before - psnr, None, 0.0)
        evidence = JobEvidence(change, of_message)
        write_json(folder / EVIDENCE, plain(evidence))
        if variant in attacks:
            attack = Applied(StrengthValue("sigma", 0.1), affects={"message": of_targets[1] > 0.02})
            write_json(folder / ATTACK_RECORD, plain(AttackRecord(attack)))
    return model_plan(name, ("unattacked", *attacks), ("clean",))


def model_plan(name: str, variants: Sequence[str], controls: Sequence[str]) -> ModelPlan:
    """The plan of a marked model ``SCHEME/SCENE`` whose variants and controls are compared in scene and message."""
    scheme, scene = name.split("/")
    model = ModelId(scheme, scene)
    views = Views(model.folder / "cameras.json", "test", model.folder / "unattacked" / "renders")
    public = model.folder / "public" / "point_cloud.ply"

    def job(variant: str, case: AttackSpec | Control) -> Job:
        return Job(model, variant, public, case, views, compared=TARGETS)

    return ModelPlan(
        id=model,
        public=public,
        modules=(),
        cameras={},
        decisions={},
        variants=tuple(job(variant, AttackSpec(variant, entry=variant)) for variant in variants),
        controls=tuple(job(control, Control(control)) for control in controls),
        condition=Condition(scheme, "shared", "both"),
        targets=TARGETS,
        photographs=Path("results/pairs") / scene,
    )
