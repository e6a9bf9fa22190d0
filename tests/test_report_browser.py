"""The report in a browser: it fits, its links and controls work, and it prints. Needs Chromium and playwright."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gspure.artifacts import write_record
from gspure.evaluation.contest import contest
from gspure.evaluation.survival import survival
from gspure.figures.viewer import write_viewer
from gspure.images import write_image
from gspure.report.page import write_report
from tests.test_report import PLANTED, VANILLA, draw_attacks, of_one_model, variant
from tests.test_viewer import evidence

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(not CHROMIUM, reason="Chromium is not installed")

WIDTHS = (1400, 1000, 420)
ROOM = "planted/room"
PIXELS = """(() => {
  const {width, height} = document.querySelector(".still");
  const {data} = document.querySelector(".still").getContext("2d").getImageData(0, 0, width, height);
  return [...new Uint32Array(data.buffer)];
})()"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    attacks = draw_attacks(folder, "gspure", "random_pruning")
    tradeoff = folder / "figures" / "planted" / "tradeoff.png"
    write_image(tradeoff, np.ones((900, 1360, 3)))
    write_record(tradeoff, inputs={}, settings={"caption": "What every attack removes and costs."})
    write_viewer(folder / ROOM / "figures" / "model" / "viewer.json", evidence(3000), np.eye(3))
    outcomes = of_one_model(*PLANTED, variant("clean", 30.0, 8.5)) + VANILLA
    write_report(
        folder / "report.html",
        outcomes,
        figures=[attacks, tradeoff],
        viewers=[folder / ROOM / "figures" / "model" / "viewer.json"],
        survivals=survival(outcomes),
        contests=contest(outcomes, {}),
    )
    return folder / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--enable-unsafe-swiftshader"])
        yield browser
        browser.close()


@pytest.fixture
def page(browser: Any, report: Path, request: pytest.FixtureRequest) -> Iterator[Any]:
    """The page, as wide as the test asks; no test may leave an error on the console."""
    width, scheme = getattr(request, "param", (1400, "light"))
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page, errors = context.new_page(), []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.set_default_timeout(5000)
    page.goto(report.as_uri())
    yield page
    context.close()
    assert not errors


def bottom(element: Any) -> float:
    box = element.bounding_box()
    return float(box["y"] + box["height"])


def unfold(page: Any) -> None:
    page.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
    page.locator(".viewer canvas").scroll_into_view_if_needed()
    page.locator(".viewer.started").wait_for()


def picture(page: Any) -> str:
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return str(page.evaluate("document.querySelector('canvas').toDataURL()"))


def test_verdict_pictures_and_tradeoff_are_on_the_first_screen(page: Any) -> None:
    assert page.locator(".verdict").count() == 2
    pictures, plot = page.locator(".evidence[open] .four img"), page.locator(".evidence[open] img.plot")
    assert pictures.count() == 4
    for shown in (page.locator(".verdict").last, pictures.last, plot):
        assert shown.is_visible()
        assert bottom(shown) < 900


@pytest.mark.parametrize("page", [(width, scheme) for width in WIDTHS for scheme in ("light", "dark")], indirect=True)
def test_nothing_is_cut_off(page: Any) -> None:
    unfold(page)
    width = page.viewport_size["width"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    for table in page.locator("table").all():
        box = table.bounding_box()
        assert 0 <= box["x"] < box["x"] + box["width"] <= width
    for toggle in page.locator(".toggle input").all():
        toggle.check()
    assert page.evaluate("document.documentElement.scrollWidth") <= width  # tables scroll, the page does not
    assert page.locator("th.more").first.is_visible()


def test_the_contents_lead_to_open_sections(page: Any) -> None:
    for link in page.locator("nav a").all():
        section = page.locator(f'[id="{link.get_attribute("href").removeprefix("#")}"]')
        assert not section.evaluate("section => section.open")
        link.click()
        assert section.evaluate("section => section.open")
        assert section.evaluate("section => section.getBoundingClientRect().top < innerHeight")


def test_a_link_from_elsewhere_opens_the_section_of_its_heading(browser: Any, report: Path) -> None:
    page = browser.new_page()
    page.goto(f"{report.as_uri()}#{ROOM}/metrics-of-every-variant")
    assert page.locator(f'[id="{ROOM}/metrics-of-every-variant"]').is_visible()
    page.close()


def test_the_slider_removes_points_and_weight(page: Any) -> None:
    unfold(page)
    before = picture(page)
    page.locator("[name=decision]").click()
    assert picture(page) != before
    pruned = evidence(3000).pruned
    assert page.locator("output[name=rows]").text_content() == f"{pruned.mean():.1%}"
    assert page.locator("output[name=message]").text_content() not in ("", "0.0%")
    page.locator("[name=cut]").fill("0")
    assert picture(page) == before


def test_colours_turning_and_zooming_change_the_picture(page: Any) -> None:
    unfold(page)
    pictures = [picture(page)]
    for label in page.locator(".viewer fieldset label").all()[1:]:
        label.click()
        pictures.append(picture(page))
    canvas = page.locator("canvas")
    for key in ("ArrowLeft", "ArrowUp", "+"):
        canvas.press(key)
        pictures.append(picture(page))
    assert len(set(pictures)) == len(pictures)


def test_a_click_on_a_point_names_its_cluster(page: Any) -> None:
    unfold(page)
    canvas = page.locator("canvas")
    box = canvas.bounding_box()
    seen = set()
    for step in range(40):
        canvas.click(position={"x": box["width"] / 2 + 3 * step, "y": box["height"] / 2})
        seen |= {text.inner_text() for text in page.locator(".picked:visible").all()}
    labels = evidence(3000).labels
    sizes = [f"{count:,}" for count in np.bincount(labels[labels >= 0])]
    assert any("a cluster of" in text and any(size in text for size in sizes) for text in seen)
    assert all("GSPure prunes it" in text or "GSPure keeps it" in text for text in seen)


def test_a_click_on_a_heading_sorts_the_table(page: Any) -> None:
    unfold(page)
    table = page.locator(f'[id="{ROOM}"] table').last
    heading = table.locator("th", has_text="message PSNR")
    for direction, ordered in (("descending", sorted), ("ascending", lambda v: sorted(v, reverse=True))):
        heading.locator("button").click()
        assert heading.get_attribute("aria-sort") == direction
        column = heading.evaluate("heading => heading.cellIndex")
        values = [
            float(text.split()[0]) for text in table.locator(f"tbody tr :nth-child({column + 1})").all_inner_texts()
        ]
        assert values == ordered(values)[::-1]


def test_a_swipe_uncovers_the_attack_that_is_chosen(page: Any) -> None:
    unfold(page)
    swipe = page.locator(".swipe").first
    before = swipe.screenshot()
    swipe.locator("input").fill("90")
    assert swipe.screenshot() != before
    page.locator(".tile[aria-pressed=false]").first.click()
    tile = page.locator(".tile[aria-pressed=true]")
    assert swipe.locator(".variant").text_content() == tile.get_attribute("data-variant") == "random pruning"
    assert swipe.locator(".after").get_attribute("src") == tile.locator("img").first.get_attribute("src")


def test_all_sections_are_printed(page: Any) -> None:
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("details.section:not([open])").count() == 0
    assert [canvas.get_attribute("class") for canvas in page.locator("canvas:visible").all()] == ["still"]
    assert len(set(page.evaluate(PIXELS))) > 1000
    assert not page.locator("nav").is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator("details.section[open]").count() == 0
    assert page.locator("canvas").count() == 1
    assert len(page.pdf()) > 20_000
