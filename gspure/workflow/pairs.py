"""Pairs of a scene and a message, as the resolved configuration describes them: the files and options of their jobs."""

import os
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gspure.artifacts import digest
from gspure.workflow.captures import camera_files, capture_files, model_files
from gspure.workflow.options import options

Pair = Mapping[str, Any]


def pair_of(scene: str) -> str:
    """Return the pair of an asset: ``raised``, of ``raised@1``."""
    return scene.partition("@")[0]


def repetition_of(scene: str) -> int:
    """Return the number of a repetition, which is added to all random seeds: 1, of ``raised@1``."""
    return int(scene.partition("@")[2] or 0)


def is_photographed(pair: Pair) -> bool:
    """Return whether a pair is made from photographs, rather than ray-traced."""
    return "photographs" in pair


def message_model(pair: Pair) -> str:
    """Return the model of a photographed pair's message: the user's, or the one trained for all pairs that hide it."""
    return f"results/messages/{trained_message(pair)}" if "message_photographs" in pair else str(pair["message"])


def trained_message(pair: Pair) -> str:
    """Return the name of a message's trained model: that of its folder and a digest of its training settings."""
    settings = [str(pair[name]) for name in ("message", "iterations", "resolution", "seed")]
    return f"{Path(pair['message']).stem}-{digest(*settings)[:8]}"


def pair_files(pair: Pair) -> list[str]:
    """Return the files that a pair is made from: photographs and the model of the message; none if ray-traced."""
    if not is_photographed(pair):
        return []
    scene = capture_files(pair["scene"], pair["photographs"])
    if "own_photographs" in pair:
        return [*scene, *capture_files(pair["message"], pair["own_photographs"])]
    if "message_photographs" in pair:
        return [*scene, message_model(pair)]
    return [*scene, *model_files(pair["message"]), *camera_files(pair["message"])]


def pair_arguments(pair: Pair, off_path: int) -> str:
    """Return the arguments of `gspure pair`: scene, message, and the settings of an entry of ``pairs`` that apply.

    `off_path` is the number of views off the camera path, of ray-traced pairs.
    """
    sources = shlex.join([pair["scene"], message_model(pair)])
    if is_photographed(pair):
        return f"{sources} {options(pair, 'protocol', 'resolution', 'seed')}"
    settings = ("protocol", "placement", "views", "width", "height", "off_path", "seed")
    return f"{sources} {options({**pair, 'off_path': off_path}, *settings)}"


def other_pairs(pairs: Mapping[str, Pair], name: str) -> list[str]:
    """Return the pairs with another message than pair `name`, however the paths are spelled."""
    return [other for other, pair in pairs.items() if _message(pair) != _message(pairs[name])]


def _message(pair: Pair) -> str:
    message = str(pair["message"])
    return os.path.realpath(message) if is_photographed(pair) else message
