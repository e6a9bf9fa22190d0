"""The page of the 3-D view, and the templates that it shares with the report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gspure import __version__
from gspure.files import write_text
from gspure.text import percent

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES: Final = Path(__file__).parent / "templates"


def write_view(path: Path, data: Mapping[str, Any]) -> None:
    """Write a page with the view of `gspure.viewer.data.view_of` alone, whole or not at all."""
    page = template_environment().get_template("view.html.j2")
    write_text(path, page.render(version=__version__, data=data))


def template_environment(*folders: Path) -> Environment:
    """Return the templates in `folders` and those of the viewer, with the filter that writes shares as percentages."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = FileSystemLoader([*folders, _TEMPLATES])
    environment = Environment(
        autoescape=True, loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["percent"] = percent
    return environment
