"""``python -m experiments.results_page`` writes docs/results.md, whose numbers are those of the committed tables."""

import csv
import string
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from experiments import printed
from experiments.paired_tests import holm, paired_test
from experiments.paper_check import beside_table
from gspure.evaluation.identity import Condition
from gspure.evaluation.radius import Radius, model_radii, radius_text
from gspure.evaluation.results import ADAPTS, PUBLISHED, Result, known_cells, read_results
from gspure.files import write_text
from gspure.grouping import grouped
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.metrics.names import GSPURE, UNATTACKED, display_name, variant_at, variant_title
from gspure.metrics.statistics import Interval, by_scene, differences, known_interval, mean_interval
from gspure.metrics.targets import MESSAGE, is_picture
from gspure.report.audit import ConditionAudit, audits
from gspure.report.table import Cell, Column, Table, TableRow, interval
from gspure.text import UNKNOWN, decimal, p_value, significant

HERE: Final = Path(__file__).parent
PAGE: Final = HERE.parent / "docs" / "results.md"
TEMPLATE: Final = HERE / "results_page.md"
TABLES: Final = HERE / "tables"
RESULTS: Final = HERE / "results"
RADII: Final = tuple(RESULTS / run / "results.csv" for run in ("radius", "scenes"))
OURS: Final = "gspure_equal"
OTHERS: Final = ("weight_equal", "gof_equal", "random_equal", "noise_equal")
DAMAGES: Final = (0.3, 1.0, 2.0)  # dB
SHOWN: Final = (OURS, "gof_equal", "random_equal", "gspure", "gof", "distil")  # of the schemes with networks
FORGERIES: Final = ("fitted key", "searched key", "searched message", "copied mark")


class Compared(NamedTuple):
    """GSPure against another attack at equal damage to the scene."""

    condition: Condition
    damage: float  # dB
    other: str  # the attack
    difference: Interval  # GSPure's drop of the message's PSNR minus the other's, dB
    p: float  # of the sign-flip test
    corrected: float  # by Holm, over the comparisons of the condition


def page() -> str:
    """Return the page as Markdown."""
    large = read_results(*sorted((RESULTS / "large").glob("*.csv")))
    networks = read_results(*sorted((RESULTS / "networks").glob("*.csv")))
    compared = comparisons(large)
    facts = {
        "compared": compared_table(compared),
        "least_p": significant(min(one.p for one in compared), 2),
        "least_corrected": significant(min(one.corrected for one in compared), 2),
        "tests": str(max(len(alike) for alike in grouped(compared, lambda one: one.condition).values())),
        "paper": paper_table([*large, *networks]),
        "networks": networks_table(networks),
        "over_gof": over_gof(compared),
        **radius_facts(),
        **paper_facts([*large, *networks]),
        **large_facts(large),
        **capture_facts(),
        **authors_facts(),
    }
    return string.Template(TEMPLATE.read_text(encoding="utf-8")).substitute(facts)


def radius_facts() -> dict[str, str]:
    """Return what the page says of the robust radius; both runs have the same suite, size and steps."""
    of_conditions = audits(read_results(*RADII))
    columns = [Column("condition"), Column("scenes"), Column("radius, adaptive"), Column("radius, as published")]
    columns += [Column("readable radius, adaptive"), Column("killer, adaptive", text=True)]
    columns += [Column("forged p, by late key; copy")]
    lines = [TableRow([*map(Cell, _radius_cells(audit))]) for audit in of_conditions if audit.has_radius]
    radii = [(audit, audit.radius()) for audit in of_conditions]
    known = [(audit, radius) for audit, radius in radii if radius]
    hidden = [radius for audit, radius in known if is_picture(audit.extraction)]
    most = max(hidden, key=lambda radius: radius.radius)
    clauses = [f"At most {most} for a hidden scene ({len(hidden)} conditions)"]
    clauses += [
        f"{_over_scenes(audit, radius)} scenes for {_scheme(audit.condition)}"
        for audit, radius in known
        if not is_picture(audit.extraction)
    ]
    scenes = [radius.scenes for _, radius in known]
    return {
        "radius_table": Table("", columns, lines).markdown(),
        "without_radius": "".join(
            f"{audit.condition.title}: {audit.sentence}\n\n" for audit in of_conditions if not audit.has_radius
        ),
        "answer_radius": "; ".join(clauses),
        "answer_radius_scenes": f"{min(scenes)} to {max(scenes)}",
    }


def _radius_cells(audit: ConditionAudit) -> list[str]:
    adaptive = audit.radius()
    published = audit.radius(owner=PUBLISHED)
    readable = audit.radius("readable")
    scenes = str(adaptive.scenes) if adaptive else UNKNOWN
    texts = [_over_scenes(audit, radius) if radius else UNKNOWN for radius in (adaptive, published, readable)]
    killer = display_name(adaptive.killer or "none") if adaptive else UNKNOWN
    forged = [_forged(audit.condition.scheme, commitment) for commitment in ("broken", "holds")]
    return [audit.condition.title, scenes, *texts, killer, "; ".join(forged)]


def _forged(scheme: str, commitment: str) -> str:
    """Return the least p-value of a forger, by claims that do or do not break a commitment."""
    rows = [row for row in _table("forgery") if (row["scheme"], row["commitment"]) == (scheme, commitment)]
    values = [float(row["p"]) for row in rows if row["forgery"] in FORGERIES]
    return p_value(min(values)) if values else UNKNOWN


def _over_scenes(audit: ConditionAudit, radius: Radius) -> str:
    """Return where attacks end the message: in all scenes, or in some of them and up to which damage in the others."""
    alike = [one for one in audit.models if (one.kind, one.owner) == (radius.kind, radius.owner)]
    ended = sorted(one.radius for one in alike if not one.exceeds)
    tried = [one.radius for one in alike if one.exceeds]
    if len(alike) == 1:
        return str(radius)
    if not tried:
        low, high = (radius_text(end, exceeds=False) for end in (ended[0], ended[-1]))
        return f"{high} in all" if low == high else f"{low} to {high}"
    least = radius_text(min(tried), exceeds=True)
    if not ended:
        return f"{least} in all"
    return f"{least} in {len(tried)}, {' and '.join(radius_text(end, exceeds=False) for end in ended)} in {len(ended)}"


def _scheme(condition: Condition) -> str:
    return condition.title.partition(",")[0]


def comparisons(rows: Sequence[Result]) -> list[Compared]:
    """Return GSPure against the others at every damage, over the pairs in which both reach it."""
    compared = []
    for condition, alike in grouped(rows, lambda row: row.condition).items():
        family = []
        names = {row.entry: row.attack for row in alike}
        for damage in DAMAGES:
            ours = _message_drops(alike, OURS, damage)
            for other in OTHERS:
                cells = differences(ours, _message_drops(alike, other, damage))
                if cells:
                    p = paired_test(by_scene(cells))
                    family.append(Compared(condition, damage, names[other], mean_interval(by_scene(cells)), p, p))
        corrected = holm([one.p for one in family])
        compared += [one._replace(corrected=float(p)) for one, p in zip(family, corrected, strict=True)]
    return compared


def _message_drops(rows: Sequence[Result], entry: str, damage: float) -> dict[tuple[str, int], float]:
    """Return the drops of the published message's PSNR, dB, where the search reached the damage."""
    before = _levels(rows, UNATTACKED)
    found = [row for row in rows if row.variant == variant_at(entry, damage)]
    after = _levels([row for row in found if abs(row.damage - damage) <= DAMAGE_TOLERANCE], variant_at(entry, damage))
    return {cell: before[cell] - level for cell, level in after.items()}


def _levels(rows: Sequence[Result], variant: str) -> dict[tuple[str, int], float]:
    """Return the PSNR of the published message in one variant, dB, by scene and seed."""
    published = [row for row in rows if row.variant == variant and row.extraction == MESSAGE]
    return {(row.scene, row.seed): row.message_values[printed.PSNR] for row in published if row.message_values}


def over_gof(compared: Sequence[Compared]) -> str:
    """Return how much more than GOF GSPure takes, dB, on the pairs at shared poses, where both cost the scene 1 dB."""
    (one,) = (one for one in compared if (one.condition.protocol, one.other, one.damage) == ("shared", "gof", 1.0))
    return decimal(one.difference.mean, 1)


def compared_table(compared: Sequence[Compared]) -> str:
    """Return the comparisons as a table, with a column for each damage."""
    columns = [Column("condition"), Column("GSPure minus", text=True), Column("scenes")]
    columns += [Column(f"at {damage:g} dB") for damage in DAMAGES]
    lines = []
    for condition, alike in grouped(compared, lambda one: one.condition).items():
        for i, (other, against) in enumerate(grouped(alike, lambda one: one.other).items()):
            scenes = max(one.difference.scenes for one in against)
            at_damage = {one.damage: interval(one.difference, scenes) for one in against}
            cells = [Cell("" if i else condition.title), Cell(display_name(other))]
            cells += [Cell(str(scenes)), *(at_damage.get(damage, Cell()) for damage in DAMAGES)]
            lines.append(TableRow(cells))
    return Table("", columns, lines).markdown()


def paper_facts(rows: Sequence[Result]) -> dict[str, str]:
    """Return GSPure's drops of the message at shared poses, in the paper and here."""
    ours = [row for row in printed.beside(printed.read_rows(), rows) if row.variant == GSPURE]
    shared = {row.condition.scheme: row for row in ours if row.condition.protocol == "shared"}
    splats = shared["splats_in_splats"]
    hider = shared["gs_hider"]
    return {
        "paper_splats": f"{decimal(splats.paper_message_drop)} for {decimal(splats.paper_scene_drop)}",
        "paper_hider": f"{decimal(hider.paper_message_drop)} for {decimal(hider.paper_scene_drop)}",
        "hider_message": decimal(hider.message_drop),
        "hider_scene": decimal(hider.scene_drop),
        "answer_paper_scenes": f"{splats.scenes}, {hider.scenes}",
        "answer_pruning_scenes": str(splats.scenes),
    }


def paper_table(rows: Sequence[Result]) -> str:
    """Return the attacks of the paper's Table 1 that we ran, beside its numbers."""
    beside = printed.beside(printed.read_rows(), rows)
    return beside_table([row for row in beside if row.scenes and row.variant != "gof"]).markdown()


def networks_table(rows: Sequence[Result]) -> str:
    """Return the drops of scene and message by attack, with a column for each condition."""
    of_attack: dict[str, dict[str, Cell]] = {}
    conditions = grouped(rows, lambda row: row.condition)
    for condition, alike in conditions.items():
        before = _levels(alike, UNATTACKED)
        for row in alike:
            if row.entry in SHOWN:
                drop = interval(known_interval(differences(before, _levels([row], row.variant))), 1)
                title = variant_title(row.entry.removesuffix("_equal"), row.wanted)
                of_attack.setdefault(title, {})[condition.title] = Cell(f"{decimal(row.damage)} / {drop}")
    titles = [condition.title for condition in conditions]
    columns = [Column("attack"), *map(Column, titles)]
    lines = [
        TableRow([Cell(attack), *(cells.get(title, Cell()) for title in titles)]) for attack, cells in of_attack.items()
    ]
    return Table("", columns, lines).markdown()


def large_facts(rows: Sequence[Result]) -> dict[str, str]:
    """Return the numbers that the text tells of the pairs at shared poses."""
    shared = [row for row in rows if row.condition.protocol == "shared"]
    facts = {}
    for name in ("gspure", "gof", "half_precision"):
        alike = [row for row in shared if row.variant == name]
        facts[f"{name}_scene"] = _mean_text(known_cells(alike, "damage"))
        facts[f"{name}_message"] = _mean_text(differences(_levels(shared, UNATTACKED), _levels(alike, name)))
    clusters = differences(_message_drops(shared, OURS, 1.0), _message_drops(shared, "weight_equal", 1.0))
    facts["clusters"] = str(interval(mean_interval(by_scene(clusters)), len(clusters)))
    return facts


def _mean_text(cells: Mapping[tuple[str, int], float]) -> str:
    return decimal(mean_interval(by_scene(cells)).mean)


def capture_facts() -> dict[str, str]:
    """Return the numbers that the text tells of the photographed captures."""
    adaptive = "Splats in Splats, own poses, message (adaptive)"
    facts = {}
    for row in _table("captures-measures"):
        if row["condition"] == adaptive:
            facts[f"capture_{row['attack']}_message"] = row["drop of message"]
            facts[f"capture_{row['attack']}_scene"] = row["drop of scene"]
        if row["condition"].startswith("SecureGS") and row["attack"] == "prune_repair":
            owner = "adaptive" if "adaptive" in row["condition"] else "published"
            facts[f"secure_{owner}"] = row["drop of message"]
            facts["secure_scene"] = row["drop of scene"]
    for row in _table("captures-before"):
        scheme = row["condition"].partition(",")[0].replace(" ", "_").lower()
        facts[f"before_{scheme}_scene"] = row["scene: public model"]
        facts[f"before_{scheme}_message"] = row["message: right key"]
    return facts


def authors_facts() -> dict[str, str]:
    """Return what GSPure takes from models of the authors' GS-Hider, and their radii for the owner who adapts."""
    rows = read_results(RESULTS / "authors" / "results.csv")
    scenes = dict.fromkeys(row.scene for row in rows)
    drops = [_drops([row for row in rows if row.scene == scene]) for scene in scenes]
    radii = [one for one in model_radii(rows) if (one.kind, one.owner) == ("message", ADAPTS)]
    texts = [f"{radius_text(one.radius, exceeds=one.exceeds)} ({display_name(one.killer)})" for one in radii]
    return {
        "authors_message": " and ".join(message for message, _ in drops),
        "authors_scene": " and ".join(scene for _, scene in drops),
        "authors_radius": " and ".join(dict.fromkeys(texts)),
    }


def _drops(rows: Sequence[Result]) -> tuple[str, str]:
    """Return what GSPure takes from the message as published, and from the scene, dB."""
    before, after = (
        next(row for row in rows if row.variant == variant and row.extraction == MESSAGE)
        for variant in (UNATTACKED, GSPURE)
    )
    message = before.message_values[printed.PSNR] - after.message_values[printed.PSNR]
    scene = before.scene_values[printed.PSNR] - after.scene_values[printed.PSNR]
    return decimal(message), decimal(scene)


def _table(name: str) -> list[dict[str, str]]:
    with (TABLES / f"{name}.csv").open(encoding="utf-8", newline="") as stream:
        return [*csv.DictReader(stream)]


if __name__ == "__main__":
    write_text(PAGE, page())
