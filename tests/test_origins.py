"""Artifacts in the folder of a variant that are of another one."""

from __future__ import annotations

import os
import shutil
import sys
from contextlib import nullcontext
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import known_digest, save_array, write_json, write_record
from gspure.artifacts.checksums import record_file
from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation.comparison import write_metrics
from gspure.evaluation.controls import CLEAN, OTHER_SCENE, WRONG_KEY
from gspure.evaluation.csv_tables import write_table
from gspure.evaluation.detection import Reading
from gspure.evaluation.names import GSPURE, SCHEMES, UNATTACKED
from gspure.evaluation.origins import (
    require_equal_images,
    require_equal_renders,
    require_one_origin,
    require_one_owner,
    require_origins,
)
from gspure.evaluation.outcomes import MESSAGE, SCENE, Outcome, collect
from gspure.evaluation.retrieval import Retrieval, Retrieved
from gspure.images import SHOWN, record_views, shown_in, with_records, write_image
from gspure.schemes.registry import BUILT_IN
from tests.contest_cases import measured

ROOM = Path("results/gs_hider/room")
EMBEDDING = "run 1"
DETECTOR = "import json, sys, pathlib; print(json.dumps({p.stem: 1 for p in pathlib.Path(sys.argv[1]).glob('*.png')}))"
ARTIFACTS = ["prune_mask.npy", "transform.npy", "verdict.json", "metrics.csv", "detections/score.csv"]
ARTIFACTS += ["renders/scene", "renders/message"]


def record(path: Path, inputs=None, **settings) -> Path:
    write_record(path, inputs=inputs or {}, settings=settings)
    return path


def published(folder: Path, content: str, embedding: str) -> Path:
    model = folder / "public/point_cloud.ply"
    model.parent.mkdir(parents=True)
    model.write_text(content)
    write_record(model, inputs={}, settings={}, embedding=embedding)
    return model


def evaluated(variant: str, model: Path, owner: str = EMBEDDING) -> list[Path]:
    """Write images, metrics and readings of a variant; return the images."""
    images = []
    for target in (SCENE, MESSAGE):
        images.append(ROOM / variant / "renders" / target / "view.png")
        write_image(images[-1], np.full((2, 2, 3), len(images) / 4))
        key = {"key": owner} if target == MESSAGE else {}
        record_views(images[-1].parent, {"view": []}, target=target, model=known_digest(model), **key)
    metrics, detections = ROOM / variant / "metrics.csv", ROOM / variant / "detections/score.csv"
    write_metrics(metrics, [measured(target, 20.0) for target in (SCENE, MESSAGE)])
    write_table(detections, Reading, [Reading("view", 1.0, 0)])
    record(metrics, with_records(images), baseline=None)
    record(detections, with_records(images[:1]))
    return images


@pytest.fixture(autouse=True)
def project(tmp_path, monkeypatch):
    """Two attacked models of a watermarked one, the wrong key, and another scene; it is the current folder."""
    monkeypatch.chdir(tmp_path)
    public, other = published(ROOM, "room", EMBEDDING), published(ROOM.parent / "vault", "vault", "run 2")
    key = ROOM / "key/decoder.pth"
    key.parent.mkdir()
    key.write_text("key")
    write_record(key, inputs={}, settings={}, embedding=EMBEDDING)
    images = evaluated(WRONG_KEY, public, WRONG_KEY) + evaluated(OTHER_SCENE, other)
    for sigma in (1, 2):
        folder = ROOM / f"noise_{sigma}"
        origin = {"attack": "noise", "sigma": sigma}
        for file in (folder / "prune_mask.npy", folder / "transform.npy"):
            save_array(file, np.zeros(3, bool))
            record(file, {"model": public}, **origin)
        write_json(folder / "verdict.json", {"reached": {}, "strength": ""})
        record(folder / "verdict.json", {"model": public}, **origin)
        images += evaluated(folder.name, record(published(folder, f"noise {sigma}", ""), {"model": public}, **origin))
    write_image(photograph := Path("results/pairs/room/scene/view.png"), np.full((2, 2, 3), 0.5))
    record_views(photograph.parent, {"view": []}, target=SCENE)
    rows = [Retrieved(path.parts[-4], MESSAGE, Retrieval(1, 1, 1, 1, 5)) for path in images[1::2]]
    write_table(ROOM / "retrieval.csv", Retrieved, rows)
    record(ROOM / "retrieval.csv", with_records([photograph, *images[1::2]]))


def copy(source: str, target: str) -> None:
    """Replace an artifact and its record, or a folder of images, by another."""
    source, target = ROOM / source, ROOM / target
    files = source.iterdir() if source.is_dir() else [source, Path(f"{source}.json")]
    for file in files:
        (target / file.name if source.is_dir() else target.parent / file.name).write_bytes(file.read_bytes())


def unfit() -> set[Path]:
    """Return the first artifact in the folder of each variant that is of another one."""
    artifacts = set()
    for variant in sorted(path.parent.resolve() for path in ROOM.glob("*/metrics.csv")):
        try:
            require_origins(variant, ROOM.rglob("*.csv"))
        except InputError as error:
            artifacts.add(Path(os.path.relpath(error.source)))
    return artifacts


def tabulated() -> list[Outcome]:
    files = (sorted(ROOM.glob(f"*/{name}")) for name in ("prune_mask.npy", "verdict.json", "detections/score.csv"))
    masks, verdicts, detections = files
    metrics, retrievals = sorted(ROOM.glob("*/metrics.csv")), [ROOM / "retrieval.csv"]
    return collect(metrics, masks, (), verdicts, (), retrievals, detections)


def test_artifacts_of_their_variants_are_fit():
    assert unfit() == set()
    tabulated()


@pytest.mark.parametrize(
    ("variant", "key", "fits"),
    [
        ("noise_1", EMBEDDING, True),
        ("noise_1", "run 2", False),
        ("noise_1", WRONG_KEY, False),
        (WRONG_KEY, WRONG_KEY, True),
        (WRONG_KEY, EMBEDDING, False),
        (OTHER_SCENE, EMBEDDING, True),
        (OTHER_SCENE, "run 2", False),
    ],
)
def test_bits_of_a_variant_are_read_with_its_key(variant, key, fits):
    """The readings of other variants are of no key; metrics beside them name none, either."""
    readings, images = ROOM / variant / "detections/score.csv", ROOM / variant / "renders/scene"
    record(readings, with_records([images / "view.png"]), key=key, **shown_in(images))
    metrics = ROOM / variant / "metrics.csv"
    shown = {f"{SHOWN}{name}": shown_in(images.with_name(name))[f"{SHOWN}{name}"] for name in (SCENE, MESSAGE)}
    pictures = [images.with_name(name) / "view.png" for name in (SCENE, MESSAGE)]
    record(metrics, with_records(pictures), baseline=None, **shown)
    with nullcontext() if fits else pytest.raises(InputError, match=r"key: expected|embedding: expected"):
        tabulated()


@pytest.mark.parametrize(("read", "fits"), [("noisy", True), ("plain", False)])
def test_a_detector_reads_the_images_that_are_measured_whatever_their_folder_is_called(tmp_path, read, fits):
    for name, value in (("plain", 0.5), ("noisy", 0.25)):
        write_image(tmp_path / "flat" / name / "view.png", np.full((2, 2, 3), value))
    variant = tmp_path / "own/hall/noise"
    write_metrics(variant / "metrics.csv", [measured(".", 20.0)])
    record(variant / "metrics.csv", with_records([tmp_path / "flat" / name / "view.png" for name in ("noisy",)]))
    write_table(variant / "detections/mark.csv", Reading, [Reading("view", 1.0, 0)])
    record(variant / "detections/mark.csv", with_records([tmp_path / "flat" / read / "view.png"]))
    with nullcontext() if fits else pytest.raises(InputError, match=r"view\.png differs"):
        collect([variant / "metrics.csv"], detections=[variant / "detections/mark.csv"])


def test_files_of_an_earlier_configuration_do_not_stop_a_table():
    """As those of a detector that was renamed, or of an extraction that is no longer made."""
    readings, images = ROOM / "noise_1/detections/old.csv", ROOM / "noise_1/renders/old/view.png"
    write_table(readings, Reading, [Reading("view", 1.0, 0)])
    record(readings, with_records([ROOM / "noise_2/renders/scene/view.png"]))
    write_image(images, np.zeros((2, 2, 3)))
    record_views(images.parent, {"view": []}, target="old", model="of an earlier run")
    tabulated()


@pytest.mark.parametrize("name", ARTIFACTS)
def test_an_artifact_of_another_variant_is_unfit_and_no_table_reads_it(name):
    copy(f"noise_2/{name}", f"noise_1/{name}")
    assert ROOM / "noise_1" / name in unfit()
    assert not any("noise_2" in str(path) for path in unfit())
    with pytest.raises(InputError, match="noise_1"):
        tabulated()


@pytest.mark.parametrize("name", ["prune_mask.npy", "verdict.json"])
def test_files_of_two_attacks_are_unfit_also_without_a_model(name):
    copy(f"noise_2/{name}", f"noise_1/{name}")
    for file in ROOM.glob("noise_*/public/*"):
        file.unlink()
    assert len(unfit()) == 1
    with pytest.raises(InputError, match=r"noise_1.*sigma: expected"):
        tabulated()


def test_a_folder_without_a_model_may_not_be_renamed_to_another_attack():
    for file in ROOM.glob("noise_1/public/*"):
        file.unlink()
    require_one_origin([(ROOM / "noise_1").rename(ROOM / "noise")], {"gspure"}, {})
    for reserved in ("gspure", "gspure@1dB"):
        with pytest.raises(InputError, match="attack: expected gspure, found noise"):
            require_one_origin([(ROOM / "noise").rename(ROOM / reserved)], {"gspure"}, {})
        (ROOM / reserved).rename(ROOM / "noise")


def test_a_table_without_a_record_may_measure_any_images():
    copy("noise_2/renders/message", "noise_1/renders/message")
    for table in (ROOM / "noise_1/metrics.csv", ROOM / "retrieval.csv"):
        record_file(table).unlink()
    with pytest.raises(InputError, match=r"noise_1.renders.message: model"):
        tabulated()


def test_the_retrieval_of_exchanged_variants_is_unfit():
    (ROOM / "noise_1").rename(ROOM / "other")
    (ROOM / "noise_2").rename(ROOM / "noise_1")
    (ROOM / "other").rename(ROOM / "noise_2")
    with pytest.raises(InputError, match=r"retrieval.csv: images"):
        tabulated()


def test_the_images_of_a_table_may_be_named_by_any_path_to_them():
    images = with_records(ROOM.glob("*/renders/message/*.png"))
    record(ROOM / "retrieval.csv", {f"./{name}": path for name, path in images.items()})
    assert unfit() == set()
    tabulated()


def test_readings_may_be_a_symbolic_link(tmp_path):
    readings = ROOM / "noise_1/detections/score.csv"
    readings.rename(tmp_path / "score.csv")
    record_file(readings).unlink()
    readings.symlink_to(tmp_path / "score.csv")
    (outcome,) = (o for o in tabulated() if o.variant == "noise_1")
    assert outcome.detections.keys() == {"score"}


def test_models_of_one_condition_are_trained_alike_in_any_order(tmp_path):
    """Also if the record of the first one names no protocol."""
    models = [ROOM.parent / name / "public/point_cloud.ply" for name in "abc"]
    for path, settings in zip(models, ({}, {"protocol": "own"}, {"protocol": "shared"}), strict=True):
        path.parent.mkdir(parents=True)
        path.write_text(path.parts[-3])
        record(path, **settings)
    variants = [path.parents[1] / "unattacked" for path in models]
    for order in permutations(variants):
        with pytest.raises(InputError, match="protocol: expected"):
            require_one_origin(order, {}, {})
    require_one_origin(variants[:2], {}, {})


@pytest.mark.parametrize(
    ("source", "target"),
    [
        ("noise_1/renders/scene", "noise_1/renders/message"),
        ("wrong_key/renders/message", "noise_1/renders/message"),
        ("noise_1/renders/message", "wrong_key/renders/message"),
        ("noise_1/renders/message", "other_scene/renders/message"),
        ("other_scene/renders/message", "wrong_key/renders/message"),
    ],
)
def test_images_of_another_target_or_control_are_unfit(source, target):
    copy(source, target)
    assert ROOM / target in unfit()


@pytest.mark.parametrize(("source", "target"), [("black", "noise_1"), ("noise_1", "black"), ("mean_colour", "black")])
def test_metrics_of_a_baseline_are_of_no_other_variant(source, target):
    images = with_records((ROOM / "noise_1/renders/message").glob("*.png"))
    for name in ("black", "mean_colour"):
        write_metrics(ROOM / name / "metrics.csv", [measured(MESSAGE, 9.0)])
        record(ROOM / name / "metrics.csv", images, baseline=name)
    assert unfit() == set()
    copy(f"{source}/metrics.csv", f"{target}/metrics.csv")
    assert ROOM / target / "metrics.csv" in unfit()


@pytest.mark.parametrize("level", [0.25, 0.5])
@pytest.mark.parametrize("table", ["noise_1/detections/score.csv", "retrieval.csv"])
def test_tables_of_other_images_are_not_joined_wherever_they_lie(tmp_path, table, level):
    """The renders of the other run may be deleted."""
    target = SCENE if "detections" in table else MESSAGE
    image = Path("run_2/gs_hider/room/noise_1/renders", target, "view.png")
    write_image(image, np.full((2, 2, 3), level))
    other = Path("run_2/gs_hider/room", table)
    write_table(other, Reading, [Reading("view", 1.0, 0)])
    record(other, with_records([image]))
    image.unlink()
    metrics = ROOM / "noise_1/metrics.csv"
    tables = ([metrics, other], []) if target == SCENE else ([metrics], [other])
    same = level == {SCENE: 0.25, MESSAGE: 0.5}[target]
    for absolute in (False, True):
        of_variants, of_models = ([tmp_path / path if absolute else path for path in kind] for kind in tables)
        with nullcontext() if same else pytest.raises(InputError, match=r"images: expected those .*metrics"):
            require_equal_images(of_variants, of_models)


def test_variants_of_two_embeddings_are_not_compared():
    own, other = (Path(run, "gs_hider/room") for run in ("run_1", "run_2"))
    published(own / "unattacked", "a", "run 1"), published(other / "noise_1", "b", "run 2")
    published(other / OTHER_SCENE, "c", "run 3"), published(own / "noise_2", "d", "run 1")
    alike = [own / "unattacked", own / "noise_2", other / OTHER_SCENE]
    require_one_origin(alike, {}, {})
    with pytest.raises(InputError, match="embedding: expected run 1"):
        require_one_origin([*alike, other / "noise_1"], {}, {})


@pytest.mark.parametrize(("setting", "value"), [("background", (1.0, 1.0, 1.0)), ("energy", "ray"), ("views", None)])
def test_variants_rendered_with_other_settings_are_not_compared(setting, value):
    """Their drops would be those of the setting, not of the attack."""

    def rendered(variant, **changed):
        images = ROOM / variant / "renders" / SCENE
        write_image(images / "view.png", np.zeros((2, 2, 3)))
        known = {"views": {"view": [1.0, 2.0]}, "background": (0.0, 0.0, 0.0), "energy": "ewa"} | changed
        record_views(images, known.pop("views"), **known)
        write_metrics(ROOM / variant / "metrics.csv", [measured(SCENE, 20.0)])
        return record(ROOM / variant / "metrics.csv", with_records([images / "view.png"]))

    changed = {setting: value or {"view": [1.0, 2.1]}}
    alike = [rendered("unattacked"), rendered("noise_1"), rendered(OTHER_SCENE, **changed)]
    require_equal_renders(alike)
    with pytest.raises(InputError, match="view" if setting == "views" else setting):
        require_equal_renders([*alike, rendered("noise_2", **changed)])


NOISE = {"attack": "noise", "sigma": 0.1, "attributes": "colour"}


@pytest.mark.parametrize(
    ("settings", "fits"),
    [
        (NOISE | {"seed": 1}, True),
        (NOISE | {"attack": "crop"}, False),
        (NOISE | {"sigma": 0.2}, False),
        (NOISE | {"attributes": "opacity"}, False),
        (NOISE | {"damage": 1.0}, False),
    ],
)
def test_variants_of_one_name_are_one_attack_in_all_scenes(settings, fits):
    record(published(ROOM / "weak", "a", "1"), **NOISE, seed=0)
    record(published(ROOM.parent / "hall/weak", "b", "2"), **settings)
    record(published(ROOM.parents[1] / "other_scheme/room/weak", "c", "3"), attack="gof")
    variants = [ROOM / "weak", ROOM.parent / "hall/weak", ROOM.parents[1] / "other_scheme/room/weak"]
    with nullcontext() if fits else pytest.raises(InputError, match="or another name"):
        require_one_origin(variants, {UNATTACKED}, {})


def test_settings_that_the_first_record_lacks_are_compared_between_the_others():
    for scene, settings in (("a", {}), ("b", {"sigma": 0.1}), ("c", {"sigma": 0.2})):
        record(published(ROOM.parent / scene / "weak", scene, scene), attack="noise", **settings)
    variants = [ROOM.parent / scene / "weak" for scene in "abc"]
    require_one_origin(variants[:2], {}, {})
    with pytest.raises(InputError, match="sigma: expected"):
        require_one_origin(variants, {}, {})


@pytest.mark.parametrize(
    ("damage", "attributes", "fits"), [(1.0, "colour", True), (2.0, "colour", False), (1.0, "x", False)]
)
def test_strengths_that_were_searched_for_one_damage_differ_between_scenes(damage, attributes, fits):
    found = {"attack": "noise", "attributes": "colour", "damage_reference": "truth", "damage": 1.0, "sigma": 0.1}
    record(published(ROOM / "gentle", "a", "1"), **found)
    other = {"sigma": 0.3, "damage_reference": "render", "damage": damage, "attributes": attributes}
    record(published(ROOM.parent / "hall/gentle", "b", "2"), **found | other)
    with nullcontext() if fits else pytest.raises(InputError, match="or another name"):
        require_one_origin([ROOM / "gentle", ROOM.parent / "hall/gentle"], {UNATTACKED}, {})


@pytest.mark.parametrize(
    ("variant", "settings", "found"),
    [
        ("noise@1dB", {"damage": 1.0}, ""),
        ("noise@1.23457dB", {"damage": 1.2345678}, ""),
        ("noise@0.5dB", {"damage": 1.0}, "1.0"),
        ("noise@1dB", {}, "a fixed strength"),
        ("noise", {"damage": 1.0}, ""),
    ],
)
def test_a_variant_named_after_a_damage_was_searched_for_it(variant, settings, found):
    record(published(ROOM / variant, "a", "1"), attack="noise", **settings)
    with pytest.raises(InputError, match=f"damage: expected .* dB, found {found}") if found else nullcontext():
        require_one_origin([ROOM / variant], {}, {})


@pytest.mark.parametrize(("attack", "fits"), [(UNATTACKED, True), ("random_pruning", False)])
def test_the_variant_before_attacks_is_no_attack(attack, fits):
    record(published(ROOM / UNATTACKED, "a", "1"), attack=attack)
    with (
        nullcontext() if fits else pytest.raises(InputError, match="attack: expected unattacked, found random_pruning")
    ):
        require_one_origin([ROOM / UNATTACKED], {UNATTACKED}, {})


@pytest.mark.parametrize(
    ("variant", "after", "fits"), [("noise", "crop", True), (UNATTACKED, "", True), (UNATTACKED, "crop", False)]
)
def test_only_variants_of_other_names_may_follow_an_attack(variant, after, fits):
    record(published(ROOM / variant, "a", "1"), attack=variant, after=after)
    with nullcontext() if fits else pytest.raises(InputError, match="before any attack, found a model after crop"):
        require_one_origin([ROOM / variant], {UNATTACKED}, {})


def test_attacks_of_one_name_follow_the_same_attacks_in_all_scenes():
    for scene, after in (("room", ""), ("hall", "crop")):
        record(published(ROOM.parent / scene / "noise", scene, scene), attack="noise", after=after)
    with pytest.raises(InputError, match=r"after: expected.*or another name"):
        require_one_origin([ROOM / "noise", ROOM.parent / "hall/noise"], {}, {})


def decided(folder: Path, attack: str, tau: float, views: int = 8, energy: str = "ray") -> Path:
    """Write a variant with the prune mask of a decision, and the chain of records behind it; return its folder."""
    model = published(folder, attack, "1")
    inputs: dict[str, Path] = {}
    for name, settings in (
        ("weights", {"energy": energy, "views": views}),
        ("tree", {"min_samples": 10}),
        ("prune_mask", {"tau_c": tau}),
    ):
        path = folder / f"{name}.npy"
        path.write_text(f"{folder.parent} {settings}")
        write_record(path, inputs=inputs, settings=settings, geometry="g", kind=name)
        inputs = {name: path}
    write_record(model, inputs={"model": folder.parent / "none", **inputs}, settings={"attack": attack})
    return folder


@pytest.mark.parametrize(
    ("other", "message"),
    [({"tau": 4.0, "views": 4}, ""), ({"tau": 1.2}, "tau_c"), ({"tau": 4.0, "energy": "ewa"}, "energy")],
)
def test_decisions_of_one_name_have_the_same_settings_in_all_scenes(other, message):
    """Numbers of views may differ, as those of scenes do."""
    variants = [decided(ROOM.parent / "hall/gspure", "gspure", 4.0), decided(ROOM / "gspure", "gspure", **other)]
    with pytest.raises(InputError, match=f"{message}: expected.*or another name") if message else nullcontext():
        require_one_origin(variants, {}, {})


@pytest.mark.parametrize(
    ("variant", "tau", "fits"), [("random_matched", 4.0, True), ("random_matched", 1.2, False), ("other", 1.2, True)]
)
def test_a_matched_control_removes_as_many_rows_as_gspure(variant, tau, fits):
    variants = [decided(ROOM / "gspure", "gspure", 4.0), decided(ROOM / variant, "random_matched", tau)]
    with nullcontext() if fits else pytest.raises(InputError, match="prune_mask: expected"):
        require_one_origin(variants, {}, {})


def test_a_scheme_folder_holds_models_of_its_scheme(tmp_path):
    for folder, fits in (("gs_hider", True), ("of_my_own", True), ("splats_in_splats", False)):
        model = published(tmp_path / folder / "room/unattacked", "a", "1")
        write_record(model, inputs={}, settings={}, ancestors={"scheme": "gs_hider"})
        with nullcontext() if fits else pytest.raises(InputError, match="scheme: expected splats_in_splats, found gs_"):
            require_one_origin([model.parents[1]], {}, {})


def test_all_built_in_schemes_are_named():
    assert {scheme.name for scheme in BUILT_IN} == SCHEMES.keys()


@pytest.mark.parametrize("control", [CLEAN, OTHER_SCENE])
@pytest.mark.parametrize("fact", ["embedding", "model"])
def test_a_control_that_shows_the_marked_model_is_warned_of(control, fact, capsys):
    published(ROOM / UNATTACKED, "a", EMBEDDING)
    images = ROOM / control / "renders" / SCENE
    write_image(images / "view.png", np.zeros((2, 2, 3)))
    record_views(images, {"view": []}, **{fact: "run 2"})
    require_one_origin([ROOM / control, ROOM / UNATTACKED], {}, {})
    assert not capsys.readouterr().err
    record_views(images, {"view": []}, **{fact: EMBEDDING})
    require_one_origin([ROOM / control, ROOM / UNATTACKED], {}, {})
    assert f"{control}/renders/scene: expected renders of a model without the message" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("variant", "shown", "refused"),
    [
        ("noise", {"embedding": EMBEDDING, "attack": "noise"}, ""),
        ("noise", {"embedding": "run 2"}, "embedding: expected"),
        ("noise", {"key": "run 2"}, "embedding: expected"),
        (WRONG_KEY, {"key": "run 2"}, ""),
        (CLEAN, {"key": "run 2"}, "embedding: expected"),
        (CLEAN, {"key": WRONG_KEY}, "embedding: expected"),
        (OTHER_SCENE, {"key": EMBEDDING}, ""),
        (CLEAN, {"embedding": "run 2"}, ""),
        (UNATTACKED, {"embedding": EMBEDDING, "attack": "noise"}, "attack: expected unattacked, found images of noise"),
        (GSPURE, {"embedding": EMBEDDING, "attack": "noise"}, "attack: expected gspure, found images of noise"),
        (GSPURE, {"embedding": EMBEDDING, "model": EMBEDDING}, "attack: expected gspure, found images of unattacked"),
        (GSPURE, {"embedding": EMBEDDING, "model": "purified"}, ""),
        (GSPURE, {"embedding": EMBEDDING, "model": "purified", "attack": "gspure"}, ""),
    ],
)
def test_images_of_other_embeddings_and_attacks_are_refused_where_no_model_lies_beside_them(variant, shown, refused):
    tables = [Path("sis/hall") / name / "metrics.csv" for name in ("first", variant)]
    for table, origin in zip(tables, ({"embedding": EMBEDDING}, shown), strict=True):
        write_metrics(table, [measured(SCENE, 20.0)])
        record(table, {}, **{f"{SHOWN}scene": origin})
    with pytest.raises(InputError, match=refused) if refused else nullcontext():
        require_one_owner(tables)


@pytest.mark.parametrize(("photographs", "fits"), [("room", True), ("", True), ("hall", False)])
def test_a_clean_model_shows_the_scene_of_its_model(photographs, fits):
    for variant, shown in ((UNATTACKED, "room"), (CLEAN, photographs)):
        write_image(ROOM / variant / "renders/scene/view.png", np.zeros((2, 2, 3)))
        origin = {"model": variant, "target": SCENE, "photographs": shown}
        record_views(ROOM / variant / "renders/scene", {"view": []}, **origin)
    with nullcontext() if fits else pytest.raises(InputError, match="scene: expected room"):
        require_one_origin([ROOM / CLEAN, ROOM / UNATTACKED], {}, {})


@pytest.mark.parametrize(("pixel", "fits"), [(0.5, True), (0.25, False)])
def test_variants_of_a_model_are_compared_with_the_same_images(tmp_path, pixel, fits):
    renders = {variant: ROOM / f"noise_{i}/renders" for i, variant in ((1, "first"), (2, "second"))}
    for variant, value in (("first", 0.5), ("second", pixel)):
        write_image(reference := tmp_path / variant / "scene/view.png", np.full((2, 2, 3), value))
        options = ("--targets", SCENE, "--out", ROOM / variant / "metrics.csv")
        assert main(["metrics", *map(str, (reference.parents[1], renders[variant], *options))]) == 0
    with nullcontext() if fits else pytest.raises(InputError, match=r"reference of scene/view: .* \(compare all"):
        collect([ROOM / variant / "metrics.csv" for variant in renders])


def test_repetitions_of_a_scene_are_of_one_pair(tmp_path):
    photographs = [tmp_path / "a", tmp_path / "b"]
    for path in photographs:
        path.write_text(path.name)
        write_record(path, inputs={}, settings={}, kind=SCENE)
    for folder, first in (("room", 0), ("room@1", 0), ("room@2", 1), ("hall", 1)):
        for variant in (UNATTACKED, OTHER_SCENE):
            model = published(ROOM.parent / folder / variant, "model", "1")
            write_record(model, inputs={"scene": photographs[first]}, settings={})
    alike = [ROOM.parent / folder / UNATTACKED for folder in ("room", "room@1", "hall")]
    others = ROOM.parent / "room@2"
    require_one_origin([*alike, others / OTHER_SCENE], {}, {})
    with pytest.raises(InputError, match="SCENE@1, SCENE@2"):
        require_one_origin([*alike, others / UNATTACKED], {}, {})


def test_the_message_by_the_key_of_an_earlier_run_is_unfit():
    evaluated("noise_1", ROOM / "noise_1/public/point_cloud.ply", "run 0")
    assert ROOM / "noise_1/renders/message" in unfit()


def test_a_retrieval_of_other_images_is_unfit():
    record_views(ROOM / "noise_1/renders/message", {"view": [1.0]})
    record(ROOM / "noise_1/metrics.csv")
    assert unfit() == {ROOM / "retrieval.csv"}


def test_the_cost_of_another_variant_is_unfit():
    cost = Path("results/benchmarks/gs_hider/room/noise_1/attack.cost.json")
    write_json(cost, {"cpu": 1.0, "memory": 1.0})
    record(cost, attack="noise", sigma=1)
    assert unfit() == set()
    record(cost, attack="noise", sigma=2)
    assert unfit() == {cost}


@pytest.mark.parametrize("name", ["metrics.csv", "detections/score.csv"])
def test_a_table_of_deleted_renders_of_an_earlier_model_is_unfit(name, tmp_path):
    folder, script = (ROOM / "noise_1").resolve(), tmp_path / "detector.py"
    for table in (ROOM / "retrieval.csv", folder / "metrics.csv", folder / "detections/score.csv"):
        table.unlink()
    write_image(tmp_path / "pair/scene/view.png", np.full((2, 2, 3), 0.5))
    script.write_text(DETECTOR)
    if name == "metrics.csv":
        command = ["metrics", tmp_path / "pair", folder / "renders", "--targets", SCENE]
    else:
        command = ["detect", folder / "renders/scene", "--command", f"{sys.executable} {script}"]
    assert main([*map(str, [*command, "--out", folder / name])]) == 0
    shutil.rmtree(folder / "renders")
    require_origins(folder, [folder / name])
    (folder / "public/point_cloud.ply").write_text("noise 1, another seed")
    record(folder / "public/point_cloud.ply", {"model": ROOM / "public/point_cloud.ply"}, attack="noise", sigma=1)
    for file in ("prune_mask.npy", "transform.npy", "verdict.json"):
        record(folder / file, {"model": ROOM / "public/point_cloud.ply"}, attack="noise", sigma=1)
    with pytest.raises(InputError, match=f"{name}: model"):
        require_origins(folder, [folder / name])
