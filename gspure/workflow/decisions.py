"""Decisions of the method: the settings of each, what they have in common, and which variants are one sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any, Final

from gspure.attacks import find_attack
from gspure.method.features import PARTS

Settings = Mapping[str, Any]
Decisions = Mapping[str, Settings]

METHOD: Final = "method"
"""Name of the decision that has the settings of `method` in the configuration."""

FACTORS: Final = ("tau_c", "tau_n")

STAGES: Final[Mapping[str, Sequence[str]]] = {
    "contributions": ("energy",),
    "weights.npy": ("reduction",),
    "features.npy": (),
    "tree.npy": ("cluster_on", "min_samples"),
    "clusters.npz": ("min_cluster_size", "selection", "max_cluster_share"),
    "prune_mask.npy": FACTORS,
}
"""The artifacts of a decision in the order in which they are made, and the settings that each depends on besides."""


def decisions(config: Settings, suited: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Return all settings of every decision by name, that of the method first.

    Parameters
    ----------
    config : mapping
        A validated configuration.
    suited : mapping
        The pruning factors that suit the scheme, for those that are null.

    """
    common = {"cluster_on": list(PARTS), **config["method"]}
    found = {METHOD: common, **{name: {**common, **own} for name, own in config["decisions"].items()}}
    return {name: {**one, **{tau: one[tau] or suited[tau] for tau in FACTORS}} for name, one in found.items()}


def origin(among: Decisions, name: str, artifact: str) -> str:
    """Return the first decision that has the same `artifact` as decision `name`: equal in all that it depends on."""
    earlier = takewhile(lambda stage: stage != artifact, STAGES)
    relevant = [setting for stage in (*earlier, artifact) for setting in STAGES[stage]]
    return next(other for other in among if all(among[other][s] == among[name][s] for s in relevant))


def sweeps(variants: Decisions, among: Decisions) -> dict[str, list[str]]:
    """Return the variants that are one attack at several strengths, by a name for all of them.

    A strength is a number: a setting of the attack, or a pruning factor of the decision that it goes by. Variants that
    differ in anything else are not of one sweep, and a single one is none.

    Parameters
    ----------
    variants : mapping
        Settings by variant, each with its attack (`gspure.workflow.configuration.resolved`).
    among : mapping
        The scheme's decisions.

    """
    found: dict[tuple[object, ...], list[str]] = {}
    for variant, settings in variants.items():
        found.setdefault(_kind(settings, among), []).append(variant)
    return {" ".join(map(str, kind)): names for kind, names in found.items() if len(names) > 1}


def factors_of(variants: Decisions, among: Decisions) -> dict[str, tuple[float, float]]:
    """Return tau_n and tau_c of every variant that is GSPure with the method's settings but for these."""
    method = {"attack": "gspure", "seed": 0}
    found = {name: among[one.get("decision", METHOD)] for name, one in variants.items() if _is_like(one, method, among)}
    return {name: (settings["tau_n"], settings["tau_c"]) for name, settings in found.items()}


def _is_like(settings: Settings, other: Settings, among: Decisions) -> bool:
    return _kind(settings, among) == _kind(other, among)


def _kind(settings: Settings, among: Decisions) -> tuple[object, ...]:
    """Return what makes a variant incomparable to others: its attack, and what of its settings is no strength."""
    attack = find_attack(settings["attack"])
    words = {k: v for k, v in settings.items() if isinstance(attack.settings.get(k), str) and v != attack.settings[k]}
    kind = [attack.name, *words.values(), *([f"seed {settings['seed']}"] if settings["seed"] else [])]
    if attack.needs & {"weights", "prune_mask"}:
        name = settings.get("decision", METHOD)
        first = origin(among, name, "clusters.npz" if "prune_mask" in attack.needs else "weights.npy")
        kind += [] if first == METHOD else [first]
    return tuple(kind)
