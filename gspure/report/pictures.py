"""Pictures of the page: figures with captions and files, and one view of a model after every attack."""

import base64
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from gspure.artifacts import record_of
from gspure.errors import InputError
from gspure.evaluation.names import display_name
from gspure.evaluation.outcomes import Outcome, ordered
from gspure.figures import style
from gspure.images import opened

_WIDEST: Final = 1400  # pixels of an embedded figure
_RENDER: Final = 560  # and of a render
_FORMATS: Final = (".png", ".svg", ".glb", ".gltf", ".vtp")


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
    files: list[Link]  # the figure itself, as a vector graphic if there is one, and what holds the same in 3-D


@dataclass(frozen=True)
class Lineup:
    """One view of a model after every attack."""

    view: str
    images: dict[str, dict[str, str]]  # by variant and target, as data URIs


def link(file: Path, page: Path) -> Link:
    """Return a link from a page to a file."""
    return Link(file.name, Path(os.path.relpath(file.resolve(), page.resolve().parent)).as_posix())


def companions(file: Path, page: Path) -> list[Link]:
    """Return links from a page to a PNG figure and to the files that hold the same, as vectors or in 3-D."""
    return [link(path, page) for suffix in _FORMATS if (path := file.with_suffix(suffix)).exists()]


def picture(file: Path, page: Path) -> Picture:
    """Return a PNG figure with the caption in the record beside it."""
    note = file.with_name(file.name + ".json")
    caption = record(note)["settings"].get("caption", "") if note.exists() else ""
    with opened(file) as image:
        wide = image.width > 1.2 * style.COLUMN * style.DPI
        data = _embedded(image, _WIDEST)
    return Picture(display_name(file.stem), caption, data, wide, companions(file, page))


def lineup(figure: Path, outcomes: Sequence[Outcome], further: str = "") -> Lineup | None:
    """Return the renders that a figure of ``gspure figures attacks`` shows; None if they are not beside it.

    The record of `figure`, ``SCHEME/SCENE/figures/attacks.png``, names view and variants; `further` is a variant to
    include in any case.
    """
    match record_of(figure):
        case {"inputs": {"unattacked scene": {"file": str(view)}} as inputs}:
            variants = {"unattacked", further, *(str(title).rpartition(" ")[0] for title in inputs)}
        case _:
            return None
    images: dict[str, dict[str, str]] = {}
    for outcome in (o for o in outcomes if o.variant in variants and not o.is_control):
        for target in ordered(outcome.targets):
            shown = inputs.get(f"unattacked {target}", {}).get("file", view)
            file = figure.parents[1] / outcome.variant / "renders" / target / shown
            if file.is_file():
                with opened(file) as image:
                    images.setdefault(outcome.variant, {})[target] = _embedded(image, _RENDER)
    return Lineup(Path(view).stem, images) if "unattacked" in images else None


def record(file: Path) -> dict[str, Any]:
    """Return the content of a record, or raise `InputError` if the file is none."""
    content = (record_of(file.with_suffix("")) if file.suffix == ".json" else None) or {}
    match content:
        case {"digest": str(), "settings": dict()}:
            return content
    raise InputError(file, "file", expected="a record beside its file", found="none")


def _embedded(image: Any, widest: int) -> str:
    image = image.convert("RGB")
    image.thumbnail((widest, 10 * widest))
    buffer = io.BytesIO()
    image.save(buffer, format="WEBP", quality=80, method=4)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()
