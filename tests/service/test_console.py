"""The console in a real browser, against a real server; and rules for its sources."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from service.servers import OPERATOR, VIEWER, Server, serving

CONSOLE = Path("src/oath/service/console")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
GATES = "missions/maze-25-gates.yaml"

in_browser = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")


class Console:
    """A page of a browser with the console on it, and everything it complained about."""

    def __init__(self, browser: Any, server: Server, **options: Any) -> None:
        context = browser.new_context(viewport={"width": 1440, "height": 900}, **options)
        context.set_default_timeout(30_000)
        self.page = context.new_page()
        self.server = server
        self.complaints: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._said)
        self.page.add_init_script(
            "addEventListener('securitypolicyviolation', e => console.error('CSP ' + e.blockedURI))"
        )

    def _said(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def open(self, token: str = OPERATOR) -> Any:
        """Open the console and wait until it is live."""
        self.page.goto(f"{self.server.url}/?token={token}")
        self.live()
        return self.page

    def live(self) -> None:
        """Wait for the connection."""
        self.page.wait_for_selector('#link[data-status="live"]')

    def until(self, condition: str, argument: Any = None) -> None:
        """Wait until a condition holds on the page; its policy forbids the page to evaluate it."""
        for _ in range(600):
            if self.page.evaluate(condition, argument):
                return
            self.page.wait_for_timeout(50)
        raise AssertionError(f"it never came to {condition}")

    def click_at(self, x: float, y: float) -> None:
        """Click the map at a point of the world [m]."""
        px, py = self.page.evaluate("([x, y]) => oath.map.camera.toScreen(x, y)", [x, y])
        self.page.click("#map", position={"x": px, "y": py})

    def confirm(self) -> None:
        """Confirm the proposal that waits, with the mouse."""
        self.page.click(".card:not(.closed) button.primary")
        self.page.wait_for_selector(".card.closed >> text=Confirmed")

    def row(self, table: str, key: str) -> Any:
        """A row of a table."""
        return self.page.locator(f'#{table}-table tr[data-key="{key}"]')


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        options = {"executable_path": CHROMIUM, "args": ["--no-sandbox"]}
        chromium = playwright.chromium.launch(**options)
        yield chromium
        chromium.close()


@pytest.fixture
def console(browser: Any) -> Iterator[Console]:
    with serving(GATES, "--speed", "2") as server:
        made = Console(browser, server)
        yield made
        made.page.context.close()
        assert made.complaints == []


@pytest.mark.slow
@in_browser
def test_robots_move_and_their_state_is_told(console: Console) -> None:
    page = console.open()
    before = page.evaluate("[...oath.world.poses]")
    console.until("old => oath.world.poses.some((v, i) => Math.abs(v - old[i]) > 1)", before)
    page.keyboard.press("2")
    assert page.locator("#robots-table tbody tr").count() == 4
    console.until("parseFloat(document.querySelector('#figure-driven').textContent) > 2")
    assert page.evaluate("performance.getEntriesByName('useful').length") == 1


@pytest.mark.slow
@in_browser
def test_tables_sort_and_filter(console: Console) -> None:
    page = console.open()
    first = page.locator("#tasks-table tbody tr").first
    page.click("#tasks-table th >> text=Task")
    assert first.get_attribute("data-key") == "bb"
    page.click("#tasks-table th >> text=Task")
    assert first.get_attribute("data-key") == "he"
    page.fill("#filter", "he")
    assert page.locator("#tasks-table tbody tr").count() == 1
    page.fill("#filter", "no such thing")
    page.wait_for_selector("text=Nothing matches the filter.")
    page.fill("#filter", "")
    page.click("#tab-events")
    page.select_option("#kinds", "mission")
    page.click("#events-table >> text=mission maze-25-gates starts")
    page.wait_for_selector("#past-banner:visible")


@pytest.mark.slow
@in_browser
def test_words_become_a_task(console: Console) -> None:
    page = console.open()
    page.fill("#say", "there is a special task aa at (5, 19.5), deliver it to c")
    page.keyboard.press("Enter")
    assert "aa" in page.inner_text(".card .says")
    assert console.row("tasks", "aa").count() == 0, "nothing happens before it is confirmed"
    console.confirm()
    console.row("tasks", "aa").wait_for()
    page.fill("#say", "there is a task somewhere")
    page.keyboard.press("Enter")
    page.wait_for_selector("#log .question")


@pytest.mark.slow
@in_browser
def test_a_drawn_task_changes_a_route(console: Console) -> None:
    page = console.open()
    page.click("#tool-task")
    console.click_at(9, 8.5)
    console.click_at(6, 3)
    assert page.input_value("#draw-pickup") == "9 8.5"
    assert page.input_value("#draw-delivery") == "b", "a click near a place means the place"
    page.click("#draw-propose")
    page.wait_for_selector(".card .effect li")
    console.confirm()
    console.row("tasks", "t1").wait_for()
    console.until("oath.world.live.robots.some(r => r.route.some(s => s.task === 't1'))")


@pytest.mark.slow
@in_browser
def test_a_drawn_obstacle_stands_on_the_map(console: Console) -> None:
    page = console.open()
    page.click("#tool-obstacle")
    for corner in ((8, 9.5), (9, 9.5), (9, 8.5)):
        console.click_at(*corner)
    console.click_at(8, 9.5)  # the first corner closes it
    console.confirm()
    page.keyboard.press("Escape")
    page.keyboard.press("3")
    console.row("obstacles", "wall-1").wait_for()
    console.row("obstacles", "wall-1").locator("button").click()
    console.confirm()
    console.row("obstacles", "wall-1").wait_for(state="detached")


@pytest.mark.slow
@in_browser
def test_the_map_moves_and_shows_more_on_demand(console: Console) -> None:
    page = console.open()
    scale = page.evaluate("oath.map.camera.scale")
    page.mouse.move(500, 400)
    page.mouse.wheel(0, -400)
    console.until("old => oath.map.camera.scale > old", scale)
    page.focus("#map")
    at = page.evaluate("oath.map.camera.x")
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("oath.map.camera.x") < at
    page.keyboard.press("r")
    page.keyboard.press("f")
    console.until(
        "() => { const { x } = oath.world.pose('robot1'); const { map } = oath;"
        " return map.follows && Math.abs(map.camera.toScreen(x, 0)[0]) < 1440; }"
    )
    assert page.get_attribute('#robots-table tr[data-key="robot1"]', "aria-selected") == "true"
    page.keyboard.press("g")
    page.wait_for_selector('#show-roadmap[aria-pressed="true"]')
    page.keyboard.press("0")
    assert page.evaluate("oath.map.camera.scale") == scale
    x, y = page.evaluate("oath.map.camera.toScreen(1, 1.5)")
    page.click("#map", position={"x": x, "y": y})
    assert console.row("tasks", "gb").get_attribute("aria-selected") == "true"


@pytest.mark.slow
@in_browser
def test_tables_ask_for_changes(console: Console) -> None:
    page = console.open()
    console.row("tasks", "ee").locator("select").select_option("high")
    assert "priority of task ee" in page.inner_text(".card:not(.closed) .says")
    console.confirm()
    page.wait_for_selector('#tasks-table tr[data-key="ee"] td.urgent')
    console.row("tasks", "ge").get_by_label("Cancel task ge").click()
    console.confirm()
    console.until("!oath.world.live.tasks.some(t => t.id === 'ge' && t.status !== 'done')")
    page.keyboard.press("Escape")
    page.keyboard.press("2")
    console.row("robots", "robot4").get_by_label("Pause robot4").click()
    console.row("robots", "robot4").get_by_text("paused").wait_for()
    console.row("robots", "robot4").get_by_label("Let robot4 go on").click()
    console.confirm()


@pytest.mark.slow
@in_browser
def test_the_past_is_marked_and_left_again(console: Console) -> None:
    page = console.open()
    console.until("oath.world.history.done.length > 0 && oath.world.history.last > 20")
    page.focus("#scrub")
    page.keyboard.press("Home")
    page.wait_for_selector("#past-banner >> text=You are looking at 0.0 s")
    console.until("oath.world.shown.seq === 0 || oath.world.shown.t === 0")
    assert page.locator("#tasks-table select:enabled").count() == 0, "the past cannot be changed"
    assert page.evaluate("oath.world.shown.tasks.every(t => t.status !== 'done')")
    page.keyboard.press("ArrowRight")
    page.wait_for_selector("#past-banner >> text=You are looking at 1.0 s")
    page.click("#to-live")
    page.wait_for_selector("#past-banner", state="hidden")
    assert page.evaluate("oath.world.shown === oath.world.live")


@pytest.mark.slow
@in_browser
def test_a_proposal_is_confirmed_with_keys_only(console: Console) -> None:
    page = console.open()
    page.keyboard.press("o")
    page.keyboard.type("8 9, 9 9")
    page.keyboard.press("Enter")
    card = page.locator(".card:not(.closed)")
    card.wait_for()
    page.keyboard.press("/")
    for _ in range(8):
        page.keyboard.press("Shift+Tab")
        if page.evaluate("document.activeElement.textContent") == "Confirm":
            break
    page.keyboard.press("Enter")
    page.wait_for_selector(".card.closed >> text=Confirmed")
    page.keyboard.press("Escape")
    page.keyboard.press("t")
    page.keyboard.type("9 8.5")
    page.keyboard.press("Tab")
    page.keyboard.type("6 3")
    page.keyboard.press("Enter")
    card.wait_for()
    page.keyboard.press("y")
    console.until("document.querySelectorAll('.card.closed').length === 2")


@pytest.mark.slow
@in_browser
def test_editing_and_rejecting_change_nothing(console: Console) -> None:
    page = console.open()
    page.click("#tool-obstacle")
    page.fill("#draw-corners", "8 9, 9 9")
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Edit").click()
    assert page.input_value("#draw-corners") == "8 9, 9 9"
    page.keyboard.press("Enter")
    page.locator(".card:not(.closed)").get_by_role("button", name="Reject").click()
    page.wait_for_selector(".card.closed >> text=Rejected")
    assert page.locator(".card:not(.closed)").count() == 0
    assert not any(o["source"] == "told" for o in console.server.get("/api/state")["obstacles"])


@pytest.mark.slow
@in_browser
def test_a_viewer_sees_and_changes_nothing(console: Console) -> None:
    page = console.open(VIEWER)
    console.row("tasks", "bb").wait_for()
    page.wait_for_selector("text=Viewer")
    for hidden in ("#chat-form", "#tool-obstacle", "#hold", "#finish", "#tasks-table td.act"):
        assert not page.locator(hidden).first.is_visible(), hidden
    page.keyboard.press("o")
    page.keyboard.press("Space")
    assert not page.locator("#draw").is_visible()


@pytest.mark.slow
@in_browser
def test_what_is_said_is_shown_as_it_is(console: Console) -> None:
    evil = '<img src=x onerror="alert(1)"> <b>bold</b>'
    page = console.open()
    page.fill("#say", evil)
    page.keyboard.press("Enter")
    assert page.inner_text("#log .you") == evil
    page.wait_for_selector("#log .oath:not(.wait)")
    assert page.locator("img, #log b").count() == 0


@pytest.mark.slow
@in_browser
def test_it_comes_back_after_the_server_was_killed(browser: Any, tmp_path: Path) -> None:
    options = ("--speed", "2", "--journal", str(tmp_path / "maze.journal"))
    with serving(GATES, *options) as first:
        console = Console(browser, first)
        page = console.open()
        console.server.command("aa", "add_task", location=[9, 8.5], delivery_point="b")
        console.row("tasks", "t1").wait_for()
        console.until("oath.world.history.last > 20")
        seen = page.evaluate("oath.world.history.last")
        page.evaluate("window.kept = true")
        first.process.kill()
        page.wait_for_selector("#lost-banner:visible")
        assert page.locator("#tasks-table select:enabled").count() == 0
        page.keyboard.press("2")
        console.row("robots", "robot1").get_by_text("lost").wait_for()
        page.keyboard.press("1")
        with serving(GATES, *options, "--port", str(first.port)):
            console.live()
            page.wait_for_selector("#lost-banner", state="hidden")
            console.until("seen => oath.world.history.last > seen + 10", seen)
            assert page.evaluate("window.kept"), "it resumed, it did not load anew"
            assert page.evaluate("oath.world.history.times.every(t => t !== undefined)")
            console.row("tasks", "t1").wait_for()
            page.reload()
            console.live()
            console.row("tasks", "t1").wait_for()
    page.context.close()
    mishaps = [text for text in console.complaints if "ERR_" not in text]
    assert mishaps == []


NAMELESS = """() => [...document.querySelectorAll('button, input, select, [role], table')]
  .filter(node => node.checkVisibility() && !node.closest('[aria-hidden=true]'))
  .filter(node => !['gridcell', 'alert', 'status', 'timer'].includes(node.role ?? ''))
  .filter(node => !(node.ariaLabel || node.textContent.trim() || node.labels?.length
    || node.getAttribute('aria-labelledby')))
  .map(node => node.outerHTML.slice(0, 80))"""

FAINT = """() => {
  const rgb = text => { const c = document.createElement('canvas').getContext('2d');
    c.fillStyle = text; c.fillRect(0, 0, 1, 1); return [...c.getImageData(0, 0, 1, 1).data]; };
  const light = ([r, g, b]) => [r, g, b].map(v => v / 255)
    .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = node => { for (; node; node = node.parentElement) {
      const colour = rgb(getComputedStyle(node).backgroundColor);
      if (colour[3] > 250) return colour; }
    return [255, 255, 255]; };
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), faint = [];
  while (walk.nextNode()) {
    const node = walk.currentNode.parentElement;
    if (!walk.currentNode.data.trim() || !node.checkVisibility()) continue;
    if (node.closest(':disabled, .unseen')) continue;
    const [a, b] = [light(rgb(getComputedStyle(node).color)), light(ground(node))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) faint.push(`${walk.currentNode.data.trim()}: ${ratio.toFixed(2)}`);
  }
  return faint;
}"""


@pytest.mark.slow
@in_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everything_has_a_name_and_can_be_read(browser: Any, scheme: str) -> None:
    with serving(GATES) as server:
        console = Console(browser, server, color_scheme=scheme, reduced_motion="reduce")
        page = console.open()
        console.row("tasks", "bb").click()
        page.click("#tool-task")
        page.fill("#draw-pickup", "9 8.5")
        page.fill("#draw-delivery", "b")
        page.keyboard.press("Enter")
        page.wait_for_selector(".card")
        for tab in ("tasks", "robots", "obstacles", "events"):
            page.click(f"#tab-{tab}")
            assert page.evaluate(NAMELESS) == []
            assert page.evaluate(FAINT) == []
        page.click("#help-button")
        assert page.evaluate(FAINT) == []
        page.keyboard.press("Escape")
        roles = ("tab", "tabpanel", "grid", "log", "slider", "toolbar", "application")
        for role in roles:
            assert page.get_by_role(role).count() > 0, role  # type: ignore[arg-type]
        assert page.get_attribute("#log", "aria-live") == "polite"
        page.context.close()
        assert console.complaints == []


# -- rules for the sources


def sources() -> list[Path]:
    return sorted(CONSOLE.glob("*.js"))


@pytest.mark.parametrize("path", sources(), ids=lambda path: path.name)
def test_text_never_becomes_markup(path: Path) -> None:
    text = path.read_text()
    for sink in (
        "innerHTML",
        "outerHTML",
        "insertAdjacentHTML",
        "document.write",
        "eval(",
        "srcdoc",
    ):
        assert sink not in text
    assert len(text.splitlines()) <= 500


def test_the_page_has_no_script_or_style_of_its_own() -> None:
    page = (CONSOLE / "index.html").read_text()
    assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\sstyle=|\son\w+=", page)


def test_every_module_is_loaded_at_once() -> None:
    page = (CONSOLE / "index.html").read_text()
    named = set(re.findall(r"/static/(\w+\.js)", page))
    assert named == {path.name for path in sources()}


def test_modules_import_modules_that_are_there() -> None:
    for path in sources():
        for other in re.findall(r'from "\./([\w.]+)"', path.read_text()):
            assert (CONSOLE / other).is_file(), f"{path.name} imports {other}"
