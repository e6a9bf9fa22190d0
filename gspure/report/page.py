"""The report: one self-contained HTML page about all models of a run."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from gspure.artifacts import read_json, write_text
from gspure.errors import InputError, reading
from gspure.evaluation.contest import Contest
from gspure.evaluation.costs import AttackCost
from gspure.evaluation.matched import Matched, reached_names
from gspure.evaluation.names import GSPURE
from gspure.evaluation.outcomes import Outcome, by_model
from gspure.evaluation.survival import MARGIN, Survival
from gspure.model.suspicious import REASONS
from gspure.report.audit import ALLOWED, EQUAL, SIGNIFICANT, Audit, audits
from gspure.report.findings import findings, limits
from gspure.report.pictures import Lineup, Link, Picture, companions, lineup, link, picture, record
from gspure.report.table import Table
from gspure.report.tables import condition_tables, failures, model_table
from gspure.report.templates import render

_FIGURES: Final = "figures"  # the folder of those that show all models of a condition
_LINEUP: Final = "attacks"
_TRADEOFF: Final = "tradeoff"
_CLOUDS: Final = ("clusters", "ranks", "kept", "hidden")  # what the viewer shows


@dataclass(frozen=True)
class Model:
    """One model as the page shows it."""

    scheme: str
    folder: str
    outcomes: Sequence[Outcome]
    attack: str  # the variant that pictures compare with the unattacked model
    table: Table
    pictures: list[Picture]
    files: list[Link]  # figures that renders or viewer replace on the page
    lineup: Lineup | None
    viewer: str  # markup of what `gspure.figures.viewer.write_viewer` wrote; empty if there is none
    failures: Sequence[str]
    diagnosis: str  # markup

    @property
    def names(self) -> dict[str, str]:
        """The display name of every variant, with the damage that the search for its strength reached."""
        return reached_names(self.outcomes)


@dataclass(frozen=True)
class Comparison:
    """One condition over all of its scenes."""

    audit: Audit
    models: list[Model]
    tables: list[Table]
    tradeoff: Picture | None
    pictures: list[Picture]

    @property
    def compared(self) -> bool:
        """Whether anything compares its attacks beyond the verdict."""
        return bool(self.tables or self.pictures)

    @property
    def beside(self) -> list[Picture]:
        """Figures on the first screen: the trade-off or, without a message, GSPure's pruned rows and all outcomes."""
        if self.tradeoff or not self.shown:
            return [self.tradeoff] if self.tradeoff else []
        return [figure for name in ("splats", "outcomes") for figure in self.shown.pictures if figure.name == name]

    @property
    def shown(self) -> Model | None:
        """The first model with renders that holds the message; without one, the first with renders."""
        models = [model for model in self.models if model.lineup]
        holding = (m for m in models if any(self.audit.extraction in o.messages for o in m.outcomes))
        return next(holding, next(iter(models), None))


def write_report(
    path: Path,
    outcomes: Sequence[Outcome],
    *,
    figures: Sequence[Path] = (),
    diagnoses: Sequence[Path] = (),
    matched: Sequence[Matched] = (),
    survivals: Sequence[Survival] = (),
    contests: Sequence[Contest] = (),
    costs: Sequence[AttackCost] = (),
    viewers: Sequence[Path] = (),
    links: Sequence[Path] = (),
    records: Sequence[Path] = (),
) -> None:
    """Write the page, whole or not at all. It loads nothing from outside itself, and links the files of the run.

    `outcomes` are all variants of all models. Figures (PNG, in display order, with captions in the ``.png.json``
    beside them), `viewers` (``viewer.json`` of `gspure figures model`) and
    `diagnoses` (``diagnosis.json`` of `gspure prune`, ``hidden.json`` of `gspure hidden`) belong to the model whose
    scheme and scene are consecutive folders of their path; figures in ``figures/SCHEME-PROTOCOL-INITIALIZATION`` belong
    to all models of the condition. Where the renders of an ``attacks.png`` lie beside its folder, the page shows these
    instead. `links` are files to link, `records` those of `gspure.artifacts.write_record` to list.

    Raise `InputError` if a file cannot be read, or a figure or diagnosis belongs to none of the models.
    """
    from gspure import __version__

    models = by_model(outcomes)
    verdicts = audits(outcomes, survivals, contests)
    owners = [*(key for key, _ in models), *((_FIGURES, audit.condition.key) for audit in verdicts)]
    _require_owner((*figures, *diagnoses, *viewers), owners)

    def comparison(audit: Audit) -> Comparison:
        pictures = {file.stem: picture(file, path) for file in figures if _owns((_FIGURES, audit.condition.key), file)}
        return Comparison(
            audit,
            [model(key, variants, audit) for key, variants in models if variants[0].condition == audit.condition],
            condition_tables(audit.condition, survivals, contests, matched, costs),
            pictures.pop(_TRADEOFF, None),
            list(pictures.values()),
        )

    def model(key: tuple[str, str], variants: Sequence[Outcome], audit: Audit) -> Model:
        attack = audit.strongest.variant if audit.strongest else GSPURE
        files = {file.stem: file for file in figures if _owns(key, file)}
        renders = lineup(files[_LINEUP], variants, attack) if _LINEUP in files else None
        viewer = _part("viewer.html.j2", [file for file in viewers if _owns(key, file)])
        replaced = {_LINEUP, *(target for o in variants for target in o.targets)} if renders else set()
        replaced |= {*_CLOUDS} if viewer else set()
        return Model(
            *key,
            variants,
            attack,
            model_table(variants),
            [picture(file, path) for stem, file in files.items() if stem not in replaced],
            [other for stem, file in files.items() if stem in replaced for other in companions(file, path)],
            renders,
            viewer,
            failures(variants),
            _part("diagnosis.html.j2", [file for file in diagnoses if _owns(key, file)]),
        )

    page = render(
        "page.html.j2",
        version=__version__,
        comparisons=[comparison(audit) for audit in verdicts],
        audits=verdicts,
        allowed=ALLOWED,
        margin=MARGIN,
        significant=SIGNIFICANT,
        equal=EQUAL,
        findings=findings,
        limits=limits(outcomes),
        links=[link(file, path) for file in links],
        records=[(file.as_posix(), record(file)) for file in records],
    )
    write_text(path, page, checksum=True)


def _owns(key: tuple[str, str], file: Path) -> bool:
    return key in pairwise(file.resolve().parts)


def _part(template: str, files: Iterable[Path]) -> str:
    """Return the part of the page that shows the entries of JSON files; empty without files.

    Raise `InputError` naming the file whose entries cannot be shown.
    """
    data: dict[str, Any] = {}
    markup = ""
    for file in files:
        with reading(file, "entries that the report shows"):
            data |= read_json(file)
            markup = render(template, data=data, suspicions=REASONS)
    return markup


def _require_owner(files: Iterable[Path], keys: Sequence[tuple[str, str]]) -> None:
    known = ", ".join("/".join(key) for key in keys) or "no model at all"
    for file in files:
        if not any(_owns(key, file) for key in keys):
            raise InputError(file, "path", expected=f"a folder SCHEME/SCENE of the table ({known})", found="none")
