"""The report: one self-contained HTML page about all models of a run."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import pairwise
from operator import or_
from pathlib import Path
from typing import Any, Final

from gspure.artifacts import read_json, record_of, write_text
from gspure.errors import InputError, reading
from gspure.evaluation.contest import Contest
from gspure.evaluation.matched import Matched
from gspure.evaluation.names import display_name, model_name
from gspure.evaluation.outcomes import Outcome, by_model
from gspure.evaluation.survival import MARGIN, Survival
from gspure.figures import style
from gspure.model.suspicious import REASONS
from gspure.report.audit import SIGNIFICANT, audits
from gspure.report.findings import findings, limits
from gspure.report.table import Table
from gspure.report.tables import failures, model_table, scheme_tables
from gspure.report.templates import render

DIAGNOSIS_TERMS: Final = {
    "gaussians": "rows (Gaussians or anchors)",
    "clusters": "clusters",
    "largest_share": "rows in the largest cluster",
    "noise_share": "rows in no cluster (noise)",
    "pruned_share": "rows pruned",
    "pruned_as_cluster": "rows pruned as part of a cluster",
    "pruned_as_noise": "rows pruned as noise",
    "pruned_weight_share": "share of the total weight that was pruned",
    "plain_share": "rows pruned by the same threshold without clustering",
    "changed_share": "rows on which clustering changed the decision",
    "hidden_low_share": "share of the message's weight on rows of low public weight",
}
"""Fields of ``diagnosis.json`` and ``hidden.json`` in display order, and what they mean."""

_FIGURES: Final = "figures"  # the folder of those that show all models of a scheme
_WIDEST: Final = 1400  # pixels of an embedded image
_OTHER_FORMATS: Final = (".gltf", ".vtp")


@dataclass(frozen=True)
class Picture:
    """One figure as the page shows it."""

    name: str
    caption: str
    data: str
    """The image as a data URI."""

    wide: bool
    """Whether it is as wide as a page rather than a column."""

    companions: list[str]
    """Names of the files beside it that hold the same in 3-D."""


@dataclass(frozen=True)
class Section:
    """One scheme over all of its scenes, or one model."""

    heading: str
    tables: list[Table]
    pictures: list[Picture]
    outcomes: Sequence[Outcome] = ()
    failures: Sequence[str] = ()
    diagnosis: Mapping[str, Any] = field(default_factory=dict)


def write_report(
    path: Path,
    title: str,
    outcomes: Sequence[Outcome],
    *,
    figures: Sequence[Path] = (),
    diagnoses: Sequence[Path] = (),
    matched: Sequence[Matched] = (),
    survivals: Sequence[Survival] = (),
    contests: Sequence[Contest] = (),
    sources: Sequence[Path] = (),
    provenance: Sequence[Path] = (),
) -> None:
    """Write the page, whole or not at all. It refers to nothing outside itself.

    Figures and diagnoses belong to the model whose scheme and scene are consecutive folders of their path; figures in
    ``figures/SCHEME`` belong to all models of the scheme.

    Parameters
    ----------
    path : Path
        HTML file to write.
    title : str
        Heading of the page.
    outcomes : sequence of Outcome
        All variants of all models.
    figures : sequence of Path
        PNG files, in display order; captions are in the ``.png.json`` beside them.
    diagnoses : sequence of Path
        ``diagnosis.json`` of `gspure prune`, ``hidden.json`` of `gspure hidden`.
    matched : sequence of Matched
        Attacks at equal damage to the scene.
    survivals : sequence of Survival
        What every attack leaves of the message.
    contests : sequence of Contest
        GSPure minus every other attack.
    sources : sequence of Path
        The files of these tables, to be named.
    provenance : sequence of Path
        JSON files of `gspure.artifacts.write_provenance`, to be listed.

    Raises
    ------
    InputError
        If a file cannot be read, or a figure or diagnosis belongs to none of the models.

    """
    from gspure import __version__

    models, schemes = by_model(outcomes), list(dict.fromkeys(o.scheme for o in outcomes))
    _require_owner((*figures, *diagnoses), [*(key for key, _ in models), *((_FIGURES, scheme) for scheme in schemes)])
    page = render(
        "page.html.j2",
        title=title,
        version=__version__,
        audits=audits(outcomes, survivals, contests),
        margin=MARGIN,
        significant=SIGNIFICANT,
        schemes=[_scheme(scheme, scheme_tables(scheme, survivals, contests, matched), figures) for scheme in schemes],
        models=[_model(key, variants, figures, diagnoses) for key, variants in models],
        findings=findings,
        limits=limits(outcomes),
        diagnosis_terms=DIAGNOSIS_TERMS,
        suspicions=REASONS,
        sources=[file.as_posix() for file in sources],
        records=[(file.as_posix(), _record(file)) for file in provenance],
    )
    write_text(path, page)


def _scheme(scheme: str, tables: list[Table], figures: Sequence[Path]) -> Section:
    pictures = [_picture(file) for file in figures if _owns((_FIGURES, scheme), file)]
    return Section(display_name(scheme), tables, pictures)


def _model(
    key: tuple[str, str], outcomes: Sequence[Outcome], figures: Sequence[Path], diagnoses: Sequence[Path]
) -> Section:
    return Section(
        model_name(*key),
        [model_table(outcomes)],
        [_picture(file) for file in figures if _owns(key, file)],
        outcomes,
        failures(outcomes),
        reduce(or_, (read_json(file) for file in diagnoses if _owns(key, file)), {}),
    )


def _owns(key: tuple[str, str], file: Path) -> bool:
    return key in pairwise(file.resolve().parts)


def _require_owner(files: Iterable[Path], keys: Sequence[tuple[str, str]]) -> None:
    known = ", ".join("/".join(key) for key in keys) or "no model at all"
    for file in files:
        if not any(_owns(key, file) for key in keys):
            raise InputError(file, "path", expected=f"a folder SCHEME/SCENE of the table ({known})", found="none")


def _picture(file: Path) -> Picture:
    from PIL import Image

    note = file.with_name(file.name + ".json")
    caption = _record(note)["settings"].get("caption", "") if note.exists() else ""
    with reading(file, "a PNG image"), Image.open(file) as image:
        wide = image.width > 1.2 * style.COLUMN * style.DPI
        data = _embedded(image.convert("RGB"))
    companions = [other.name for suffix in _OTHER_FORMATS if (other := file.with_suffix(suffix)).exists()]
    return Picture(display_name(file.stem), caption, data, wide, companions)


def _record(file: Path) -> dict[str, Any]:
    record = (record_of(file.with_suffix("")) if file.suffix == ".json" else None) or {}
    match record:
        case {"digest": str(), "settings": dict()}:
            return record
    raise InputError(file, "file", expected="provenance beside its file", found="none")


def _embedded(image: Any) -> str:
    image.thumbnail((_WIDEST, 10 * _WIDEST))
    buffer = io.BytesIO()
    image.save(buffer, format="WEBP", quality=80, method=4)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()
