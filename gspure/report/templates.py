"""The texts of the report: Jinja templates, in which every sentence stands."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gspure.evaluation.metrics import METRICS
from gspure.evaluation.names import condition_name, display_name, model_name
from gspure.report import phrases, table

if TYPE_CHECKING:
    from jinja2 import Environment

FOLDER: Final = Path(__file__).parent / "templates"
TEMPLATES: Final = sorted(FOLDER.iterdir())


def render(template: str, **facts: Any) -> str:
    """Return a template filled with facts; they are escaped in ``.html.j2``."""
    return _environment().get_template(template).render(**facts)


def say(template: str, macro: str, *facts: Any) -> str:
    """Return what a macro of a template says about some facts, in one line."""
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
        "signed": table.signed,
        "percent": lambda value: table.share(value).text,
        **{phrase.__name__: phrase for phrase in phrases.PHRASES},
    }
    return environment
