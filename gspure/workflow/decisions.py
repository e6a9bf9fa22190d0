"""Decisions of GSPure: what their steps depend on, which of them share a step, and the sweeps among variants."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Final

from gspure.evaluation.plan import METHOD, Decision
from gspure.grouping import grouped
from gspure.method.settings import MethodSettings
from gspure.metrics.names import GSPURE
from gspure.workflow.variants import VariantSpec

SettingsByDecision = Mapping[str, MethodSettings]  # of every decision by name, that of the method first
Factors = Mapping[str, tuple[float, float]]

ARTIFACTS: Final[Mapping[str, Sequence[str]]] = {
    "contributions": ("energy",),
    "weights.npy": ("reduction", "views"),
    "opacities.npy": (),
    "features.npy": (),
    "tree.npy": ("cluster_on", "min_samples"),
    "clusters.npz": ("min_cluster_size", "selection", "max_cluster_share"),
    "prune_mask.npy": ("tau_c", "tau_n"),
}
"""The files of a decision in the order of their steps, and the settings that each depends on besides those before."""


def suited(settings: SettingsByDecision, tau_c: float, tau_n: float) -> SettingsByDecision:
    """Return decisions in which factors that are None are those that suit a scheme."""
    return {
        name: replace(
            decision,
            tau_c=tau_c if decision.tau_c is None else decision.tau_c,
            tau_n=tau_n if decision.tau_n is None else decision.tau_n,
        )
        for name, decision in settings.items()
    }


def sharing_decision(settings: SettingsByDecision, name: str, artifact: str) -> str:
    """Return the decision whose `artifact` decision `name` can share: the first with the same settings up to it."""
    steps = [*takewhile(lambda step: step != artifact, ARTIFACTS), artifact]
    relevant = [setting for step in steps for setting in ARTIFACTS[step]]

    def values(decision: str) -> list[object]:
        return [getattr(settings[decision], setting) for setting in relevant]

    return next(decision for decision in settings if values(decision) == values(name))


def decisions_of(settings: SettingsByDecision, folder: Path) -> dict[str, Decision]:
    """Return the decisions of a model with their files below its folder, those of the method in the folder itself."""

    def file(name: str, artifact: str) -> Path:
        owner = sharing_decision(settings, name, artifact)
        place = folder if owner == METHOD else folder / "decisions" / owner
        return place / artifact

    return {
        name: Decision(decision, {artifact: file(name, artifact) for artifact in ARTIFACTS})
        for name, decision in settings.items()
    }


def decision_folders(names: Iterable[str]) -> dict[str, str]:
    """Return decisions by the end of their folder's path below that of the model; empty for the method's own."""
    return {"": METHOD, **{f"/decisions/{name}": name for name in names}}


def attack_groups(variants: Mapping[str, VariantSpec], settings: SettingsByDecision) -> dict[str, tuple[str, ...]]:
    """Return the variants of each attack, by its name and those of its settings that are no strength."""
    groups = grouped(variants, lambda variant: " ".join(_group(variants[variant], settings)))
    return {name: tuple(members) for name, members in groups.items()}


def sweeps(variants: Mapping[str, VariantSpec], settings: SettingsByDecision) -> dict[str, tuple[str, ...]]:
    """Return the variants of each sweep, that is, of one attack at several strengths, by its name.

    A strength is a number: a setting of the attack, or a pruning factor of its decision. Variants that differ in
    anything else are different sweeps. A single variant is no sweep.
    """
    swept = {}
    for name, members in attack_groups(variants, settings).items():
        if len(members) > 1:
            is_taken = name in variants and name not in members
            swept[f"{name} sweep" if is_taken else name] = members
    return swept


def factors_of(variants: Mapping[str, VariantSpec], settings: SettingsByDecision) -> Factors:
    """Return tau_n and tau_c of every variant that differs from GSPure in these alone, those with its factors first.

    There are none if no variant differs from GSPure in one factor alone.
    """
    gspure = _group(variants[GSPURE]._replace(seed=0, settings={}, decision=METHOD), settings)
    points = {}
    for name, variant in variants.items():
        if variant.attack.name == GSPURE and _group(variant, settings) == gspure:
            points[name] = _factors(settings[variant.decision])
    tau_n, tau_c = _factors(settings[METHOD])
    is_swept = any((n == tau_n) != (c == tau_c) for n, c in points.values())
    if not is_swept:
        return {}
    return dict(sorted(points.items(), key=lambda point: point[1] != (tau_n, tau_c)))


def _factors(decision: MethodSettings) -> tuple[float, float]:
    """Return tau_n and tau_c of a decision that is suited to a scheme."""
    return decision.tau_n or 0.0, decision.tau_c or 0.0


def _group(variant: VariantSpec, settings: SettingsByDecision) -> tuple[str, ...]:
    """Return what the variants of one sweep share: the attack, and all settings but its strength."""
    attack = variant.attack
    group = attack.kind({**variant.settings, "seed": variant.seed})
    if attack.needs & {"weights", "prune_mask"}:
        artifact = "clusters.npz" if attack.needs & {"prune_mask", "labels"} else "weights.npy"
        owner = sharing_decision(settings, variant.decision, artifact)
        if owner != METHOD:
            group = [*group, owner]
    return tuple(group)
