"""Configurations from YAML files: read, laid over each other, and checked."""

from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import yaml

from gspure.codec import read
from gspure.errors import InputError, reading
from gspure.evaluation.plan import METHOD
from gspure.files import Json
from gspure.metrics.names import GSPURE, UNATTACKED
from gspure.metrics.targets import MESSAGE
from gspure.workflow.config import AssetConfig, Config
from gspure.workflow.matrix import expanded

SUITES: Final = Path(__file__).parent / "suites"


def read_config(files: Iterable[Path], overrides: Mapping[str, object], source: str) -> Config:
    """Read a configuration from YAML files, later ones over earlier ones, with the overrides of ``--config`` on top.

    Raise `InputError` for the first entry that no job could use; `source` names the configuration.
    """
    content: dict[str, object] = {}
    for file in files:
        content = _laid_over(content, expanded(load_yaml(file), file))
    return config_of(_laid_over(content, expanded(overrides, source)), source)


def config_of(content: Mapping[str, object], source: str) -> Config:
    """Return the configuration with this content, or raise `InputError` for the first entry that does not fit."""
    content = dict(content)
    if "suite" in content:
        if "variants" in content:
            raise InputError(source, "variants", expected="nothing beside suite", found="an entry")
        content = _laid_over(suite_content(content["suite"], source), content)
    if "decisions" in content:
        content["decisions"] = _inherited(content)
    config: Config = read(Config, content, source)
    _require_consistent(config, source)
    return config


def suite_content(name: object, source: str) -> Json:
    """Return the configuration that a suite is, by its name, or raise `InputError`."""
    known = {file.stem: file for file in sorted(SUITES.glob("*.yaml"))}
    if name not in known:
        raise InputError(source, "suite", expected=f"one of {', '.join(known)}", found=repr(name))
    return load_yaml(known[str(name)])


def _require_consistent(config: Config, source: str) -> None:
    """Refuse entries that contradict others, or lack them."""
    for name in (UNATTACKED, GSPURE):
        if name not in config.variants:
            raise InputError(source, f"variants.{name}", expected="an entry", found="none")
    if METHOD in config.decisions:
        raise InputError(source, f"decisions.{METHOD}", expected="another name than that of the method", found=METHOD)
    for name, decision in config.decisions.items():
        if not {"opacity", "weight"} & {*decision.cluster_on}:
            place = f"decisions.{name}.cluster_on"
            raise InputError(source, place, expected="opacity, weight or both", found=", ".join(decision.cluster_on))
    for name, asset in config.assets.items():
        _require_complete(asset, source, f"assets.{name}")
    if config.extractions is not None and MESSAGE not in config.extractions:
        raise InputError(source, "extractions", expected=f"{MESSAGE} among them", found=", ".join(config.extractions))


def _require_complete(asset: AssetConfig, source: str, place: str) -> None:
    """Refuse an asset that lacks what its other entries need, or has a model beside photographs to train one from."""
    fields = ("model", "cameras", "key", "message")
    if asset.train:
        for name in fields:
            if getattr(asset, name):
                raise InputError(source, f"{place}.{name}", expected="nothing beside train", found=getattr(asset, name))
        return
    for name in ("model", "cameras"):
        if not getattr(asset, name):
            raise InputError(source, f"{place}.{name}", expected="a path, or photographs to train from", found="none")
    for name in ("scheme", "message"):
        if getattr(asset, name) and not asset.key:
            raise InputError(source, f"{place}.{name}", expected="a key beside it", found="none")
    if asset.generated.up is not None and not any(asset.generated.up):
        raise InputError(source, f"{place}.generated.up", expected="a direction", found="0 0 0")


def load_yaml(file: Path) -> Json:
    """Read a YAML file whose keys are texts, such as ``no`` or ``2024_05``, each of them once."""
    with reading(file, "a configuration, as YAML"), file.open(encoding="utf-8-sig") as stream:
        content = yaml.load(stream, _TextKeys)  # noqa: S506 - a SafeLoader
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise InputError(file, "content", expected="a mapping", found=type(content).__name__)
    return content


class _TextKeys(yaml.SafeLoader):
    """A safe loader that keeps keys as they are written, and refuses those that are written twice."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node: yaml.MappingNode = super().compose_mapping_node(anchor)
        self._require_distinct(node)  # here, since `<<` repeats keys later
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, object]:  # noqa: FBT001, FBT002
        self.flatten_mapping(node)  # lays the entries of `<<` below the node's own
        return {
            self._key(key_node): self.construct_object(value_node, deep=deep) for key_node, value_node in node.value
        }

    def _key(self, node: yaml.Node) -> Hashable:
        if isinstance(node, yaml.ScalarNode):
            return str(node.value)
        key: Hashable = self.construct_object(node, deep=True)
        return key

    def _require_distinct(self, node: yaml.MappingNode) -> None:
        known = set[Hashable]()
        for key_node, _ in node.value:
            key = self._key(key_node)
            if key in known:
                place = f"{key} in line {key_node.start_mark.line + 1}"
                raise InputError(node.start_mark.name, place, expected="each key once", found="the second one")
            known.add(key)


def _laid_over(content: Mapping[str, object], changes: Mapping[str, object]) -> dict[str, object]:
    """Return content with the entries of `changes`, below common mappings one by one, as Snakemake does.

    Neither is changed: with an alias, a YAML file has the same mapping in several places.
    """
    merged = {**content, **changes}
    for name in content.keys() & changes.keys():
        below = content[name]
        above = changes[name]
        if isinstance(below, Mapping) and isinstance(above, Mapping):
            merged[name] = _laid_over(below, above)
    return merged


def _inherited(content: Mapping[str, object]) -> object:
    """Return the decisions, each with the settings of the method that it does not set itself."""
    method = content.get("method")
    decisions = content["decisions"]
    if not isinstance(method, Mapping) or not isinstance(decisions, Mapping):
        return decisions
    return {name: {**method, **entry} if isinstance(entry, Mapping) else entry for name, entry in decisions.items()}
