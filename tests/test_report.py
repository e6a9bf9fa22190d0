"""The report page: self-contained, and true to the numbers."""

import html
import json
import math
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.artifacts import write_json, write_record
from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation.comparison import RENDER, TRUTH
from gspure.evaluation.contest import contest
from gspure.evaluation.matched import match
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.survival import survival
from gspure.figures import style
from gspure.figures.viewer import write_viewer
from gspure.images import write_image
from gspure.model.suspicious import REASONS
from gspure.report.findings import findings, limits
from gspure.report.page import write_report
from tests.contest_cases import measured, outcome
from tests.test_viewer import evidence

VOID = {"meta", "link", "img", "br", "hr", "input"}


class Page(HTMLParser):
    """Every element with its attributes, and the visible text; fails on tags that do not nest."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.open: list[str] = []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        self.close()
        assert not self.open, f"not closed: {self.open}"
        self.text = " ".join(self.text.split())

    def handle_starttag(self, tag, attrs) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data) -> None:
        if self.open and self.open[-1] not in {"style", "title", "script"}:
            self.text += data

    @property
    def ids(self) -> list[str | None]:
        return [attributes["id"] for _, attributes in self.elements if "id" in attributes]

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def variant(name: str, scene: float, message: float = math.nan, *, asset=("planted", "room"), **known) -> Outcome:
    reference = TRUTH if asset[0] == "planted" else RENDER
    targets = {"scene": measured("scene", scene, 0.9, reference)}
    if not math.isnan(message):
        targets["message"] = measured("message", message, 0.8, reference)
    return Outcome(*asset, name, targets, dict.fromkeys(targets, 3), **known)


def of_one_model(*outcomes: Outcome) -> list[Outcome]:
    """Relate every variant to the first."""
    return [Outcome(**{**vars(o), "reference": outcomes[0].targets}) for o in outcomes]


PLANTED = of_one_model(
    variant("unattacked", 30.0, 25.0, pruned_share=0.0, recall=0.0),
    variant("gspure", 29.0, 9.0, pruned_share=0.4, precision=0.875, recall=0.95),
    variant("random_pruning", 20.0, 22.0, pruned_share=0.25, precision=0.4, recall=0.25),
)
VANILLA = of_one_model(
    variant("unattacked", math.inf, asset=("vanilla", "chair")),
    variant("gspure", 35.5, asset=("vanilla", "chair"), pruned_share=0.3),
)


@pytest.fixture
def figures(tmp_path: Path) -> list[Path]:
    """A figure as wide as a column and one as wide as a page, each with its note."""
    folder = tmp_path / "planted" / "room" / "figures"
    paths = [folder / "kept.png", folder / "scene.png"]
    for path, inches in zip(paths, (style.COLUMN, style.PAGE), strict=True):
        write_image(path, np.full((10, round(inches * style.DPI), 3), 0.5))
        write_record(path, inputs={}, settings={"caption": f"Caption of <{path.stem}>."})
    (folder / "kept.gltf").touch()
    return paths


def test_the_page_loads_nothing_and_its_links_work(tmp_path: Path, figures: list[Path]) -> None:
    (tmp_path / "a b.yaml").touch()
    write_report(tmp_path / "report.html", PLANTED + VANILLA, figures=figures, links=[tmp_path / "a b.yaml"])
    page = Page(tmp_path / "report.html")
    for _, attributes in page.elements:
        for name in {"src", "srcset", "poster", "data", "action"} & attributes.keys():
            assert (attributes[name] or "").startswith("data:")
    assert not re.search(r"url\(|@import|https?:|fetch\(|XMLHttp", page.source)
    links = [attributes["href"] for attributes in page.all("a")]
    assert len([link for link in links if not link.startswith("#")]) == 4
    for link in links:
        assert link.removeprefix("#") in page.ids if link.startswith("#") else (tmp_path / unquote(link)).exists(), link
    assert len(page.all("img")) == 2


def test_every_heading_has_an_anchor_and_the_contents_list_every_section(tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", PLANTED + VANILLA)
    page = Page(tmp_path / "report.html")
    assert len(page.ids) == len(set(page.ids))
    for section in re.findall(r"<h[23].*?</h[23]>", page.source, re.DOTALL):
        assert 'class="anchor"' in section
    contents = re.findall(r'href="#(.*?)"', page.source.split("<nav")[1].split("</nav>")[0])
    assert contents == [e["id"] for e in page.all("details") if e["class"] == "section"]


def test_text_from_outside_is_escaped(tmp_path: Path, figures: list[Path]) -> None:
    viewer = figures[0].parent / "viewer.json"
    write_viewer(viewer, replace(evidence(50), rows="</script><script>alert(1)</script>"), np.eye(3))
    write_report(tmp_path / "report.html", PLANTED, figures=figures, viewers=[viewer])
    page = Page(tmp_path / "report.html")
    assert "<script>alert" not in page.source
    assert "<script>alert(1)</script>" in page.text
    assert "Caption of <kept>." not in page.text  # the viewer shows it


def test_the_page_is_the_same_bytes_again(tmp_path: Path, figures: list[Path]) -> None:
    for name in ("a.html", "b.html"):
        write_report(tmp_path / name, PLANTED, figures=figures)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_the_findings_of_a_model_are_its_changes_and_pruning(tmp_path: Path) -> None:
    facts = findings(PLANTED)
    assert (facts.attacks, facts.against_photographs, facts.views) == (2, True, {"scene": 3, "message": 3})
    assert [tuple(change) for change in facts.changes] == [("scene", 30.0, 29.0), ("message", 25.0, 9.0)]
    write_report(tmp_path / "report.html", PLANTED)
    text = Page(tmp_path / "report.html").text
    for fact in ("40.0%", "87.5%", "95.0%", "scene 30.00 and 29.00 dB, message 25.00 and 9.00 dB."):
        assert fact in text
    assert "nothing about any published watermarking scheme" in text
    assert "can tell whether a message survived" not in text


def test_a_model_without_key_has_scene_damage_alone(tmp_path: Path) -> None:
    assert limits(VANILLA).without_key == limits(VANILLA).against_renders == [("vanilla", "chair")]
    write_report(tmp_path / "report.html", VANILLA)
    page = Page(tmp_path / "report.html")
    assert "can tell whether a message survived" in page.text
    assert "<td>∞</td>" in page.source
    headings = re.findall(r'<th scope="col".*?([^<>]+)</button>', page.source)
    metrics = [metric.title for metric in METRICS.values()]
    assert [heading.strip() for heading in headings] == ["variant", "PSNR", "pruned", *metrics[1:]]
    assert "nan" not in page.text.lower().split()
    assert "planted" not in page.text.lower()
    assert "watermarked" not in page.text.lower()  # nobody knows whether it bears a mark


def test_the_limit_of_one_scene_is_stated_once(tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", PLANTED + VANILLA)
    assert Page(tmp_path / "report.html").text.count("tested on one scene") == 1
    vault = [variant("unattacked", 30.0, message, asset=("planted", "vault")) for message in (25.0, math.nan)]
    assert limits([*PLANTED, vault[0]]).one_scene == []
    assert len(limits([*PLANTED, vault[1]]).one_scene) == 1  # no message was extracted there


def test_the_highest_score_is_marked(tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", PLANTED)
    marked = re.findall(r'<tr class="best">\s*<th scope="row">(.*?)</th>', Page(tmp_path / "report.html").source)
    assert marked == ["GSPure"]


@pytest.mark.parametrize(
    "entries", [1.5, [1], "text", {"warnings": 3}, {"clusters": "many"}, {"suspicious": {"unknown": [1]}}]
)
@pytest.mark.parametrize("part", ["diagnoses", "viewers"])
def test_entries_that_cannot_be_shown_are_refused_with_their_file(tmp_path: Path, part: str, entries: object) -> None:
    file = tmp_path / "vanilla" / "chair" / "entries.json"
    write_json(file, entries)
    with pytest.raises(InputError, match=r"entries\.json"):
        write_report(tmp_path / "report.html", PLANTED + VANILLA, **{part: [file]})
    assert not (tmp_path / "report.html").exists()


def test_models_have_their_own_figures_and_diagnosis(tmp_path: Path, figures: list[Path]) -> None:
    diagnosis = tmp_path / "vanilla" / "chair" / "diagnosis.json"
    write_json(
        diagnosis,
        {"clusters": 1234, "noise_share": 0.25, "hidden_low_share": None, "warnings": ["the clustering has collapsed"]},
    )
    write_report(tmp_path / "report.html", PLANTED + VANILLA, figures=figures, diagnoses=[diagnosis])
    room, chair = Page(tmp_path / "report.html").source.split('id="vanilla/chair"')
    assert room.count("<figure") == 2
    assert room.count('<figure class="wide"') == 1
    assert "kept.gltf" in room
    assert "collapsed" not in room
    for expected in ("The clustering has collapsed", "<dd>1,234</dd>", "<dd>25.0%</dd>", "<dd>none in any row</dd>"):
        assert expected in chair
    assert "<figure" not in chair


def test_suspicious_rows_are_counted_with_the_reason_beside_the_clustering(tmp_path: Path) -> None:
    diagnosis = tmp_path / "vanilla" / "chair" / "diagnosis.json"
    for suspects, shown in (({"undrawable": [3], "needle": [5, 6]}, True), ({}, False)):
        write_json(diagnosis, {"clusters": 2, "suspicious": suspects})
        write_report(tmp_path / "report.html", PLANTED + VANILLA, diagnoses=[diagnosis])
        text = Page(tmp_path / "report.html").text
        assert (f"1 undrawable ({REASONS['undrawable']})" in text) == shown
        assert (f"2 needle ({REASONS['needle']})" in text) == shown
        assert ("diagnosis.json" in text) == shown


def test_a_scheme_s_attacks_are_compared_over_its_scenes(tmp_path: Path, figures: list[Path]) -> None:
    swept = of_one_model(*(variant(f"v{i}", 30 - i, 25 - 4 * i) for i in range(3)))
    write_image(figure := tmp_path / "figures" / "planted" / "tradeoff.png", np.zeros((4, 4, 3)))
    matched = match(PLANTED + swept, {"ours": ["v1", "v2"], "theirs": ["random_pruning"]})
    write_report(tmp_path / "report.html", PLANTED + VANILLA, figures=[*figures, figure], matched=matched)
    page = Page(tmp_path / "report.html")
    assert "Planted message: comparison of attacks" in page.text
    assert "Own model: comparison of attacks" not in page.text
    table = page.source.split('id="compare/planted"')[1].split("</table>")[0]
    assert table.count("<b>") == 4
    rows = {row.split("</th>")[0].split(">")[-1]: row for row in table.split("<tr>") if 'scope="row"' in row}
    assert {name for name, row in rows.items() if "<b>" in row} == {"GSPure", "v0"}
    assert "<td>6.00" in rows["ours"]
    assert len(page.all("img")) == 3


def test_notes_stand_once_in_a_section_and_explain_extractions_before_their_tables(tmp_path: Path) -> None:
    drops = {"unattacked": (0, 0), "gspure": (1, 20), "gof": (1, 10), "clean": (0, 25), "black": (20, 25)}
    outcomes = [
        outcome(name, targets={"scene": 30.0 - a, "message": 28.0 - b, "message_oracle": 28.0 - b})
        for name, (a, b) in drops.items()
    ]
    outcomes = [Outcome(**{**vars(o), "reached": {"message_oracle": o.variant != "gof"}}) for o in outcomes]
    known = {"survivals": survival(outcomes), "contests": contest(outcomes, {}), "matched": match(outcomes, {})}
    write_report(tmp_path / "report.html", outcomes, **known)
    text = Page(tmp_path / "report.html").text
    assert text.count("RMS ratio: root-mean-square") == text.count("Positive: GSPure has") == 1
    assert text.index("Message (oracle): extracted") < text.index("Survival of the message (oracle)")
    assert "Message (adaptive): extracted" not in text


def test_a_figure_of_an_unknown_model_is_refused(tmp_path: Path, figures: list[Path]) -> None:
    with pytest.raises(
        InputError,
        match=r"kept.png: path: expected a folder SCHEME/SCENE of the table .vanilla/chair, figures/va",
    ):
        write_report(tmp_path / "report.html", VANILLA, figures=figures)
    assert not (tmp_path / "report.html").exists()


def test_a_figure_that_is_not_an_image_is_refused(tmp_path: Path, figures: list[Path]) -> None:
    figures[0].write_bytes(b"half a file")
    with pytest.raises(InputError, match=r"kept.png: content: expected CRC-32"):
        write_report(tmp_path / "report.html", PLANTED, figures=figures)
    figures[0].with_name("kept.png.json").unlink()
    with pytest.raises(InputError, match=r"kept.png: file: expected an image"):
        write_report(tmp_path / "report.html", PLANTED, figures=figures)


def test_records_are_listed(tmp_path: Path, figures: list[Path]) -> None:
    note = figures[0].with_name("kept.png.json")
    write_report(tmp_path / "report.html", PLANTED, records=[note])
    digest = json.loads(note.read_text())["digest"]
    text = Page(tmp_path / "report.html").text
    assert f"{note} {digest[:12]}" in text
    assert f'"digest": "{digest}"' in text


def test_a_file_that_is_no_record_is_refused(tmp_path: Path) -> None:
    write_json(tmp_path / "other.json", [1, 2])
    with pytest.raises(InputError, match=r"other.json: file: expected a record beside its file"):
        write_report(tmp_path / "report.html", PLANTED, records=[tmp_path / "other.json"])


def test_nothing_measured_makes_a_page_too(tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", [])
    assert "<h1>" in Page(tmp_path / "report.html").source
    write_report(tmp_path / "failed.html", [Outcome("s", "room", "gspure", {}, {}, failure="no memory")])
    text = Page(tmp_path / "failed.html").text
    assert "Nothing was measured" in text
    assert "no memory" in text


def draw_attacks(folder: Path, *shown: str) -> Path:
    """Write the figure of some attacks on a planted room, and beside it the renders of all."""
    figure = folder / "planted" / "room" / "figures" / "attacks.png"
    write_image(figure, np.zeros((4, 4, 3)))
    inputs = {}
    for i, attack in enumerate(("unattacked", "gspure", "random_pruning")):
        for target in ("scene", "message"):
            render = figure.parents[1] / attack / "renders" / target / "view_007.png"
            write_image(render, np.full((90, 120, 3), 0.2 + 0.3 * i))
            inputs |= {f"{attack} {target}": render} if attack in ("unattacked", *shown) else {}
    write_record(figure, inputs=inputs, settings={})
    return figure


@pytest.fixture
def attacks(tmp_path: Path) -> Path:
    return draw_attacks(tmp_path, "gspure")


def test_the_first_screen_answers_for_every_scheme_and_shows_it(tmp_path: Path, attacks: Path) -> None:
    clean = variant("clean", 30.0, 8.5)
    outcomes = of_one_model(*PLANTED, clean)
    write_report(tmp_path / "report.html", outcomes + VANILLA, figures=[attacks], survivals=survival(outcomes))
    first = " ".join(Page(tmp_path / "report.html").source.split("<nav")[0].split())
    verdicts, evidence = first.split("<details", 1)
    assert re.findall('id="verdict/(.*?)"', verdicts) == ["planted", "vanilla"]
    assert "did not survive GSPure, which lowers the PSNR of the message by 16.0 dB" in verdicts
    assert "Only the owner's key can tell" in html.unescape(verdicts)
    removal = "GSPure removed 30.0% of the rows; renders after it have a PSNR of 35.5 dB against renders before it."
    assert removal in verdicts
    assert evidence.startswith(' class="evidence" open>')
    assert evidence.count("<img") == 4


def test_the_heading_asks_about_the_watermark_only_if_a_message_was_extracted(tmp_path: Path) -> None:
    headings = {}
    for name, outcomes in {"key": PLANTED, "no key": VANILLA, "both": PLANTED + VANILLA}.items():
        write_report(tmp_path / "report.html", outcomes, survivals=survival(outcomes))
        (headings[name],) = re.findall("<h1>(.*)</h1>", Page(tmp_path / "report.html").source)
    assert "watermark" in headings["key"] == headings["both"]
    assert "scene" in headings["no key"]
    assert "watermark" not in headings["no key"]


def test_without_a_key_the_first_screen_shows_what_was_removed_and_what_attacks_cost(tmp_path: Path) -> None:
    attacks = draw_attacks(tmp_path, "gspure")
    shutil.copytree(attacks.parents[1], folder := tmp_path / "vanilla" / "chair")
    figures = [folder / "figures" / "attacks.png"]
    for name in ("splats", "outcomes", "weights"):
        write_image(folder / "figures" / f"{name}.png", np.ones((4, 4, 3)))
        figures.append(folder / "figures" / f"{name}.png")
    write_report(tmp_path / "report.html", VANILLA, figures=figures)
    first = Page(tmp_path / "report.html").source.split("<nav")[0]
    assert first.count("<figure") == 4
    assert [name for name in ("Splats", "Outcomes", "Weights") if f"<b>{name}.</b>" in first] == ["Splats", "Outcomes"]
    page = Page(tmp_path / "report.html")
    assert [page.source.count(f"<b>{name}.</b>") for name in ("Splats", "Outcomes", "Weights")] == [1, 1, 1]
    assert "floor" not in page.text


def test_a_picture_that_others_are_compared_with_has_no_distance(tmp_path: Path, attacks: Path) -> None:
    shown = attacks.parents[3].joinpath("vanilla", "chair")
    shutil.copytree(attacks.parents[1], shown)
    figure = shown / attacks.relative_to(attacks.parents[1])
    renders = {f"{attack} scene": shown / attack / "renders/scene/view_007.png" for attack in ("unattacked", "gspure")}
    write_record(figure, inputs=renders, settings={})
    write_report(tmp_path / "report.html", VANILLA, figures=[figure])
    captions = re.findall("<figcaption>(.*?)</figcaption>", Page(tmp_path / "report.html").source.split("<nav")[0])
    assert [re.sub("<.*?>", " ", caption).split()[-2:] for caption in captions] == [
        ["the", "reference"],
        ["35.50", "dB"],
    ]


def test_renders_of_the_attacks_figure_replace_it(tmp_path: Path, attacks: Path) -> None:
    write_report(tmp_path / "report.html", PLANTED, figures=[attacks])
    page = Page(tmp_path / "report.html")
    tiles = [e["data-variant"] for e in page.all("button") if e.get("class") == "tile"]
    assert tiles == ["GSPure"]  # the record does not name the renders of random pruning
    assert "view_007" in page.text
    assert "attacks.png" in [Path(e["href"]).name for e in page.all("a")]
    for render in attacks.parents[1].glob("*/renders/*/*.png"):
        render.unlink()
    write_report(tmp_path / "report.html", PLANTED, figures=[attacks])
    assert len(Page(tmp_path / "report.html").all("img")) == 1  # the figure itself


nan = st.just(math.nan)
psnrs, shares = st.floats(0, 99), nan | st.floats(0, 1)
names = st.text("abc_", min_size=1, max_size=3)


@settings(deadline=None)
@given(st.dictionaries(names, st.tuples(psnrs, nan | psnrs, shares, shares, shares), min_size=1, max_size=4))
def test_a_table_read_back_is_what_was_written(tmp_path_factory, variants) -> None:
    written = of_one_model(
        variant("unattacked", 30.0, 25.0),
        *(
            variant(f"attack_{name}", scene, message, pruned_share=pruned, precision=precision, recall=recall)
            for name, (scene, message, pruned, precision, recall) in variants.items()
        ),
    )
    path = tmp_path_factory.mktemp("table") / "results.csv"
    write_results(path, written)
    read = read_results(path)
    assert repr(read) == repr(written)  # NaN does not equal itself, but looks the same
    assert [o.score for o in read] == pytest.approx([o.score for o in written], nan_ok=True)


@pytest.mark.parametrize(
    "content", ["", "a,b\n1,2\n", "HEADER", "HEADERplanted,room,x\n", "HEADERp,r,v,scene,truth,x,1,1,,,,,,\n"]
)
def test_a_file_that_is_not_a_table_is_refused_in_one_line(tmp_path: Path, capsys, content: str) -> None:
    write_results(tmp_path / "results.csv", [])
    header = (tmp_path / "results.csv").read_text()
    (tmp_path / "results.csv").write_text(content.replace("HEADER", header))
    status = main(["report", "--table", str(tmp_path / "results.csv"), "--out", str(tmp_path / "report.html")])
    if content == "HEADER":  # a table of nothing is a table
        assert status == 0
        return
    assert status == 2
    error = capsys.readouterr().err
    assert "results.csv: " in error
    assert error.count("\n") == 1


def test_the_command_writes_the_page(tmp_path: Path, figures: list[Path], capsys) -> None:
    write_results(tmp_path / "results.csv", PLANTED)
    out = tmp_path / "report.html"
    words = ["--table", tmp_path / "results.csv", "--figures", *figures, "--out", out]
    assert main(["report", *map(str, words)]) == 0
    assert "How robust is the watermark?" in Page(out).text
    assert str(out) in capsys.readouterr().out
