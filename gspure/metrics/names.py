"""Names of schemes, scenes, variants and targets, and how reports and figures show them."""

import re
from math import isnan, nan
from typing import Final

from gspure.metrics.targets import HIDDEN_BITS

UNATTACKED: Final = "unattacked"  # the variant without an attack: drops are relative to it
GSPURE: Final = "gspure"  # the variant of the paper's attack, and the name of the sweep over its pruning factors

CLEAN: Final = "clean"
WRONG_KEY: Final = "wrong_key"
OTHER_SCENE: Final = "other_scene"
BLACK: Final = "black"
MEAN_COLOUR: Final = "mean_colour"
BASELINES: Final = (BLACK, MEAN_COLOUR)  # blank images: black, and the mean colour of the message

CONTROLS: Final = (CLEAN, WRONG_KEY, OTHER_SCENE)
"""Negative controls: extractions without the message or without the right key. There may be more clean models."""

SCHEMES: Final = {  # display names of the built-in schemes and of the examples
    "splats_in_splats": "Splats in Splats",
    "splats_in_splats_hardened": "Splats in Splats (hardened)",
    "gs_hider": "GS-Hider",
    "gs_hider_hardened": "GS-Hider (hardened)",
    "gs_hider_canonical": "GS-Hider (canonical)",
    "secure_gs": "SecureGS",
    "secure_gs_hardened": "SecureGS (hardened)",
    "secure_gs_canonical": "SecureGS (canonical)",
    "keyss": "KeySS",
    "keyss_canonical": "KeySS (canonical)",
    "keyed_pattern": "Keyed Pattern",
    "marked_clones": "Marked Clones",
    "rendered_bits": "Rendered Bits",
}

_NAMES: Final = SCHEMES | {
    CLEAN: "clean model",
    OTHER_SCENE: "other scene's model",
    BLACK: "black image",
    MEAN_COLOUR: "mean-colour image",
    "random_matched": "count-matched random pruning",
    "lowest_weight_matched": "count-matched lowest-weight pruning",
    "lowest_opacity_matched": "count-matched lowest-opacity pruning",
    "message_adaptive": "message (adaptive)",
    "bits": "mark in renders",
    "model_bits": "mark in the file",
    "tradeoff": "trade-off",
    "vanilla": "Own model",
}

_CLEAN_MODEL: Final = re.compile(rf"{CLEAN}(_\d+)?")

_WORDS: Final = {"gspure": "GSPure", "gof": "GOF", "gaussian": "Gaussian", "jpeg": "JPEG"}


def clean_model(number: int) -> str:
    """Return the name of a model's n-th clean model; numbers begin with 1."""
    return CLEAN if number == 1 else f"{CLEAN}_{number}"


def clean_seed(variant: str) -> int:
    """Return what a clean model adds to the random seed of the marked one; nothing for the first."""
    number = int(variant.rpartition("_")[2]) if variant != CLEAN else 1
    return 1000 * (number - 1)


def is_message_free(variant: str) -> bool:
    """Return whether a variant is a model that never held the message: trained without it, or with another."""
    return variant == OTHER_SCENE or _CLEAN_MODEL.fullmatch(variant) is not None


def is_control(variant: str) -> bool:
    """Return whether a variant is a negative control."""
    return variant in CONTROLS or is_message_free(variant)


def variant_at(variant: str, damage: float) -> str:
    """Return the name of a variant whose strength is searched for this damage to the scene, in dB."""
    return f"{variant}@{damage:g}dB"


def variant_title(entry: str, damage: float = nan) -> str:
    """Return the display name of a variant: its entry in the configuration, and the damage searched for, in dB."""
    return display_name(entry) if isnan(damage) else f"{display_name(entry)}, {damage:g} dB"


def display_name(name: str) -> str:
    """Return the name of a scheme, an attack, a control or a target as people write it."""
    return _NAMES.get(name) or " ".join(_WORDS.get(word, word) for word in name.split("_"))


def extraction_name(extraction: str) -> str:
    """Return the display name of an extraction of the message, or of the mark of a detector: ``mark (spread)``."""
    has_name = extraction.startswith("message") or extraction in HIDDEN_BITS
    return display_name(extraction) if has_name else f"mark ({display_name(extraction)})"


def model_name(scheme: str, scene: str, seed: int = 0) -> str:
    """Return the display name of one model: scheme, scene and repetition."""
    return f"{display_name(scheme)}, {scene}" + (f", repetition {seed}" if seed else "")
