"""The job of one variant or control: what it attacks, renders, extracts, reads and compares, and what it writes."""

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gspure.arrays import Bools, Float32, load_array
from gspure.codec import read
from gspure.errors import InputError
from gspure.evaluation.attacking import Context, attacked
from gspure.evaluation.evaluate import evaluate
from gspure.evaluation.plan import AttackSpec, Control, Detector, Job, Views
from gspure.evaluation.verdict import VERDICT, Applied, AttackRecord, Refused, StrengthValue
from gspure.files import read_json
from gspure.images import read_image, write_image
from gspure.method.purify import purify
from gspure.method.settings import MethodSettings
from gspure.metrics.comparison import ViewMetrics, read_metrics
from gspure.metrics.csv_tables import read_table, write_table
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE, nominal_drop, psnr
from gspure.metrics.readings import Reading
from gspure.metrics.retrieval import Retrieved
from gspure.metrics.targets import ADAPTIVE, MESSAGE, SCENE
from gspure.model import Gaussians, read_model
from tests import evaluation_cases as cases
from tests.evaluation_cases import TESTED, attack_job, drawn, job, renders, run

UNAFFECTED = dict.fromkeys((MESSAGE, ADAPTIVE, cases.ORACLE), False)
METHOD = MethodSettings(min_samples=3, min_cluster_size=5, tau_c=2.0, tau_n=2.0)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder in which the unattacked model has been evaluated."""
    with cases.project(tmp_path_factory.mktemp("project")) as folder:
        run(attack_job("unattacked", "unattacked", targets=(SCENE, MESSAGE, ADAPTIVE)))
        yield folder


@pytest.fixture(autouse=True)
def in_project(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(project)


def verdict(planned: Job) -> Applied | Refused:
    content: AttackRecord = read(AttackRecord, read_json(planned.folder / VERDICT), "verdict")
    return content.attack


def prune_mask(planned: Job) -> Bools:
    return load_array(planned.folder / "prune_mask.npy", dtype=np.bool_, shape=(cases.ROWS,))


def attacked_model(planned: Job) -> Gaussians:
    return read_model(planned.folder / "public" / "point_cloud.ply")


def assert_same(images: dict[str, Float32], expected: dict[str, Float32]) -> None:
    assert images.keys() == expected.keys()
    for name, image in images.items():
        np.testing.assert_array_equal(image, expected[name])


def differ(images: dict[str, Float32], references: dict[str, Float32]) -> bool:
    return all((image != references[name]).any() for name, image in images.items())


def unattacked(target: str) -> dict[str, Float32]:
    return renders(attack_job("unattacked", "unattacked"), target)


def test_an_attack_leaves_its_model_mask_images_tables_and_verdict() -> None:
    planned = attack_job("pruned", "random_pruning", attack={"fraction": 0.25})
    evaluation = run(planned)
    mask = prune_mask(planned)
    assert mask.sum() == 15
    np.testing.assert_array_equal(attacked_model(planned).table, cases.public_rows()[~mask].table)
    assert_same(renders(planned, SCENE), drawn(cases.public_rows()[~mask]))
    assert differ(renders(planned, MESSAGE), unattacked(MESSAGE))
    assert [(row.target, row.view, row.reference) for row in evaluation.metrics] == [
        (target, view, "render") for target in (MESSAGE, SCENE) for view in TESTED
    ]
    assert read_metrics(planned.folder / "metrics.csv") == [*evaluation.metrics]
    assert [(row.variant, row.target, row.retrieval.views) for row in evaluation.retrieval] == [("pruned", MESSAGE, 2)]
    assert read_table(planned.folder / "retrieval.csv", Retrieved) == [*evaluation.retrieval]
    affected = dict.fromkeys((MESSAGE, ADAPTIVE, cases.ORACLE), True)
    assert verdict(planned) == evaluation.attack == Applied(StrengthValue("fraction", 0.25), None, affects=affected)


def test_metrics_compare_with_the_unattacked_renders_of_the_same_view() -> None:
    planned = attack_job("noisy", "gaussian_noise", targets=(SCENE,))
    run(planned)
    before = unattacked(SCENE)
    after = renders(planned, SCENE)
    psnrs = {row.view: row.psnr for row in read_metrics(planned.folder / "metrics.csv")}
    assert psnrs == {name: psnr(before[name], after[name]) for name in TESTED}


def test_an_attack_affects_the_extractions_that_read_what_it_changes() -> None:
    evaluation = run(attack_job("noisy", "gaussian_noise"))
    assert evaluation.attack == Applied(
        StrengthValue("sigma", 0.1), None, {MESSAGE: False, ADAPTIVE: True, cases.ORACLE: True}
    )


def test_the_unattacked_model_is_the_public_one() -> None:
    planned = attack_job("again", "unattacked")
    evaluation = run(planned)
    assert attacked_model(planned).table.tobytes() == cases.public_rows().table.tobytes()
    assert {row.psnr for row in evaluation.metrics} == {inf}
    assert evaluation.attack == Applied(affects=UNAFFECTED)


def test_the_seed_of_an_attack_is_that_of_the_plan() -> None:
    masks = []
    for seed in (0, 0, 1):
        planned = job("seeded", AttackSpec("random_pruning", seed=seed), targets=(SCENE,))
        run(planned)
        masks.append(prune_mask(planned).tobytes())
    assert masks[0] == masks[1] != masks[2]


def test_measurements_are_read_from_their_files() -> None:
    weights = np.arange(cases.ROWS, dtype=np.float32) % 2
    np.save("weights.npy", weights)
    planned = job("bleached", AttackSpec("bleach", measured={"weights": Path("weights.npy")}), targets=(SCENE,))
    run(planned)
    np.testing.assert_array_equal(prune_mask(planned), weights > 0)


def test_a_strength_is_searched_for_a_damage() -> None:
    planned = job("searched", AttackSpec("gaussian_noise", damage=2.0))
    evaluation = run(planned)
    assert isinstance(evaluation.attack, Applied)
    assert evaluation.attack.search_damage == pytest.approx(2.0, abs=DAMAGE_TOLERANCE)
    drops = [nominal_drop(row.psnr) for row in evaluation.metrics if row.target == SCENE]
    assert np.mean(drops) == pytest.approx(evaluation.attack.search_damage, abs=1e-4)
    comments = " ".join(attacked_model(planned).comments)
    assert f"sigma={evaluation.attack.strength.value}" in comments
    assert "dB of 2 dB" in comments


def test_with_photographs_the_damage_is_the_drop_of_the_mean_psnr_against_them() -> None:
    photographed = Views(cases.PHOTOGRAPHED, "test", cases.UNATTACKED, photographed=(SCENE,))
    before = run(attack_job("photographed", "unattacked", targets=(SCENE,), views=photographed)).metrics
    planned = job("searched", AttackSpec("feature_scaling", damage=0.5), targets=(SCENE,), views=photographed)
    evaluation = run(planned)
    assert {row.reference for row in evaluation.metrics} == {"truth"}
    photographs = {name: read_image(cases.PHOTOGRAPHED.with_name(f"{name}.png")) for name in TESTED}
    images = renders(planned, SCENE)
    assert [row.psnr for row in evaluation.metrics] == [psnr(photographs[name], images[name]) for name in TESTED]
    drop = np.mean([row.psnr for row in before]) - np.mean([row.psnr for row in evaluation.metrics])
    assert isinstance(evaluation.attack, Applied)
    assert drop == pytest.approx(evaluation.attack.search_damage, abs=1e-4)
    assert drop == pytest.approx(0.5, abs=DAMAGE_TOLERANCE)


def test_an_attack_on_what_rows_do_not_store_is_refused() -> None:
    planned = attack_job("refused", "opacity_noise")
    evaluation = run(planned)
    assert verdict(planned) == evaluation.attack == Refused("rows do not store opacity")
    assert read_table(planned.folder / "metrics.csv", ViewMetrics) == []
    assert read_table(planned.folder / "retrieval.csv", Retrieved) == []
    assert not prune_mask(planned).any()
    assert [*planned.folder.rglob("*.png")] == [*planned.folder.rglob("*.ply")] == []


def test_an_attack_that_leaves_no_row_is_refused() -> None:
    planned = attack_job("emptied", "crop", attack={"fraction": 1e-9})
    assert run(planned).attack == Refused("none of 60 rows would remain")
    assert not prune_mask(planned).any()


def test_of_a_removed_format_only_the_scene_is_shown() -> None:
    planned = attack_job("converted", "convert", targets=(SCENE, MESSAGE, ADAPTIVE))
    evaluation = run(planned)
    assert verdict(planned) == Applied(None, None, UNAFFECTED, "no key reads this format")
    assert {row.target for row in evaluation.metrics} == {SCENE}
    assert evaluation.retrieval == ()
    assert [folder.name for folder in (planned.folder / "renders").iterdir()] == [SCENE]


def test_the_scene_is_compared_in_views_that_move_with_the_model() -> None:
    planned = attack_job("turned", "rigid_transform", attack={"angle": 40.0, "translation": "1,0,0"}, targets=(SCENE,))
    assert min(row.psnr for row in run(planned).metrics) > 45
    assert differ(drawn(attacked_model(planned)), unattacked(SCENE))


def likeness(planned: Job, target: str) -> float:
    """The PSNR of the least similar view of a target, compared with that of the unattacked model."""
    before = unattacked(target)
    return min(psnr(image, before[name]) for name, image in renders(planned, target).items())


def test_an_owner_who_adapts_moves_the_model_back() -> None:
    adaptive = cases.owner(published=cases.PUBLIC)
    planned = attack_job(
        "turned", "rigid_transform", attack={"angle": 40.0}, targets=(MESSAGE, ADAPTIVE), owner=adaptive
    )
    run(planned)
    assert likeness(planned, MESSAGE) < 30
    assert likeness(planned, ADAPTIVE) > 40


def test_without_the_published_model_nothing_is_moved_back() -> None:
    planned = attack_job("turned", "rigid_transform", attack={"angle": 40.0}, targets=(ADAPTIVE,))
    run(planned)
    assert likeness(planned, ADAPTIVE) < 30


def test_all_extractions_are_compared_with_the_message() -> None:
    planned = attack_job("again", "unattacked", targets=(MESSAGE, ADAPTIVE))
    metrics = run(planned).metrics
    assert {row.target: row.psnr == inf for row in metrics} == {MESSAGE: True, ADAPTIVE: False}


def test_an_owner_who_adapts_learns_from_photographs_of_the_message() -> None:
    learner = cases.owner(published=cases.PUBLIC, photographs=cases.MESSAGE_CAMERAS.parent)
    planned = attack_job("learned", "reorder", targets=(MESSAGE, ADAPTIVE), owner=learner)
    run(planned)
    assert_same(renders(planned, MESSAGE), unattacked(MESSAGE))
    taught = replace(cases.lantern_key(), colour=np.array([0.0, 1.0, 0.0]))
    shown, _ = taught.revealed(cases.LanternModel(cases.public_rows()), ADAPTIVE)
    assert_same(renders(planned, ADAPTIVE), drawn(shown))


def test_an_attack_on_renders_changes_the_scene_alone() -> None:
    planned = attack_job("pressed", "jpeg", attack={"quality": 5})
    evaluation = run(planned)
    assert differ(renders(planned, SCENE), unattacked(SCENE))
    assert_same(renders(planned, MESSAGE), unattacked(MESSAGE))
    assert evaluation.attack == Applied(StrengthValue("quality", 5), None, UNAFFECTED)
    assert not prune_mask(planned).any()


def test_an_attack_that_learns_sees_the_training_views() -> None:
    planned = attack_job("lesson", "reestimate", attack={"iterations": 1}, targets=(SCENE,))
    run(planned)
    assert differ(renders(planned, SCENE), unattacked(SCENE))


def test_a_wrong_key_shows_other_pictures() -> None:
    planned = job("wrong_key", Control("wrong_key"), targets=(MESSAGE,))
    evaluation = run(planned)
    assert differ(renders(planned, MESSAGE), unattacked(MESSAGE))
    assert max(row.psnr for row in evaluation.metrics) < inf
    assert evaluation.attack is None
    assert not (planned.folder / VERDICT).exists()


def test_a_wrong_key_is_the_same_in_every_run() -> None:
    planned = job("wrong_key", Control("wrong_key"), targets=(MESSAGE,))
    run(planned)
    before = renders(planned, MESSAGE)
    run(planned)
    assert_same(renders(planned, MESSAGE), before)


def test_another_control_has_the_right_key() -> None:
    planned = job("other_scene", Control("other_scene"), targets=(MESSAGE,))
    run(planned)
    assert_same(renders(planned, MESSAGE), unattacked(MESSAGE))


@pytest.mark.parametrize("baseline", ["black", "mean_colour"])
def test_a_baseline_is_blank_images_that_are_not_rendered(baseline: str) -> None:
    planned = job(baseline, Control(baseline), rendered=(), compared=(MESSAGE,))
    evaluation = run(planned)
    assert [*(planned.folder / "renders").iterdir()] == []
    for row in evaluation.metrics:
        picture = unattacked(MESSAGE)[row.view]
        colour = np.zeros(3) if baseline == "black" else picture.mean(axis=(0, 1))
        blank = np.broadcast_to(colour.astype(np.float32), picture.shape)
        assert row.psnr == pytest.approx(psnr(picture, blank), abs=0.1)
    assert evaluation.retrieval == ()


def test_gspure_on_a_clean_model_is_a_control_with_a_mask() -> None:
    planned = job("clean_gspure", Control("clean_gspure", METHOD), targets=(SCENE,), public=cases.CLEAN, owner=None)
    run(planned)
    clean = cases.blobs(cases.ROWS, seed=1, sh_degree=1)
    training = [view for view in cases.views() if view.name not in TESTED]
    expected = purify(cases.LanternModel(clean), training, **METHOD.of_purify).prune_mask
    assert 0 < expected.sum() < cases.ROWS
    np.testing.assert_array_equal(prune_mask(planned), expected)
    assert_same(renders(planned, SCENE), drawn(clean[~expected]))


def test_gspure_on_a_clean_model_uses_as_many_views_as_on_the_marked_one(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = []

    def counting(public: Any, views: list[Any], **settings: Any) -> Any:
        counts.append(len(views))
        return purify(public, views, **settings)

    monkeypatch.setattr("gspure.evaluation.evaluate.purify", counting)
    run(job("clean_gspure", Control("clean_gspure", replace(METHOD, views=3)), targets=(SCENE,), owner=None))
    assert counts == [3]


def test_a_clean_control_is_shown_as_it_is() -> None:
    planned = job("clean", Control("clean"), targets=(SCENE,), public=cases.CLEAN, owner=None)
    run(planned)
    assert_same(renders(planned, SCENE), drawn(cases.blobs(cases.ROWS, seed=1, sh_degree=1)))
    assert not (planned.folder / "prune_mask.npy").exists()


def test_without_an_owner_there_is_no_message() -> None:
    evaluation = run(attack_job("pruned", "random_pruning", targets=(SCENE,), owner=None))
    assert isinstance(evaluation.attack, Applied)
    assert evaluation.attack.affects == {}
    assert {row.target for row in evaluation.metrics} == {SCENE}


def test_a_users_detector_reads_the_renders_of_the_scene() -> None:
    program = "import json, pathlib, sys; folder = pathlib.Path(sys.argv[1]); "
    program += "print(json.dumps({image.stem: image.stat().st_size for image in folder.glob('*.png')}))"
    Path("size.py").write_text(program)
    detectors = {"size": Detector(f"{sys.executable} size.py"), "again": Detector(f"{sys.executable} size.py")}
    planned = attack_job("marked", "gaussian_noise", targets=(SCENE,), detectors=detectors)
    evaluation = run(planned)
    sizes = {name: (planned.folder / "renders" / SCENE / f"{name}.png").stat().st_size for name in TESTED}
    expected = [Reading(name, sizes[name], 0) for name in TESTED]
    assert {name: [*rows] for name, rows in evaluation.readings.items()} == {"size": expected, "again": expected}
    assert read_table(planned.folder / "detections" / "size.csv", Reading) == expected


def test_bits_are_read_with_the_key_and_a_detector_gets_the_embedded_ones() -> None:
    program = 'import json; print(json.dumps({"view_0": "10", "view_8": "01"}))'
    Path("bits.py").write_text(program)
    detectors = {"bits_of_two": Detector(f"{sys.executable} bits.py", message="10")}
    planned = attack_job(
        "read", "unattacked", targets=(SCENE,), owner=cases.owner("blinker"), reads_bits=True, detectors=detectors
    )
    levels = {name: [row.level for row in rows] for name, rows in run(planned).readings.items()}
    assert levels == {"bits_of_two": [100.0, 0.0], "bits": [100.0, 100.0]}
    assert {path.name for path in (planned.folder / "detections").iterdir()} == {"bits_of_two.csv", "bits.csv"}


def test_a_wrong_key_reads_other_bits() -> None:
    blinker = cases.owner("blinker")
    planned = job("wrong_bits", Control("wrong_key"), owner=blinker, rendered=(SCENE,), compared=(), reads_bits=True)
    evaluation = run(planned)
    assert [row.level for row in evaluation.readings["bits"]] == [0.0, 0.0]
    assert evaluation.metrics == ()
    assert not (planned.folder / "metrics.csv").exists()


def test_bits_are_read_only_where_they_are_planned() -> None:
    assert run(attack_job("unread", "unattacked", targets=(SCENE,), owner=cases.owner("blinker"))).readings == {}


def test_an_attack_on_renders_affects_hidden_bits() -> None:
    evaluation = run(attack_job("pressed", "jpeg", targets=(SCENE,), owner=cases.owner("blinker")))
    assert isinstance(evaluation.attack, Applied)
    assert evaluation.attack.affects == {"bits": True}


def test_images_and_readings_of_an_earlier_run_are_gone() -> None:
    planned = attack_job("again", "unattacked", targets=(SCENE,))
    write_image(planned.folder / "renders" / MESSAGE / "view_0.png", cases.green())
    write_table(planned.folder / "detections" / "mark.csv", Reading, [])
    run(planned)
    assert not (planned.folder / "renders" / MESSAGE).exists()
    assert [*(planned.folder / "detections").iterdir()] == []


def test_decoys_are_candidates_of_the_retrieval() -> None:
    candidates = []
    for decoys in ((), (cases.PHOTOGRAPHED.parent,)):
        planned = attack_job("recalled", "unattacked", owner=cases.owner(decoys=decoys))
        (row,) = run(planned).retrieval
        candidates.append(row.retrieval.candidates)
    assert candidates[1] == candidates[0] + 1


def test_the_provenance_names_the_model_and_the_settings() -> None:
    planned = attack_job("noisy", "gaussian_noise", attack={"sigma": 0.2}, targets=(SCENE,))
    run(planned)
    record = json.loads((planned.folder / "public" / "provenance.json").read_text())
    assert record["settings"] == {"attack": "gaussian_noise", "sigma": 0.2, "attributes": "colour", "seed": 0}
    whole = json.loads((planned.folder / "provenance.json").read_text())
    assert whole["inputs"]["model"]["path"] == str(cases.PUBLIC)
    assert read(Job, whole["settings"], "provenance") == planned


@pytest.mark.parametrize(
    ("name", "numbers"),
    [("random_pruning", ["45", "60", "45"]), ("inject", ["60", "60", "75"]), ("reorder", ["60"] * 3)],
)
def test_an_attack_tells_the_rows_that_it_kept_of_all_and_those_that_there_are_now(
    name: str, numbers: list[str]
) -> None:
    settings = {} if name == "reorder" else {"fraction": 0.25}
    public = cases.LanternModel(cases.public_rows())
    sentence = attacked(public, AttackSpec(name, settings=settings), Context()).sentence
    assert re.findall("[0-9]+", sentence) == numbers


def test_a_setting_that_an_attack_does_not_have_is_an_error() -> None:
    with pytest.raises(InputError, match="random_pruning: share: "):
        evaluate(attack_job("broken", "random_pruning", attack={"share": 0.5}))
