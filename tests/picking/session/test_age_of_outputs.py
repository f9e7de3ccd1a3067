"""Results are older than what the page shows where their inputs differ, whoever wrote them."""

from __future__ import annotations

import hashlib
import json

from pick_pages import Page, running, small_project


def results_of(folder, *names):
    """As a run in a terminal writes them, with what it read."""
    inputs = {
        name: {"sha256": hashlib.sha256((folder / name).read_bytes()).hexdigest(), "bytes": 1}
        for name in names
    }
    (folder / "out").mkdir(exist_ok=True)
    text = json.dumps({"provenance": {"inputs": inputs}})
    (folder / "out" / "results.json").write_text(text)


def test_a_run_elsewhere_makes_them_current_and_an_edit_makes_them_old(tmp_path):
    project = small_project(tmp_path)
    (tmp_path / "picks.csv").write_text("image,label,u_px,v_px\nP1.jpg,A,10,20\n")
    read = ("project.yaml", "camera.yaml", "picks.csv", "photos/P1.jpg", "photos/P2.jpg")
    results_of(tmp_path, *read)
    with running(project) as server, Page(server) as page:
        assert page.initial_state["outputs"]["version"] == page.initial_state["version"]
        page.do("place", image=0, label="A", u_px=11, v_px=21)
        assert page.until("outputs")["outputs"]["version"] is None
        results_of(tmp_path, *read)  # `uavgram run` in a terminal, while the page is open
        assert page.until("outputs")["outputs"]["version"] == 1
    with running(project) as server, Page(server) as page:
        assert page.initial_state["outputs"]["version"] == page.initial_state["version"]
    (tmp_path / "camera.yaml").write_text((tmp_path / "camera.yaml").read_text() + "# note\n")
    with running(project) as server, Page(server) as page:
        assert page.initial_state["outputs"]["version"] is None
