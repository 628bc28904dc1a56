"""Makes the pictures of the console, from a real server in a real browser.

    python docs/screenshots.py

writes ``docs/images/console-{light,dark,replay,tablet}.png``. Needs chromium and the development
extras.
"""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs/images"
MISSION = ROOT / "missions/maze-25-gates.yaml"
TOKEN = "for-the-pictures"


@contextmanager
def serving() -> Iterator[str]:
    """Run the mission live; yield the console's address."""
    command = [sys.executable, "-m", "oath.cli", "serve", str(MISSION), "--port", "0"]
    command += ["--token", TOKEN, "--speed", "5", "--seed", "7"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        match = re.match(r"console: (http://[^/]+)/", process.stdout.readline())
        assert match, "the server did not start"
        yield f"{match[1]}/?token={TOKEN}"
    finally:
        process.terminate()
        process.communicate()


def wait(page: Page, condition: str) -> None:
    """Wait until a condition holds on the page."""
    for _ in range(1200):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    raise TimeoutError(condition)


def run_until(page: Page, t: float) -> None:
    """Let the mission run until the clock shows `t` [s], and hold it there."""
    if page.evaluate("oath.world.clock.paused"):
        page.click("#hold")
    wait(page, f"oath.world.t >= {t}")
    page.click("#hold")
    wait(page, "oath.world.live.clock.paused")
    page.wait_for_timeout(700)


def say(page: Page, text: str, confirm: bool = True) -> None:
    """Say something, and confirm what comes of it."""
    page.fill("#say", text)
    page.keyboard.press("Enter")
    page.wait_for_selector(".card:not(.closed)")
    if confirm:
        page.keyboard.press("Control+Enter")
        page.wait_for_selector(".card:not(.closed)", state="detached")


def save(page: Page, name: str) -> None:
    """Write what the page shows."""
    page.mouse.move(0, 0)
    page.wait_for_timeout(300)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    path = IMAGES / f"console-{name}.png"
    picture.save(path, optimize=True)
    size = path.stat().st_size
    assert size < 300_000, f"{path} has {size} bytes"
    sys.stdout.write(f"{path.relative_to(ROOT)}: {size // 1000} kB\n")


def opened(browser: Browser, url: str, size: tuple[int, int], **options: Any) -> Page:
    """Open the console."""
    viewport = {"width": size[0], "height": size[1]}
    page = browser.new_context(viewport=viewport, **options).new_page()  # type: ignore[arg-type]
    page.goto(url)
    page.wait_for_selector('#link[data-status="live"]')
    return page


def main() -> None:
    """Make all pictures."""
    with serving() as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = opened(browser, url, (1440, 900), color_scheme="light")
        run_until(page, 12)
        say(page, "there is a wall from (7, 5) to (8, 5)")
        run_until(page, 31)
        say(page, "pick up a special task aa at (9, 8.5), deliver it to d", confirm=False)
        save(page, "light")
        page.keyboard.press("Control+Enter")
        page.keyboard.press("Escape")
        page.emulate_media(color_scheme="dark")
        run_until(page, 40)
        page.keyboard.press("2")
        page.click("#robots-table tbody tr:nth-child(3)")
        page.keyboard.press("0")
        save(page, "dark")
        page.emulate_media(color_scheme="light")
        page.keyboard.press("4")
        page.click("#scrub", position={"x": 420, "y": 40})
        wait(page, "Math.abs(oath.world.shown.t - oath.world.time) < 1")
        save(page, "replay")
        tablet = opened(browser, url, (834, 1112), color_scheme="dark", has_touch=True)
        tablet.tap("#tool-task")
        tablet.fill("#draw-pickup", "9 8.5")
        tablet.fill("#draw-delivery", "e")
        tablet.tap("#draw-propose")
        tablet.wait_for_selector(".card")
        save(tablet, "tablet")
        browser.close()


if __name__ == "__main__":
    main()
