"""The pages in a browser: report, 3-D view and leaderboard answer to mouse and keys, at any width, without errors."""

import io
import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gspure.cameras import orbit_cameras
from gspure.evaluation.plan import Plan
from gspure.figures import style
from gspure.files import write_json
from gspure.public_model import PublicModel
from gspure.report.writing import write_report
from gspure.viewer.data import view_of, write_viewer
from gspure.viewer.page import write_view
from tests import contest_cases
from tests.documentation import ROOT
from tests.models import blobs
from tests.test_site import site
from tests.test_viewer import purified

ATTACKS = {"gspure": (0.055, 0.55), "noise": (0.2, 0.02), "noise@2dB": (0.1, 0.3), "lowest_opacity_matched": (0.3, 0.3)}
WIDTHS = (1400, 900, 420)
PANEL = ".panel:not([hidden])"
PAGES = ("report", "view", "leaderboard")

CLIPPED = """() => [...document.querySelectorAll("body *")].filter(part =>
  part.scrollWidth > part.clientWidth + 1 && part.clientWidth && !part.matches(".stage")
  && ["hidden", "clip"].includes(getComputedStyle(part).overflowX)).map(part => part.outerHTML.slice(0, 80))"""
SIDEWAYS = "() => document.documentElement.scrollWidth - innerWidth"
CUT_TABLES = """() => [...document.querySelectorAll(".panel:not([hidden]) .scroll:has(.attacks, .table *)")]
  .filter(box => box.scrollWidth > box.clientWidth).length"""
STOPS = """() => [...document.querySelectorAll("a[href], button, select, summary, canvas, input")]
  .filter(part => part.checkVisibility() && (part.type !== "radio" || part.checked))"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, Path]:
    """A report of two models whose pictures are higher than wide, a view of two models, and the leaderboard's table."""
    folder = tmp_path_factory.mktemp("pages")
    upright = contest_cases.photograph
    shown = purified(600)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "DPI", 60)
        patch.setattr(contest_cases, "photograph", lambda view, target: np.swapaxes(upright(view, target), 0, 1))
        plans = [contest_cases.write_model(folder / "results", name, ATTACKS) for name in ("sis/room", "sis/vault")]
        for plan in plans:
            drawn = folder / "results" / plan.id.name / "figures" / "model"
            write_viewer(drawn / "view.json", shown, orbit_cameras(shown.public.model, count=9))
        write_json(folder / "results" / "configuration.json", {})
        write_report(folder / "results", Plan(tuple(plans), meanings={"gspure": "What it does."}))
    models = {f"{count}.ply": PublicModel(blobs(count)) for count in (60, 10)}
    write_view(folder / "view.html", view_of(models, orbit_cameras(blobs(60), count=9)))
    parts = {part: (ROOT / "docs" / "site" / part).read_text() for part in ("style.css", "sort.js")}
    table = re.search(r"<table.*?</table>", site.leaderboard_page(), re.DOTALL)
    body = f'<body style="overflow-x: auto">{table[0]}<script>{parts["sort.js"]}</script>'
    (folder / "leaderboard.html").write_text(f"<!doctype html><style>{parts['style.css']}</style>{body}")
    files = (folder / "results" / "report.html", folder / "view.html", folder / "leaderboard.html")
    return dict(zip(PAGES, files, strict=True))


def drawn(page, differs_from: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
    """Return the pixels of the canvas once they are not of one colour and differ from others."""
    from PIL import Image

    end = time.monotonic() + 5
    bare = ".stage :not(canvas) { visibility: hidden }"
    while True:
        shot = page.locator("canvas:visible").screenshot(style=bare, animations="allow")
        pixels = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"))
        is_new = differs_from is None or pixels.shape != differs_from.shape or np.any(pixels != differs_from)
        if is_new and np.ptp(pixels[5:-5, 5:-5]) > 50:
            return pixels
        assert time.monotonic() < end, "the canvas is empty, or does not change"


def changes(page, *acts: Callable[[], object]) -> None:
    """Assert that each act changes the picture."""
    before = drawn(page)
    for act in acts:
        act()
        before = drawn(page, differs_from=before)


def column(page, table: str, number: int) -> list[str]:
    return page.locator(f"{PANEL} {table} tbody tr > :nth-child({number + 1})").all_inner_texts()


def number_of(text: str) -> float:
    return float(re.sub(r"[^\d.-]", "", text.replace("−", "-").split()[0]))


@pytest.mark.parametrize("width", WIDTHS)
def test_every_part_of_the_report_opens_and_nothing_is_clipped(visit, pages, width: int) -> None:
    page = visit(pages["report"], width)
    links = page.locator(f"{PANEL} nav a").evaluate_all("links => links.map(link => link.hash.slice(1))")
    assert len(links) == 5
    for link in links:
        page.locator(f"{PANEL} nav a[href='#{link}']").click()
        page.locator(f"[id='{link}']").wait_for()
        assert page.locator(".panel:visible").count() == 1
        assert (page.evaluate(CUT_TABLES), page.evaluate(SIDEWAYS)) == (0, 0), link
        for toggle in page.locator(f"{PANEL} .toggle").all():
            toggle.click()
        assert (page.evaluate(CLIPPED), page.evaluate(SIDEWAYS)) == ([], 0), link


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", ["view", "leaderboard"])
def test_nothing_is_clipped(visit, pages, name: str, width: int) -> None:
    page = visit(pages[name], width)
    assert page.evaluate(CLIPPED) == []
    if name == "view":
        assert page.evaluate(SIDEWAYS) == 0


def test_every_attack_shows_its_pictures_in_straight_rows(visit, pages) -> None:
    page = visit(pages["report"])
    attacks = page.locator(".attacks tbody tr")
    assert attacks.count() == len(ATTACKS) == page.locator(".attacks [data-variant]").count()
    assert attacks.last.bounding_box()["y"] < 900  # on the first screen
    for button in page.locator(".attacks [data-variant]").all():
        button.click()
        name = button.get_attribute("data-variant")
        assert page.locator(f".pictures > [data-variant='{name}']").is_visible()
        boxes = [image.bounding_box() for image in page.locator(".pictures img:visible").all()]
        assert len(boxes) == 6
        assert len({box["y"] for box in boxes}) == 2, name
        assert min(box["height"] for box in boxes) > 60


def test_each_model_has_its_row_in_the_matrix_and_the_shown_one_is_named(visit, pages) -> None:
    page = visit(pages["report"])
    gspure = column(page, ".attacks", 0).index("GSPure")
    for scene in ("room", "vault"):
        row = page.locator(".matrix tr", has_text=scene)
        verdicts = row.locator("td b").all_inner_texts()
        assert (len(verdicts), verdicts[gspure]) == (len(ATTACKS), "lost")
        assert set(verdicts) == {"lost", "survives"}
    assert "model room" in page.locator(".screen .note").first.inner_text()
    page.locator(".matrix a", has_text="vault").click()
    page.locator("[id='sis/vault']").wait_for()


def test_tables_are_sorted_by_a_click_and_begin_in_the_order_of_the_verdict(visit, pages) -> None:
    page = visit(pages["report"])
    names = column(page, ".attacks", 0)
    page.get_by_role("link", name="Attacks compared").first.click()
    page.locator("[id^=compare]").first.wait_for()
    survival = "section:first-child > .table"
    assert [name.removesuffix(" †") for name in column(page, survival, 0)] == ["unattacked", *names]
    for number in (1, 2):
        title = page.locator(f"{PANEL} {survival} thead button").nth(number)
        orders = []
        for _ in range(2):
            title.click()
            orders.append([number_of(text) for text in column(page, survival, number)])
        assert orders == [sorted(orders[0]), sorted(orders[0], reverse=True)]
        assert orders[0] != orders[1]
    page = visit(pages["leaderboard"])
    keys = "cells => cells.map(cell => Number(cell.dataset.sort))"
    orders = []
    for _ in range(2):
        page.locator("th").nth(2).click()
        orders.append(page.locator("td:nth-child(3)").evaluate_all(keys))
    assert orders == [sorted(orders[0]), sorted(orders[0], reverse=True)]


def test_the_view_of_a_report_turns_prunes_and_changes_its_camera(visit, pages) -> None:
    page = visit(pages["report"])
    canvas, menu, cut = (page.locator(f"{PANEL} {name}") for name in ("canvas", "[name=camera]", "[name=cut]"))
    assert menu.locator("option").all_inner_texts()[-1] == "overview"
    first = drawn(page)
    changes(
        page,
        lambda: menu.select_option("1"),
        lambda: canvas.press("ArrowRight"),
        lambda: canvas.press("+"),
        lambda: drag(page, canvas, 0.5, 0.6),
        page.locator(f"{PANEL} .tools label", has_text="clusters").click,
        page.get_by_text("GSPure prunes").first.click,
    )
    assert page.locator("output[name=rows]").first.inner_text() in page.get_by_text("GSPure prunes").first.inner_text()
    cut.fill("0")
    page.locator(f"{PANEL} .tools label", has_text="scene").click()
    menu.select_option("0")
    page.get_by_role("button", name="reset").first.click()
    assert np.array_equal(drawn(page), first)


def drag(page, part, start: float, end: float) -> None:
    """Drag horizontally, between shares of the width of a part of the page."""
    box = part.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + start * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + end * box["width"], y, steps=4)
    page.mouse.up()


def test_the_divider_of_two_models_is_dragged(visit, pages) -> None:
    page = visit(pages["view"])
    changes(
        page,
        lambda: drag(page, page.locator("canvas"), 0.5, 0.3),
        lambda: page.locator("[name=camera]").select_option("1"),
        lambda: drag(page, page.locator("canvas"), 0.8, 0.9),
    )
    assert float(page.locator("[name=divider]").input_value()) == pytest.approx(30, abs=2)


def test_tab_reaches_every_stop_and_arrow_keys_lead_from_part_to_part(visit, pages) -> None:
    page = visit(pages["report"])
    page.evaluate(f"() => {{ window.missed = new Set(({STOPS})()); }}")
    for _ in range(page.evaluate("() => missed.size") + 10):
        page.keyboard.press("Tab")
        page.evaluate("() => missed.delete(document.activeElement)")
    assert page.evaluate("() => [...missed].map(part => part.outerHTML)") == []
    page.locator(f"{PANEL} nav a").first.focus()
    for part in ("compare", "sis/room", "sis/vault", "limits"):
        page.keyboard.press("ArrowRight")
        assert page.locator(".panel:visible").get_attribute("id").startswith(part)
    page.keyboard.press("ArrowLeft")
    assert page.locator(".panel:visible").get_attribute("id") == "sis/vault"


def test_a_verdict_is_printed_on_two_pages(visit, pages) -> None:
    printed = visit(pages["report"]).pdf(format="A4", prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 2
