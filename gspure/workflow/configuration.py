"""The workflow's configuration: checked against its schema, defaults filled in."""

import filecmp
import math
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr
from copy import deepcopy
from io import StringIO
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import jsonschema
import numpy as np
import yaml
from jsonschema.validators import extend

from gspure.attacks import Evidence, attacks, find_attack
from gspure.cameras import GENERATED, read_cameras
from gspure.cameras.photographs import require_present
from gspure.cameras.reading import follow
from gspure.constants import TEST_EVERY
from gspure.datasets import SCENES
from gspure.errors import InputError, did_you_mean, reading
from gspure.evaluation.controls import CONTROLS
from gspure.evaluation.detection import words_of
from gspure.evaluation.names import GSPURE, variant_at
from gspure.evaluation.outcomes import BITS, MESSAGE, SCENE, is_picture
from gspure.model import Gaussians
from gspure.model.inria import point_cloud, saved_iterations
from gspure.scenes.staging import NAMES, scene_builder
from gspure.schemes.registry import schemes
from gspure.settings import require_settings
from gspure.training.dataset import read_views
from gspure.workflow.decisions import DEFAULT
from gspure.workflow.pairs import pair_arguments

_FOLDERS: Final = ("public", "key", "contributions", "decisions", "figures", "trained")  # of a model

_EXPECTED = {
    "type": "type {}",
    "enum": "one of {}",
    "minLength": "at least {} character",
    "maxLength": "at most {} characters",
    "minimum": "at least {}",
    "maximum": "at most {}",
    "exclusiveMinimum": "more than {}",
    "exclusiveMaximum": "less than {}",
}
"""The expected value in words, by keyword of the schema."""


def require_distinct_names(file: str | Path) -> None:
    """Raise `InputError` if a mapping of a YAML file repeats a name: YAML parsers keep the last value silently."""
    with reading(file, "a configuration, as YAML"):
        text = Path(file).read_text(encoding="utf-8")
        yaml.safe_load(text)  # refuses values that Snakemake cannot have, such as numbers of 5,000 digits
        nodes = [yaml.compose(text, yaml.SafeLoader)]
    visited = set()  # an alias is the node that it names
    while nodes:
        node = nodes.pop()
        if id(node) in visited:
            continue
        visited.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            nodes += node.value
        if isinstance(node, yaml.MappingNode):
            names = [name.value for name, _ in node.value if isinstance(name, yaml.ScalarNode)]
            if repeated := [name for name in names if names.count(name) > 1]:
                line = node.start_mark.line + 1
                raise InputError(file, f"line {line}", expected="each name once", found=f"{repeated[0]!r} twice")
            nodes += [value for _, value in node.value]


def validated(config: Mapping[str, Any], schema_file: Path, source: str | Path) -> dict[str, Any]:
    """Return a copy of `config`, which the user wrote in `source`, in which every absent setting has its default.

    `schema_file` is a JSON schema (draft 2020-12) as YAML. Raise `InputError` naming the first setting at fault.
    """
    schema = yaml.safe_load(schema_file.read_text(encoding="utf-8"))
    with reading(source, "settings"):  # nested too deep, or a number too long to print
        filled = dict(deepcopy(config))
        _require_text_keys(filled, source)
        errors = _strict_validator(jsonschema.Draft202012Validator)(schema).iter_errors(filled)
        if error := jsonschema.exceptions.best_match(errors):
            raise _refusal(error, source)
    for scene, asset in (config.get("assets") or {}).items():
        if "generated" in asset and asset.get("cameras") not in GENERATED:
            expected, found = f"cameras {' or '.join(GENERATED)}", f"cameras {asset.get('cameras')}"
            raise InputError(source, f"assets.{scene}.generated", expected=expected, found=found)
    return filled


def _require_text_keys(config: Any, source: str | Path, place: str = "config") -> None:
    """Refuse names that YAML reads as numbers, truth values or null, such as ``no: {}``."""
    for name, value in config.items() if isinstance(config, Mapping) else ():
        if not isinstance(name, str):
            raise InputError(source, place, expected="names as text", found=repr(name), hint="put it in quotes")
        _require_text_keys(value, source, name)


def resolved(config: Mapping[str, Any], source: str | Path) -> dict[str, Any]:
    """Return a copy of a validated configuration in which models are files and every variant names its attack.

    Models and pairs to be trained get the entry ``photographs``, the files that their cameras name; messages to be
    trained get ``message_photographs``.

    Raise `InputError` if there is no model; a model, its cameras or its photographs do not exist; a model file is
    named beside training data; or a scheme, attack, setting or decision is unknown.
    """
    settled = deepcopy(dict(config))
    if not settled["assets"] and not (settled["pairs"] and settled["schemes"]):
        raise InputError(source, "assets", expected="at least one model, or a pair and a scheme", found="none")
    for scene, asset in settled["assets"].items():
        _settle_asset(asset, source, f"assets.{scene}")
        _check_clean(scene, settled["assets"], source)
    _require_different_assets(settled["assets"], source)
    for name, detector in settled["detectors"].items():
        words_of(detector["command"])
        if name in (SCENE, BITS) or is_picture(name):
            expected = f"a name other than {SCENE}, {BITS} and {MESSAGE}..."
            raise InputError(source, f"detectors.{name}", expected=expected, found=name)
    for name, pair in settled["pairs"].items():
        _settle_pair(pair, source, f"pairs.{name}")
    _require_different(settled["pairs"], source)
    if DEFAULT in settled["decisions"]:
        raise InputError(source, f"decisions.{DEFAULT}", expected="another name than that of the method", found=DEFAULT)
    functions: dict[str, Callable[..., Any]] = {name: attack.function for name, attack in attacks().items()}
    for variant, settings in settled["variants"].items():
        attack = settings.setdefault("attack", variant)
        _check_name(variant, attack, source)
        _check_settings(settings, attack, functions, source, f"variants.{variant}")
        _check_texts(settings, source, f"variants.{variant}")
        _check_decision(settings, settled["decisions"], source, f"variants.{variant}")
        _check_damage(settings, source, f"variants.{variant}")
    _check_one_decision(settled["variants"], source)
    settled["variants"] = _at_damages(settled["variants"], source)
    known = schemes() if settled["schemes"] else {}
    functions = {name: scheme.embed for name, scheme in known.items()}
    for scheme, settings in settled["schemes"].items():
        _check_settings(settings, scheme, functions, source, f"schemes.{scheme}")
        if not settings.get("message_weight", 1):
            hint = "clean models, without a message, are trained in any case"
            raise InputError(source, f"schemes.{scheme}.message_weight", expected="more than 0", found="0", hint=hint)
    _check_views(settled, source)
    extractions = sorted({name for scheme in settled["schemes"] for name in known[scheme].extractions})
    for name in {*(settled["extractions"] or ())} - {*extractions}:
        raise InputError(
            source, "extractions", expected=f"some of {', '.join(extractions) or 'none'}", found=repr(name)
        )
    return settled


def _settle_asset(asset: dict[str, Any], source: str | Path, place: str) -> None:
    """Check the paths of an asset, and find its model file or the photographs to train it from."""
    for field in (name for name in ("model", "cameras", "train") if name in asset):
        if field != "train" and "train" in asset:
            raise InputError(source, f"{place}.{field}", expected="nothing beside train", found=asset[field])
        if not (field == "cameras" and asset[field] in GENERATED):
            _require_path(asset[field], source, f"{place}.{field}")
    if "model" in asset and (model := Path(asset["model"])).is_dir():
        asset["model"] = str(point_cloud(model))
    if (
        "model" in asset
        and asset["cameras"] not in GENERATED
        and not follow(Path(asset["cameras"]), Path(asset["model"]))
    ):
        hint = f"if they were moved with it, delete {asset['model']}.json"
        expected, found = "views that moved with the model", f"those from before an attack moved {asset['model']}"
        raise InputError(source, f"{place}.cameras", expected=expected, found=found, hint=hint)
    if "train" in asset:
        asset["photographs"] = _photographs(asset["train"])


def _check_clean(scene: str, assets: Mapping[str, Mapping[str, Any]], source: str | Path) -> None:
    """Refuse a clean model that is not among the other assets, or has a mark of its own: one with a clean model."""
    unmarked = {name for name, asset in assets.items() if asset["clean"] is None} - {scene}
    if (clean := assets[scene]["clean"]) not in {None, *unmarked}:
        expected = f"another asset without `clean` ({', '.join(sorted(unmarked)) or 'there is none'})"
        raise InputError(source, f"assets.{scene}.clean", expected=expected, found=repr(clean))


def _settle_pair(pair: dict[str, Any], source: str | Path, place: str) -> None:
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
    message = Path(pair["message"])
    if pair["protocol"] == "own":
        pair["own_photographs"] = _photographs(pair["message"])
    elif message.suffix != ".ply" and not saved_iterations(message) and not (message / "point_cloud.ply").is_file():
        pair["message_photographs"] = _photographs(pair["message"])


def _require_different(pairs: Mapping[str, Mapping[str, Any]], source: str | Path) -> None:
    """Refuse a pair that repeats another one, perhaps with another seed: it would count as another scene."""
    first: dict[tuple[str, str], str] = {}
    for name, pair in pairs.items():
        settings = pair_arguments({**pair, "seed": 0}, 0), pair["initialization"]
        if (twin := first.setdefault(settings, name)) != name:
            hint = "repeat a pair by `repetitions`"
            raise InputError(
                source, f"pairs.{name}", expected="another pair", found=f"the settings of {twin}", hint=hint
            )


def _require_different_assets(assets: Mapping[str, Mapping[str, Any]], source: str | Path) -> None:
    """Refuse an asset that repeats another one, perhaps from a copy of its files: it would count as another scene."""
    for (first, asset), (name, other) in combinations(assets.items(), 2):
        settings = [{**each, "model": None, "cameras": None, "clean": None} for each in (asset, other)]
        if settings[0] == settings[1] and all(_is_same(asset.get(k), other.get(k)) for k in ("model", "cameras")):
            found = f"the model and the views of {first}"
            raise InputError(source, f"assets.{name}", expected="another model", found=found)


def _is_same(first: str | None, second: str | None) -> bool:
    """Return whether two paths are equal, or those of files of the same content."""
    if first is None or second is None or os.path.realpath(first) == os.path.realpath(second):
        return bool(first) == bool(second)
    return Path(first).is_file() and Path(second).is_file() and filecmp.cmp(first, second, shallow=False)


def _require_path(path: str, source: str | Path, place: str) -> None:
    with reading(source, "an existing file or folder", place):  # a path may be too long to ask for
        exists = Path(path).is_file() or Path(path).is_dir()
    _require_no_braces(path, source, place)
    if not exists:
        hint = f"gspure download {name}" if (name := Path(path).name) in SCENES else None
        raise InputError(source, place, expected="an existing file or folder", found=path, hint=hint)


def _photographs(data: str) -> list[str]:
    """Return the photographs of all cameras of training data, held-out ones too; relative if the data is."""
    cameras = [camera for camera in read_views(Path(data)).cameras if camera.image]
    images = [str(camera.image) for camera in cameras]
    if not Path(data).is_absolute():  # a project that was moved is not trained again
        images = [os.path.relpath(image) for image in images]
    for image in images:
        _require_no_braces(image, data, "photographs")
    require_present(cameras, data)
    return images


def _require_no_braces(path: str, source: str | Path, place: str) -> None:
    if {*path} & {*"{}<>"}:
        hint = "Snakemake takes these for wildcards and variables"
        raise InputError(source, place, expected="a path without { } < >", found=path, hint=hint)


def _check_settings(
    settings: Mapping[str, Any], name: str, known: Mapping[str, Callable[..., Any]], source: str | Path, place: str
) -> None:
    """Refuse an unknown attack or scheme, and settings that its function refuses."""
    if name not in known:
        raise InputError(source, place, expected=f"one of {', '.join(known)}", found=repr(name))
    require_settings(source, known[name], _of_function(settings), f"{place}.")


def _of_function(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return those settings of a variant or a scheme that are its function's."""
    return {name: value for name, value in settings.items() if name not in {"attack", "damage", "decision", "seed"}}


def _check_name(variant: str, attack: str, source: str | Path) -> None:
    """Refuse names of controls, of folders and of other attacks."""
    if variant in {*CONTROLS, *_FOLDERS}:
        expected = f"a name other than {', '.join([*CONTROLS, *_FOLDERS])}"
        raise InputError(source, f"variants.{variant}", expected=expected, found=variant)
    if variant in attacks() and attack != variant:
        hint = "a variant with the name of an attack must be that attack; rename it"
        raise InputError(source, f"variants.{variant}.attack", expected=variant, found=repr(attack), hint=hint)


def _check_texts(settings: Mapping[str, Any], source: str | Path, place: str) -> None:
    """Refuse settings that the attack refuses on a model of a single Gaussian, such as the name of a codec."""
    chosen = _of_function(settings)
    one = np.ones((1, 1), np.float32)
    shapes = {"means": 3, "quats": 4, "log_scales": 3}
    columns = {name: np.repeat(one, count, 1) for name, count in shapes.items()}
    model = Gaussians.from_stored(**columns, opacity_logits=one[0], sh_coeffs=np.ones((1, 16, 3), np.float32))
    evidence = Evidence(one[0], np.zeros(1, np.bool_), one[0], one[0], np.zeros(1, np.int32))
    try:
        with redirect_stderr(StringIO()):
            find_attack(settings["attack"]).apply(model, evidence, **chosen)
    except InputError as error:
        if error.field in chosen:
            raise InputError(source, f"{place}.{error.field}", expected=error.expected, found=error.found) from None
    except Exception:  # noqa: BLE001, S110 - a plug-in may need a larger model
        pass


def _check_views(config: Mapping[str, Any], source: str | Path) -> None:
    """Refuse weights averaged over more views than a model has for training."""
    methods = {"method": config["method"]} | {f"decisions.{name}": d for name, d in config["decisions"].items()}
    wanted = {place: views for place, settings in methods.items() if (views := settings.get("views"))}
    if not wanted:
        return
    scenes = {f"assets.{name}": asset for name, asset in config["assets"].items()}
    scenes |= {f"pairs.{name}": pair for name, pair in config["pairs"].items()} if config["schemes"] else {}
    counts = {place: _count_training_views(scene) for place, scene in scenes.items()}
    fewest = min(counts, key=lambda place: counts[place])
    for place, views in wanted.items():
        if views > counts[fewest]:
            expected = f"at most {counts[fewest]}, the training views of {fewest}"
            raise InputError(source, f"{place}.views", expected=expected, found=str(views))


def _count_training_views(scene: Mapping[str, Any]) -> int:
    """Return the number of training views of an asset or a pair."""
    if "photographs" in scene:
        count = len(scene["photographs"])
    elif "cameras" not in scene:
        count = scene["views"]
    elif scene["cameras"] in GENERATED:
        count = scene["generated"]["count"]
    else:
        count = len(read_cameras(scene["cameras"]))
    return int(count - -(-count // TEST_EVERY))


def _check_decision(variant: Mapping[str, Any], decisions: Mapping[str, Any], source: str | Path, place: str) -> None:
    """Refuse an unknown decision, and a decision for an attack that uses none."""
    if "decision" not in variant:
        return
    if variant["decision"] not in decisions:
        expected = f"one of {', '.join(decisions) or 'no decisions'}"
        raise InputError(source, f"{place}.decision", expected=expected, found=repr(variant["decision"]))
    if not find_attack(variant["attack"]).needs & {"weights", "prune_mask"}:
        expected = f"no entry, since {variant['attack']} uses no decision"
        raise InputError(source, f"{place}.decision", expected=expected, found=repr(variant["decision"]))


def _check_one_decision(variants: Mapping[str, Mapping[str, Any]], source: str | Path) -> None:
    """Refuse different decisions for variants that are named after their attacks: they are compared with gspure."""
    named = [name for name, settings in variants.items() if name == settings["attack"]]
    masked = [name for name in named if "prune_mask" in find_attack(name).needs]
    decisions = {name: variants[name].get("decision", DEFAULT) for name in masked}
    first = GSPURE if GSPURE in decisions else next(iter(decisions), "")
    for name, decision in decisions.items():
        if decision != decisions[first]:
            hint = f"rename the variant, and set `attack: {name}` in it"
            expected = f"{decisions[first]}, the decision of {first}"
            raise InputError(source, f"variants.{name}.decision", expected=expected, found=decision, hint=hint)


def _check_damage(variant: Mapping[str, Any], source: str | Path, place: str) -> None:
    """Refuse a damage for an attack without a strength, or beside a value of that strength."""
    if "damage" not in variant:
        return
    strength = find_attack(variant["attack"]).strength
    if strength is None:
        raise InputError(source, f"{place}.damage", expected="an attack with a strength", found=variant["attack"])
    if strength.setting in variant:
        expected, found = "nothing beside damage", repr(variant[strength.setting])
        raise InputError(source, f"{place}.{strength.setting}", expected=expected, found=found)


def _at_damages(variants: Mapping[str, Mapping[str, Any]], source: str | Path) -> dict[str, dict[str, Any]]:
    """Return the variants, with one for each damage in place of those that list several."""
    expanded: dict[str, dict[str, Any]] = {}
    for name, settings in variants.items():
        listed = settings.get("damage", [])
        for damage in listed if isinstance(listed, list) else [listed]:
            if (variant := variant_at(name, damage)) in expanded:
                found = f"{variant} twice"
                raise InputError(source, f"variants.{name}.damage", expected="different damages", found=found)
            expanded[variant] = {**settings, "damage": damage}
        if "damage" not in settings:
            expanded[name] = dict(settings)
    return expanded


def _strict_validator(base: Any) -> Any:
    """Extend a validator class: numbers are finite, whole ones have no decimal point, and it fills in defaults.

    Before it looks into an object, it sets the absent properties to their defaults.
    """

    def fill(validator: Any, properties: Mapping[str, Any], instance: Any, schema: Mapping[str, Any]) -> Iterator[Any]:
        if validator.is_type(instance, "object"):
            for name, subschema in properties.items():
                if "default" in subschema:
                    instance.setdefault(name, deepcopy(subschema["default"]))
        yield from base.VALIDATORS["properties"](validator, properties, instance, schema)

    def is_number(_checker: Any, value: object) -> bool:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

    def is_integer(_checker: Any, value: object) -> bool:
        return isinstance(value, int) and not isinstance(value, bool)

    types = base.TYPE_CHECKER.redefine_many({"number": is_number, "integer": is_integer})
    return extend(base, {"properties": fill}, type_checker=types)  # type: ignore[no-untyped-call]


def _refusal(error: Any, source: str | Path) -> InputError:
    """Return a schema error in one line."""
    path = [str(step) for step in error.absolute_path]
    if error.validator == "additionalProperties":
        known = list(error.schema.get("properties", ()))
        unknown = next(key for key in error.instance if key not in known)
        field, hint = ".".join([*path, str(unknown)]), did_you_mean(str(unknown), known)
        return InputError(source, field, expected=f"one of {', '.join(known)}", found="an unknown key", hint=hint)
    if error.validator == "required":
        missing = next(name for name in error.validator_value if name not in error.instance)
        return InputError(source, ".".join([*path, missing]), expected="an entry", found="nothing")
    wanted = error.validator_value
    if error.validator == "pattern":
        description = error.schema["description"].rstrip(".")
        expected = description[0].lower() + description[1:]
        return InputError(source, ".".join(path) or "config", expected=expected, found=repr(error.instance))
    listed = ", ".join(wanted) if isinstance(wanted, list) else wanted
    expected = _EXPECTED.get(error.validator, error.validator + " {}").format(listed)
    return InputError(source, ".".join(path) or "config", expected=expected, found=repr(error.instance))
