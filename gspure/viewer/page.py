"""The templates of the 3-D view, which the report shares."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from gspure.text import percent

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES: Final = Path(__file__).parent / "templates"


def template_environment(*folders: Path) -> Environment:
    """Return the templates in `folders` and those of the viewer, with the filter that writes shares as percentages."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = FileSystemLoader([*folders, _TEMPLATES])
    environment = Environment(
        autoescape=True, loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["percent"] = percent
    return environment
