"""The job of one variant or control: what it attacks, renders, extracts, reads and compares, and what it writes."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from gspure.arrays import Bools, Float32, load_array, save_array
from gspure.codec import read
from gspure.evaluation.attack_record import ATTACK_RECORD, Applied, AttackRecord, Refused, StrengthValue
from gspure.evaluation.attacking import Context, attacked
from gspure.evaluation.evidence import EVIDENCE, JobEvidence
from gspure.evaluation.judging import word_left
from gspure.evaluation.plan import AttackSpec, Control, Detector, Job, Views
from gspure.evaluation.searching import LEFT, searched
from gspure.files import read_json
from gspure.images import read_image, write_image
from gspure.metrics.bit_evidence import BitEvidence
from gspure.metrics.comparison import ViewMetrics, read_metrics
from gspure.metrics.csv_tables import read_table, write_table
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE, psnr
from gspure.metrics.legibility import legibility
from gspure.metrics.proof import trace, traces
from gspure.metrics.readings import Reading
from gspure.metrics.targets import ADAPTIVE, BITS, MESSAGE, MODEL_BITS, SCENE
from gspure.model import Gaussians, read_model
from tests import evaluation_cases as cases
from tests.evaluation_cases import TESTED, attack_job, drawn, job, renders, run

UNAFFECTED = dict.fromkeys((MESSAGE, ADAPTIVE), False)
BLINKER = cases.owner("blinker")


@pytest.fixture(scope="module", autouse=True)
def project(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The unattacked model has been evaluated in the current folder."""
    with cases.project(tmp_path_factory.mktemp("project")):
        run(attack_job("unattacked", "unattacked", targets=(SCENE, MESSAGE, ADAPTIVE)))
        yield


def verdict(planned: Job) -> Applied | Refused:
    content: AttackRecord = read(AttackRecord, read_json(planned.folder / ATTACK_RECORD), "attack record")
    return content.attack


def written_evidence(planned: Job) -> JobEvidence:
    evidence: JobEvidence = read(JobEvidence, read_json(planned.folder / EVIDENCE), "evidence")
    return evidence


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


def likeness(planned: Job, target: str) -> list[float]:
    """The PSNR of every view of a target, compared with that of the unattacked model."""
    before = unattacked(target)
    return [psnr(before[name], image) for name, image in renders(planned, target).items()]


def test_an_attack_leaves_its_model_mask_images_tables_and_verdict() -> None:
    planned = attack_job("pruned", "random_pruning", attack={"fraction": 0.25})
    evaluation = run(planned)
    mask = prune_mask(planned)
    assert mask.sum() == 15
    np.testing.assert_array_equal(attacked_model(planned).table, cases.public_rows()[~mask].table)
    assert_same(renders(planned, SCENE), drawn(cases.public_rows()[~mask]))
    assert differ(renders(planned, MESSAGE), unattacked(MESSAGE))
    rows = evaluation.metrics
    places = [(target, view, "render") for target in (MESSAGE, SCENE) for view in TESTED]
    assert [(row.target, row.view, row.reference) for row in rows] == places
    assert [row.psnr for row in rows] == [*likeness(planned, MESSAGE), *likeness(planned, SCENE)]
    assert read_metrics(planned.folder / "metrics.csv") == [*rows]
    assert written_evidence(planned) == evaluation.evidence
    affected = dict.fromkeys((MESSAGE, ADAPTIVE), True)
    assert verdict(planned) == evaluation.attack == Applied(StrengthValue("fraction", 0.25), None, affects=affected)
    record = read_json(planned.folder / "public" / "provenance.json")
    assert record["settings"] == {"attack": "random_pruning", "fraction": 0.25, "seed": 0}
    whole = read_json(planned.folder / "provenance.json")
    assert whole["inputs"]["model"]["path"] == str(cases.PUBLIC)
    assert read(Job, whole["settings"], "provenance") == planned


def test_the_change_of_the_scene_is_the_same_from_renders_that_another_job_left() -> None:
    planned = attack_job("pruned", "random_pruning", attack={"fraction": 0.5})
    rendered = run(planned).evidence
    assert rendered.scene is not None
    assert rendered.scene.coverage_lost > 0
    assert run(replace(planned, inputs=(planned.views.unattacked,))).evidence == rendered


def test_the_unattacked_model_is_the_public_one_and_nothing_is_left_of_an_earlier_run() -> None:
    planned = attack_job("again", "unattacked", targets=(SCENE, MESSAGE, ADAPTIVE))
    write_image(planned.folder / "renders" / "earlier" / "view_0.png", cases.green())
    write_table(planned.folder / "detections" / "earlier.csv", Reading, [])
    evaluation = run(planned)
    assert attacked_model(planned).table.tobytes() == cases.public_rows().table.tobytes()
    is_exact = {row.target: row.psnr == inf for row in evaluation.metrics}
    assert is_exact == {SCENE: True, MESSAGE: True, ADAPTIVE: False}  # all extractions are compared with the message
    assert evaluation.attack == Applied(affects=UNAFFECTED)
    assert not [*planned.folder.rglob("earlier*")]


def test_seed_and_measurements_of_an_attack_are_those_of_the_plan() -> None:
    public = cases.LanternModel(cases.public_rows())
    random = [attacked(public, AttackSpec("random_pruning", seed=seed), Context()) for seed in (0, 0, 1)]
    masks = [result.attacked.prune_mask.tobytes() for result in random]
    assert masks[0] == masks[1] != masks[2]
    weights = np.arange(cases.ROWS, dtype=np.float32) % 2
    np.save("weights.npy", weights)
    spec = AttackSpec("plain_weight", measured={"weights": Path("weights.npy")})
    pruned = attacked(public, spec, Context())
    np.testing.assert_array_equal(pruned.attacked.prune_mask, weights == 0)


def test_a_strength_is_searched_for_a_drop_of_the_mean_psnr_against_photographs() -> None:
    views = Views(cases.PHOTOGRAPHED, "test", cases.UNATTACKED, photographed=(SCENE,))
    planned = job("searched", AttackSpec("gaussian_noise", damage=0.5), targets=(SCENE,), views=views)
    evaluation = run(planned)
    assert isinstance(evaluation.attack, Applied)
    assert evaluation.attack.search_damage == pytest.approx(0.5, abs=DAMAGE_TOLERANCE)
    photographs = {name: read_image(cases.PHOTOGRAPHED.with_name(f"{name}.png")) for name in TESTED}
    images = renders(planned, SCENE)
    assert [row.psnr for row in evaluation.metrics] == [psnr(photographs[name], images[name]) for name in TESTED]
    assert {row.reference for row in evaluation.metrics} == {"truth"}
    assert evaluation.evidence.scene.damage == pytest.approx(evaluation.attack.search_damage, abs=1e-4)
    assert evaluation.evidence.scene.fidelity > 10
    comments = " ".join(attacked_model(planned).comments)
    assert f"sigma={evaluation.attack.strength.value}" in comments
    assert "dB of 0.5 dB" in comments


@pytest.mark.parametrize("until", ["gone", "unreadable"])
def test_the_least_strength_is_searched_that_ends_the_message(until) -> None:
    planned = job("ended", AttackSpec("random_pruning", until=until))
    found = searched(planned)
    assert [row.psnr for row in found.metrics if row.target == MESSAGE] == likeness(planned, MESSAGE)
    weaker = run(attack_job("weaker", "random_pruning", attack={"fraction": found.attack.strength.value - 1 / 128}))
    assert [word_left(one.evidence) in LEFT[until] for one in (weaker, found)] == [True, False]


NO_PHOTOGRAPHS = [("gaussian_noise", {"damage": 0.5}, "a damage is a drop of the PSNR against photographs")]
NOT_APPLIED = [("opacity_noise", {}, "rows do not store opacity")]
NO_MESSAGE = [("gaussian_noise", {"until": "gone"}, "`until` needs a message")]
LEFT_NOTHING = [("crop", {"settings": {"fraction": 1e-9}}, "none of 60 rows would remain")]


@pytest.mark.parametrize(("attack", "spec", "reason"), NOT_APPLIED + LEFT_NOTHING + NO_PHOTOGRAPHS + NO_MESSAGE)
def test_an_attack_that_does_not_apply_or_leaves_nothing_is_refused(attack, spec, reason) -> None:
    planned = job(f"refused_{attack}", AttackSpec(attack, **spec))
    evaluation = run(planned)
    assert isinstance(evaluation.attack, Refused)
    assert verdict(planned) == evaluation.attack
    assert evaluation.attack.reason.startswith(reason)
    assert read_table(planned.folder / "metrics.csv", ViewMetrics) == []
    assert written_evidence(planned) == JobEvidence()
    assert not prune_mask(planned).any()
    assert [*planned.folder.rglob("*.png")] == [*planned.folder.rglob("*.ply")] == []


def test_of_a_removed_format_only_the_scene_is_shown() -> None:
    planned = attack_job("converted", "convert", targets=(SCENE, MESSAGE, ADAPTIVE))
    evaluation = run(planned)
    assert verdict(planned) == Applied(None, None, UNAFFECTED, "no key reads this format")
    assert {row.target for row in evaluation.metrics} == {SCENE}
    assert not evaluation.evidence.pictures
    assert [folder.name for folder in (planned.folder / "renders").iterdir()] == [SCENE]


@pytest.mark.parametrize(("published", "is_moved_back"), [(cases.PUBLIC, True), (None, False)])
def test_views_move_with_the_model_and_an_owner_who_adapts_moves_it_back(published, is_moved_back) -> None:
    turn = {"angle": 40.0, "translation": "1,0,0"}
    owner = cases.owner(published_model=published)
    planned = attack_job("turned", "rigid_transform", attack=turn, targets=(SCENE, MESSAGE, ADAPTIVE), owner=owner)
    run(planned)
    assert differ(drawn(attacked_model(planned)), unattacked(SCENE))
    assert min(likeness(planned, SCENE)) > 45
    assert min(likeness(planned, MESSAGE)) < 30
    assert (min(likeness(planned, ADAPTIVE)) > 40) is is_moved_back


def test_an_owner_who_adapts_learns_from_photographs_of_the_message() -> None:
    learner = cases.owner(published_model=cases.PUBLIC, photographs=cases.MESSAGE_CAMERAS.parent)
    planned = attack_job("learned", "reorder", targets=(MESSAGE, ADAPTIVE), owner=learner)
    evidence = run(planned).evidence.pictures
    assert {name: known.is_fitted for name, known in evidence.items()} == {MESSAGE: False, ADAPTIVE: True}
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


def test_a_wrong_key_shows_other_pictures_the_same_in_every_run_and_other_controls_have_the_right_one() -> None:
    planned = job("wrong_key", Control("wrong_key"), targets=(MESSAGE,))
    evaluation = run(planned)
    shown = renders(planned, MESSAGE)
    assert differ(shown, unattacked(MESSAGE))
    assert max(row.psnr for row in evaluation.metrics) < inf
    assert evaluation.attack is None
    assert not (planned.folder / ATTACK_RECORD).exists()
    run(planned)
    assert_same(renders(planned, MESSAGE), shown)
    other = job("other_scene", Control("other_scene"), targets=(MESSAGE,))
    run(other)
    assert_same(renders(other, MESSAGE), unattacked(MESSAGE))


@pytest.mark.parametrize(
    ("case", "levels", "evidence"),
    [
        (AttackSpec("jpeg"), [100.0, 100.0], BitEvidence(1 / 16, 4, 4, 2)),
        (Control("wrong_key"), [0.0, 0.0], BitEvidence(1.0, 0, 4, 2)),
    ],
)
def test_bits_are_read_with_the_key_and_detectors_get_the_renders_of_the_scene(case, levels, evidence) -> None:
    Path("bits.py").write_text('import json; print(json.dumps({"view_0": "10", "view_8": "01"}))')
    program = "import json, pathlib, sys; folder = pathlib.Path(sys.argv[1]); "
    program += "print(json.dumps({image.stem: image.stat().st_size for image in folder.glob('*.png')}))"
    Path("size.py").write_text(program)
    detectors = {"bits_of_two": Detector(f"{sys.executable} bits.py", message="10")}
    detectors["size"] = Detector(f"{sys.executable} size.py")
    planned = job("bits", case, owner=BLINKER, rendered=(SCENE,), compared=(), bit_targets=(BITS,), detectors=detectors)
    evaluation = run(planned)
    read_levels = {name: [row.level for row in rows] for name, rows in evaluation.readings.items()}
    sizes = [(planned.folder / "renders" / SCENE / f"{name}.png").stat().st_size for name in TESTED]
    assert read_levels == {"bits_of_two": [100.0, 0.0], "size": sizes, "bits": levels}
    assert [row.level for row in read_table(planned.folder / "detections" / "size.csv", Reading)] == sizes
    assert evaluation.evidence.bits == {"bits_of_two": BitEvidence(1.0, 0, 2, 2), "bits": evidence}
    assert written_evidence(planned) == evaluation.evidence
    assert {path.stem for path in (planned.folder / "detections").iterdir()} == {"bits_of_two", "size", "bits"}
    assert evaluation.metrics == ()
    assert not (planned.folder / "metrics.csv").exists()
    assert evaluation.attack is None or evaluation.attack.affects == {BITS: True}


@pytest.mark.parametrize(
    ("case", "level", "affects"),
    [
        (AttackSpec("unattacked"), 100.0, False),
        (AttackSpec("jpeg"), 100.0, False),  # of renders
        (AttackSpec("rigid_transform"), 100.0, False),
        (AttackSpec("quantize", settings={"bits": 1}), 0.0, True),
        (AttackSpec("convert"), None, False),  # a format that no key reads
        (Control("wrong_key"), 0.0, None),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_bits_of_the_file_and_a_detector_of_files_read_the_attacked_one(case, level, affects) -> None:
    Path("size.py").write_text("import json, os, sys; print(json.dumps({'model': os.path.getsize(sys.argv[1])}))")
    detectors = {"size": Detector(f"{sys.executable} size.py", reads="model")}
    owner = cases.owner("etched")
    planned = job(
        "etched", case, owner=owner, rendered=(SCENE,), compared=(), bit_targets=(MODEL_BITS,), detectors=detectors
    )
    evaluation = run(planned)
    file = cases.PUBLIC if isinstance(case, Control) else planned.folder / "public" / "point_cloud.ply"
    decoded = "0100" if affects else "1011"
    bits = {} if level is None else {MODEL_BITS: (Reading("model", level, 4, decoded),)}
    assert evaluation.readings == {"size": (Reading("model", file.stat().st_size, 0, ""),), **bits}
    correct = {name: evidence.correct for name, evidence in evaluation.evidence.bits.items()}
    assert correct == ({} if level is None else {MODEL_BITS: 4 * level / 100})
    if isinstance(evaluation.attack, Applied):
        assert evaluation.attack.affects == {MODEL_BITS: affects}


def test_the_evidence_of_a_message_has_candidates_and_twins_with_redrawn_carriers() -> None:
    pictures = np.random.default_rng(0).integers(256, size=(5, len(TESTED), 12, 16, 3), dtype=np.uint8)
    save_array(Path("candidates.npy"), pictures)
    owner = cases.owner(candidates=Path("candidates.npy"), twins=2)
    planned = attack_job("proven", "random_pruning", attack={"fraction": 0.25}, owner=owner)
    evidence = run(planned).evidence.pictures[MESSAGE]
    assert not evidence.is_fitted
    messages = [*unattacked(MESSAGE).values()]
    extracted = [*renders(planned, MESSAGE).values()]
    assert (evidence.trace, evidence.legibility) == (trace(extracted, messages), legibility(extracted, messages))
    assert evidence.candidates == tuple(traces(extracted, pictures))
    for seed, twin_trace in enumerate(evidence.twins):
        twin = cases.LANTERN.redrawn(cases.LanternModel(attacked_model(planned)), np.random.default_rng(seed))
        shown, _ = cases.lantern_key().revealed(twin, MESSAGE)
        assert twin_trace == trace([*drawn(shown).values()], messages)
    assert len({*evidence.twins, evidence.trace}) == 3
    control = run(job("other_scene", Control("other_scene"), targets=(MESSAGE,), owner=owner)).evidence
    assert (len(control.pictures[MESSAGE].candidates), control.pictures[MESSAGE].twins) == (5, ())
