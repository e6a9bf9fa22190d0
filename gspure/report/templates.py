"""The texts of the report: Jinja templates with all sentences, and the filters that phrase numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gspure.evaluation.intervals import LEVEL, Interval
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.names import condition_name, display_name, extraction_name, model_name
from gspure.evaluation.outcomes import is_picture
from gspure.evaluation.survival import Survival
from gspure.progress import decimal, percent, significant
from gspure.report.table import few

if TYPE_CHECKING:
    from jinja2 import Environment

FOLDER: Final = Path(__file__).parent / "templates"
TEMPLATES: Final = sorted(FOLDER.iterdir())

_NAMED: Final = 12  # most items that a sentence lists


def render(template: str, **facts: Any) -> str:
    """Return a template filled with facts; they are escaped in ``.html.j2``."""
    return _environment().get_template(template).render(**facts)


def say(template: str, macro: str, *facts: Any) -> str:
    """Return the text of a macro of a template for some facts, in one line."""
    return " ".join(str(getattr(_environment().get_template(template).module, macro)(*facts)).split())


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape

    environment = Environment(
        autoescape=select_autoescape(["html.j2"]),
        loader=FileSystemLoader(FOLDER),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "name": display_name,
        "condition_name": lambda condition: condition_name(*condition),
        "model_name": lambda model: model_name(*model),
        "psnr": METRICS["psnr"].text,
        **{phrase.__name__: phrase for phrase in PHRASES},
    }
    return environment


def plural(count: int, noun: str) -> str:
    """Return a count with its noun."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def listed(names: Iterable[str]) -> str:
    """Return names with commas and "and"; of very many, the first."""
    every = list(names)
    rest = len(every) - _NAMED
    shown = [*every[:_NAMED], f"{rest} more"] if rest > 0 else every
    between, last = ("; ", "; and ") if any("," in name for name in shown) else (", ", " and ")
    return last.join([between.join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def sentence_case(text: str) -> str:
    """Return text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


def unit(extraction: str) -> str:
    """Return the unit of an extraction: dB of PSNR, or points of what a detector reads."""
    return "dB" if is_picture(extraction) else "points"


def number(value: float, unit: str = "dB") -> str:
    """Return a number with one decimal, or if it is no PSNR, and so of any magnitude, with its first digits."""
    return decimal(value, 1) if unit == "dB" else significant(value)


def db(value: Interval, unit: str = "dB", scenes: int = 0) -> str:
    """Return a mean with its unit and spread, and the count of its scenes if they are fewer than `scenes`."""
    low, high = number(value.low, unit), number(value.high, unit)
    spread = f"[{low}, {high}]" if value.level >= LEVEL else f"({low} to {high})" if value.scenes > 1 else ""
    return " ".join(filter(None, (number(value.mean, unit), unit, spread, few(value.scenes, scenes))))


def size(value: Interval, unit: str = "dB", scenes: int = 0) -> str:
    """Return how large a difference is, whatever its sign."""
    mirrored = value._replace(mean=-value.mean, low=-value.high, high=-value.low)
    return db(value if value.mean >= 0 else mirrored, unit, scenes)


def cost(row: Survival) -> str:
    """Return an attack with its change of the message's and the scene's PSNR."""
    of = unit(row.extraction)
    drops = (("message" if of == "dB" else "mark", row.message_drop, of), ("scene", row.scene_drop, "dB"))
    known = [
        f"{name} {number(-drop.mean, of)} {of} {few(drop.scenes, row.scenes)}".rstrip()
        for name, drop, of in drops
        if drop
    ]
    scenes = row.survived or row.only_retrieved
    counted = f"; {scenes} of {row.present} scenes" if 0 < scenes < row.present else ""
    return f"{row.name} ({', '.join(known) or 'drops unknown'}{counted})"


PHRASES: Final[tuple[Callable[..., str], ...]] = (
    *(plural, listed, sentence_case, unit, extraction_name, db, size, few, cost),
    *(decimal, number, percent, significant),
)
"""Those that templates know as filters."""
