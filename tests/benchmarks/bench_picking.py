"""The picking page in a real browser without a GPU: how soon, how smooth, how large.

python tests/benchmarks/bench_picking.py [MEGAPIXELS [PHOTOS]]

Prints each figure beside its bar; exit status 1 where one is missed. Wants a quiet machine.
"""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from large_photos import write_large_project
from playwright.sync_api import (
    Browser,
    Page,
    Playwright,
    ViewportSize,
    expect,
    sync_playwright,
)

WINDOW: ViewportSize = {"width": 1500, "height": 860}
OPENINGS = 3

WATCH_ANSWERS = """() => {
  // From the pointer's move that a change carries, to the frame in which its numbers are painted.
  window.latencies = [];
  let moved = 0;
  const asked = new Map(), versions = [];
  addEventListener('pointermove', () => { moved = performance.now(); }, true);
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (text) {
    const message = JSON.parse(text);
    if (message.t === 'place') asked.set(message.seq, moved);
    if (!this.watched) {
      this.watched = true;
      this.addEventListener('message', ({data}) => {
        const said = JSON.parse(data);
        const from = asked.get(said.seq);
        if (said.t === 'changed' && from) versions.push([said.version, from]);
        if (said.t !== 'live') return;
        while (versions.length && versions[0][0] <= said.for) {
          const [version, from] = versions.shift();
          if (version !== said.for) continue;
          requestAnimationFrame(() => setTimeout(() => latencies.push(performance.now() - from)));
        }
      });
    }
    send.call(this, text);
  };
}"""
WATCH_FRAMES = """() => {
  window.frames_ms = [];
  let last = performance.now();
  const next = (now) => { frames_ms.push(now - last); last = now; requestAnimationFrame(next); };
  requestAnimationFrame(next);
}"""
# When the picture is there, and when it is sharp: seconds after the address was opened.
WATCH_PICTURE = """() => {
  window.seen = {};
  const look = () => {
    const {pictured, sharp} = document.querySelector('.pane')?.dataset ?? {};
    // Painted by the second frame after it was drawn.
    const note = (name) => requestAnimationFrame(() => requestAnimationFrame(() => {
      seen[name] ??= performance.now() / 1000;
    }));
    if (pictured === 'true' && !seen.askedPictured) { seen.askedPictured = 1; note('pictured'); }
    if (sharp === 'true') { note('sharp'); return; }
    requestAnimationFrame(look);
  };
  look();
}"""


@dataclass
class Report:
    """Figures beside their bars."""

    missed: list[str] = field(default_factory=list)

    def say(self, what: str, value: float, bar: float, unit: str, *, least: bool = False) -> None:
        holds = value >= bar if least else value <= bar
        sign = ">=" if least else "<="
        word = "holds" if holds else "MISSED"
        print(f"{what:58s} {value:8.2f} {unit:4s} bar {sign} {bar:g}  {word}", flush=True)
        if not holds:
            self.missed.append(what)


def start(project: Path) -> tuple[subprocess.Popen[str], str]:
    command = [sys.executable, "-m", "uavgram", "pick", str(project), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    found = re.search(r"http://\S+", process.stdout.readline())
    assert found is not None
    return process, found.group()


def stop(server: subprocess.Popen[str]) -> None:
    server.terminate()
    server.wait(20)


def chromium(driver: Playwright) -> Browser:
    return driver.chromium.launch(
        executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
    )


def children_of(process: int) -> list[int]:
    found = Path(f"/proc/{process}/task").glob("*/children")
    return [int(child) for path in found for child in path.read_text().split()]


def pss_mb(process: int) -> float:
    """Proportional share of memory of a process and its children [MB]."""
    try:
        text = Path(f"/proc/{process}/smaps_rollup").read_text()
        children = children_of(process)
    except OSError:  # it ended meanwhile
        return 0.0
    own = re.search(r"Pss:\s+(\d+)", text)
    return int(own.group(1)) / 1024 + sum(map(pss_mb, children)) if own else 0.0


class Watch:
    """The greatest memory that a process and its children took, looked at again and again."""

    def __init__(self, take_mb: Callable[[], float], every_s: float) -> None:
        self.most_mb = 0.0
        self._take_mb, self._every_s = take_mb, every_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def _look(self) -> None:
        while not self._ended.wait(self._every_s):
            self.most_mb = max(self.most_mb, self._take_mb())

    def end(self) -> float:
        self._ended.set()
        self._thread.join()
        return self.most_mb


def watched_opening(page: Page, address: str) -> dict[str, float]:
    page.add_init_script(f"addEventListener('DOMContentLoaded', {WATCH_PICTURE})")
    page.goto(address)
    expect(page.locator(".pane")).to_have_attribute("data-sharp", "true", timeout=60_000)
    page.wait_for_timeout(200)
    seen: dict[str, float] = page.evaluate("seen")
    return seen


def openings(driver: Playwright, project: Path, report: Report) -> None:
    """Server and browser started anew each time: nothing is decoded, nothing is in a cache."""
    up, picture, sharp, cold = [], [], [], []
    for _ in range(OPENINGS):
        begun = time.perf_counter()
        server, address = start(project)
        up.append(time.perf_counter() - begun)
        browser = chromium(driver)
        opened = time.perf_counter()
        seen = watched_opening(browser.new_page(viewport=WINDOW), address)
        picture.append(seen["pictured"])
        sharp.append(seen["sharp"])
        cold.append(opened - begun + seen["pictured"])
        browser.close()
        stop(server)
    print(f"server up in {statistics.median(up):.2f} s; with the browser's start and the picture")
    print(f"  {statistics.median(cold):.2f} s (medians of {OPENINGS}, everything anew)")
    report.say("first picture after the address is opened", statistics.median(picture), 2.0, "s")
    report.say("sharp after the address is opened", statistics.median(sharp), 4.0, "s")


def frames_while(page: Page) -> list[float]:
    page.evaluate(WATCH_FRAMES)
    box = page.locator(".pane").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    for k in range(60):
        page.mouse.wheel(0, -90 if k < 30 else 90)
        page.wait_for_timeout(16)
    page.mouse.down(button="right")
    for k in range(60):
        page.mouse.move(x + 200 * (k % 20) / 20, y + 4 * k)
        page.wait_for_timeout(16)
    page.mouse.up(button="right")
    frames_ms: list[float] = page.evaluate("frames_ms.slice(5)")
    return frames_ms


def side_by_side(page: Page) -> None:
    """Both photos at pixels of their own: both must be decoded."""
    page.keyboard.press("Control+2")
    for pane in page.locator(".pane").all():
        expect(pane).to_have_attribute("data-sharp", "true", timeout=60_000)
        box = pane.bounding_box()
        assert box is not None
        # Not where it was zoomed before: the browser has those tiles.
        page.mouse.move(box["x"] + box["width"] / 4, box["y"] + box["height"] / 2)
        for _ in range(20):
            page.mouse.wheel(0, -90)
        expect(pane).to_have_attribute("data-sharp", "true", timeout=60_000)
    page.wait_for_timeout(1000)


def drag_latencies(page: Page) -> list[float]:
    mark = page.locator('.mark[data-label="P7"]')
    x, y = (float(part) for part in re.findall(r"[-\d.]+", mark.get_attribute("transform") or ""))
    box = page.locator(".pane svg.marks").bounding_box()
    assert box is not None
    x, y = x + box["x"], y + box["y"]
    page.evaluate(WATCH_ANSWERS)
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(150):
        page.mouse.move(x + k / 6, y + (k % 10) / 3)
        page.wait_for_timeout(20)
    during: list[float] = page.evaluate("latencies.slice()")
    page.mouse.up()
    return during


def work(driver: Playwright, project: Path, report: Report) -> None:
    """A session: zooming, dragging, the second photo; with the memory that it takes."""
    others = set(children_of(os.getpid()))
    server, address = start(project)
    drivers = others - {server.pid}
    browser = chromium(driver)

    def browser_mb() -> float:
        return sum(pss_mb(child) for one in drivers for child in children_of(one))

    def server_mb() -> float:
        return pss_mb(server.pid)

    watches = Watch(server_mb, 0.1), Watch(browser_mb, 0.5)
    page = browser.new_page(viewport=WINDOW)
    watched_opening(page, address)
    expect(page.locator("#mode")).to_have_attribute("data-mode", "adjusted", timeout=60_000)
    print("full adjustment:", page.locator("#mode").inner_text())
    frames = frames_while(page)
    rate = 1000 / statistics.median(frames)
    report.say("zoom and pan, median", rate, 50.0, "fps", least=True)
    print(f"  95 % of its frames within {statistics.quantiles(frames, n=20)[18]:.0f} ms")
    page.keyboard.press("f")
    page.wait_for_timeout(500)
    late = drag_latencies(page)
    print(f"drag of one of 200 marks: {len(late)} answers before the button is up,")
    print(f"  median {statistics.median(late):.0f} ms")
    report.say(
        "change to new numbers on the screen, 95th percentile",
        statistics.quantiles(late, n=20)[18],
        100.0,
        "ms",
    )
    page.locator('#strip [data-image="1"]').click()
    page.wait_for_timeout(500)
    expect(page.locator(".pane")).to_have_attribute("data-sharp", "true", timeout=60_000)
    frames_while(page)
    page.wait_for_timeout(1000)
    server_most_mb, browser_most_mb = (watch.end() for watch in watches)
    report.say("server, two photos, most at any moment", server_most_mb, 500.0, "MB")
    report.say("browser, two photos, most at any moment", browser_most_mb, 600.0, "MB")
    watch = Watch(server_mb, 0.1)
    side_by_side(page)
    report.say("server, both zoomed side by side, at any moment", watch.end(), 500.0, "MB")
    browser.close()
    stop(server)


def main() -> int:
    megapixels = float(sys.argv[1]) if len(sys.argv) > 1 else 48.0
    width = round((megapixels * 1e6 * 4 / 3) ** 0.5)
    photos = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    load = f"load before {os.getloadavg()[0]:.1f} on {os.cpu_count()}"
    print(f"{photos} photos of {megapixels:g} megapixels, {load}")
    report = Report()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        project = write_large_project(Path(folder), width, round(width * 3 / 4), photos=photos)
        openings(driver, project, report)
        work(driver, project, report)
    print("all hold" if not report.missed else f"missed: {'; '.join(report.missed)}")
    return 1 if report.missed else 0


if __name__ == "__main__":
    sys.exit(main())
