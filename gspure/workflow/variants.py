"""The variants of a configuration, and its detectors and schemes: names are looked up, settings are checked."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from gspure.attacks import Attack, attacks
from gspure.errors import InputError
from gspure.evaluation.plan import METHOD, Detector, Until
from gspure.external import words_of
from gspure.metrics.names import is_control, variant_at
from gspure.metrics.targets import HIDDEN_BITS, SCENE, is_picture
from gspure.plugins import detectors as detectors_of_plugins
from gspure.schemes.registry import schemes
from gspure.settings import Setting, require_settings, typed_settings
from gspure.workflow.assets import require_known
from gspure.workflow.config import Config, VariantConfig

_FOLDERS: Final = ("public", "key", "contributions", "decisions", "figures", "trained")  # of a model


class VariantSpec(NamedTuple):
    """A variant of the configuration: an attack at one strength."""

    attack: Attack
    entry: str  # of the configuration
    decision: str
    seed: int
    settings: Mapping[str, Setting]
    damage: float | None = None  # to search a strength for, dB
    until: Until | None = None  # what to search the least strength for

    @property
    def is_searched(self) -> bool:
        """Whether the strength is searched."""
        return self.damage is not None or self.until is not None


def read_variants(config: Config, source: str) -> dict[str, VariantSpec]:
    """Return the variants of a configuration; a list of damages becomes a variant for each."""
    variants = {}
    for name, entry in config.variants.items():
        variant = _variant(name, entry, config, source)
        if entry.damage is None:
            variants[name] = variant
            continue
        damages = entry.damage if isinstance(entry.damage, tuple) else (entry.damage,)
        for damage in damages:
            variant_name = variant_at(name, damage)
            if variant_name in variants:
                place = f"variants.{name}.damage"
                raise InputError(source, place, expected="damages that differ in six digits", found=f"{damage:g} twice")
            variants[variant_name] = variant._replace(damage=damage)
    return variants


def _variant(name: str, entry: VariantConfig, config: Config, source: str) -> VariantSpec:
    """Return a variant; refuse it unless its name, attack, settings, decision and damage go together."""
    place = f"variants.{name}"
    known = attacks()
    if name in _FOLDERS or is_control(name):
        raise InputError(source, place, expected="a name of no control and no folder of a model", found=name)
    attack_name = entry.attack or name
    require_known(attack_name, [name] if name in known else [*known], source, place)
    attack = known[attack_name]
    require_settings(source, attack.function, entry.settings, f"{place}.")
    if entry.decision is not None:
        require_known(entry.decision, [*config.decisions], source, f"{place}.decision")
        if not attack.needs & {"weights", "prune_mask"}:
            expected = f"no entry, since {attack_name} uses no decision"
            raise InputError(source, f"{place}.decision", expected=expected, found=repr(entry.decision))
    for search in ("damage", "until"):
        if getattr(entry, search) is None:
            continue
        if attack.strength is None:
            raise InputError(source, f"{place}.{search}", expected="an attack with a strength", found=attack_name)
        strength = entry.settings.get(attack.strength.setting)
        if strength is not None:
            field = f"{place}.{attack.strength.setting}"
            raise InputError(source, field, expected=f"nothing beside {search}", found=repr(strength))
    if entry.damage is not None and entry.until is not None:
        raise InputError(source, f"{place}.until", expected="nothing beside damage", found=entry.until)
    settings = typed_settings(attack.function, entry.settings)
    return VariantSpec(attack, name, entry.decision or METHOD, entry.seed, settings, until=entry.until)


def read_detectors(config: Config, source: str) -> dict[str, Detector]:
    """Return the detectors of a configuration; refuse commands that cannot be split, and names of targets."""
    detectors = {}
    for name, entry in config.detectors.items():
        place = f"detectors.{name}"
        if name in (SCENE, *HIDDEN_BITS) or is_picture(name):
            raise InputError(source, place, expected="a name of no target", found=name)
        if entry.command is None:
            require_known(name, [*detectors_of_plugins()], source, place)
        command = entry.command or detectors_of_plugins()[name]
        words_of(command, f"{source}: {place}")
        detectors[name] = Detector(command, entry.message, entry.timeout, entry.reads)
    return detectors


def check_schemes(config: Config, source: str) -> None:
    """Refuse unknown schemes, settings and extractions."""
    known = schemes() if config.schemes else {}
    for name, entry in config.schemes.items():
        require_known(name, [*known], source, f"schemes.{name}")
        require_settings(source, known[name].embed, entry.settings, f"schemes.{name}.")
    extractions = sorted({extraction for name in config.schemes for extraction in known[name].extractions})
    for extraction in config.extractions or ():
        require_known(extraction, extractions, source, "extractions")
