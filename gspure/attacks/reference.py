"""What an attack is, for people: from the docstring of its function and its declarations."""

import inspect
from collections.abc import Iterator
from typing import Final

from gspure.attacks.attack import Attack
from gspure.settings import Setting, bounds

LARGEST_SHOWN: Final = 1000  # larger bounds are far above what is useful
NOTES: Final = """\
A row is a Gaussian of the model's .ply, or an anchor of SecureGS. Its weight ω is its mean contribution to the
training views; the opacity of an anchor is the mean over its Gaussians. The radius of a model is that of the sphere
around the median of its centres that holds 90 % of them.
"""
"""Words of the docstrings."""


def reference(attack: Attack) -> str:
    """Return what an attack does, its settings, strength and needs, as Markdown that terminals can show."""
    text = inspect.getdoc(attack.function) or ""
    facts = "\n".join([*_settings(attack), *_strength(attack), *_needs(attack)])
    return f"{text}\n\n{facts}".strip() + "\n"


def _settings(attack: Attack) -> Iterator[str]:
    limits = bounds(attack.function)
    for name, default in attack.settings.items():
        span = limits[name]
        range_text = f"; {span}" if span and span.most <= LARGEST_SHOWN else ""
        yield f"- Setting `{name}`: default {_shown(default)}{range_text}."


def _shown(default: Setting) -> str:
    return f"`{default}`" if isinstance(default, str) else f"{default:g}"


def _strength(attack: Attack) -> Iterator[str]:
    strength = attack.strength
    if strength:
        direction = "larger" if strength.strong > strength.weak else "smaller"
        span = f"{strength.weak:g} to {strength.strong:g}"
        yield f"- Strength: `{strength.setting}`, {direction} is stronger; a search for a damage tries {span}."
    else:
        yield "- Strength: none; a damage cannot be searched for."


def _needs(attack: Attack) -> Iterator[str]:
    options = [f"`--{name.replace('_', '-')}`" for name in sorted(attack.needs)]
    if "teacher" in attack.parameters:
        options.append("`--cameras`")
    if options:
        yield f"- Needs: {', '.join(options)}."
    if attack.packages:
        yield f"- Packages: {', '.join(sorted(set(attack.packages.values())))}."
    if attack.of_renders:
        yield "- Changes renders, so it runs as a variant of a configuration only."
