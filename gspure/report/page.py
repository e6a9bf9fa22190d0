"""The report: one self-contained HTML page about all models of a run."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from gspure.evaluation.matched import reached_names
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.names import condition_name, display_name, extraction_name, model_name
from gspure.evaluation.outcomes import Outcome
from gspure.figures import style
from gspure.files import read_json, write_text
from gspure.images import opened
from gspure.progress import percent
from gspure.report.audit import ALLOWED, Audit
from gspure.report.table import Table
from gspure.report.tables import failures, model_table

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES: Final = Path(__file__).parent / "templates"
_WIDEST: Final = 1400  # pixels of an embedded figure
_RENDER: Final = 560  # and of a render


class Link(NamedTuple):
    """A file beside the page."""

    name: str
    target: str  # its path from the folder of the page


@dataclass(frozen=True)
class Picture:
    """One figure as the page shows it."""

    name: str
    caption: str
    data: str  # the image as a data URI
    wide: bool  # whether it is as wide as a page rather than a column
    files: list[Link]  # the figure itself, also as a vector graphic if there is one


@dataclass(frozen=True)
class Lineup:
    """One view of a model after every attack: images by variant and target, as data URIs."""

    view: str
    images: dict[str, dict[str, str]]


@dataclass(frozen=True)
class Model:
    """One model as the page shows it.

    `viewer` and `diagnosis` hold what `gspure.figures.viewer.write_viewer` and the diagnosis of the clustering wrote.
    """

    scheme: str
    folder: str
    outcomes: Sequence[Outcome]
    attack: str  # the variant that pictures compare with the unattacked model
    pictures: Sequence[Picture] = ()
    files: Sequence[Link] = ()  # figures that renders or viewer replace on the page
    lineup: Lineup | None = None
    viewer: Mapping[str, Any] = field(default_factory=dict)
    diagnosis: Mapping[str, Any] = field(default_factory=dict)

    @property
    def names(self) -> dict[str, str]:
        """The display name of every variant, with the damage that the search for its strength reached."""
        return reached_names(self.outcomes)

    @property
    def table(self) -> Table:
        """The metrics of all variants."""
        return model_table(self.outcomes)

    @property
    def failures(self) -> list[str]:
        """What is missing, and why."""
        return failures(self.outcomes)


@dataclass(frozen=True)
class Comparison:
    """One condition over all of its scenes."""

    audit: Audit
    models: Sequence[Model]
    tables: Sequence[Table]
    pictures: Sequence[Picture]

    @property
    def shown(self) -> Model | None:
        """The first model with renders that holds the message; without one, the first with renders."""
        models = [model for model in self.models if model.lineup]
        holding = (m for m in models if any(self.audit.extraction in o.messages for o in m.outcomes))
        return next(holding, next(iter(models), None))


def write_page(path: Path, comparisons: Sequence[Comparison], links: Sequence[Path] = ()) -> None:
    """Write the page, whole or not at all. It loads nothing from outside itself, and links the files of the run."""
    from gspure import __version__

    linked = [link(file, path) for file in links]
    page = environment().get_template("page.html.j2")
    write_text(path, page.render(version=__version__, comparisons=comparisons, links=linked, allowed=ALLOWED))


def link(file: Path, page: Path) -> Link:
    """Return a link from a page to a file."""
    return Link(file.name, Path(os.path.relpath(file.resolve(), page.resolve().parent)).as_posix())


def picture(file: Path, caption: str, page: Path) -> Picture:
    """Return a PNG figure with its caption, and links to it and to its vector graphic."""
    files = [link(path, page) for suffix in (".png", ".svg") if (path := file.with_suffix(suffix)).exists()]
    with opened(file) as image:
        wide = image.width > 1.2 * style.COLUMN * style.DPI
        return Picture(display_name(file.stem), caption, _embedded(image, _WIDEST), wide, files)


def lineup(folder: Path, variants: Sequence[str], views: Mapping[str, str]) -> Lineup | None:
    """Return the renders ``folder/VARIANT/renders/TARGET/VIEW.png``, with a view of every target; None without any."""
    images: dict[str, dict[str, str]] = {}
    for variant in dict.fromkeys(variants):
        for target, view in views.items():
            if (file := folder / variant / "renders" / target / f"{view}.png").is_file():
                with opened(file) as image:
                    images.setdefault(variant, {})[target] = _embedded(image, _RENDER)
    return Lineup(next(iter(views.values())), images) if "unattacked" in images else None


def read_parts(*files: Path) -> dict[str, Any]:
    """Return the entries of those JSON files that exist."""
    return {name: value for file in files if file.is_file() for name, value in dict(read_json(file)).items()}


def _embedded(image: Any, widest: int) -> str:
    image = image.convert("RGB")
    image.thumbnail((widest, 10 * widest))
    buffer = io.BytesIO()
    image.save(buffer, format="WEBP", quality=80, method=4)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()


@cache
def environment() -> Environment:
    """Return the templates, with the filters that write names and numbers."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = FileSystemLoader(_TEMPLATES)
    environment = Environment(
        autoescape=True, loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {
        "name": display_name,
        "extraction_name": extraction_name,
        "condition_name": lambda condition: condition_name(*condition),
        "model_name": lambda model: model_name(*model),
        "psnr": METRICS["psnr"].text,
        "percent": percent,
        "sentence_case": lambda text: text[:1].upper() + text[1:],
    }
    return environment
