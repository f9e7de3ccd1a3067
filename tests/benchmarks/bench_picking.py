"""The picking page in a real browser without a GPU: how soon, how smooth, how large.

python tests/benchmarks/bench_picking.py [MEGAPIXELS]
"""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from large_photos import write_large_project
from playwright.sync_api import Page, expect, sync_playwright

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


def start(project: Path) -> tuple[subprocess.Popen[str], str]:
    command = [sys.executable, "-m", "uavgram", "pick", str(project), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    found = re.search(r"http://\S+", process.stdout.readline())
    assert found is not None
    return process, found.group()


def children_of(process: int) -> list[int]:
    found = Path(f"/proc/{process}/task").glob("*/children")
    return [int(child) for path in found for child in path.read_text().split()]


def pss_mb(process: int) -> float:
    """Proportional share of memory of a process and its children [MB]."""
    own = re.search(r"Pss:\s+(\d+)", Path(f"/proc/{process}/smaps_rollup").read_text())
    return int(own.group(1)) / 1024 + sum(map(pss_mb, children_of(process))) if own else 0.0


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
    return page.evaluate("frames_ms.slice(5)")


def drag_latencies(page: Page) -> list[float]:
    mark = page.locator('.mark[data-label="P7"]')
    x, y = (float(part) for part in re.findall(r"[-\d.]+", mark.get_attribute("transform")))
    box = page.locator(".pane svg.marks").bounding_box()
    x, y = x + box["x"], y + box["y"]
    page.evaluate(WATCH_ANSWERS)
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(90):
        page.mouse.move(x + k / 6, y + (k % 10) / 3)
        page.wait_for_timeout(20)
    during = page.evaluate("latencies.slice()")
    page.mouse.up()
    return during


def main() -> None:
    megapixels = float(sys.argv[1]) if len(sys.argv) > 1 else 48.0
    width = round((megapixels * 1e6 * 4 / 3) ** 0.5)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        project = write_large_project(Path(folder), width, round(width * 3 / 4))
        begun = time.perf_counter()
        server, address = start(project)
        browser = driver.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1500, "height": 860})
        opened = time.perf_counter()
        page.goto(address)
        expect(page.locator(".pane")).to_have_attribute("data-sharp", "true", timeout=60_000)
        sharp = time.perf_counter()
        print(f"server up {opened - begun:.2f} s, opening to sharp {sharp - opened:.2f} s")
        expect(page.locator("#mode")).to_have_attribute("data-mode", "adjusted", timeout=60_000)
        print("full adjustment:", page.locator("#mode").inner_text())
        frames = frames_while(page)
        print(
            f"zoom and pan: median {1000 / statistics.median(frames):.0f} fps, "
            f"95 % of frames within {statistics.quantiles(frames, n=20)[18]:.0f} ms"
        )
        page.keyboard.press("f")
        page.wait_for_timeout(500)
        late = drag_latencies(page)
        print(
            f"drag of one of 200 marks: {len(late)} answers before the button is up, median "
            f"{statistics.median(late):.0f} ms, p95 {statistics.quantiles(late, n=20)[18]:.0f} ms"
        )
        page.locator('#strip [data-image="1"]').click()
        page.wait_for_timeout(3000)
        drivers = [child for child in children_of(os.getpid()) if child != server.pid]
        chromium = sum(pss_mb(child) for driver_ in drivers for child in children_of(driver_))
        print(f"two photos seen: server {pss_mb(server.pid):.0f} MB, browser {chromium:.0f} MB")
        browser.close()
        server.terminate()
        server.wait(20)


if __name__ == "__main__":
    main()
