"""From evidence to words, to the table of results and back, and to the robust radius of every owner."""

from dataclasses import replace
from math import inf, isnan, nan
from pathlib import Path

import pytest

from gspure.codec import plain
from gspure.evaluation.attack_record import StrengthValue
from gspure.evaluation.evidence import Evidence, SceneChange
from gspure.evaluation.identity import Condition, ModelId
from gspure.evaluation.judging import LEAST_CLEAN, judged
from gspure.evaluation.outcomes import Outcome, with_references
from gspure.evaluation.radius import ModelRadius, Radius, model_radii, radii
from gspure.evaluation.results import ADAPTS, PUBLISHED, Result, read_results, write_results
from gspure.metrics.detection import Detection
from gspure.metrics.proof import compared_views
from tests.outcome_cases import NOTHING, PLAIN, PROTOCOL, outcome, read, shown
from tests.outcome_cases import with_evidence as attacked


def results(*outcomes: Outcome) -> list[Result]:
    return judged(with_references(outcomes), {})


def words(*outcomes: Outcome) -> dict[tuple[str, str], str]:
    """The words by variant and owner."""
    return {(row.variant, row.owner): row.word for row in results(*outcomes)}


def of(kind: str, owner: str, *outcomes: Outcome) -> Radius:
    """The only radius of a kind and an owner."""
    rows = results(*outcomes)
    known = radii(model_radii(rows), {row.model: row.condition for row in rows})
    (radius,) = (radius for radius in known if (radius.kind, radius.owner) == (kind, owner))
    return radius


WORDS = {
    "plain": (PLAIN, "readable"),
    "inverted": (shown(-0.5, 0.9), "readable"),
    "in part": (shown(0.3, 0.5), "traces"),
    "faint": (shown(0.3, 0.1), "proven"),
    "noise": (NOTHING, "gone"),
    "blank": (shown(0.95, 1.0, is_blank=True), "gone"),
    "of the key alone": (shown(0.3, 0.9, twins=(0.28, 0.31, 0.3, 0.29, 0.32, 0.3, 0.31, 0.29)), "key-only"),
    "inverted, fitted": (shown(-0.5, 0.9, is_fitted=True), "gone"),
    "no null": (Evidence(0.95, 1.0), "readable"),
    "no null, faint": (Evidence(0.95, 0.3), "gone"),
    "no null, of the key alone": (Evidence(0.95, 1.0, (), (0.95, 0.94, 0.96, 0.95)), "key-only"),
}


@pytest.mark.parametrize(("evidence", "word"), WORDS.values(), ids=WORDS)
def test_a_word_needs_a_proof_and_then_what_can_be_recognized(evidence: Evidence, word: str) -> None:
    assert words(attacked("unattacked", 0.0, message=evidence)) == {("unattacked", PUBLISHED): word}


def test_a_key_that_shows_the_message_in_a_clean_model_proves_nothing() -> None:
    marked = attacked("unattacked", 0.0, message=shown(0.6, 0.9))
    assert words(marked, attacked("clean", 0.0, message=NOTHING))["unattacked", PUBLISHED] == "readable"
    for trace in (0.4, -0.4):  # as it is, or inverted
        assert words(marked, attacked("clean", 0.0, message=shown(trace, 0.5)))["unattacked", PUBLISHED] == "gone"
    of_scenes = [attacked("clean", 0.0, "room", seed, message=shown(0.05 * seed, 0.1)) for seed in range(LEAST_CLEAN)]
    models = [replace(o, seed=0, variant="clean") for o in of_scenes]
    (row,) = (row for row in results(marked, *models) if row.variant == "unattacked")
    assert (row.clean_models, row.word) == (LEAST_CLEAN, "gone")  # clean models vary by 0.12


def test_a_key_that_learned_proves_a_message_only_beside_eight_clean_models() -> None:
    learned = attacked("unattacked", 0.0, message=shown(0.6, 0.9, is_fitted=True))
    clean = [replace(attacked("clean", 0.0, message=shown(0.01 * i, 0.1)), variant="clean") for i in range(LEAST_CLEAN)]
    assert words(learned, *clean)["unattacked", PUBLISHED] == "readable"
    assert words(learned, *clean[1:])["unattacked", PUBLISHED] == "gone"
    assert LEAST_CLEAN == 8


def test_an_owner_who_adapts_is_never_worse_than_as_published() -> None:
    key_only = shown(0.9, 1.0, twins=(0.9, 0.91, 0.89, 0.9, 0.92, 0.9, 0.88, 0.9))
    found = words(attacked("unattacked", 0.0, message=shown(0.3, 0.2), message_adaptive=key_only))
    assert found == {("unattacked", PUBLISHED): "proven", ("unattacked", ADAPTS): "readable"}
    lost = words(attacked("unattacked", 0.0, message=NOTHING, message_adaptive=PLAIN))
    assert lost == {("unattacked", PUBLISHED): "gone", ("unattacked", ADAPTS): "readable"}


@pytest.mark.parametrize(
    ("correct", "bits", "word"),
    [(32, 32, "readable"), (30, 32, "proven"), (17, 32, "gone"), (8, 8, "readable"), (4, 4, "gone")],
)
def test_bits_are_proven_by_their_majority_and_readable_if_all_are_right(correct: int, bits: int, word: str) -> None:
    (row,) = results(read("unattacked", correct, bits))
    assert (row.owner, row.word, row.candidates, row.twins) == (PUBLISHED, word, 0, 0)
    assert [row._replace(level=level).is_decided for level in (0.05, 0.051)] == [True, False]


def test_scores_are_proven_against_those_of_clean_views_only() -> None:
    for p, least_p, word in ((0.01, 0.01, "readable"), (0.2, 0.01, "gone"), (1.0, 1.0, "")):
        detections = {"mark": Detection(3.0, 0.1, nan, nan, p, least_p, 4, 0)}
        scored = outcome("unattacked", targets={"scene": 30.0}, detections=detections)
        assert words(scored)["unattacked", PUBLISHED] == word


BEFORE = attacked("unattacked", 0.0, message=PLAIN)


def test_a_radius_is_the_least_damage_at_which_a_message_is_gone() -> None:
    attacks = [
        attacked("gof", 0.4, message=shown(0.3, 0.5)),
        attacked("gspure", 1.5, message=NOTHING),
        attacked("noise", 6.0, message=NOTHING),
        attacked("crop", 2.5, message=PLAIN),
    ]
    message = of("message", PUBLISHED, BEFORE, *attacks)
    assert (message.radius, message.killer, str(message)) == (pytest.approx(1.5), "gspure", "1.5 dB")
    readable = of("readable", PUBLISHED, BEFORE, *attacks)
    assert (readable.radius, readable.killer) == (pytest.approx(0.4), "gof")
    fewer = of("message", PUBLISHED, BEFORE, *attacks[2:])
    assert fewer.radius == pytest.approx(6.0)
    assert str(of("message", PUBLISHED, BEFORE, attacked("gain", -0.2, message=NOTHING))) == "< 0.05 dB"


def test_a_radius_exceeds_what_was_tried_if_nothing_ends_the_message() -> None:
    held = of("message", PUBLISHED, BEFORE, attacked("gof", 0.4, message=PLAIN), attacked("crop", 2.1, message=PLAIN))
    assert (held.exceeds, str(held), held.high) == (True, "> 2.1 dB", inf)
    rows = results(attacked("unattacked", 0.0, message=NOTHING), attacked("gof", 0.4, message=NOTHING))
    assert not model_radii(rows)


def test_a_radius_over_scenes_is_the_lower_median_and_seeds_of_a_scene_count_once() -> None:
    outcomes = []
    for scene, damages in {"a": (0.5, 0.5, 9.0), "b": (2.0,), "c": (3.0,), "d": (inf,)}.items():
        for seed, damage in enumerate(damages):
            outcomes.append(attacked("unattacked", 0.0, scene, seed, message=PLAIN))
            evidence = PLAIN if damage == inf else NOTHING
            outcomes.append(attacked("gspure", min(damage, 8.0), scene, seed, message=evidence))
    radius = of("message", PUBLISHED, *outcomes)
    assert (radius.radius, radius.low, radius.high, radius.scenes) == (pytest.approx(2.0), pytest.approx(0.5), inf, 4)


def test_without_photographs_the_gentlest_attack_that_ends_a_message_has_a_fidelity() -> None:
    fidelity = {"unattacked": (None, PLAIN), "gof": (41.0, NOTHING), "gspure": (33.0, NOTHING)}
    rendered = [
        replace(attacked(name, 0.0, message=left), change=SceneChange(None, level, 0.0))
        for name, (level, left) in fidelity.items()
    ]
    radius = of("message", PUBLISHED, *rendered)
    assert isnan(radius.radius)
    assert (radius.killer, radius.fidelity, str(radius)) == ("gof", 41.0, "unknown")


def test_without_photographs_a_radius_over_scenes_is_the_median_by_fidelity() -> None:
    condition = Condition("sis")
    known = []
    for scene, fidelity in {"a": 30.0, "b": 41.0, "c": 35.0}.items():
        killer = f"attack on {scene}"
        model = ModelId("sis", scene)
        known.append(ModelRadius(model, "message", PUBLISHED, "message", nan, False, killer, fidelity))
    (radius,) = radii(known, {one.model: condition for one in known})
    assert (radius.killer, radius.fidelity) == ("attack on c", 35.0)


def test_a_removed_format_ends_the_message() -> None:
    removed = outcome("distil", targets={"scene": 29.0}, unreadable={"message": "removed"}, **PROTOCOL)
    assert of("message", PUBLISHED, BEFORE, removed).radius == pytest.approx(1.0)


def test_a_table_is_read_back_with_every_number_and_reason(tmp_path: Path) -> None:
    strong = replace(attacked("gof", 0.4, message=shown(0.3, 0.5)), strength=StrengthValue("tolerance", 2.0))
    failed = outcome("crop", failure="no memory", **PROTOCOL)
    rows = judged(with_references([BEFORE, strong, failed, read("blur", 30, 32)]), {"sweep": ["gof", "blur"]})
    write_results(tmp_path / "results.csv", rows)
    copies = read_results(tmp_path / "results.csv")
    assert [*map(plain, copies)] == [*map(plain, rows)]
    by_variant = {row.variant: row for row in copies}
    assert (by_variant["gof"].attack, by_variant["gof"].strength) == ("sweep", ("tolerance", 2.0))
    assert by_variant["crop"].failure == "no memory"


@pytest.mark.parametrize(("count", "views"), [(3, [0, 1, 2]), (4, [0, 1, 2, 3]), (8, [0, 2, 4, 6]), (9, [0, 2, 4, 6])])
def test_compared_views_are_spread_evenly(count: int, views: list[int]) -> None:
    assert compared_views(count) == views
