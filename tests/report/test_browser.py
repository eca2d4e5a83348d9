"""The report in a real browser: it filters, hovers, turns and steps, asks no network, and fits phone and laptop."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING, Any

import pytest

from tests.report.conftest import COLOR, CUT, DEPTH

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page

sync_api = pytest.importorskip("playwright.sync_api", reason="driving a browser needs playwright")

CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine: apt-get install chromium"),
]

FLAGS = [
    *("--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
]
PHONE, LAPTOP = {"width": 360, "height": 740}, {"width": 1400, "height": 900}
PATIENCE_MS = 30_000


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_api.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield started
        started.close()


@pytest.fixture
def visit(browser: Browser, reported: Path) -> Iterator[Callable[..., Page]]:
    """Open a page of the report; at the end, nothing was said on the console, and nothing but files was asked for."""
    said: list[str] = []
    asked: list[str] = []
    contexts = []

    def opened(name: str, size: dict[str, int] | None = None, **more: Any) -> Page:
        context = browser.new_context(viewport=size or LAPTOP, offline=True, **more)  # type: ignore[arg-type]
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto((reported / "report" / name).as_uri())
        return page

    yield opened
    for context in contexts:
        context.close()
    assert said == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def recording(name: str) -> str:
    return f"recordings/{name}.html"


def shown(page: Page, table: str) -> int:
    count: int = page.locator(f"#{table} tbody tr:visible").count()
    return count


def camera(page: Page) -> Any:
    return page.evaluate("document.getElementById('cloud-plot')._fullLayout.scene.camera.eye")


def wait_for_plots(page: Page) -> None:
    page.wait_for_selector("#curves-plot .main-svg")
    page.wait_for_function("document.querySelector('#cloud-plot canvas') !== null")


def test_filters_work_while_typing(visit: Callable[..., Page]) -> None:
    page = visit("index.html")
    everything = shown(page, "recordings-table")
    assert everything == 6
    search = page.get_by_label("Filter", exact=True).first
    search.press_sequentially("ruler gr")
    assert 0 < shown(page, "recordings-table") < everything
    assert page.locator("[data-count=recordings]").inner_text() == f"{shown(page, 'recordings-table')} of 6 recordings"
    search.press_sequentially("een 01")
    assert shown(page, "recordings-table") == 1
    page.get_by_role("button", name="Clear").first.click()
    page.wait_for_function("document.querySelector('[data-count=recordings]').textContent.startsWith('6')")
    page.locator("[data-key=there]").select_option("present")
    assert shown(page, "recordings-table") == 5
    page.locator("[data-key=results]").select_option("failed")
    assert shown(page, "recordings-table") == 2
    page.locator("form[data-filters=findings-table] [data-key=source]").select_option("check")
    assert 0 < shown(page, "findings-table") < page.locator("#findings-table tbody tr").count()


def test_curves_say_value_and_unit_under_the_mouse(visit: Callable[..., Page]) -> None:
    page = visit(recording(DEPTH))
    wait_for_plots(page)
    page.locator("#curves-plot").scroll_into_view_if_needed()
    line = page.locator("#curves-plot .scatterlayer .trace.scatter path.js-line").last
    box = line.bounding_box()
    assert box is not None
    for share in range(5, 100, 5):
        page.mouse.move(box["x"] + box["width"] / 2 + share / 20, box["y"] + box["height"] * share / 100)
        page.wait_for_timeout(120)  # what is hovered is looked for a few times a second
        if page.locator("#curves-plot .hovertext").count():
            break
    text = page.locator("#curves-plot .hovertext").first.text_content() or ""
    assert " m" in text
    assert " s" in text
    assert "point" in text or "gripper" in text


def test_another_quantity_and_bands_are_chosen(visit: Callable[..., Page]) -> None:
    page = visit(recording(DEPTH))
    wait_for_plots(page)
    traces = "document.getElementById('curves-plot').data.length"
    with_bands = page.evaluate(traces)
    page.get_by_label("bands of two standard uncertainties").uncheck()
    assert page.evaluate(traces) == with_bands / 2 == 6
    page.get_by_label("Quantity").select_option(label="velocity forward, vz [m/s]")
    title = page.evaluate("document.getElementById('curves-plot').layout.yaxis.title.text")
    assert title == "velocity forward, vz [m/s]"
    assert "kinematics.vz_m_s" in page.locator("#quantity-described").inner_text()


def test_the_view_in_space_turns_and_steps(visit: Callable[..., Page]) -> None:
    page = visit(recording(DEPTH))
    wait_for_plots(page)
    place = page.locator("#cloud-plot")
    place.scroll_into_view_if_needed()
    box = place.bounding_box()
    assert box is not None
    before = camera(page)
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 120, box["y"] + box["height"] / 2, steps=6)
    page.mouse.up()
    page.wait_for_function(
        "before => JSON.stringify(document.getElementById('cloud-plot')._fullLayout.scene.camera.eye)"
        " !== JSON.stringify(before)",
        arg=before,
    )
    turned = camera(page)
    said = page.locator("#cloud-said").inner_text()
    page.get_by_role("button", name="Next frame in space").click()
    assert page.locator("#cloud-said").inner_text() != said
    page.wait_for_timeout(300)
    assert camera(page) == pytest.approx(turned)  # a step does not turn it back
    page.get_by_role("button", name="Turn right").click()
    page.wait_for_function(
        "turned => Math.abs(document.getElementById('cloud-plot')._fullLayout.scene.camera.eye.x - turned.x) > 0.01",
        arg=turned,
    )


def test_the_loop_steps_and_pauses_and_rests_for_who_wants_less_motion(visit: Callable[..., Page]) -> None:
    page = visit(recording(DEPTH), reduced_motion="reduce")
    player = page.locator("#player")
    player.scroll_into_view_if_needed()
    picture = player.locator("img[data-stream=color]")  # depth is the same in all frames at rest
    first = picture.get_attribute("src")
    page.wait_for_timeout(500)
    assert picture.get_attribute("src") == first
    player.get_by_role("button", name="Next frame").click()
    assert picture.get_attribute("src") != first
    assert page.evaluate("document.querySelector('#player img').naturalWidth") > 100
    player.get_by_role("button", name="Play").click()
    second = picture.get_attribute("src")
    page.wait_for_function("src => document.querySelector('#player [data-stream=color]').src !== src", arg=second)
    player.get_by_role("button", name="Pause").click()
    paused = picture.get_attribute("src")
    page.wait_for_timeout(400)
    assert picture.get_attribute("src") == paused
    moving = visit(recording(COLOR))
    moving.locator("#player").scroll_into_view_if_needed()
    moving.locator("#player").get_by_role("button", name="Pause").wait_for()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [PHONE, LAPTOP], ids=["360", "1400"])
def test_pages_are_as_wide_as_the_screen(visit: Callable[..., Page], size: dict[str, int], scheme: str) -> None:
    for name in ("index.html", recording(DEPTH), recording(COLOR), recording(CUT)):
        page = visit(name, size, color_scheme=scheme, reduced_motion="reduce")
        page.wait_for_load_state("load")
        if name == recording(DEPTH):
            wait_for_plots(page)
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= size["width"], name


def contrast(page: Page) -> float:
    """Return the least contrast of a text to what is behind it, as WCAG 2 has it."""
    least: float = page.evaluate("""() => {
        const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
        const light = ([r, g, b]) => {
            const [x, y, z] = [r, g, b].map((v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
            return 0.2126 * x + 0.7152 * y + 0.0722 * z;
        };
        const behind = (element) => {
            for (let each = element; each; each = each.parentElement) {
                const [r, g, b, a = 1] = rgb(getComputedStyle(each).backgroundColor);
                if (a > 0) return [r, g, b];
            }
            return [255, 255, 255];
        };
        let least = 21;
        const texts = "p, td, th, dt, dd, a, li, span.chip, summary, label, button, caption";
        for (const element of document.querySelectorAll(texts)) {
            if (!element.textContent.trim() || !element.offsetParent) continue;
            const pair = [light(rgb(getComputedStyle(element).color)), light(behind(element))].sort((a, b) => b - a);
            least = Math.min(least, (pair[0] + 0.05) / (pair[1] + 0.05));
        }
        return least;
    }""")
    return least


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_and_everything_can_be_reached_by_keyboard(visit: Callable[..., Page], scheme: str) -> None:
    for name in ("index.html", recording(DEPTH), recording(CUT)):
        page = visit(name, color_scheme=scheme, reduced_motion="reduce")
        assert contrast(page) >= 4.5, name
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "main"


def test_keys_step_through_frames(visit: Callable[..., Page]) -> None:
    page = visit(recording(DEPTH), reduced_motion="reduce")
    wait_for_plots(page)
    slider = page.locator("#player [data-frame]")
    slider.focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert slider.input_value() == "2"
    assert "seconds" in (slider.get_attribute("aria-valuetext") or "")
