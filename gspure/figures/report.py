"""The report: one self-contained HTML page about all models of a run."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import groupby, pairwise
from operator import or_
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from gspure.artifacts import read_json, record_of, write_text
from gspure.errors import InputError, reading
from gspure.evaluation.contest import Contest
from gspure.evaluation.matched import Matched
from gspure.evaluation.outcomes import REFERENCE, Outcome, ordered
from gspure.evaluation.statistics import MATCHED_DAMAGES
from gspure.evaluation.survival import MARGIN, Survival
from gspure.figures import findings, style
from gspure.figures.audit import CRITERION, audit
from gspure.figures.comparisons import Extraction, extractions

TEMPLATE: Final = Path(__file__).with_name("report.html.j2")

_FIGURES: Final = "figures"  # the folder that holds those about all models of a scheme
_WIDEST: Final = 1400  # pixels of an embedded picture
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

    companions: tuple[str, ...]
    """Names of the files beside it that hold the same in 3-D."""


@dataclass(frozen=True)
class Comparison:
    """The variants of one scheme over all of its scenes."""

    name: str
    pictures: list[Picture]
    extractions: list[Extraction]


@dataclass(frozen=True)
class Section:
    """Everything about one model."""

    name: str
    outcomes: list[Outcome]
    targets: list[str]
    findings: list[str]
    pictures: list[Picture]
    diagnosis: dict[str, Any]

    def known(self, number: str) -> bool:
        """Whether any variant has this number, so that it deserves a column."""
        return any(getattr(o, number) == getattr(o, number) for o in self.outcomes)  # NaN differs from itself

    @property
    def against_truth(self) -> bool:
        """Whether all numbers compare with photographs."""
        return all(o.against_truth for o in self.outcomes)

    @property
    def off_path(self) -> list[str]:
        """The targets that views beside the path show."""
        return [target for target in self.targets if any(target in o.off_path for o in self.outcomes)]

    @property
    def missed(self) -> bool:
        """Whether any attack did not reach what an extraction reads."""
        return any(not all(o.reached.values()) for o in self.outcomes if o.variant != REFERENCE)

    @property
    def best(self) -> float:
        """The highest Score."""
        return max((o.score for o in self.outcomes if o.score == o.score), default=float("nan"))


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
    sources: Mapping[str, Path] = MappingProxyType({}),
    provenance: Sequence[Path] = (),
) -> None:
    """Write the page, whole or not at all. It refers to nothing outside itself.

    Figures and diagnoses belong to the model whose scheme and scene are consecutive folders of their path; figures in
    ``figures/SCHEME`` to all models of the scheme.

    Parameters
    ----------
    path : Path
        HTML file to write.
    title : str
        Heading of the page.
    outcomes : sequence of Outcome
        All variants of all models.
    figures : sequence of Path
        PNG files, in the order in which to show them; captions are in the ``.png.json`` beside them.
    diagnoses : sequence of Path
        ``diagnosis.json`` of `gspure prune`, ``hidden.json`` of `gspure hidden`.
    matched : sequence of Matched
        Attacks at equal damage to the scene.
    survivals : sequence of Survival
        What every attack leaves of the message.
    contests : sequence of Contest
        GSPure against every other attack.
    sources : mapping
        The files of ``outcomes``, ``matched``, ``survivals`` and ``contests``, to be named below the tables.
    provenance : sequence of Path
        JSON files that `gspure.artifacts.write_provenance` has written, to be listed.

    Raises
    ------
    InputError
        If a file cannot be read, or a figure or diagnosis belongs to none of the models.

    """
    from jinja2 import Environment, StrictUndefined

    from gspure import __version__

    models = [(key, list(group)) for key, group in groupby(outcomes, key=lambda o: (o.scheme, o.asset))]
    schemes = list(dict.fromkeys(o.scheme for o in outcomes))
    _require_owner((*figures, *diagnoses), [*(key for key, _ in models), *((_FIGURES, scheme) for scheme in schemes)])
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {name: getattr(findings, name) for name in ("decibels", "signed", "percent", "spoken")}
    page = environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        title=title,
        version=__version__,
        audits=audit(outcomes, survivals, contests),
        criterion=CRITERION,
        margin=f"{MARGIN:g}",
        comparisons=[
            Comparison(
                scheme,
                [_picture(file) for file in figures if _owns((_FIGURES, scheme), file)],
                extractions(scheme, survivals, contests, matched),
            )
            for scheme in schemes
        ],
        sources=sources,
        damages=MATCHED_DAMAGES,
        sections=[_section(key, variants, figures, diagnoses) for key, variants in models],
        limits=list(findings.limits(outcomes)),
        diagnosis_terms=findings.DIAGNOSIS_TERMS,
        records=[(file.as_posix(), _record(file)) for file in provenance],
    )
    write_text(path, page)


def _section(
    key: tuple[str, str], outcomes: list[Outcome], figures: Sequence[Path], diagnoses: Sequence[Path]
) -> Section:
    return Section(
        name=" / ".join(key),
        outcomes=outcomes,
        targets=ordered({target for o in outcomes for target in o.targets}),
        findings=findings.findings(outcomes),
        pictures=[_picture(file) for file in figures if _owns(key, file)],
        diagnosis=reduce(or_, (read_json(file) for file in diagnoses if _owns(key, file)), {}),
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
    companions = (other.name for suffix in _OTHER_FORMATS if (other := file.with_suffix(suffix)).exists())
    return Picture(findings.spoken(file.stem), caption, data, wide, tuple(companions))


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
