"""What is asked of the project as a whole: reading it again, its outputs, a calibration."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from pick_pages import LONGEST_WAIT_S, Page, Server, ask, browser_of, entry_of, small_project
from picking_server import served
from small_recording import write_small_recording

from uavgram.picking.protocol.messages import Json

PICKS = b"image,label,u_px,v_px,note\r\nP1.jpg,A,10.50,20,seen\r\n"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    project = small_project(tmp_path)
    (tmp_path / "picks.csv").write_bytes(PICKS)
    return project


@pytest.fixture
def server(project: Path) -> Iterator[Server]:
    server = Server(project)
    yield server
    server.stop()


def ask_project(page: Page, kind: str, **fields: object) -> Json:
    """Ask something of the project as a whole, and wait for the answer."""
    seq = page.send(kind, **fields)
    while True:
        said = page.read()
        if said.get("seq") == seq:
            return said


def labels(said: Json) -> set[str]:
    return {pick["label"] for pick in said["state"]["picks"]}


def test_a_table_that_was_edited_outside_is_taken_on_request_and_loses_nothing(
    server: Server, tmp_path: Path
) -> None:
    edited = PICKS + b"P2.jpg,Z,7,8,from a spreadsheet\r\n"
    with Page(server) as page, Page(server, page.entry) as other:
        assert page.initial_state["outside"] == []
        (tmp_path / "picks.csv").write_bytes(edited)
        assert page.until("outside")["files"] == ["picks.csv"]
        page.do("place", image=1, label="ours", u_px=50, v_px=60)
        assert "picks-from-page.csv" in page.until("saved")["fault"]
        said = ask_project(page, "reload")
        assert said["t"] == "done"
        initial_state = other.until("initial-state")  # every page begins anew
        assert labels(initial_state) == {"A", "Z"}
        assert (initial_state["undo"], initial_state["redo"], initial_state["outside"]) == (
            0,
            0,
            [],
        )
        assert "pick-not-recovered" in {message["code"] for message in initial_state["messages"]}
        page.do("place", image=0, label="after", u_px=5, v_px=6)
        page.until("saved", fault="")
    kept = (tmp_path / "picks.csv").read_bytes()
    assert kept.startswith(edited)
    assert b"after" in kept
    assert b"ours" in (tmp_path / "picks-from-page.csv").read_bytes()


def test_photos_of_the_project_are_left_out_and_only_those_taken_back(
    server: Server, project: Path
) -> None:
    before = project.read_bytes()
    with Page(server) as page:
        for fields in ({"names": ["P9.jpg"]}, {"names": ["P1.jpg"], "is_taken_back": True}):
            refused = ask_project(page, "leave-out", **fields)
            assert "is no such photo" in refused["why"]
        assert "names must be a list" in ask_project(page, "leave-out", names=[])["why"]
        assert project.read_bytes() == before
        # A sound photo, too: a verdict offers it where a photo shows another place.
        assert ask_project(page, "leave-out", names=["P2.jpg"])["t"] == "done"
        assert "leave_out: [P2.jpg]" in project.read_text(encoding="utf-8")


def test_what_the_page_has_is_saved_before_the_project_is_read_again(
    server: Server, project: Path, tmp_path: Path
) -> None:
    with Page(server) as page, Page(server, page.entry) as other:
        page.do("place", image=1, label="B", u_px=50, v_px=60)
        project.write_text(project.read_text() + "picks_sigma_px: 2.5\n", encoding="utf-8")
        assert ask_project(page, "reload")["t"] == "done"
        codes = {message["code"] for message in other.until("initial-state")["messages"]}
        assert not codes & {"pick-recovered", "pick-not-recovered"}
        page.do("place", image=0, label="C", u_px=5, v_px=6)
        page.until("saved", fault="")
    with Page(server, page.entry) as page:
        assert page.initial_state["pick_sigma_px"] == 2.5
        assert labels(page.initial_state) == {"A", "B", "C"}
    assert b"P2.jpg,B,50" in (tmp_path / "picks.csv").read_bytes()


def test_a_project_that_cannot_be_read_any_more_leaves_the_page_as_it_was(
    server: Server, project: Path
) -> None:
    sound = project.read_text(encoding="utf-8")
    with Page(server) as page:
        project.write_text(sound + "imagse: x\n", encoding="utf-8")
        assert page.until("outside")["files"] == ["project.yaml"]
        said = ask_project(page, "reload")
        assert said["t"] == "refused"
        assert "imagse" in said["why"]
        assert page.do("place", image=1, label="B", u_px=50, v_px=60)["t"] == "changed"
        page.until("saved", fault="")
        project.write_text(sound, encoding="utf-8")
        assert page.until("outside")["files"] == []


def test_outputs_are_handed_out_by_name_and_a_report_can_do_nothing(
    server: Server, tmp_path: Path
) -> None:
    with browser_of(server, entry := entry_of(server)) as browser:
        assert browser.get("/output/report.html").status_code == 404
        out = tmp_path / "out"
        (out / "report.html").write_text("<script>1</script>", encoding="utf-8")
        (out / "measurements.csv").write_text("name,value\n", encoding="utf-8")
        report = browser.get("/output/report.html")
        assert report.text == "<script>1</script>"
        policy = report.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "sandbox" in policy
        assert "script-src" not in policy
        table = browser.get("/output/measurements.csv")
        assert table.headers["content-disposition"] == 'attachment; filename="measurements.csv"'
        with Page(server, entry) as page:
            outputs = page.initial_state["outputs"]
        assert [file["name"] for file in outputs["files"]] == ["report.html", "measurements.csv"]
        assert not outputs["recording"]


def test_the_recording_opens_in_a_viewer_of_this_machine_that_ends_with_the_page(
    server: Server, tmp_path: Path
) -> None:
    with browser_of(server, entry_of(server)) as browser:
        assert browser.get("/recording").status_code == 404
        write_small_recording(tmp_path / "out" / "recording.rrd")
        answer = browser.get("/recording")
        assert answer.status_code == 303
        address = answer.headers["location"]
        assert address.startswith("http://127.0.0.1:")
        assert ask(address).status_code == 200
        again = browser.get("/recording")
        assert again.headers["location"] == address  # one viewer for one recording
    server.stop()
    with pytest.raises(httpx.ConnectError):
        ask(address)


def until_calibrated(page: Page) -> Json:
    latest = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < latest:
        said = page.until("calibration")
        if said["state"] != "running":
            return said
    pytest.fail("the calibration did not end")


@pytest.fixture
def board(data_dir: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "board"
    folder.mkdir()
    for k in range(1, 7):
        name = f"left{k:02}.jpg"
        shutil.copy(data_dir / "opencv_chess" / name, folder / name)
    return folder


@pytest.mark.usefixtures("board")
def test_a_camera_is_calibrated_on_a_folder_beside_and_taken_into_the_project(
    server: Server, project: Path, tmp_path: Path
) -> None:
    before = project.read_text(encoding="utf-8")
    with Page(server) as page:
        assert ask_project(page, "use-camera")["why"] == "no camera file was made yet"
        folders = {one["name"]: one for one in ask_project(page, "folders")["folders"]}
        assert (folders["board"]["photos"], folders["board"]["width_px"]) == (6, 640)
        number = folders["board"]["id"]
        asked = {"folder": number, "board": "chessboard:9x6:25mm", "model": "brown"}
        assert ask_project(page, "calibrate", **asked)["t"] == "done"
        assert page.do("place", image=0, label="meanwhile", u_px=5, v_px=6)["t"] == "changed"
        assert "already" in ask_project(page, "calibrate", **asked)["why"]
        said = until_calibrated(page)
        assert said["state"] == "done", said
        assert said["file"] == "calibration/camera.yaml"
        assert (tmp_path / said["file"]).is_file()
        assert project.read_text(encoding="utf-8") == before  # only when asked to
        assert ask_project(page, "calibrate", **asked)["t"] == "done"
        ask_project(page, "stop-work", work="calibration")
        assert until_calibrated(page)["state"] == "failed"
        assert ask_project(page, "use-camera")["t"] == "done"  # the one that was made before
    changed = before.replace("camera: camera.yaml", "camera: calibration/camera.yaml")
    assert project.read_text(encoding="utf-8") == changed
    with Page(server, page.entry) as page:
        focal = float(page.initial_state["camera"]["parameters"][0][1].split()[0])
        assert focal == pytest.approx(534, abs=8)  # OpenCV's own result for these photos
        assert any("board" in line for line in page.initial_state["camera"]["source"])
        assert labels(page.initial_state) == {"A", "meanwhile"}


@pytest.mark.usefixtures("board")
def test_a_calibration_takes_no_path_and_no_board_that_is_none(
    server: Server, tmp_path: Path
) -> None:
    with Page(server) as page:
        fields = {"board": "chessboard:9x6:25mm", "model": "brown"}
        for folder in ("/etc", "../..", -1, 10**6, 0.5, None):
            assert ask_project(page, "calibrate", folder=folder, **fields)["t"] == "refused"
        (number, *_) = [one["id"] for one in ask_project(page, "folders")["folders"]]
        for board in ("chessboard:1x1:25mm", "/etc/passwd", "chessboard:9x6:0mm", ""):
            said = ask_project(page, "calibrate", folder=number, board=board, model="brown")
            assert said["t"] == "refused"
        wrong = {"folder": number, "board": "chessboard:9x6:25mm", "model": "pinhole"}
        assert ask_project(page, "calibrate", **wrong)["t"] == "refused"
    assert not (tmp_path / "calibration").exists()


@pytest.mark.usefixtures("board")
def test_a_calibration_that_finds_no_board_or_is_stopped_leaves_nothing(
    server: Server, tmp_path: Path
) -> None:
    with Page(server) as page:
        (folder, *_) = ask_project(page, "folders")["folders"]
        other = {"folder": folder["id"], "board": "chessboard:4x3:25mm", "model": "brown"}
        ask_project(page, "calibrate", **other)
        said = until_calibrated(page)
        assert said["state"] == "failed"
        assert "board" in said["why"]
        again = ask_project(page, "calibrate", **{**other, "board": "chessboard:9x6:25mm"})
        assert again["t"] == "done", again
        ask_project(page, "stop-work", work="calibration")
        said = until_calibrated(page)
        assert said["state"] == "failed"
        assert "stopped" in said["why"]
    assert not (tmp_path / "calibration").exists()


def test_a_bug_while_results_are_written_is_said_and_the_page_goes_on(project: Path) -> None:
    def broken(_: Path) -> None:
        raise ValueError("a bug")

    with served(project, run=broken) as server, Page(server, entry_of(server)) as page:
        assert "The program failed" in ask_project(page, "export")["why"]
        page.do("place", image=0, label="C", u_px=5, v_px=6)
