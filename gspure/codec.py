"""Dataclasses as JSON and back, and their JSON schema: the one codec of configurations, plans and results.

Fields are numbers, texts, paths, literals, dataclasses, named tuples, and tuples, mappings and unions of these.
`Annotated` adds bounds (`gspure.settings.Range`), a `Text` rule, a description for the schema, or `REST`. In a union of
dataclasses, the entry `KIND` names the class. Numbers that are not finite are null.
"""

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from gspure.errors import InputError
from gspure.settings import Range

KIND: Final = "kind"  # entry that names the class of an object in a union of classes
REST: Final = "rest"  # annotation of a mapping field that takes all keys which no other field has

_Reader = Callable[[Any, Any, str | Path, str], Any]


class Text(NamedTuple):
    """A rule for texts: a pattern, and the rule in words for refusals."""

    pattern: str
    expected: str

    def require(self, source: str | Path, field: str, value: object) -> None:
        """Raise `InputError` for the `field` of a source unless the value is a text that follows the rule."""
        if not isinstance(value, str) or not re.fullmatch(self.pattern, value):
            raise InputError(source, field, expected=self.expected, found=shown(value))


def text(value: object) -> str:
    """Return a value as JSON on one line."""
    return json.dumps(plain(value), ensure_ascii=False)


def plain(value: Any) -> Any:
    """Return a value as dictionaries, lists, texts and numbers, which JSON and YAML can hold."""
    if is_dataclass(value) or hasattr(value, "_fields"):
        return _plain_object(value)
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def read(kind: Any, value: Any, source: str | Path, place: str = "") -> Any:
    """Return a value of a type from dictionaries, lists, texts and numbers.

    Raise `InputError` for the first entry of the source that does not fit, with its place: ``pairs.room.width``.
    """
    is_object = is_dataclass(kind) or hasattr(kind, "_fields")
    default: _Reader = _read_object if is_object else _read_scalar
    readers: dict[Any, _Reader] = {
        Annotated: _read_annotated,
        Union: _read_union,
        UnionType: _read_union,
        Literal: _read_literal,
        tuple: _read_tuple,
        Mapping: _read_mapping,
    }
    return readers.get(get_origin(kind), default)(kind, value, source, place)


def schema(kind: Any) -> dict[str, Any]:
    """Return the JSON schema of a type."""
    writers: dict[Any, Callable[[tuple[Any, ...]], dict[str, Any]]] = {
        Annotated: _annotated_schema,
        Union: _union_schema,
        UnionType: _union_schema,
        Literal: lambda choices: {"enum": [*choices]},
        tuple: _tuple_schema,
        Mapping: _mapping_schema,
    }
    if is_dataclass(kind) or hasattr(kind, "_fields"):
        return _object_schema(kind)
    if get_origin(kind) in writers:
        return writers[get_origin(kind)](get_args(kind))
    names: dict[Any, str] = {str: "string", Path: "string", int: "integer", float: "number", bool: "boolean"}
    return {"type": names.get(kind, "null")}


def _tuple_schema(items: tuple[Any, ...]) -> dict[str, Any]:
    content: dict[str, Any] = {"type": "array", "items": schema(items[0])}
    if Ellipsis not in items:
        content |= {"minItems": len(items), "maxItems": len(items)}
    return content


def _mapping_schema(arguments: tuple[Any, ...]) -> dict[str, Any]:
    names = schema(arguments[0])
    names.pop("type", None)
    return {"type": "object", "propertyNames": names, "additionalProperties": schema(arguments[1])}


def shown(value: object) -> str:
    """Return a value as the user wrote it, for refusals."""
    if isinstance(value, str):
        return repr(value)
    if isinstance(value, Mapping):
        return "a mapping" if value else "nothing"
    return json.dumps(value) if isinstance(value, list | bool | NoneType) else str(value)


@cache
def hints(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a class, with their annotations."""
    return get_type_hints(kind, include_extras=True)


@cache
def _defaults(kind: type) -> dict[str, Any]:
    """Return the defaults of the fields that have one."""
    if not is_dataclass(kind):
        return dict(getattr(kind, "_field_defaults", {}))
    known = {}
    for field in fields(kind):
        if field.default is not MISSING:
            known[field.name] = field.default
        elif field.default_factory is not MISSING:
            known[field.name] = field.default_factory()
    return known


def _plain_object(value: Any) -> dict[str, Any]:
    content: dict[str, Any] = {}
    kind: Any = type(value)
    for name, hint in hints(kind).items():
        item = getattr(value, name)
        if REST in getattr(hint, "__metadata__", ()):
            content |= plain(item)
            continue
        content[name] = plain(item)
        if len(_classes(hint)) > 1 and item is not None:
            content[name] = {KIND: type(item).__name__, **content[name]}
    return content


def _classes(kind: Any) -> list[type]:
    """Return the classes of a union."""
    if get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    if get_origin(kind) not in (Union, UnionType):
        return []
    return [member for member in get_args(kind) if isinstance(member, type) and is_dataclass(member)]


def _read_annotated(kind: Any, value: Any, source: str | Path, place: str) -> Any:
    inner, *rules = get_args(kind)
    for rule in rules:
        if isinstance(rule, Range | Text):
            rule.require(source, place, value)
    return read(inner, value, source, place)


def _read_literal(kind: Any, value: Any, source: str | Path, place: str) -> Any:
    choices = get_args(kind)
    if value not in choices or isinstance(value, bool):
        raise InputError(source, place, expected=f"one of {', '.join(map(str, choices))}", found=shown(value))
    return value


def _read_union(kind: Any, value: Any, source: str | Path, place: str) -> Any:
    kinds = get_args(kind)
    if value is None and NoneType in kinds:
        return None
    classes: dict[str, Any] = {member.__name__: member for member in _classes(kind)}
    if len(classes) > 1:
        return _read_named_class(classes, value, source, place)
    candidates = [member for member in kinds if member is not NoneType]
    fitting = [member for member in candidates if _takes(member, value)]
    return read((fitting or candidates)[0], value, source, place)


def _read_named_class(classes: Mapping[str, Any], value: Any, source: str | Path, place: str) -> Any:
    if not isinstance(value, Mapping):
        raise InputError(source, place or "content", expected="a mapping", found=shown(value))
    name = value.get(KIND)
    if not isinstance(name, str) or name not in classes:
        inner = f"{place}.{KIND}" if place else KIND
        raise InputError(source, inner, expected=f"one of {', '.join(classes)}", found=shown(name))
    content = {key: item for key, item in value.items() if key != KIND}
    return read(classes[name], content, source, place)


def _takes(kind: Any, value: object) -> bool:
    """Return whether a type of a union is meant by a value: the type itself, or a container for lists and mappings."""
    inner = get_args(kind)[0] if get_origin(kind) is Annotated else kind
    if isinstance(value, list | tuple):
        return get_origin(inner) is tuple
    if isinstance(value, Mapping):
        return is_dataclass(inner) or get_origin(inner) is Mapping
    return inner is type(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _read_tuple(kind: Any, value: Any, source: str | Path, place: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise InputError(source, place, expected="a list", found=shown(value))
    item_kind, *rest = get_args(kind)
    if rest not in ([], [Ellipsis]) and len(value) != 1 + len(rest):
        raise InputError(source, place, expected=f"{1 + len(rest)} entries", found=f"{len(value)}")
    return tuple(read(item_kind, item, source, f"{place}[{i}]") for i, item in enumerate(value))


def _read_mapping(kind: Any, value: Any, source: str | Path, place: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(source, place, expected="a mapping", found=shown(value))
    key_kind, item_kind = get_args(kind)
    items = {}
    for key, item in value.items():
        inner = f"{place}.{key}" if place else str(key)
        items[read(key_kind, key, source, inner)] = read(item_kind, item, source, inner)
    return items


def _read_object(kind: type, value: Any, source: str | Path, place: str) -> Any:
    if not isinstance(value, Mapping):
        raise InputError(source, place or "content", expected="a mapping", found=shown(value))
    known = hints(kind)
    rest_field = next((name for name, hint in known.items() if REST in getattr(hint, "__metadata__", ())), None)
    rest: dict[str, Any] = {}
    content: dict[str, Any] = {}
    for key, item in value.items():
        inner = f"{place}.{key}" if place else str(key)
        if key in known and key != rest_field:
            content[key] = read(known[key], item, source, inner)
        elif rest_field is not None:
            rest[key] = item
        else:
            raise InputError(source, inner, expected=_expected_keys(key, known), found="an unknown key")
    if rest_field is not None:
        content[rest_field] = read(known[rest_field], rest, source, place)
    missing = [name for name in known if name not in content and name not in _defaults(kind)]
    if missing:
        inner = f"{place}.{missing[0]}" if place else missing[0]
        raise InputError(source, inner, expected="an entry", found="none")
    return kind(**content)


def _expected_keys(key: object, known: Mapping[str, Any]) -> str:
    near = get_close_matches(str(key), known, n=1)
    return f"{near[0]}?" if near else f"one of {', '.join(known)}"


def _read_scalar(kind: Any, value: Any, source: str | Path, place: str) -> Any:
    if kind is Any:
        return value
    if kind is Path and isinstance(value, str | Path) and str(value):
        return Path(value)
    if kind is float and value is None:
        return math.nan
    if kind is float and _is_number(value):
        return float(value)
    if kind is bool and isinstance(value, bool):
        return value
    if kind in (int, str) and isinstance(value, kind) and not isinstance(value, bool):
        return value
    words = {int: "a whole number", float: "a number", bool: "true or false", str: "a text", Path: "a path"}
    raise InputError(source, place, expected=words.get(kind, "nothing"), found=shown(value))


def _annotated_schema(arguments: tuple[Any, ...]) -> dict[str, Any]:
    inner, *annotations = arguments
    content = schema(inner)
    for rule in annotations:
        if isinstance(rule, Range):
            content["exclusiveMinimum" if rule.above else "minimum"] = rule.least
            content["maximum"] = rule.most
        elif isinstance(rule, Text):
            content |= {"pattern": f"^(?:{rule.pattern})$"}
        elif isinstance(rule, str) and rule != REST:
            content = {"description": rule, **content}
    return content


def _union_schema(kinds: tuple[Any, ...]) -> dict[str, Any]:
    parts = [schema(kind) for kind in kinds]
    if all(part.keys() == {"type"} for part in parts):
        return {"type": [part["type"] for part in parts]}
    return {"anyOf": parts}


def _object_schema(kind: type) -> dict[str, Any]:
    content: dict[str, Any] = {"type": "object", "properties": {}, "additionalProperties": False}
    defaults = _defaults(kind)
    required = []
    for name, hint in hints(kind).items():
        if REST in getattr(hint, "__metadata__", ()):
            content["additionalProperties"] = schema(hint)["additionalProperties"]
            continue
        content["properties"][name] = schema(hint)
        if name in defaults:
            content["properties"][name]["default"] = plain(defaults[name])
        else:
            required.append(name)
    if required:
        content["required"] = required
    return content
