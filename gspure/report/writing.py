"""All tables and figures of a run, and its report, from the folder of results as it is."""

from collections.abc import Callable, Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import Any, TypeVar

from gspure.errors import InputError
from gspure.evaluation.collecting import collect
from gspure.evaluation.contest import Contest, Lead, contest, leads
from gspure.evaluation.identity import RESULTS
from gspure.evaluation.matched import Matched, match
from gspure.evaluation.outcomes import Outcome, by_model
from gspure.evaluation.plan import CONFIGURATION, ModelPlan, Plan
from gspure.evaluation.results import write_results
from gspure.evaluation.summary import Specificity, Summary, specificity, summarize
from gspure.evaluation.survival import Survival, not_embedded, survival
from gspure.figures.charts import draw_factors
from gspure.figures.gallery import CAPTIONS, PLATES
from gspure.figures.panels import draw_attacks
from gspure.figures.plates import stack_plates
from gspure.figures.tradeoff import draw_tradeoff
from gspure.files import Json, read_json, write_text
from gspure.metrics.csv_tables import write_table
from gspure.metrics.names import UNATTACKED
from gspure.metrics.targets import SCENE
from gspure.progress import track, warn
from gspure.report.answer import Answer, answers
from gspure.report.attack_tables import condition_tables, conditions_markdown
from gspure.report.page import Comparison, ModelSection, picture, renders, write_page
from gspure.report.table import Table
from gspure.report.tables import failures, model_table, results_markdown, summary_table

Drawn = TypeVar("Drawn")


def write_report(results: Path, plan: Plan) -> list[Outcome]:
    """Write ``tables/``, ``figures/``, the figures of every model that need several variants, and ``report.html``.

    Variants without results are named with the reason. Figures that cannot be drawn are left out with a warning. Return
    all outcomes.
    """
    outcomes = collect(results, plan.models)
    survivals = survival(outcomes)
    contests = contest(outcomes, plan.sweeps)
    matched = match(outcomes, plan.sweeps)
    tables = results / "tables"
    write_results(tables / "results.csv", outcomes, plan.attacks)
    write_table(tables / "summary.csv", Summary, summarize(outcomes))
    write_table(tables / "survival.csv", Survival, survivals)
    write_table(tables / "contest.csv", Contest, contests)
    write_table(tables / "matched.csv", Matched, matched)
    write_table(tables / "leads.csv", Lead, leads(outcomes, plan.attacks))
    write_table(tables / "clean.csv", Specificity, specificity(outcomes))
    write_text(tables / "results.md", results_markdown(outcomes))
    write_text(tables / "contest.md", conditions_markdown(survivals, contests, matched))
    write_text(tables / "summary.tex", summary_table(outcomes).latex())
    _warn(outcomes)
    comparisons = [
        _comparison(results, plan, outcomes, answer, _tables(answer, survivals, contests, matched))
        for answer in answers(outcomes, survivals)
    ]
    _draw_plates(results, comparisons)
    names = ("results", "summary", "survival", "contest", "matched", "leads", "clean")
    linked = [tables / f"{name}.csv" for name in names]
    write_page(results, comparisons, [*linked, results / CONFIGURATION, results / "logs"])
    return outcomes


def _tables(
    answer: Answer, survivals: Sequence[Survival], contests: Sequence[Contest], matched: Sequence[Matched]
) -> Mapping[str, Sequence[Table]]:
    """Return the tables of one condition by extraction, with the attacks in the order of the answer."""
    place = _places(answer)
    return condition_tables(
        answer.audit.condition,
        sorted(survivals, key=lambda row: place(row.variant)),
        sorted(contests, key=lambda row: (0 if isnan(row.damage) else row.damage, place(row.attack))),
        sorted(matched, key=lambda row: place(row.sweep)),
    )


def _places(answer: Answer) -> Callable[[str], int]:
    """Return a function from a variant to its place: attacks in the order of the answer, `UNATTACKED` before them."""
    places = {row.variant: i for i, row in enumerate(answer.attacks)} | {UNATTACKED: -1}
    return lambda variant: places.get(variant, len(places))


def _comparison(
    results: Path, plan: Plan, outcomes: Sequence[Outcome], answer: Answer, tables: Mapping[str, Sequence[Table]]
) -> Comparison:
    """Draw the figures of one condition and its models, and return it as the page shows it."""
    condition = answer.audit.condition
    alike = [o for o in outcomes if o.condition == condition]
    models = by_model(alike)
    sections = [_model(results, plan, models[model], answer) for model in track([*models], "figures")]
    folder = results / "figures" / condition.key
    tradeoff = folder / "tradeoff.png"
    sweep = folder / "sweep.png"
    captions = {
        tradeoff: _drawn(draw_tradeoff, tradeoff, alike),
        sweep: _drawn(draw_factors, sweep, alike, plan.factors.get(condition.scheme, {})),
    }
    pictures = [picture(path, caption, results) for path, caption in captions.items() if caption]
    meanings = {row.attack: plan.meanings.get(row.variant, "") for row in answer.attacks}
    return Comparison(answer, sections, tables, pictures, meanings)


def _warn(outcomes: Sequence[Outcome]) -> None:
    """Warn of incomplete declarations of what an extraction reads, and of models without a message."""
    for o in outcomes:
        for extraction in filter(o.contradicts, o.affects):
            warn(
                f"{o.model.title}, {o.variant}: the extraction {extraction} changed, although no column did that it is "
                "declared to read; the attack counts as having affected the message"
            )
    for model in not_embedded(outcomes):
        warn(
            f"{model.title}: no message is embedded, or the key does not match the model: even before any attack, the "
            "message is a single colour, is not above every control, or is not retrieved"
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


def _model(results: Path, plan: Plan, variants: Sequence[Outcome], answer: Answer) -> ModelSection:
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
    targets = {target: view for target, view in views.items() if target in (SCENE, answer.audit.extraction)}
    pictured = answer.pictured({o.variant for o in variants})
    attacked = [row.variant for row in answer.attacks]
    return ModelSection(
        model.scheme,
        model.folder_name,
        answers(variants, survival(variants))[0],
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
