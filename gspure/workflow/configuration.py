"""The configuration of the workflow, after its check against the schema: names known, files found, sweeps listed."""

import os
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any, Final

from gspure.attacks import attacks
from gspure.cameras import GENERATED, read_cameras
from gspure.cameras.photographs import missing_photographs, require_present
from gspure.datasets import SCENES
from gspure.errors import InputError
from gspure.external import words_of
from gspure.metrics.names import CONTROLS, variant_at
from gspure.metrics.targets import BITS, SCENE, is_picture
from gspure.model import is_trained_model
from gspure.model.inria import point_cloud
from gspure.scenes.procedural import NAMES, scene_builder
from gspure.schemes.registry import made_by, schemes
from gspure.settings import require_settings
from gspure.training.dataset import read_views
from gspure.workflow.decisions import METHOD

_FOLDERS: Final = ("public", "key", "contributions", "decisions", "figures", "trained")  # of a model


def resolve(config: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Return a copy of a configuration that fits the schema, in which models are files and variants name their attacks.

    Models and pairs to be trained get the entry ``photographs``, the files that their cameras name; messages to be
    trained get ``message_photographs``. A list of damages becomes a variant for each. `source` is named by errors.
    """
    settled = deepcopy(dict(config))
    if not settled["assets"] and not (settled["pairs"] and settled["schemes"]):
        raise InputError(source, "assets", expected="at least one model, or a pair and a scheme", found="none")
    for scene, asset in settled["assets"].items():
        _settle_asset(asset, source, f"assets.{scene}")
        unmarked = [name for name, other in settled["assets"].items() if name != scene and other["clean"] is None]
        _require(asset["clean"], [None, *unmarked], source, f"assets.{scene}.clean")
    for name, pair in settled["pairs"].items():
        _settle_pair(pair, source, f"pairs.{name}")
    for name, detector in settled["detectors"].items():
        words_of(detector["command"])
        if name in (SCENE, BITS) or is_picture(name):
            raise InputError(source, f"detectors.{name}", expected="a name of no target", found=name)
    if METHOD in settled["decisions"]:
        raise InputError(source, f"decisions.{METHOD}", expected="another name than that of the method", found=METHOD)
    variants: dict[str, dict[str, Any]] = {}
    for variant, settings in settled["variants"].items():
        _settle_variant(variant, settings, settled["decisions"], source)
        variants |= _at_damages(variant, settings)
    settled["variants"] = variants
    _check_schemes(settled, source)
    return settled


def _settle_asset(asset: dict[str, Any], source: str, place: str) -> None:
    """Check the paths of an asset, and find its model file or the photographs to train it from."""
    for field in (name for name in ("model", "cameras", "key", "message", "train") if name in asset):
        if field != "train" and "train" in asset:
            raise InputError(source, f"{place}.{field}", expected="nothing beside train", found=asset[field])
        if not (field == "cameras" and asset[field] in GENERATED):
            _require_path(asset[field], source, f"{place}.{field}")
    if "train" in asset:
        asset["photographs"] = _photographs(asset["train"])
    elif Path(asset["model"]).is_dir():
        asset["model"] = str(point_cloud(Path(asset["model"])))
    if "key" in asset:
        asset["scheme"] = asset.get("scheme") or made_by(Path(asset["key"]))[0]
        _require(asset["scheme"], [*schemes()], source, f"{place}.scheme")
        views = [] if asset["cameras"] in GENERATED else read_cameras(asset["cameras"])
        asset["photographed"] = bool(views) and not missing_photographs(views)
    if "message" in asset:
        asset["message_photographs"] = _photographs(asset["message"])


def _settle_pair(pair: dict[str, Any], source: str, place: str) -> None:
    """Check that a pair is ray-traced or made of files, and find the photographs that it is trained from."""
    is_traced = [scene_builder(pair[name]) is not None for name in ("scene", "message")]
    if is_traced[0] != is_traced[1]:
        expected = f"both of {NAMES}, or both paths"
        raise InputError(source, place, expected=expected, found=f"{pair['scene']} and {pair['message']}")
    if is_traced[0]:
        return
    for field in ("scene", "message"):
        _require_path(pair[field], source, f"{place}.{field}")
    pair["photographs"] = _photographs(pair["scene"])
    if pair["protocol"] == "own":
        pair["own_photographs"] = _photographs(pair["message"])
    elif not is_trained_model(pair["message"]):
        pair["message_photographs"] = _photographs(pair["message"])


def _require_path(path: str, source: str, place: str) -> None:
    if not Path(path).is_file() and not Path(path).is_dir():
        hint = f"gspure download {name}" if (name := Path(path).name) in SCENES else None
        raise InputError(source, place, expected="an existing file or folder", found=path, hint=hint)


def _photographs(data: str) -> list[str]:
    """Return the photographs of all cameras of training data, held-out ones too; relative if the data is."""
    cameras = [camera for camera in read_views(Path(data)).cameras if camera.image]
    require_present(cameras, data)
    images = [str(camera.image) for camera in cameras]
    return images if Path(data).is_absolute() else [os.path.relpath(image) for image in images]


def _require(found: Any, known: list[Any], source: str, place: str) -> None:
    if found not in known:
        listed = ", ".join(name for name in known if name) or "none"
        raise InputError(source, place, expected=f"one of {listed}", found=repr(found))


def _settle_variant(variant: str, settings: dict[str, Any], decisions: Mapping[str, Any], source: str) -> None:
    """Name the attack of a variant; check its name, its settings, its decision and its damage."""
    place, known = f"variants.{variant}", attacks()
    if variant in {*CONTROLS, *_FOLDERS}:
        raise InputError(source, place, expected="a name of no control and no folder of a model", found=variant)
    name = settings.setdefault("attack", variant)
    _require(name, [variant] if variant in known else [*known], source, place)
    attack = known[name]
    require_settings(source, attack.function, _of_function(settings), f"{place}.")
    if "decision" in settings:
        _require(settings["decision"], [*decisions], source, f"{place}.decision")
        if not attack.needs & {"weights", "prune_mask"}:
            expected = f"no entry, since {name} uses no decision"
            raise InputError(source, f"{place}.decision", expected=expected, found=repr(settings["decision"]))
    if "damage" in settings and attack.strength is None:
        raise InputError(source, f"{place}.damage", expected="an attack with a strength", found=name)
    if "damage" in settings and attack.strength and (given := settings.get(attack.strength.setting)) is not None:
        field = f"{place}.{attack.strength.setting}"
        raise InputError(source, field, expected="nothing beside damage", found=repr(given))


def _of_function(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in settings.items() if name not in {"attack", "damage", "decision", "seed"}}


def _at_damages(name: str, settings: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return a variant, or one for each of its damages."""
    if "damage" not in settings:
        return {name: settings}
    damages = settings["damage"] if isinstance(settings["damage"], list) else [settings["damage"]]
    return {variant_at(name, damage): {**settings, "damage": damage} for damage in damages}


def _check_schemes(config: Mapping[str, Any], source: str) -> None:
    """Refuse unknown schemes, settings and extractions."""
    known = schemes() if config["schemes"] else {}
    for name, settings in config["schemes"].items():
        _require(name, [*known], source, f"schemes.{name}")
        require_settings(source, known[name].embed, _of_function(settings), f"schemes.{name}.")
    extractions = sorted({extraction for scheme in config["schemes"] for extraction in known[scheme].extractions})
    for name in config["extractions"] or ():
        _require(name, extractions, source, "extractions")
