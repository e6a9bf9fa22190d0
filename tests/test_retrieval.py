"""Retrieval of the message among candidates: by what a picture shows, not by how bright it is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import read_json
from gspure.cli import main
from gspure.evaluation.comparison import ViewMetrics
from gspure.evaluation.csv_tables import read_table, write_table
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.retrieval import Retrieval, Retrieved, retrieval
from gspure.evaluation.survival import not_embedded, survival
from gspure.images import levels, read_image, write_image
from gspure.report.audit import audits
from gspure.report.tables import survival_table
from gspure.report.templates import say
from gspure.scenes import procedural
from tests.contest_cases import benchmark, measured

VIEWS = 4
NEAREST, UNRELATED = Retrieval(1.0, 1.0, 1.0, VIEWS, 17), Retrieval(0.25, 0.5, 0.0, VIEWS, 17)


def picture(seed: int, view: int) -> np.ndarray:
    """A smooth picture without symmetries, different for every seed and view."""
    rng = np.random.default_rng((seed, view))
    coarse = rng.random((6, 8, 3))
    return np.kron(coarse, np.ones((4, 4, 1))).astype(np.float32)


def photographs(folder: Path, seed: int, change=lambda image: image) -> Path:
    for view in range(VIEWS):
        write_image(folder / f"view_{view}.png", change(picture(seed, view)))
    return folder


def retrieved(tmp_path: Path, change) -> Retrieval:
    """Retrieve a changed message among its flips, the scene, and four others."""
    photographs(tmp_path / "pair" / "scene", 1)
    message = photographs(tmp_path / "pair" / "message", 0)
    decoys = [photographs(tmp_path / f"decoy_{seed}", seed) for seed in range(2, 6)]
    extraction = photographs(tmp_path / "gspure" / "renders" / "message", 0, change)
    arguments = [message, "--extractions", extraction, "--decoys", *decoys, "--out", tmp_path / "retrieval.csv"]
    assert main(["retrieve", *map(str, arguments)]) == 0
    (row,) = read_table(tmp_path / "retrieval.csv", Retrieved)
    assert (row.variant, row.target, row.retrieval.views) == ("gspure", "message", VIEWS)
    return row.retrieval


def noise(image: np.ndarray) -> np.ndarray:
    return np.random.default_rng(int(1e6 * image.mean())).random(image.shape)


@pytest.mark.parametrize(
    "fade",
    [lambda image: image, lambda image: 0.1 * image, lambda image: 0.9 + 0.1 * image**2],
    ids=["faithful", "dark", "pale"],
)
def test_a_faded_message_is_retrieved(tmp_path: Path, fade) -> None:
    measured_retrieval = retrieved(tmp_path, fade)
    assert measured_retrieval[:3] == (1.0, 1.0, 1.0)
    assert measured_retrieval.candidates == 1 + 3 + 1 + 4
    assert measured_retrieval.succeeds


@pytest.mark.parametrize(
    "change",
    [
        noise,
        lambda image: image[:, ::-1],
        lambda image: image[::-1],
        lambda image: image[::-1, ::-1],
        lambda image: 1 - image,
        np.zeros_like,
    ],
    ids=["noise", "mirrored", "upside down", "turned", "inverted", "black"],
)
def test_an_image_without_the_message_is_not_retrieved(tmp_path: Path, change) -> None:
    assert not retrieved(tmp_path, change).succeeds


def test_the_scene_in_place_of_the_message_is_not_retrieved(tmp_path: Path) -> None:
    photographs(tmp_path / "gspure" / "renders" / "message", 1)
    views = iter(range(VIEWS))
    assert retrieved(tmp_path, lambda _: picture(1, next(views))).top1 == 0


@pytest.mark.parametrize("turn", [np.s_[:, ::-1], np.s_[::-1], np.s_[::-1, ::-1]], ids=["mirrored", "down", "turned"])
def test_an_extraction_as_similar_to_the_message_as_to_its_copy_is_a_tie_and_not_a_hit(tmp_path: Path, turn) -> None:
    assert retrieved(tmp_path, lambda image: (levels(image) // 2 + levels(image)[turn] // 2) / 255).top1 == 0


def test_a_message_that_is_its_own_mirror_image_is_retrieved(tmp_path: Path) -> None:
    retrieved(tmp_path, noise)  # writes scene and decoys
    message, extraction = (
        photographs(folder, 0, lambda image: (image + image[:, ::-1]) / 2)
        for folder in (tmp_path / "pair" / "message", tmp_path / "v" / "renders" / "message")
    )
    words = [message, "--extractions", extraction, "--decoys", *tmp_path.glob("decoy_*"), "--out", tmp_path / "r.csv"]
    assert main(["retrieve", *map(str, words)]) == 0
    assert read_table(tmp_path / "r.csv", Retrieved)[0].retrieval[:2] == (1, 1)


def test_candidates_of_other_sizes_and_views_off_the_path_do_not_count(tmp_path: Path) -> None:
    retrieved(tmp_path, lambda image: image)
    for folder in ("pair/scene", "pair/message", "gspure/renders/message"):
        write_image(tmp_path / folder / "off_path_0.png", picture(9, 9))
    for view in range(VIEWS + 1):
        write_image(tmp_path / "small" / f"view_{view}.png", picture(0, 0)[:8])
    arguments = [tmp_path / "pair" / "message", "--extractions", tmp_path / "gspure" / "renders" / "message"]
    arguments += ["--decoys", tmp_path / "small", "--out", tmp_path / "r.csv"]
    assert main(["retrieve", *map(str, arguments)]) == 0
    assert read_table(tmp_path / "r.csv", Retrieved)[0].retrieval[3:] == (VIEWS, 5)
    folders = ("pair/message", "pair/scene", "gspure/renders/message", "small")
    compared = {str(tmp_path / folder / f"view_{view}.png") for folder in folders for view in range(VIEWS)}
    assert read_json(tmp_path / "r.csv.json")["inputs"].keys() == compared


def test_a_message_with_views_of_its_own_is_compared_with_other_photographs_of_the_scene(tmp_path: Path) -> None:
    alone = retrieved(tmp_path, lambda image: image)
    for view in range(VIEWS):
        (tmp_path / "pair" / "scene" / f"view_{view}.png").rename(tmp_path / "pair" / "scene" / f"desk_{view}.png")
    arguments = [tmp_path / "pair" / "message", "--extractions", tmp_path / "gspure" / "renders" / "message"]
    arguments += ["--decoys", *tmp_path.glob("decoy_*"), "--out", tmp_path / "r.csv"]
    assert main(["retrieve", *map(str, arguments)]) == 0
    assert read_table(tmp_path / "r.csv", Retrieved)[0].retrieval == alone


def test_copies_of_message_scene_and_decoys_are_no_further_candidates(tmp_path: Path) -> None:
    alone = retrieved(tmp_path, noise)
    copies = [photographs(tmp_path / f"copy_{seed}", seed) for seed in (0, 1, 2)]
    (tmp_path / "link").symlink_to(tmp_path / "decoy_3")
    decoys = [tmp_path / f"decoy_{seed}" for seed in range(2, 6)]
    decoys += [*copies, tmp_path / "link", tmp_path / "decoy_2" / ".." / "decoy_4", tmp_path / "pair" / "message"]
    arguments = [tmp_path / "pair" / "message", "--extractions", tmp_path / "gspure" / "renders" / "message"]
    arguments += ["--decoys", *decoys, "--out", tmp_path / "r.csv"]
    assert main(["retrieve", *map(str, arguments)]) == 0
    assert read_table(tmp_path / "r.csv", Retrieved)[0].retrieval == alone


def test_a_message_is_retrieved_from_its_own_folder(tmp_path: Path, monkeypatch) -> None:
    alone = retrieved(tmp_path, lambda image: image)
    monkeypatch.chdir(tmp_path / "pair" / "message")
    arguments = [".", "--extractions", tmp_path / "gspure" / "renders" / "message"]
    arguments += ["--decoys", *tmp_path.glob("decoy_*"), "--out", tmp_path / "r.csv"]
    assert main(["retrieve", *map(str, arguments)]) == 0
    assert read_table(tmp_path / "r.csv", Retrieved)[0].retrieval == alone


def test_two_extractions_of_one_variant_are_refused(tmp_path: Path, capsys) -> None:
    retrieved(tmp_path, lambda image: image)
    second = photographs(tmp_path / "other" / "gspure" / "renders" / "message", 0)
    extractions = [tmp_path / "gspure" / "renders" / "message", second]
    words = [tmp_path / "pair" / "message", "--extractions", *extractions, "--out", tmp_path / "r.csv"]
    assert main(["retrieve", *map(str, words)]) == 2
    assert f"{second}: gspure: expected one folder" in capsys.readouterr().err


@pytest.mark.parametrize(("message", "candidates"), [(picture(0, 0), 1 + 3 + 1 + 1), (np.zeros((24, 32, 3)), 1 + 1)])
def test_blank_candidates_count_once_beside_any_message(tmp_path: Path, message, candidates: int) -> None:
    for folder in ("pair/message", "gspure/renders/message"):
        write_image(tmp_path / folder / "view_0.png", message)
    decoys = [tmp_path / f"decoy_{number}" for number in range(3)]
    for folder in decoys:
        write_image(folder / "view_0.png", np.zeros((24, 32, 3)))
    write_image(tmp_path / "pair" / "scene" / "view_0.png", picture(1, 0))
    words = [tmp_path / "pair" / "message", "--extractions", tmp_path / "gspure" / "renders" / "message"]
    assert main(["retrieve", *map(str, [*words, "--decoys", *decoys, "--out", tmp_path / "r.csv"])]) == 0
    assert read_table(tmp_path / "r.csv", Retrieved)[0].retrieval.candidates == candidates


def test_equation_of_top_1_auc_and_tpr() -> None:
    views = [np.array(row) for row in ([0.9, 0.1, 0.2], [0.3, 0.3, 0.1], [0.25, 0.0, 0.1], [0.05, 0.2, 0.1])]
    false = np.concatenate([row[1:] for row in views])
    wins = [np.sum(row[0] > false) + np.sum(row[0] == false) / 2 for row in views]
    assert retrieval(views) == pytest.approx((0.5, sum(wins) / 32, 0.25, 4, 3))


def test_views_retrieved_by_chance_are_no_success() -> None:
    assert not Retrieval(0.25, 0.5, 0.0, 4, 17).succeeds  # one of four: p = 0.22
    assert Retrieval(0.5, 0.5, 0.0, 4, 17).succeeds  # two of four: p = 0.02
    assert not Retrieval(0.5, 0.5, 0.0, 4, 5).succeeds  # of fewer candidates: p = 0.18
    assert not Retrieval(0.0, 0.0, 0.0, 4, 17).succeeds


def test_too_few_views_decide_nothing() -> None:
    alone = Retrieval(1.0, 1.0, 1.0, 1, 15)  # p = 1/15
    assert not alone.succeeds
    assert not alone.decides
    assert Retrieval(0.0, 0.0, 0.0, 1, 20).decides
    assert Retrieval(0.0, 0.0, 0.0, 2, 5).decides
    for one_view in (alone, alone._replace(top1=0.0)):
        outcomes = with_retrieval(FADED, unattacked=one_view)
        assert not_embedded(outcomes) == []
        assert {row.present for row in survival(outcomes)} == {1}


def with_retrieval(outcomes, **of_variants: Retrieval):
    return [
        replace(o, retrieval={"message": of_variants[o.variant]}) if o.variant in of_variants else o for o in outcomes
    ]


FADED = benchmark({"a": {"gspure": (1.0, 20.0), "gof": (1.0, 21.0)}})


def test_a_message_is_gone_only_if_psnr_and_retrieval_agree() -> None:
    outcomes = with_retrieval(FADED, unattacked=NEAREST, gspure=NEAREST, gof=UNRELATED)
    rows = {row.variant: row for row in survival(outcomes)}
    assert (rows["gspure"].survived, rows["gspure"].only_retrieved, rows["gspure"].survives) == (0, 1, None)
    assert (rows["gof"].survived, rows["gof"].only_retrieved, rows["gof"].survives) == (0, 0, False)
    assert {row.variant: row.survives for row in survival(FADED)} == {"unattacked": True, "gspure": False, "gof": False}
    cells = {str(row.cells[0]): list(map(str, row.cells)) for row in survival_table([*rows.values()]).rows}
    assert "0 of 1 (+1)" in cells["GSPure"]
    assert "0 of 1" in cells["GOF"]


def test_the_audit_names_attacks_after_which_the_message_is_still_retrieved() -> None:
    def audit_of(outcomes):
        return audits(outcomes, survival(outcomes), ())[0]

    audit = audit_of(with_retrieval(FADED, unattacked=NEAREST, gspure=NEAREST, gof=UNRELATED))
    assert [row.variant for row in audit.only_retrieved] == ["gspure"]
    assert [row.variant for row in audit.where(False)] == ["gof"]
    assert audit.where(None) == []
    assert audit.strongest.variant == "gof"
    assert "retrieval still identifies the message" in say("verdict.html.j2", "verdict", audit)
    assert "retrieval" not in say("verdict.html.j2", "verdict", audit_of(FADED))
    both = audit_of(with_retrieval(FADED, unattacked=NEAREST, gspure=NEAREST, gof=NEAREST))
    assert "retrieval still identifies it" in say("verdict.html.j2", "answer", both, 2.0)


def test_a_message_that_is_not_retrieved_before_any_attack_is_not_embedded() -> None:
    assert not_embedded(FADED) == not_embedded(with_retrieval(FADED, unattacked=NEAREST)) == []
    outcomes = with_retrieval(FADED, unattacked=UNRELATED, gspure=UNRELATED, gof=UNRELATED)
    assert not_embedded(outcomes) == [("sis", "a")]
    assert {row.present for row in survival(outcomes)} == {0}
    (audit,) = audits(outcomes, survival(outcomes), ())
    assert audit.verdict == "not present"
    assert "No message is embedded" in say("verdict.html.j2", "verdict", audit)


def test_the_tables_hold_the_retrieval_and_warn_of_what_is_not_embedded(tmp_path: Path, capsys) -> None:
    metrics = []
    for variant, message in {"unattacked": 25.0, "gspure": 9.0, "black": 5.0}.items():
        metrics.append(tmp_path / "sis" / "room" / variant / "metrics.csv")
        write_table(metrics[-1], type(measured("scene", 30.0)), [measured("scene", 30.0), measured("message", message)])
    table, options = tmp_path / "sis" / "room" / "retrieval.csv", ["--out", tmp_path / "r.csv"]
    options += ["--markdown", tmp_path / "r.md", "--retrievals", table, "--metrics", *metrics]
    for before in (NEAREST, UNRELATED):
        rows = [Retrieved("unattacked", "message", before), Retrieved("gspure", "message", NEAREST)]
        write_table(table, Retrieved, rows)
        assert main(["table", *map(str, options)]) == 0
        assert ("no message is embedded" in capsys.readouterr().err) == (before is UNRELATED)
        outcomes = {o.variant: o for o in read_results(tmp_path / "r.csv")}
        assert outcomes["unattacked"].retrieval == {"message": before}
        assert outcomes["gspure"].retrieval == {"message": NEAREST}
        assert outcomes["black"].retrieval == {}
    write_results(tmp_path / "again.csv", [*outcomes.values()])
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "r.csv").read_bytes()


@pytest.mark.parametrize("missing", ["gspure", "vault"])
def test_extractions_without_retrieval_beside_others_with_it_are_refused(tmp_path: Path, missing: str, capsys) -> None:
    """A variant that is renamed after its retrieval, or a model without any."""
    metrics, tables = [], []
    for scene in ("room", "vault"):
        for variant in ("unattacked", "gspure", "black"):
            metrics.append(tmp_path / "sis" / scene / variant / "metrics.csv")
            write_table(metrics[-1], ViewMetrics, [measured("scene", 30.0), measured("message", 25.0)])
        tables.append(tmp_path / "sis" / scene / "retrieval.csv")
        write_table(tables[-1], Retrieved, [Retrieved(v, "message", NEAREST) for v in ("unattacked", "gspure")])
    command = [
        "table",
        "--out",
        tmp_path / "r.csv",
        "--markdown",
        tmp_path / "r.md",
        "--metrics",
        *metrics,
        "--retrievals",
    ]
    assert main([*map(str, [*command, *tables])]) == 0
    if missing == "vault":
        tables = tables[:1]
    else:
        write_table(tables[1], Retrieved, [Retrieved(v, "message", NEAREST) for v in ("unattacked", "noise")])
    assert main([*map(str, [*command, *tables])]) == 2
    assert "sis/vault" in capsys.readouterr().err


def test_decoys_are_pictures_of_different_rooms_in_the_views_and_size_asked_for(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(procedural, "DECOYS", range(9000, 9002))
    assert main(["decoys", "--views", "2", "--width", "24", "--height", "18", "--out", str(tmp_path / "decoys")]) == 0
    pictures = [read_image(path) for path in sorted(tmp_path.glob("decoys/*/*.png"))]
    assert {picture.shape for picture in pictures} == {(18, 24, 3)}
    assert len({picture.tobytes() for picture in pictures}) == 4


@pytest.mark.parametrize("option", ["views", "width", "height"])
def test_decoys_of_no_views_or_pixels_are_refused(tmp_path: Path, option: str) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["decoys", f"--{option}", "0", "--out", str(tmp_path / "decoys")])
    assert not (tmp_path / "decoys").exists()
