"""Outcomes of variants and what identifies their models: drops, effects, titles, the table, and the paper's claims."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import pytest

from gspure.evaluation.collecting import collect
from gspure.evaluation.contest import leads
from gspure.evaluation.identity import Condition, ModelId
from gspure.evaluation.matched import title_with_damage
from gspure.evaluation.outcomes import UNCHANGED, Outcome, extractions, ordered, with_references
from gspure.evaluation.paper import Check, Claim, beside, check_claims, mean_psnr, read_rows, score
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.summary import summarize
from gspure.evaluation.survival import not_embedded, survival
from gspure.evaluation.verdict import StrengthValue
from gspure.metrics.detection import Detection, detection
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE, MARGIN, rms_ratio
from gspure.metrics.readings import Reading
from gspure.metrics.retrieval import Retrieval
from gspure.metrics.statistics import Interval
from tests.contest_cases import CONTROLS, attacked, benchmark, measured, model_plan, outcome


@pytest.mark.parametrize(
    ("model", "folder", "title"),
    [
        (ModelId("gs_hider", "room"), "results/gs_hider/room", "GS-Hider, room"),
        (ModelId("gs_hider", "room", 2), "results/gs_hider/room@2", "GS-Hider, room, repetition 2"),
    ],
)
def test_a_model_has_a_folder_of_its_scheme_scene_and_repetition(model: ModelId, folder: str, title: str) -> None:
    assert (model.folder, model.title) == (Path(folder), title)
    assert folder.endswith(f"{model.scheme}/{model.folder_name}")


@pytest.mark.parametrize(
    ("condition", "key", "title"),
    [
        (Condition("vanilla"), "vanilla", "Own model"),
        (Condition("gs_hider", "own", "both"), "gs_hider-own-both", "GS-Hider, own poses"),
        (Condition("gs_hider", "shared", "scene"), "gs_hider-shared-scene", "GS-Hider, shared poses, scene's points"),
    ],
)
def test_a_condition_is_named_after_what_its_models_share(condition: Condition, key: str, title: str) -> None:
    assert (condition.key, condition.title) == (key, title)


def mark(level: float) -> Detection:
    return detection([Reading(view, level, 32) for view in "abcd"], [])


RETRIEVED = Retrieval(0.5, 0.75, 0.25, 4, 17)


def test_a_drop_is_the_level_before_minus_that_after() -> None:
    o = attacked("noise", 1.5, 6.0)
    assert (o.psnr_drop("scene"), o.drop("message"), o.score) == (1.5, 6.0, 4.5)
    assert o.drops("scene")["ssim"] == 0.0


def test_a_drop_from_or_to_an_exact_image_is_unknown() -> None:
    exact = measured("scene", math.inf)
    o = attacked("noise", 1.5, 6.0)
    assert o.before is not None
    assert math.isnan(replace(o, targets={"scene": exact}).psnr_drop("scene"))
    before = replace(o.before, targets={"scene": exact})
    assert math.isnan(replace(o, before=before).psnr_drop("scene"))


def test_without_a_reference_no_drop_is_known() -> None:
    o = replace(attacked("noise", 1.5, 6.0), before=None)
    assert math.isnan(o.psnr_drop("scene"))
    assert math.isnan(attacked("noise", 1.5, 6.0).drop("message_adaptive"))


def test_without_photographs_the_drop_is_the_nominal_one() -> None:
    o = attacked("noise", 1.5, 6.0)
    assert o.before is not None
    o = replace(o, nominal={"scene": 2.25}, before=replace(o.before, nominal={"scene": 0.25}))
    assert (o.psnr_drop("scene"), o.psnr_drop("message")) == (2.0, 6.0)


def test_the_drop_of_a_detector_is_that_of_its_mean_reading() -> None:
    before = outcome("unattacked", targets={"scene": 30.0}, detections={"mark": mark(90.0)})
    after = outcome("noise", targets={"scene": 29.0}, detections={"mark": mark(60.0)})
    assert with_references([before, after])[1].drop("mark") == 30.0


def test_a_control_has_no_score() -> None:
    assert math.isnan(attacked("wrong_key", 0.0, 6.0).score)
    assert attacked("wrong_key", 0.0, 6.0).is_control


@pytest.mark.parametrize(("change", "contradicts"), [(0.0, False), (UNCHANGED, False), (2 * UNCHANGED, True)])
def test_a_change_beyond_rounding_contradicts_that_an_extraction_is_unaffected(
    change: float, contradicts: bool
) -> None:
    before = outcome("unattacked", targets={"message": change})
    after = outcome("noise", targets={"message": 0.0}, affects={"message": False})
    _, o = with_references([before, after])
    assert o.contradicts("message") is contradicts
    assert o.reaches("message") is contradicts


@pytest.mark.parametrize("affected", [True, None])
def test_what_is_not_declared_unaffected_is_not_contradicted(affected: bool | None) -> None:
    o = attacked("noise", 1.0, 6.0, affects={} if affected is None else {"message": affected})
    assert not o.contradicts("message")
    assert o.reaches("message") is affected


STRENGTH = StrengthValue("sigma", 0.123456)


@pytest.mark.parametrize(("ended", "text"), [(1.0, "sigma=0.1235"), (0.5, "sigma=0.1235, 0.50 dB reached")])
def test_a_strength_names_the_damage_that_its_search_missed(ended: float, text: str) -> None:
    o = attacked("noise@1dB", 1.0, 2.0, strength=STRENGTH, search_damage=ended)
    assert o.strength_text == text
    assert replace(o, strength=None).strength_text == ""
    assert replace(o, wanted=math.nan).strength_text == "sigma=0.1235"


def test_the_damage_is_that_of_the_search_where_the_drop_is_unknown() -> None:
    exact = {"scene": measured("scene", math.inf)}
    o = replace(attacked("noise@1dB", 0.75, 2.0), search_damage=1.25)
    assert o.damage == 0.75
    assert replace(o, targets=exact).damage == 1.25
    assert replace(o, targets=exact, search_damage=1 + DAMAGE_TOLERANCE / 2).damage == 1.0


def test_titles_are_those_of_entries_with_their_damage() -> None:
    assert attacked("gaussian_noise@1dB", 1.0, 2.0).title == "Gaussian noise, 1 dB"
    assert attacked("gaussian_noise", 1.0, 2.0).title == "Gaussian noise"


def test_an_image_without_structure_is_flat() -> None:
    flat = measured("message", 10.0, others=0.0)
    assert replace(attacked("noise", 1.0, 2.0), targets={"message": flat}).is_flat("message")
    assert not attacked("noise", 1.0, 2.0).is_flat("message")
    assert not attacked("noise", 1.0, 2.0).is_flat("message_adaptive")


def test_targets_are_ordered_from_the_scene_to_detectors() -> None:
    names = ["mark", "bits", "message_oracle", "message", "a", "scene"]
    assert ordered(names) == ["scene", "message", "message_oracle", "bits", "a", "mark"]
    o = outcome("noise", targets={"scene": 30.0, "message": 10.0}, unreadable={"message_x": "no"})
    assert extractions([o, replace(o, detections={"mark": mark(60.0)})]) == ["message", "message_x", "mark"]


def test_failures_name_the_variant_and_its_detectors() -> None:
    o = outcome("crop", failure="no memory", detector_errors={"mark": "too slow"})
    assert o.failures == {"crop": "no memory", "mark of crop": "too slow"}
    assert attacked("crop", 1.0, 2.0).failures == {}


def test_gspure_on_a_clean_model_is_compared_with_that_model() -> None:
    variants = [outcome(name, targets={"scene": level}) for name, level in (("unattacked", 30.0), ("clean", 29.0))]
    purified = outcome("clean_gspure", targets={"scene": 28.5})
    elsewhere = outcome("unattacked", "vault", targets={"scene": 20.0})
    drops = {o.variant: o.psnr_drop("scene") for o in with_references([*variants, purified, elsewhere])[1:]}
    assert (drops["clean"], drops["clean_gspure"]) == (1.0, 0.5)


def table_rows() -> list[Outcome]:
    """Outcomes with a value in every column."""
    where = {"protocol": "own", "initialization": "scene", "run": "abc"}
    targets = {"scene": 30.0, "message": 28.0}
    known = {
        "pruned_share": 0.5,
        "precision": 0.25,
        "recall": 0.75,
        "strength": StrengthValue("sigma", 0.5),
        "search_damage": 1.03,
        "affects": {"message": True, "mark": False},
        "identical": {"scene": 0, "message": 2},
        "retrieval": {"message": RETRIEVED},
        "detections": {"mark": mark(60.0)},
    }
    noise = outcome("noise@1dB", targets={"scene": 29.0, "message": 20.0}, **where, **known)
    of_renders = {name: measured(name, level, reference="render") for name, level in targets.items()}
    return [
        outcome("unattacked", targets=targets, detections={"mark": mark(90.0)}, **where),
        noise,
        outcome("crop", failure="not run", **where),
        outcome("gof", targets=targets, detector_errors={"mark": "too slow"}, **where),
        outcome("distil", targets={"scene": 28.0}, unreadable={"message": "removed"}, **where),
        outcome("unattacked", "vault", 1, targets=targets),
        replace(
            outcome("noise", "vault", 1, targets=targets), targets=of_renders, nominal={"scene": 0.5, "message": 2.0}
        ),
    ]


def test_a_table_is_read_back_with_every_number_and_reason(tmp_path: Path) -> None:
    outcomes = with_references(table_rows())
    attacks = {"noise sweep": ["noise@1dB", "noise"], "crop": ["crop"]}
    write_results(tmp_path / "results.csv", outcomes, attacks)
    copies, known_attacks = read_results(tmp_path / "results.csv")
    assert [replace(o, before=None, nominal={}) for o in map(comparable, copies)] == [
        replace(o, before=None, nominal={}) for o in map(comparable, outcomes)
    ]
    assert known_attacks["noise sweep"] == ["noise@1dB", "noise"]
    assert known_attacks[""] == ["unattacked", "gof", "distil"]


def comparable(o: Outcome) -> Outcome:
    """Return an outcome without NaN, which differs from itself."""
    unknown = {name: None for name, value in vars(o).items() if isinstance(value, float) and math.isnan(value)}
    detections = {name: str(read) for name, read in o.detections.items()}
    return replace(o, **unknown, detections=detections)


def test_nominal_drops_of_a_table_are_those_of_renders(tmp_path: Path) -> None:
    write_results(tmp_path / "results.csv", with_references(renders_only()), {})
    copies, _ = read_results(tmp_path / "results.csv")
    assert [o.nominal for o in copies] == [{"scene": 0.0}, {"scene": 0.75}]
    assert copies[1].psnr_drop("scene") == 0.75


def test_the_score_of_a_row_is_that_of_its_extraction_or_else_of_the_message(tmp_path: Path) -> None:
    before = outcome("unattacked", targets={"scene": 30.0, "message": 28.0, "message_adaptive": 26.0})
    after = outcome("noise", targets={"scene": 29.0, "message": 20.0, "message_adaptive": 24.0})
    write_results(tmp_path / "results.csv", with_references([before, after]), {})
    rows = csv.DictReader((tmp_path / "results.csv").read_text().splitlines())
    scores = {row["target"]: float(row["score"]) for row in rows if row["variant"] == "noise"}
    assert scores == {"scene": 7.0, "message": 7.0, "message_adaptive": 1.0}


def renders_only() -> list[Outcome]:
    levels = {"unattacked": 0.25, "noise": 1.0}
    return [
        replace(
            outcome(name),
            targets={"scene": measured("scene", 40.0, reference="render")},
            nominal={"scene": drop},
            views={"scene": 3},
        )
        for name, drop in levels.items()
    ]


def test_a_model_without_readings_is_no_scene_where_others_are_read() -> None:
    marked = outcome("unattacked", targets={"scene": 30.0}, detections={"mark": mark(90.0)})
    clean = outcome("unattacked", "clean", targets={"scene": 20.0})
    (row,) = (row for row in summarize([marked, clean]) if row.extraction == "mark")
    assert row.scene is not None
    assert (row.scene.mean, row.scene.scenes) == (30.0, 1)
    failed = outcome("unattacked", "vault", failure="not run")
    assert len(summarize([clean, failed])) == 1
    (row,) = summarize([clean])
    assert row.scene is not None
    assert row.scene.mean == 20.0


@pytest.mark.parametrize(("margin", "is_embedded"), [(MARGIN, True), (MARGIN - 0.25, False)])
def test_a_message_near_the_controls_is_not_embedded(margin: float, is_embedded: bool) -> None:
    level = max(CONTROLS[name] for name in ("clean", "other_scene", "black", "mean_colour")) + margin
    outcomes = [
        replace(o, targets={**o.targets, "message": measured("message", level)}) if o.variant == "unattacked" else o
        for o in benchmark({"a": {"noise": (1.0, 2.0)}})
    ]
    assert not_embedded(outcomes) == ([] if is_embedded else [ModelId("sis", "a")])


def test_without_controls_any_message_is_embedded_unless_it_is_flat() -> None:
    o = outcome("unattacked", targets={"message": 3.0})
    assert not_embedded([o]) == []
    flat = measured("message", 3.0, others=0.0)
    assert not_embedded([replace(o, targets={"message": flat})]) == [ModelId("sis", "room")]


CLAIM = Claim("Table 1", "words", "score", "gs_hider", "gspure", "", "=", 1.0)


@pytest.mark.parametrize(
    ("relation", "recomputed", "holds"),
    [
        *[("=", 1.015, True), ("=", 0.985, True), ("=", 1.025, False), ("=", 0.975, False)],
        *[("<", 0.5, True), ("<", 1.0, False), ("<", 1.5, False)],
    ],
)
def test_a_claim_holds_within_rounding_or_below_its_bound(relation: str, recomputed: float, holds: bool) -> None:
    assert Check(CLAIM._replace(relation=relation), recomputed).holds is holds


def test_the_papers_numbers_that_do_not_follow_from_its_tables() -> None:
    checks = check_claims(read_rows())
    failed = [(check.claim.place, check.claim.value) for check in checks if not check.holds]
    assert failed == [
        ("Table 1", 15.21),
        ("Table 1", 5.03),
        ("Table 3", 25.62),
        ("Table 3", 10.19),
        ("Abstract", 16.34),
        ("Abstract", 1.0),
        ("Original Scene Fidelity", 9.68),
        ("Original Scene Fidelity", 2.21),
        ("Watermark Purification Effectiveness", 5.44),
        ("Watermark Purification Effectiveness", 12.97),
        ("Watermark Purification Effectiveness", 4.39),
    ]


def test_claims_of_ablations_name_the_column_of_their_table() -> None:
    words = [check.claim.words for check in check_claims(read_rows()) if check.claim.place in ("Table 2", "Table 3")]
    columns = [text.rpartition(", ")[2] for text in words]
    assert columns == ["GS-Hider PSNR", "SecureGS PSNR", "Scene PSNR", "Message PSNR"]


def test_the_papers_score_of_an_attack_is_that_of_its_means() -> None:
    printed = read_rows()
    means = mean_psnr(printed)
    scores = {(row.condition.scheme, row.variant): row.paper_score for row in beside(printed)}
    assert scores == {key: pytest.approx(score(means, *key)) for key in scores}


INTERVAL = Interval(1.1, 0.9, 1.3, 0.95, 9)


@pytest.mark.parametrize(
    ("scene_drop", "name"),
    [
        (INTERVAL, "GOF, 1 dB (1.10 dB reached on average)"),
        (INTERVAL._replace(level=0.75), "GOF, 1 dB (0.90 to 1.30 dB reached)"),
        (Interval(1.0, 0.98, 1.02, 0.95, 9), "GOF, 1 dB"),
        (Interval(1.0, 0.98, 1.02, 0.75, 3), "GOF, 1 dB"),
        (Interval(0.5, 0.5, 0.5, 0.0, 1), "GOF, 1 dB (0.50 dB reached)"),
        (None, "GOF, 1 dB"),
    ],
)
def test_the_name_of_a_variant_has_the_damage_where_the_search_missed_it(
    scene_drop: Interval | None, name: str
) -> None:
    row = survival(benchmark({"a": {"gof@1dB": (1.0, 5.0)}}))[1]
    assert row._replace(scene_drop=scene_drop).name == name
    assert row._replace(scene_drop=Interval(1.0, 1.0, 1.0, 0.0, 1), damage=scene_drop).name == name


def test_the_rms_ratio_of_a_variant_is_that_of_its_levels() -> None:
    row = survival(benchmark({"a": {"gof": (1.0, 10.0)}}))[1]
    assert row.rms_ratio == pytest.approx(rms_ratio([[28.0, 18.0]], [[30.0, 29.0]]))


@pytest.mark.parametrize(
    ("wanted", "drops", "suffix"),
    [
        (1.0, (1.02, 0.98), ""),
        (1.0, (1.0, 2.0, 0.5), " (0.50 to 2.00 dB reached)"),
        (1.0, (0.5, math.inf), " (0.50 dB reached)"),
        (1.0, (), ""),
        (math.nan, (0.5, 2.0), ""),
    ],
)
def test_a_title_has_the_range_of_damages_where_any_misses_the_wanted(
    wanted: float, drops: tuple[float, ...], suffix: str
) -> None:
    assert title_with_damage("GOF", wanted, *drops) == f"GOF{suffix}"


def test_a_rival_of_half_the_scenes_competes() -> None:
    drops = {"gspure@1dB": (1.0, 10.0), "gof@1dB": (1.0, 7.0)}
    outcomes = benchmark({"a": drops, "b": {"gspure@1dB": (1.0, 10.0)}})
    (row,) = leads(outcomes, {"gspure": ["gspure@1dB"], "crop": ["gof@1dB"]})
    assert (row.attack, row.difference.mean, row.difference.scenes, row.is_bound) == ("crop", 3.0, 1, False)


def test_the_unattacked_model_and_controls_are_no_rivals() -> None:
    outcomes = benchmark({"a": {"gspure": (1.0, 10.0)}})
    attacks = {name: [name] for name in ("gspure", "unattacked", "clean")}
    assert leads(outcomes, attacks) == []


def test_outcomes_are_sorted_by_model_with_the_unattacked_first(tmp_path: Path) -> None:
    names = ["b/room", "a/vault", "a/room"]
    models = [model_plan(name, ("crop", "unattacked", "blur"), ("clean",)) for name in names]
    repetition = replace(models[2], id=ModelId("a", "room", 1))
    outcomes = collect(tmp_path, [repetition, *models])
    order = [(o.scheme, o.scene, o.seed) for o in outcomes[::4]]
    assert order == [("a", "room", 0), ("a", "room", 1), ("a", "vault", 0), ("b", "room", 0)]
    assert [o.variant for o in outcomes[:4]] == ["unattacked", "crop", "blur", "clean"]
    assert {o.failure for o in outcomes} == {"not run"}
