"""The 3-D view of a model in a cell of a notebook, or as a page of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Final

from gspure import __version__
from gspure.cameras.camera import Camera
from gspure.files import write_text
from gspure.model.gaussians import Gaussians
from gspure.public_model import PublicModel
from gspure.viewer.data import view_of
from gspure.viewer.page import template_environment

_HEIGHT: Final = 480  # pixels of a cell; ours


@dataclass(frozen=True)
class View:
    """Models in 3-D: the last expression of a cell shows them in a notebook, `write` makes a file."""

    page: str  # HTML that needs no other file

    def __repr__(self) -> str:
        return f"View({len(self.page):,} characters of HTML)"

    def write(self, path: str | Path) -> None:
        """Write the page for a browser, whole or not at all."""
        write_text(Path(path), self.page)

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {_HEIGHT}px; border: 0"
        return f'<iframe srcdoc="{escape(self.page)}" style="{style}" allow="fullscreen" title="model in 3-D"></iframe>'


def view(model: Gaussians | PublicModel, cameras: Sequence[Camera] = ()) -> View:
    """Return the view of a model, from all sides; of `cameras`, the held-out ones can be chosen."""
    public = model if isinstance(model, PublicModel) else PublicModel(model)
    return view_beside({"model": public.drawable("model")}, cameras)


def view_beside(models: Mapping[str, PublicModel], cameras: Sequence[Camera]) -> View:
    """Return the view of one model, or of two beside each other, by their titles."""
    template = template_environment().get_template("view.html.j2")
    return View(template.render(version=__version__, data=view_of(models, cameras)))
