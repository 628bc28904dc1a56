"""The console in a real browser: time to its first useful paint, and its frames with 200 robots.

    python bench/console.py [--robots 200] [--seconds 10] [--loads 5]

Starts mission servers of its own on loopback and a headless chromium, which paints in software. The
first useful paint is that of map and tables with the mission's state, from the start of the
navigation; every load has an empty cache. Frames are those that the map painted, with every robot
on the map; once as the console opens, once with all planned and driven ways.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
TOKEN = "for-the-measurement"

FRAMES = """async seconds => {
  const { map } = oath, gaps = [], begun = performance.now(), before = map.frames;
  let last = begun;
  await new Promise(done => {
    const frame = now => { gaps.push(now - last); last = now;
      if (now - begun < 1000 * seconds) requestAnimationFrame(frame); else done(); };
    requestAnimationFrame(frame);
  });
  const passed = (performance.now() - begun) / 1000;
  gaps.sort((a, b) => a - b);
  return { painted_per_second: (map.frames - before) / passed,
           gap_p95_ms: gaps[Math.floor(0.95 * gaps.length)] };
}"""


def fleet(robots: int, seed: int = 1) -> str:
    """A mission of many slow robots among 36 corners of wall, two tasks each."""
    rng = random.Random(seed)
    side, places = 60.0, {"a": [1, 1], "b": [59, 59], "c": [1, 59], "d": [59, 1]}
    corners = [(10 * i + 3, 10 * j + 3) for i in range(6) for j in range(6)]

    def free() -> list[float]:
        return [rng.randrange(int(side)) + 0.5, 10 * rng.randrange(6) + 1.0 + rng.random()]

    mission = {
        "schema": "oath/mission/1",
        "name": f"fleet-{robots}",
        "map": {
            "bounds": [0, 0, side, side],
            "walls": [[[x, y], [x + 4, y], [x + 4, y + 3]] for x, y in corners],
            "wall_thickness": 0.2,
        },
        "motions": {"ground": {}, "drone": {}},
        "places": places,
        "task_types": ["normal"],
        "robots": [
            {
                "id": f"r{i}",
                "start": [3 * (i % 20) + 1.5, 0.25 + 59.5 * (i // 20) / max(1, robots / 20)],
                "motion": "ground" if i % 3 else "drone",
                "can": ["normal"],
                "capacity": 2,
                "speed": 0.5,
                "radius": 0.15,
            }
            for i in range(robots)
        ],
        "tasks": [
            {"id": f"t{i}", "pickup": free(), "delivery": rng.choice("abcd"), "type": "normal"}
            for i in range(2 * robots)
        ],
    }
    return json.dumps(mission)  # which is YAML, too


@contextmanager
def serving(mission: Path) -> Iterator[str]:
    """Run a mission live; yield the console's address."""
    command = [sys.executable, "-m", "oath.cli", "serve", str(mission), "--port", "0"]
    command += ["--token", TOKEN, "--allocator", "greedy"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        match = re.match(r"console: (http://[^/]+)/", process.stdout.readline())
        assert match, "the server did not start"
        yield f"{match[1]}/?token={TOKEN}"
    finally:
        process.terminate()
        process.communicate()


def opened(browser: Browser, url: str) -> Page:
    """Open the console with an empty cache; wait until it is live and painted."""
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.goto(url)
    page.wait_for_selector('#link[data-status="live"]', timeout=60_000)
    page.wait_for_timeout(500)
    return page


def first_paints(browser: Browser, loads: int) -> list[float]:
    """Times from navigation to the first useful paint [ms]."""
    found = []
    with serving(ROOT / "missions/maze-25-gates.yaml") as url:
        for _ in range(loads):
            page = opened(browser, url)
            found.append(page.evaluate("performance.getEntriesByName('useful')[0].startTime"))
            page.context.close()
    return found


def frames(browser: Browser, robots: int, seconds: float) -> dict[str, Any]:
    """Frames per second of the map, plain and with all ways."""
    with tempfile.TemporaryDirectory() as folder:
        mission = Path(folder) / "fleet.yaml"
        mission.write_text(fleet(robots))
        with serving(mission) as url:
            page = opened(browser, url)
            page.wait_for_timeout(2000)
            plain = page.evaluate(FRAMES, seconds)
            for toggle in ("paths", "trails"):
                page.click(f"#show-{toggle}")
            return {"plain": plain, "with_ways": page.evaluate(FRAMES, seconds)}


def main() -> None:
    """Measure, and print one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--loads", type=int, default=5)
    chosen = parser.parse_args()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        paints = first_paints(browser, chosen.loads)
        result = {
            "first_useful_paint_ms": {"median": median(paints), "max": max(paints)},
            "robots": chosen.robots,
            "frames": frames(browser, chosen.robots, chosen.seconds),
        }
        browser.close()
    sys.stdout.write(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
