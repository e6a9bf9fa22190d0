"""The pages in a browser: report, 3-D view and leaderboard answer to mouse and keys, at any width, without errors."""

import io
import re
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from experiments import leaderboard_page
from gspure.cameras import orbit_cameras
from gspure.codec import plain
from gspure.evaluation.identity import Condition
from gspure.evaluation.plan import Plan
from gspure.evaluation.radius import Radius, Record
from gspure.figures import style
from gspure.files import write_json
from gspure.public_model import PublicModel
from gspure.report.writing import write_report
from gspure.viewer.data import write_viewer
from gspure.viewer.view import view_beside
from tests import outcome_cases
from tests.documentation import ROOT
from tests.models import blobs
from tests.test_viewer import purified

ATTACKS = {"gspure": (0.055, 1.0), "noise": (0.2, 0.02), "noise@2dB": (0.1, 0.3), "lowest_opacity_matched": (0.3, 0.3)}
WIDTHS = (1400, 900, 420)
PART = ".panel:not([hidden])"

SIDEWAYS = "() => document.documentElement.scrollWidth > innerWidth"
CUT = """() => [...document.querySelectorAll("body *")].filter(part =>
  part.scrollWidth > part.clientWidth + 1 && part.clientWidth && !part.matches(".stage")
  && ["hidden", "clip"].includes(getComputedStyle(part).overflowX)).map(part => part.outerHTML.slice(0, 80))"""
CUT_TABLES = """() => [...document.querySelectorAll(".table .scroll, .scroll:has(.attacks)")]
  .filter(box => box.scrollWidth > box.clientWidth).map(box => box.innerText.slice(0, 80))"""
STOPS = """() => [...document.querySelectorAll("a[href], button, select, summary, canvas, input")]
  .filter(part => part.checkVisibility() && (part.type !== "radio" || part.checked))"""


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    """The report of two models whose pictures are higher than wide."""
    results = tmp_path_factory.mktemp("run") / "results"
    photograph = outcome_cases.photograph
    shown = purified(600)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "DPI", 60)
        patch.setattr(outcome_cases, "photograph", lambda *view: np.swapaxes(photograph(*view), 0, 1))
        plans = tuple(
            outcome_cases.write_model(results, name, ATTACKS, adapts=True) for name in ("sis/room", "sis/vault")
        )
        for plan in plans:
            file = results / plan.id.name / "figures" / "model" / "view.json"
            write_viewer(file, shown, orbit_cameras(shown.public.model, count=9))
        write_json(results / "configuration.json", {})
        write_report(results, Plan(plans, meanings={"gspure": "What it does."}))
    return results / "report.html"


@pytest.fixture(scope="module")
def view(tmp_path_factory) -> Path:
    """The view of two models beside each other."""
    file = tmp_path_factory.mktemp("view") / "view.html"
    models = {f"{count}.ply": PublicModel(blobs(count)) for count in (60, 10)}
    view_beside(models, orbit_cameras(blobs(60), count=9)).write(file)
    return file


def drawn(page, last=None):
    """Return the pixels of the canvas once they are not of one colour, and not the last ones."""
    end = time.monotonic() + 20
    bare = ".stage :not(canvas) { visibility: hidden }"
    while time.monotonic() < end:
        screenshot = page.locator("canvas:visible").screenshot(style=bare)
        pixels = np.asarray(Image.open(io.BytesIO(screenshot)).convert("RGB"))
        if np.ptp(pixels[5:-5, 5:-5]) > 50 and not np.array_equal(pixels, last):
            return pixels
    pytest.fail("the canvas is empty, or does not change")


def drag(page, start: float, end: float) -> None:
    """Drag over the canvas, between shares of its width."""
    box = page.locator("canvas:visible").bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + start * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + end * box["width"], y, steps=4)
    page.mouse.up()


def column(page, table: str, number: int) -> list[str]:
    return page.locator(f"{PART} {table} tbody tr > :nth-child({number + 1})").all_inner_texts()


def number_of(text: str) -> float:
    return float(re.sub(r"[^\d.-]", "", text.replace("−", "-").split()[0]))


@pytest.mark.parametrize("width", WIDTHS)
def test_every_part_of_a_report_opens_whole(visit, report: Path, width: int) -> None:
    page = visit(report, width)
    ids = page.locator(f"{PART} nav a").evaluate_all("links => links.map(link => link.hash.slice(1))")
    assert len(ids) == 5
    for part in ids:
        page.locator(f"{PART} nav a[href='#{part}']").click()
        page.locator(f"[id='{part}']").wait_for()
        assert page.locator(".panel:visible").count() == 1
        assert page.evaluate(CUT_TABLES) == []
        for toggle in page.locator(f"{PART} .toggle").all():
            toggle.click()
        assert (page.evaluate(CUT), page.evaluate(SIDEWAYS)) == ([], False)


def test_every_attack_shows_its_pictures_in_straight_rows(visit, report: Path) -> None:
    page = visit(report)
    attacks = page.locator(".attacks tbody tr")
    assert attacks.count() == len(ATTACKS) == page.locator(".attacks [data-variant]").count()
    assert attacks.last.bounding_box()["y"] < 900  # on the first screen
    for button in page.locator(".attacks [data-variant]").all():
        button.click()
        variant = button.get_attribute("data-variant")
        assert page.locator(f".pictures > [data-variant='{variant}']").is_visible()
        boxes = [image.bounding_box() for image in page.locator(".pictures img:visible").all()]
        assert (len(boxes), len({box["y"] for box in boxes})) == (9, 3)
        assert min(box["height"] for box in boxes) > 60


def test_each_model_has_its_row_in_the_matrix_and_the_shown_one_is_named(visit, report: Path) -> None:
    page = visit(report)
    gspure = column(page, ".attacks", 0).index("GSPure")
    for scene in ("room", "vault"):
        verdicts = page.locator(".matrix tr", has_text=scene).locator("td b").all_inner_texts()
        assert (len(verdicts), verdicts[gspure], {*verdicts}) == (len(ATTACKS), "gone", {"gone", "readable"})
    assert "model room" in page.locator(".screen .note").first.inner_text()


def test_tables_begin_in_the_order_of_the_verdict_and_are_sorted_by_a_click(
    visit, report: Path, tmp_path, monkeypatch
) -> None:
    page = visit(report)
    names = column(page, ".attacks", 0)
    page.get_by_role("link", name="Attacks compared").first.click()
    page.locator("[id^=compare]").first.wait_for()
    survival = ".figures + .tables .table"
    assert [name.removesuffix(" †") for name in column(page, survival, 0)] == ["unattacked", *names, "clean model"]
    for number in (1, 2):
        orders = []
        for _ in range(2):
            page.locator(f"{PART} {survival} thead button").nth(number).click()
            orders.append([number_of(text) for text in column(page, survival, number) if text != "–"])
        assert orders == [sorted(orders[0]), sorted(orders[0], reverse=True)]

    script = (ROOT / "docs" / "site" / "sort.js").read_text()
    radii = [Radius(Condition(f"s{i}"), "message", "published", "message", i / 4, False, 0, 9, 1) for i in (2, 9, 4)]
    record = Record("0.1.0", "small-1", "2026-11-29", 1, "96x72", "", tuple(radii), ())
    write_json(tmp_path / "records" / "mine.json", plain(record))
    monkeypatch.setattr(leaderboard_page, "RECORDS", tmp_path / "records")
    table = re.search(r"<table.*?</table>", leaderboard_page.page(), re.DOTALL)[0]
    (tmp_path / "leaderboard.html").write_text(f"<!doctype html>{table}<script>{script}</script>")
    page = visit(tmp_path / "leaderboard.html")
    orders = []
    for _ in range(2):
        page.locator("th").nth(4).click()
        cells = page.locator("td:nth-child(5)")
        orders.append(cells.evaluate_all("cells => cells.map(cell => Number(cell.dataset.sort))"))
    assert orders == [sorted(orders[0]), sorted(orders[0], reverse=True)]


def test_the_view_of_a_report_turns_prunes_and_changes_its_camera(visit, report: Path) -> None:
    page = visit(report)
    canvas, menu, modes = (page.locator(f"{PART} {name}") for name in ("canvas", "[name=camera]", ".tools label"))
    decision = page.locator(f"{PART} [name=decision]")
    assert menu.locator("option").all_inner_texts()[-1] == "overview"
    first = last = drawn(page)
    for act in (
        lambda: menu.select_option("1"),
        lambda: canvas.press("ArrowRight"),
        lambda: canvas.press("+"),
        lambda: drag(page, 0.5, 0.6),
        modes.last.click,
        decision.click,
    ):
        act()
        last = drawn(page, last)
    assert decision.inner_text().endswith(page.locator(f"{PART} output[name=rows]").inner_text())
    page.locator(f"{PART} [name=cut]").fill("0")
    modes.first.click()
    menu.select_option("0")
    assert np.array_equal(drawn(page, last), first)


@pytest.mark.parametrize("width", WIDTHS)
def test_the_divider_of_two_models_is_dragged(visit, view: Path, width: int) -> None:
    page = visit(view, width)
    assert (page.evaluate(CUT), page.evaluate(SIDEWAYS)) == ([], False)
    last = drawn(page)
    drag(page, 0.5, 0.3)
    last = drawn(page, last)
    assert float(page.locator("[name=divider]").input_value()) == pytest.approx(30, abs=3)
    drag(page, 0.8, 0.9)  # turns the models
    drawn(page, last)


def test_tab_reaches_every_stop_and_arrow_keys_lead_from_part_to_part(visit, report: Path) -> None:
    page = visit(report)
    page.evaluate(f"() => {{ window.missed = new Set(({STOPS})()); }}")
    for _ in range(page.evaluate("() => missed.size") + 10):
        page.keyboard.press("Tab")
        page.evaluate("() => missed.delete(document.activeElement)")
    assert page.evaluate("() => [...missed].map(part => part.outerHTML)") == []
    page.locator(f"{PART} nav a").first.focus()
    for part in ("compare", "sis/room", "sis/vault", "limits"):
        page.keyboard.press("ArrowRight")
        assert page.locator(".panel:visible").get_attribute("id").startswith(part)
    page.keyboard.press("ArrowLeft")
    assert page.locator(".panel:visible").get_attribute("id") == "sis/vault"


def test_a_verdict_is_printed_on_two_pages(visit, report: Path) -> None:
    printed = visit(report).pdf(format="A4", prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 2
