"""The workflow's configuration: checked against its schema, defaults filled in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from gspure.errors import InputError

GENERATED = frozenset({"orbit", "shells"})
"""What an asset may name in place of a camera file: views around its model."""

_EXPECTED = {
    "type": "type {}",
    "enum": "one of {}",
    "pattern": "a name that matches {}",
    "minimum": "at least {}",
    "maximum": "at most {}",
    "exclusiveMinimum": "more than {}",
}
"""What a failed schema keyword asks for, in words."""


def validated(config: Mapping[str, Any], schema_file: Path, source: str | Path) -> dict[str, Any]:
    """Return a copy of `config` in which every absent setting has its default.

    Parameters
    ----------
    config : mapping
        What the user wrote.
    schema_file : Path
        JSON schema (draft 2020-12) as YAML.
    source : str or Path
        Where `config` came from, for the error message.

    Raises
    ------
    InputError
        Naming the first setting at fault.

    """
    import jsonschema
    import yaml

    schema = yaml.safe_load(schema_file.read_text(encoding="utf-8"))
    filled = dict(deepcopy(config))
    errors = _filling_validator(jsonschema.Draft202012Validator)(schema).iter_errors(filled)
    if error := jsonschema.exceptions.best_match(errors):
        raise _refusal(error, source)
    return filled


def resolved(config: Mapping[str, Any], source: str | Path) -> dict[str, Any]:
    """Return a copy of a validated configuration in which given models are files and every variant names its attack.

    An asset to be trained gets the entry ``photographs``: the files that its cameras name.

    Raises
    ------
    InputError
        If there is no model at all, or one of them, its cameras or its photographs do not exist, or a model is both
        given and to be trained, or an attack or a setting of it is not known.

    """
    from gspure.attacks import attacks
    from gspure.cameras import read_cameras
    from gspure.model.inria import point_cloud

    settled = deepcopy(dict(config))
    if not settled["assets"] and not settled["planted"]:
        raise InputError(source, "assets", expected="at least one model", found="none")
    for scene, asset in settled["assets"].items():
        for field in (name for name in ("model", "cameras", "train") if name in asset):
            if field != "train" and "train" in asset:
                raise InputError(source, f"assets.{scene}.{field}", expected="nothing beside train", found=asset[field])
            if not Path(asset[field]).exists() and not (field == "cameras" and asset[field] in GENERATED):
                raise InputError(source, f"assets.{scene}.{field}", expected="an existing path", found=asset[field])
        if "model" in asset and (model := Path(asset["model"])).is_dir():
            asset["model"] = str(point_cloud(model))
        if "train" in asset:
            asset["photographs"] = [str(camera.image) for camera in read_cameras(asset["train"]) if camera.image]
    available = attacks()
    for variant, settings in settled["variants"].items():
        attack = settings.setdefault("attack", variant)
        if attack not in available:
            expected = f"one of {', '.join(available)}"
            raise InputError(source, f"variants.{variant}", expected=expected, found=repr(attack))
        _check_settings(settings, available[attack].settings, source, f"variants.{variant}")
    return settled


def _check_settings(given: Mapping[str, Any], known: Mapping[str, Any], source: str | Path, variant: str) -> None:
    """Refuse what is no setting of a variant's attack, and texts for numbers or the other way round."""
    for name in sorted(given.keys() - {"attack", "seed"}):
        if name not in known:
            expected = f"one of {', '.join(known) or 'no settings'}"
            raise InputError(source, f"{variant}.{name}", expected=expected, found="an unknown key")
        if isinstance(given[name], str) != isinstance(known[name], str):
            expected = "a text" if isinstance(known[name], str) else "a number"
            raise InputError(source, f"{variant}.{name}", expected=expected, found=repr(given[name]))


def _filling_validator(base: Any) -> Any:
    """Extend a validator class: before it looks into an object, it sets the absent properties to their defaults."""
    from jsonschema.validators import extend

    def fill(validator: Any, properties: Mapping[str, Any], instance: Any, schema: Mapping[str, Any]) -> Iterator[Any]:
        if validator.is_type(instance, "object"):
            for name, subschema in properties.items():
                if "default" in subschema:
                    instance.setdefault(name, deepcopy(subschema["default"]))
        yield from base.VALIDATORS["properties"](validator, properties, instance, schema)

    return extend(base, {"properties": fill})  # type: ignore[no-untyped-call]


def _refusal(error: Any, source: str | Path) -> InputError:
    """Tell a schema error in one line."""
    path = [str(step) for step in error.absolute_path]
    if error.validator == "additionalProperties":
        known = list(error.schema.get("properties", ()))
        unknown = next(key for key in error.instance if key not in known)
        near = get_close_matches(str(unknown), known, 1)
        hint = f"did you mean {near[0]}?" if near else None
        field = ".".join([*path, str(unknown)])
        return InputError(source, field, expected=f"one of {', '.join(known)}", found="an unknown key", hint=hint)
    if error.validator == "required":
        missing = next(name for name in error.validator_value if name not in error.instance)
        return InputError(source, ".".join([*path, missing]), expected="an entry", found="nothing")
    wanted = error.validator_value
    listed = ", ".join(wanted) if isinstance(wanted, list) else wanted
    expected = _EXPECTED.get(error.validator, error.validator + " {}").format(listed)
    return InputError(source, ".".join(path) or "config", expected=expected, found=repr(error.instance))
