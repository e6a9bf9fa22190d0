"""Decisions: the settings of GSPure, what is made for each of them, and the sweeps among variants."""

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any, Final

from gspure.attacks import find_attack
from gspure.grouping import grouped
from gspure.metrics.names import GSPURE

Settings = Mapping[str, Any]
Decisions = Mapping[str, Settings]

METHOD: Final = "method"  # name of the decision with the settings of `method` in the configuration
FACTORS: Final = ("tau_c", "tau_n")

MADE: Final[Mapping[str, Sequence[str]]] = {
    "contributions": ("energy",),
    "weights.npy": ("reduction", "views"),
    "opacities.npy": (),
    "features.npy": (),
    "tree.npy": ("cluster_on", "min_samples"),
    "clusters.npz": ("min_cluster_size", "selection", "max_cluster_share"),
    "prune_mask.npy": FACTORS,
}
"""What is made for a decision, in this order, and the settings that each depends on besides those before it."""


def first_alike(among: Decisions, name: str, made: str) -> str:
    """Return the first decision that agrees with decision `name` in all settings that something made depends on."""
    relevant = [setting for each in (*takewhile(lambda each: each != made, MADE), made) for setting in MADE[each]]
    return next(other for other in among if all(among[other][s] == among[name][s] for s in relevant))


def kinds(variants: Decisions, among: Decisions) -> dict[str, list[str]]:
    """Return the variants of each attack, by its name and those of its settings that are no strength."""
    return grouped(variants, lambda variant: " ".join(_kind(variants[variant], among)))


def sweeps(variants: Decisions, among: Decisions) -> dict[str, list[str]]:
    """Return the variants of each sweep, that is, of one attack at several strengths, by its name.

    A strength is a number: a setting of the attack, or a pruning factor of its decision, `among` those of the scheme.
    Variants that differ in anything else are different sweeps. A single variant is no sweep.
    """
    swept = {kind: names for kind, names in kinds(variants, among).items() if len(names) > 1}
    return {f"{name} sweep" if name in variants and name not in names else name: names for name, names in swept.items()}


def factors_of(variants: Decisions, among: Decisions) -> dict[str, tuple[float, float]]:
    """Return tau_n and tau_c of every variant that differs from GSPure in these alone, those with its factors first.

    There are none if no variant differs from GSPure in one factor alone.
    """
    kind = _kind({"attack": GSPURE, "seed": 0}, among)
    alike = [name for name, v in variants.items() if v["attack"] == GSPURE and _kind(v, among) == kind]
    chosen = {name: among[variants[name].get("decision", METHOD)] for name in alike}
    points = {name: (decision["tau_n"], decision["tau_c"]) for name, decision in chosen.items()}
    own = among[METHOD]["tau_n"], among[METHOD]["tau_c"]
    is_swept = any((n == own[0]) != (c == own[1]) for n, c in points.values())
    return dict(sorted(points.items(), key=lambda point: point[1] != own)) if is_swept else {}


def _kind(settings: Settings, among: Decisions) -> tuple[str, ...]:
    """Return what the variants of one sweep share: the attack, and all settings but its strength."""
    attack = find_attack(settings["attack"])
    kind = attack.kind(settings)
    if attack.needs & {"weights", "prune_mask"}:
        made = "clusters.npz" if attack.needs & {"prune_mask", "labels"} else "weights.npy"
        first = first_alike(among, settings.get("decision", METHOD), made)
        kind += [] if first == METHOD else [first]
    return tuple(kind)
