"""Every number and sentence at the edges: what is unknown, identical, failed, or known in some scenes only."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation.contest import contest
from gspure.evaluation.matched import match
from gspure.evaluation.outcomes import MESSAGE, SCENE
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.retrieval import retrieval
from gspure.evaluation.survival import survival
from gspure.figures.tradeoff import places
from gspure.model import write_model
from gspure.report.page import write_report
from gspure.report.tables import conditions_markdown, results_markdown, summary_table
from gspure.report.templates import say
from tests.contest_cases import attacked, outcome
from tests.edge_tables import VARIANTS, edge_outcomes
from tests.models import blobs, camera, tilted_camera
from tests.test_audit import audit_of, of_scenes, sentence, told
from tests.test_report import Page

SWEEPS = {"gspure": [name for name in VARIANTS if name.startswith("gspure")]}
NO_NUMBER = r"\bnan\b|\binf\b|\bNone\b|[-−]0(\.0+)?\b(?![.\de])|(?<!\d)-\d|\b0 of 0\b|– ?dB|\d{8}"
NO_SENTENCE = (
    r"\(\s*\)|\s[.,;:]|\.\.|\b1 (other )?(attacks|scenes|views|models)\b|[02-9] (other )?(attack|model|view)\b"
)


def texts(folder: Path, seed: int) -> tuple[str, str]:
    """The text of the page without its tables, and all tables of a random run."""
    write_results(folder / "results.csv", edge_outcomes(seed))
    outcomes = read_results(folder / "results.csv")
    rows = {"survivals": survival(outcomes), "contests": contest(outcomes, SWEEPS), "matched": match(outcomes, SWEEPS)}
    write_report(folder / "report.html", outcomes, **rows)
    spaced = re.sub(r"</(li|h\d|p|span|button)>", r" </\1>", (folder / "report.html").read_text())
    (folder / "report.html").write_text(re.sub(r"<table>.*?</table>", "", spaced, flags=re.DOTALL))
    tables = [results_markdown(outcomes), conditions_markdown(*rows.values()), summary_table(outcomes).latex()]
    cells = " ".join(re.sub(r"^\| *-.*$|^%.*$", "", "\n".join(tables), flags=re.MULTILINE).replace("$-$", "−").split())
    return Page(folder / "report.html").text, cells


@pytest.mark.parametrize("seed", range(40))
def test_every_table_of_results_gives_whole_sentences_and_known_numbers(tmp_path: Path, seed: int) -> None:
    page, tables = texts(tmp_path, seed)
    for text, wrong in ((page, f"{NO_NUMBER}|{NO_SENTENCE}"), (tables, NO_NUMBER)):
        assert not [text[max(0, m.start() - 60) : m.end() + 30] for m in re.finditer(wrong, text)]
        assert all(int(part) <= int(whole) for part, whole in re.findall(r"\b(\d+) of (\d+)\b", text))


def test_an_attack_measured_only_where_no_message_was_present_is_not_judged() -> None:
    outcomes = of_scenes(2, gspure=(0.5, 20.0), crop=(0.5, 1.0))
    absent = [o for o in outcomes if (o.scene, o.variant) != ("s0", "crop")]
    absent = [replace(o, targets=o.targets | {MESSAGE: o.targets[MESSAGE]._replace(values=_black(o))}) for o in absent]
    row = next(row for row in survival(absent) if row.variant == "crop")
    assert (row.present, row.scenes, row.message_drop) == (0, 0, None)
    assert [row.variant for row in audit_of(absent).incomplete] == ["crop"]


def _black(o) -> dict[str, float]:
    """The metrics of the message, which the model of scene s1 does not hold."""
    values = dict(o.targets[MESSAGE].values)
    return values | {"psnr": 0.0} if o.scene == "s1" and not o.is_control else values


def test_every_scene_counts_the_same_in_the_trade_off_and_incomplete_variants_are_left_out() -> None:
    cells = [("a", 0, 10.0), ("a", 1, 10.0), ("b", 0, 4.0)]
    outcomes = [
        attacked(name, 0.0, drop * (name != "unattacked"), scene, seed)
        for scene, seed, drop in cells
        for name in ("unattacked", "gof")
    ]
    outcomes += [
        attacked(name, 1.0, 1.0, scene, seed)
        for name in ("x", "y")
        for scene, seed, _ in cells[:: 1 if name == "x" else 2]
    ]
    at = {place.variants: place.residual for place in places(outcomes)}
    assert at == {("gof",): 21.0, ("unattacked",): 28.0, ("x",): 27.0}


def test_drops_on_and_off_the_path_are_of_the_same_scenes() -> None:
    outcomes = [o for o in of_scenes(2, gspure=(0.5, 20.0)) if not o.is_control]
    outcomes[1] = replace(outcomes[1], off_path=outcomes[1].targets, off_path_reference=outcomes[1].reference)
    (gspure,) = [o for o in outcomes if o.off_path]
    off_path = audit_of(outcomes).off_path
    assert (off_path.message_on_path.scenes, off_path.message.scenes) == (1, 1)
    assert off_path.scene_on_path.mean == gspure.psnr_drop(SCENE)


def test_a_wrong_key_is_compared_with_the_floor_of_its_own_scenes_or_not_at_all() -> None:
    outcomes = of_scenes(2, gspure=(0.5, 20.0))
    assert "negative controls" in told(outcomes)[1]["With a wrong key"]
    fewer = [o for o in outcomes if (o.scene, o.variant) != ("s0", "wrong_key")]
    assert not re.search("negative controls|floor", told(fewer)[1]["With a wrong key"])


def test_an_attack_in_one_of_two_scenes_is_not_ahead_in_every_scene() -> None:
    drops = {"gspure": (0.3, 5.0), "gspure@0.3dB": (0.3, 5.0), "gof@0.3dB": (0.3, 9.0), "x@0.3dB": (0.3, 1.0)}
    outcomes = of_scenes(2, **drops)
    sweeps = {name: [variant for variant in drops if variant.startswith(name)] for name in ("gspure", "gof", "x")}
    assert "in every scene" in told(outcomes, sweeps)[1]["Compared with other attacks"]
    fewer = [o for o in outcomes if (o.scene, o.variant) != ("s0", "gof@0.3dB")]
    text = told(fewer, sweeps)[1]["Compared with other attacks"]
    assert "GOF removes more" in text
    assert "in every scene" not in text
    assert "1 of 2 scenes" in text


def test_a_message_that_survives_here_and_is_only_retrieved_there_is_said_to() -> None:
    outcomes = of_scenes(3, gspure=(0.5, 20.0))
    row = next(row for row in survival(outcomes) if row.variant == "gspure")._replace(survived=1, only_retrieved=1)
    audit = replace(audit_of(outcomes), attacks=[row])
    text = say("verdict.html.j2", "answer", audit, 2.0)
    assert re.search("did not survive GSPure in 2 of 3 scenes.*retrieval.* 1 of these", text)


def test_a_scene_without_renders_of_an_attack_is_counted_where_its_strength_is_named() -> None:
    outcomes = of_scenes(2, **{"gspure": (0.5, 9.0), "crop@1dB": (1.0, 3.0)})
    fewer = [replace(o, targets={}, failure="x") if (o.scene, o.variant) == ("s0", "crop@1dB") else o for o in outcomes]
    outcomes[0] = replace(
        outcomes[0],
        targets={n: m._replace(values=m.values | {"psnr": m.psnr + 4}) for n, m in outcomes[0].targets.items()},
    )
    names = [row.cells[1].text for row in summary_table(fewer).rows]
    assert "crop, 1 dB" in names


def test_identical_renders_are_named_among_the_attacks() -> None:
    psnr = {"unattacked": math.inf, "gspure": math.inf, "gof": 30.0}
    outcomes = [
        outcome(name, scheme="vanilla", targets={"scene": value}, pruned_share=0.0) for name, value in psnr.items()
    ]
    outcomes = [replace(o, reference={SCENE: outcomes[0].targets[SCENE]}) for o in outcomes]
    outcomes = [replace(o, targets={SCENE: o.targets[SCENE]._replace(reference="render")}) for o in outcomes]
    assert "identical" in told(outcomes)[1]["The scene"]
    assert "identical" in sentence(outcomes)


def test_the_verdict_counts_the_models_of_its_means() -> None:
    values = {("a", "gspure"): 36.0, ("b", "gspure"): math.inf, ("a", "unattacked"): math.inf}
    values |= {("b", "unattacked"): math.inf, ("c", "unattacked"): math.inf}
    outcomes = [
        outcome(name, scheme="vanilla", scene=scene, targets={SCENE: psnr}, pruned_share=0.25 * (name == "gspure"))
        for (scene, name), psnr in values.items()
    ]
    outcomes = [replace(o, targets={SCENE: o.targets[SCENE]._replace(reference="render")}) for o in outcomes]
    text = sentence(outcomes)
    assert "25.0% of the rows on average (2 of 3 scenes)" in text
    assert "36.0 dB (1 of 3 scenes)" in text


@pytest.mark.parametrize(
    ("drops", "words"),
    [
        ((0.0, 0.0), "changes the PSNR of the message by 0.0 dB and that of the scene by 0.0 dB"),
        ((1.0, 0.0), "changes the PSNR of the message by 0.0 dB and lowers that of the scene by 1.0 dB"),
        ((-1.0, -2.0), "raises the PSNR of the message by 2.0 dB and that of the scene by 1.0 dB"),
    ],
)
def test_no_drop_is_not_said_to_lower(drops: tuple[float, float], words: str) -> None:
    assert words in told(of_scenes(1, gspure=drops))[1]["GSPure"]


def test_a_message_without_false_candidates_is_not_retrieved_from_nothing() -> None:
    with pytest.raises(InputError, match="candidates: expected pictures"):
        retrieval([np.array([1.0])])
    assert retrieval([np.array([1.0]), np.array([0.5, 0.4])]).views == 1


def test_views_that_show_nothing_are_warned_of(tmp_path: Path, capsys) -> None:
    write_model(tmp_path / "m.ply", blobs(20, sh_degree=0))
    here = tilted_camera(16, 12, name="here")
    away = replace(here, name="away", viewmat=here.viewmat - 1e3 * np.eye(4)[:, [2]] @ np.eye(4)[[3]])
    write_cameras(tmp_path / "c.json", [here, away])
    main(["render", str(tmp_path / "m.ply"), "--cameras", str(tmp_path / "c.json"), "--out", str(tmp_path / "r")])
    warning = capsys.readouterr().err
    assert "1 of 2 views" in warning
    assert "(first: away)" in warning
    write_cameras(tmp_path / "c.json", [camera(1, 1)])
    main(["render", str(tmp_path / "m.ply"), "--cameras", str(tmp_path / "c.json"), "--out", str(tmp_path / "one")])
    assert "warning" not in capsys.readouterr().err, "a single pixel has a single colour"
