"""Decisions of the method: the settings of each, the artifacts that they share, and sweeps of variants."""

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any, Final

from gspure.attacks import find_attack
from gspure.evaluation.names import GSPURE
from gspure.method.features import PARTS

Settings = Mapping[str, Any]
Decisions = Mapping[str, Settings]

DEFAULT: Final = "method"  # name of the decision that has the settings of `method` in the configuration

FACTORS: Final = ("tau_c", "tau_n")

ARTIFACTS: Final[Mapping[str, Sequence[str]]] = {
    "contributions": ("energy",),
    "weights.npy": ("reduction", "views"),
    "features.npy": (),
    "tree.npy": ("cluster_on", "min_samples"),
    "clusters.npz": ("min_cluster_size", "selection", "max_cluster_share"),
    "prune_mask.npy": FACTORS,
}
"""The artifacts of a decision in the order in which they are made, and the settings that each depends on besides."""


def decisions(config: Settings, suited: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Return all settings of every decision of a validated configuration by name, that of the method first.

    `suited` are the pruning factors that suit the scheme, for those that are null.
    """
    common = {"cluster_on": list(PARTS), **config["method"]}
    every = {DEFAULT: common, **{name: {**common, **changed} for name, changed in config["decisions"].items()}}
    return {name: {**chosen, **{tau: chosen[tau] or suited[tau] for tau in FACTORS}} for name, chosen in every.items()}


def origin(among: Decisions, name: str, artifact: str) -> str:
    """Return the first decision that has the same `artifact` as decision `name`: equal in all that it depends on."""
    earlier = takewhile(lambda name: name != artifact, ARTIFACTS)
    relevant = [setting for each in (*earlier, artifact) for setting in ARTIFACTS[each]]
    return next(other for other in among if all(among[other][s] == among[name][s] for s in relevant))


def sweeps(variants: Decisions, among: Decisions) -> dict[str, list[str]]:
    """Return the variants of each sweep, that is, of one attack at several strengths, by its name.

    A strength is a number: a setting of the attack, or a pruning factor of its decision, `among` those of the scheme.
    Variants that differ in anything else are different sweeps. A single variant is no sweep. `variants` are settings by
    variant, each with its attack (`gspure.workflow.configuration.resolved`).
    """
    by_kind: dict[tuple[object, ...], list[str]] = {}
    for variant, settings in variants.items():
        by_kind.setdefault(_kind(settings, among), []).append(variant)
    swept = {" ".join(map(str, kind)): names for kind, names in by_kind.items() if len(names) > 1}
    return {f"{name} sweep" if name in variants and name not in names else name: names for name, names in swept.items()}


def factors_of(variants: Decisions, among: Decisions) -> dict[str, tuple[float, float]]:
    """Return tau_n and tau_c of every variant that differs from GSPure in these alone, those with its factors first."""
    kind = _kind({"attack": GSPURE, "seed": 0}, among)
    chosen = {
        name: among[settings.get("decision", DEFAULT)]
        for name, settings in variants.items()
        if settings["attack"] == GSPURE and _kind(settings, among) == kind
    }
    points = {name: (settings["tau_n"], settings["tau_c"]) for name, settings in chosen.items()}
    return dict(sorted(points.items(), key=lambda point: point[1] != _default_factors(among)))


def is_swept(variants: Decisions, among: Decisions) -> bool:
    """Return whether there are variants that differ from GSPure in one pruning factor alone."""
    tau_n, tau_c = _default_factors(among)
    return any((n == tau_n) != (c == tau_c) for n, c in factors_of(variants, among).values())


def _default_factors(among: Decisions) -> tuple[float, float]:
    return among[DEFAULT]["tau_n"], among[DEFAULT]["tau_c"]


def _kind(settings: Settings, among: Decisions) -> tuple[object, ...]:
    """Return what the variants of one sweep share: the attack, and all settings but its strength."""
    attack = find_attack(settings["attack"])
    kind = attack.kind(settings)
    if attack.needs & {"weights", "prune_mask"}:
        name = settings.get("decision", DEFAULT)
        first = origin(among, name, "clusters.npz" if attack.needs & {"prune_mask", "labels"} else "weights.npy")
        kind += [] if first == DEFAULT else [first]
    return tuple(kind)
