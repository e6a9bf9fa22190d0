"""All tables and figures of a run, and its report, from the folder of results as it is."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from gspure.codec import plain
from gspure.errors import InputError
from gspure.evaluation.collecting import collect
from gspure.evaluation.identity import RESULTS
from gspure.evaluation.judging import judged
from gspure.evaluation.outcomes import Outcome, by_model
from gspure.evaluation.plan import CONFIGURATION, ModelPlan, Plan
from gspure.evaluation.radius import RADIUS, RadiusRecord, model_radii, radii
from gspure.evaluation.results import GONE, Result, write_results
from gspure.figures.charts import draw_factors
from gspure.figures.gallery import CAPTIONS, PLATES
from gspure.figures.panels import draw_attacks
from gspure.figures.plates import stack_plates
from gspure.figures.radius_chart import draw_evidence
from gspure.files import Json, read_json, write_json, write_text
from gspure.grouping import grouped
from gspure.metrics.names import UNATTACKED, extraction_name
from gspure.metrics.targets import ADAPTIVE, SCENE
from gspure.progress import track, warn
from gspure.report.answer import Answer, answers
from gspure.report.audit import is_judged
from gspure.report.evidence_table import evidence_tables
from gspure.report.page import Comparison, ModelSection, picture, renders, write_page
from gspure.report.tables import failures, model_table, results_markdown

Drawn = TypeVar("Drawn")


def write_report(results: Path, plan: Plan) -> list[Outcome]:
    """Write ``tables/``, ``figures/``, the figures of every model that need several variants, and ``report.html``.

    Variants without results are named with the reason. Figures that cannot be drawn are left out with a warning. Return
    all outcomes.
    """
    outcomes = collect(results, plan.models)
    rows = judged(outcomes, plan.attacks)
    tables = results / "tables"
    write_results(tables / "results.csv", rows)
    write_text(tables / "results.md", results_markdown(outcomes))
    of_models = tuple(model_radii(rows))
    conditions = {row.model: row.condition for row in rows}
    write_json(results / RADIUS, plain(RadiusRecord(of_models, tuple(radii(of_models, conditions)))))
    _warn(outcomes, rows)
    by_condition = grouped(rows, lambda row: row.condition)
    comparisons = [
        _comparison(results, plan, outcomes, answer, by_condition[answer.audit.condition]) for answer in answers(rows)
    ]
    _draw_plates(results, comparisons)
    linked = [tables / "results.csv", results / RADIUS, results / CONFIGURATION, results / "logs"]
    write_page(results, comparisons, linked)
    return outcomes


def _places(answer: Answer) -> Callable[[str], int]:
    """Return a function from a variant to its place: attacks in the order of the answer, `UNATTACKED` before them."""
    places = {row.variant: i for i, row in enumerate(answer.attacks)} | {UNATTACKED: -1}
    return lambda variant: places.get(variant, len(places))


def _comparison(
    results: Path, plan: Plan, outcomes: Sequence[Outcome], answer: Answer, rows: Sequence[Result]
) -> Comparison:
    """Draw the figures of one condition and its models, and return it as the page shows it."""
    condition = answer.audit.condition
    alike = [o for o in outcomes if o.condition == condition]
    models = by_model(alike)
    of_model = grouped(rows, lambda row: row.model)
    sections = [_model(results, plan, models[model], answer, of_model[model]) for model in track([*models], "figures")]
    folder = results / "figures" / condition.key
    evidence = folder / "evidence.png"
    sweep = folder / "sweep.png"
    judged = [row for row in rows if is_judged(row, answer.audit.extraction)]
    captions = {
        evidence: _drawn(draw_evidence, evidence, judged, answer.audit.radii),
        sweep: _drawn(draw_factors, sweep, alike, plan.factors.get(condition.scheme, {})),
    }
    pictures = [picture(path, caption, results) for path, caption in captions.items() if caption]
    meanings = {row.attack: plan.meanings.get(row.variant, "") for row in answer.attacks}
    place = _places(answer)
    in_order = sorted(rows, key=lambda row: place(row.variant))
    return Comparison(answer, sections, evidence_tables(in_order), pictures, meanings)


def _warn(outcomes: Sequence[Outcome], rows: Sequence[Result]) -> None:
    """Warn of incomplete declarations of what an extraction reads, and of models without a message."""
    for o in outcomes:
        for extraction in filter(o.contradicts, o.affects):
            warn(
                f"{o.model.title}, {o.variant}: the extraction {extraction} changed, although no column did that it is "
                "declared to read; the attack counts as having affected the message"
            )
    for row in rows:
        if row.variant == UNATTACKED and row.is_decided and row.word == GONE:
            warn(
                f"{row.model.title}, {extraction_name(row.extraction)}: even before any attack, the message is not "
                "proven: none is embedded, the key does not match, or it shows the message in a clean model, too"
            )


def _draw_plates(results: Path, comparisons: Sequence[Comparison]) -> None:
    """Draw the layouts of the paper's Fig. 1 and Fig. 6, with a row for one model of each condition."""
    shown = [(c.answer.audit.condition.title, c.models[0]) for c in comparisons]
    firsts = {title: results / model.scheme / model.folder for title, model in shown}
    for name in PLATES:
        files = {title: folder / "figures" / "model" / f"{name}.png" for title, folder in firsts.items()}
        plates = {title: file for title, file in files.items() if file.is_file()}
        if plates:
            _drawn(stack_plates, results / "figures" / f"{name}.png", plates)


def _model(
    results: Path, plan: Plan, variants: Sequence[Outcome], answer: Answer, rows: Sequence[Result]
) -> ModelSection:
    """Draw the figures of a model, and return it as the page shows it."""
    model = variants[0].model
    folder = results / model.name
    path = folder / "figures" / "attacks.png"
    drawn = folder / "figures" / "model"
    attacks = _drawn(draw_attacks, path, folder, variants, plan.sweeps, _photographs(results, plan.by_name[model.name]))
    caption, views = attacks or ("", {})
    captions = {path: caption} | {drawn / name: text for name, text in _parts(drawn / CAPTIONS).items()}
    place = _places(answer)
    by_damage = sorted(variants, key=lambda o: place(o.variant))
    targets = {target: view for target, view in views.items() if target in (SCENE, answer.audit.extraction, ADAPTIVE)}
    pictured = answer.pictured({o.variant for o in variants})
    attacked = [row.variant for row in answer.attacks]
    return ModelSection(
        model.scheme,
        model.folder_name,
        answers(rows)[0],
        outcomes=variants,
        table=model_table(by_damage),
        failures=failures(variants),
        pictures=[picture(path, text, results) for path, text in captions.items() if text],
        images=renders(folder, [*pictured, *attacked], targets),
        viewer=_parts(drawn / "view.json"),
        diagnosis=_parts(folder / "diagnosis.json") | _parts(folder / "hidden.json"),
    )


def _photographs(results: Path, model: ModelPlan) -> Path | None:
    """Return the folder with the truth of a model, below the results wherever these are."""
    return None if model.photographs is None else results / model.photographs.relative_to(RESULTS)


def _parts(file: Path) -> Json:
    """Return the entries of a JSON file; none if it does not exist."""
    return dict(read_json(file)) if file.is_file() else {}


def _drawn(draw: Callable[..., Drawn | None], path: Path, *facts: Any) -> Drawn | None:
    try:
        return draw(path, *facts)
    except (InputError, OSError, ValueError) as error:
        warn(f"{path}: not drawn: {error}")
        return None
