"""The report: one self-contained HTML page about all models of a run."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from gspure import __version__
from gspure.evaluation.outcomes import Outcome
from gspure.figures import style
from gspure.files import Json, write_text
from gspure.images import opened
from gspure.metrics import legibility
from gspure.metrics.names import UNATTACKED, display_name, extraction_name
from gspure.report.answer import Answer
from gspure.report.audit import BROKEN, WEAK
from gspure.report.table import Table
from gspure.text import decimal, p_value
from gspure.viewer.page import template_environment

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES: Final = Path(__file__).parent / "templates"
_WIDEST: Final = 1400  # width in pixels of an embedded figure as wide as a page
_RENDER: Final = 420  # width in pixels of an embedded render


@dataclass(frozen=True)
class Picture:
    """One figure as the page shows it."""

    name: str
    caption: str
    data: str  # the image as a data URI
    wide: bool  # whether it is as wide as a page rather than a column
    files: list[str]  # paths, relative to the page, of the figure and of its vector graphic if there is one


@dataclass(frozen=True)
class ModelSection:
    """One model as the page shows it.

    `viewer` holds the data of `gspure.viewer.data.write_viewer`, and `diagnosis` that of the clustering.
    """

    scheme: str
    folder: str
    answer: Answer  # of this model alone
    outcomes: Sequence[Outcome]
    table: Table
    failures: Sequence[str]
    pictures: Sequence[Picture]
    images: Mapping[str, Mapping[str, str]]  # one view by variant and target, as data URIs
    viewer: Json
    diagnosis: Json


class Comparison(NamedTuple):
    """One condition over all of its scenes."""

    answer: Answer
    models: Sequence[ModelSection]
    tables: Sequence[Table]  # one for each owner and detector
    pictures: Sequence[Picture]
    meanings: Mapping[str, str]  # of the attacks, by display name

    @property
    def scans(self) -> list[Mapping[str, str]]:
        """The verdicts of a scan of each model, before and after GSPure."""
        return [model.diagnosis["scan"] for model in self.models if "after" in model.diagnosis.get("scan", {})]


def write_page(results: Path, comparisons: Sequence[Comparison], links: Sequence[Path]) -> None:
    """Write ``report.html``, whole or not at all. The page loads nothing; it links `links`, files of the run."""
    page = environment().get_template("page.html.j2")
    text = page.render(
        version=__version__,
        comparisons=comparisons,
        links=[os.path.relpath(file.resolve(), results.resolve()) for file in links],
        weak=WEAK,
        broken=BROKEN,
        legible=legibility.TRACES,
    )
    write_text(results / "report.html", text)


def picture(file: Path, caption: str, results: Path) -> Picture:
    """Return a PNG figure with its caption, and links to it and to its vector graphic."""
    formats = [file.with_suffix(suffix) for suffix in (".png", ".svg")]
    files = [str(path.relative_to(results)) for path in formats if path.exists()]
    with opened(file) as image:
        wide = image.width > 1.2 * style.COLUMN * style.DPI
        data = _embedded(image, _WIDEST if wide else _WIDEST // 2)
    return Picture(display_name(file.stem), caption, data, wide, files)


def renders(folder: Path, variants: Iterable[str], views: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return the renders ``folder/VARIANT/renders/TARGET/VIEW.png`` as data URIs by variant and target.

    `views` name one view per target. Return none if the unattacked model has none.
    """
    images: dict[str, dict[str, str]] = {}
    for variant in dict.fromkeys(variants):
        for target, view in views.items():
            file = folder / variant / "renders" / target / f"{view}.png"
            if file.is_file():
                with opened(file) as image:
                    images.setdefault(variant, {})[target] = _embedded(image, _RENDER)
    return images if UNATTACKED in images else {}


def _embedded(image: Any, widest: int) -> str:
    """Return a picture as a data URI, reduced to a width of at most `widest` pixels."""
    reduced = image.convert("RGB")
    reduced.thumbnail((widest, 10 * widest))
    buffer = io.BytesIO()
    reduced.save(buffer, format="WEBP", quality=80, method=4)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()


@cache
def environment() -> Environment:
    """Return the templates of the report and the viewer, with the filters that write names and numbers."""
    templates = template_environment(_TEMPLATES)
    templates.filters |= {
        "name": display_name,
        "extraction_name": extraction_name,
        "decimal": decimal,
        "p_value": p_value,
        "sentence_case": lambda text: text[:1].upper() + text[1:],
    }
    return templates
