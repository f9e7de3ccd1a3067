"""The door over its protocol: what it lists, what it refuses, and one project after another."""

from __future__ import annotations

import errno
import json
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from pick_pages import Entry, Page, browser_of, entry_of, small_project
from picking_server import Served, served

from uavgram.io.outputs import convert_output_errors
from uavgram.picking.session.folder_chooser import MAX_REQUEST_BYTES, FolderChooser
from uavgram.picking.session.project import OpenProject


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """Two folders of photos without a project, and one outside."""
    for name in ("home/first", "home/second", "outside"):
        small_project(tmp_path / name)
        (tmp_path / name / "project.yaml").unlink()
    return tmp_path / "home"


@pytest.fixture
def server(home: Path) -> Iterator[Served]:
    with served(None, FolderChooser(roots=(home,))) as server:
        yield server


@pytest.fixture
def entry(server: Served) -> Entry:
    return entry_of(server)


@pytest.fixture
def browser(server: Served, entry: Entry) -> Iterator[httpx.Client]:
    with browser_of(server, entry) as client:
        yield client


def numbers(browser: httpx.Client) -> dict[str, int]:
    """Folders of the home by their names."""
    top = browser.get("/door/folders", params={"folder": ""}).json()
    inner = browser.get("/door/folders", params={"folder": top["folders"][0]["number"]}).json()
    return {one["name"]: one["number"] for one in inner["folders"]}


def wanted(number: int, **more: object) -> dict[str, object]:
    return {"folder": number, "setup": {}, **more}


ADDRESSES = [
    "/door/beginning",
    "/door/folders?folder=",
    "/door/look?folder=0",
    "/photo/0/0/0/0.jpg",
]


@pytest.mark.parametrize("address", ADDRESSES)
def test_the_key_of_the_tab_and_the_cookie_are_both_asked_for(
    server: Served, entry: Entry, address: str
) -> None:
    sign = "&" if "?" in address else "?"
    with httpx.Client(base_url=server.origin) as other:
        assert other.get(address).status_code == 403
        assert other.get(f"{address}{sign}tab={entry.key}").status_code == 403
        assert other.get(address, headers={"Cookie": entry.cookie}).status_code == 403


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "cors"},
        {"Host": "evil.example"},
    ],
    ids=str,
)
@pytest.mark.parametrize("address", ["/door/begin", "/door/close"])
def test_another_page_begins_nothing(
    browser: httpx.Client, home: Path, address: str, headers: dict[str, str]
) -> None:
    number = numbers(browser)["first"]
    browser.get("/door/look", params={"folder": number})
    assert browser.post(address, json=wanted(number), headers=headers).status_code == 403
    assert not (home / "first" / "project.yaml").exists()


def test_only_what_was_listed_is_looked_into(browser: httpx.Client, home: Path) -> None:
    known = numbers(browser)
    for asked in ("", "-1", "99", "../outside", str(home.parent / "outside"), "1e0", "\u00b2"):
        answer = browser.get("/door/look", params={"folder": asked})
        assert answer.status_code == 409, asked
        assert str(home.parent / "outside") not in answer.text
    found = browser.get("/door/look", params={"folder": known["first"]}).json()
    assert found["photos"][0]["count"] == 2
    assert found["cameras"] == [{"name": "camera.yaml", "width_px": 640, "height_px": 480}]


@pytest.mark.parametrize(
    "asked",
    [
        {"camera": "../outside/camera.yaml"},
        {"camera": "/etc/passwd"},
        {"log": "../outside/flight.BIN"},
        {"images": ["../outside/photos/*.jpg"]},
        {"images": "photos/*.jpg"},
        {"gcp_list": "/etc/passwd"},
        {"setup": {"pitch_deg": 1e999}},
        {"setup": {"pitch_deg": 45}},
        {"setup": {"pitch_deg": True}},
        {"setup": {"reading_sigma_m": 0}},
        {"setup": {"case": {"number": "x" * 1000}}},
        {"setup": {"case": {"number": "a\nunits: imperial"}}},
        {"setup": {"units": "furlongs"}},
        {"setup": []},
    ],
    ids=str,
)
def test_what_was_not_found_or_cannot_be_is_refused(
    browser: httpx.Client, home: Path, asked: dict[str, object]
) -> None:
    number = numbers(browser)["first"]
    browser.get("/door/look", params={"folder": number})
    body = json.dumps(wanted(number, **asked))
    answer = browser.post("/door/begin", content=body)
    assert answer.status_code == 409
    assert answer.json()["why"]
    assert not (home / "first" / "project.yaml").exists()
    assert browser.post("/door/begin", content="{").status_code == 409
    assert browser.post("/door/begin", content=b" " * (MAX_REQUEST_BYTES + 1)).status_code == 413


def test_one_project_after_another(
    browser: httpx.Client, entry: Entry, home: Path, server: Served
) -> None:
    known = numbers(browser)
    assert "door.js" in browser.get("/").text
    browser.get("/door/look", params={"folder": known["first"]})
    setup = {"pitch_deg": -45, "units": "imperial", "case": {"number": '7/26: "A"'}}
    answer = browser.post("/door/begin", json=wanted(known["first"], setup=setup))
    assert answer.json() == {}
    text = (home / "first" / "project.yaml").read_text(encoding="utf-8")
    assert "\n  pitch_deg: -45.0 " in text
    assert "\nunits: imperial " in text
    assert "app.js" in browser.get("/").text
    with Page(server, entry) as page:
        page.do("place", image=0, label="A", u_px=10, v_px=20)
        assert browser.post("/door/close").json() == {}
        page.until("closed")
    assert "A" in (home / "first" / "picks.csv").read_text()
    assert "door.js" in browser.get("/").text
    assert browser.get("/photo/0/thumbnail.jpg").status_code == 404
    assert not list((home / "first" / "out").glob("*.door"))

    browser.get("/door/look", params={"folder": known["second"]})
    assert browser.post("/door/begin", json=wanted(known["second"])).json() == {}
    with Page(server, entry) as page:
        assert page.initial_state["project"] == "second"
    recent = browser.get("/door/beginning").json()["recent"]
    assert [one["name"] for one in recent] == ["second", "first"]

    # Set up anew: what is not asked for stays as it is, comments too.
    browser.post("/door/close", params={"to": "setup"})
    begun = browser.get("/door/beginning").json()
    assert (begun["folder"], begun["is_chosen"]) == (known["second"], True)
    found = browser.get("/door/look", params={"folder": known["first"]}).json()
    assert found["has_project"]
    assert found["setup"]["pitch_deg"] == -45.0
    assert found["setup"]["case"]["number"] == '7/26: "A"'
    assert found["has_gimbal"] is None
    again = {**found["setup"], "pitch_deg": "auto"}
    browser.post("/door/begin", json=wanted(known["first"], setup=again))
    changed = (home / "first" / "project.yaml").read_text(encoding="utf-8")
    assert changed == text.replace('gimbal: "none"', "gimbal: auto").replace("-45.0", "auto")


def test_a_full_disk_is_said_and_leaves_nothing(
    browser: httpx.Client, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, _: str) -> None:
        with convert_output_errors(path.parent):
            raise OSError(errno.ENOSPC, "No space left on device", str(path))

    number = numbers(browser)["first"]
    before = sorted((home / "first").rglob("*"))
    browser.get("/door/look", params={"folder": number})
    monkeypatch.setattr("uavgram.pipeline.setup.replace_text", full)
    answer = browser.post("/door/begin", json=wanted(number, setup={"pitch_deg": -45}))
    assert answer.status_code == 409
    assert answer.json()["why"].endswith(
        "the disk is full; free some space, or copy the photos to another folder, and open that"
    )
    assert sorted((home / "first").rglob("*")) == before


def test_a_project_that_a_tab_shows_is_closed_only_where_that_is_asked_for(
    server: Served, entry: Entry, browser: httpx.Client, home: Path
) -> None:
    known = numbers(browser)
    for name in ("first", "second"):
        browser.get("/door/look", params={"folder": known[name]})
    assert browser.post("/door/begin", json=wanted(known["first"])).json() == {}
    with Page(server, entry):
        refused = browser.post("/door/begin", json=wanted(known["second"]))
        assert (refused.status_code, refused.json()["open"]) == (409, "first")
        assert not (home / "second" / "project.yaml").exists()
        assert browser.post("/door/begin", json=wanted(known["first"])).json() == {}  # is this one
    asked = browser.post("/door/begin", params={"closes": "yes"}, json=wanted(known["second"]))
    assert asked.json() == {}
    assert (home / "second" / "project.yaml").exists()


def test_a_project_at_work_that_no_tab_shows_is_closed_only_where_that_is_asked_for(
    browser: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = numbers(browser)
    for name in ("first", "second"):
        browser.get("/door/look", params={"folder": known[name]})
    assert browser.post("/door/begin", json=wanted(known["first"])).json() == {}
    monkeypatch.setattr(OpenProject, "is_busy", property(lambda _: True))
    refused = browser.post("/door/begin", json=wanted(known["second"]))

    assert (refused.status_code, refused.json()["open"]) == (409, "first")
    asked = browser.post("/door/begin", params={"closes": "yes"}, json=wanted(known["second"]))
    assert asked.json() == {}


def test_a_home_is_no_flight_for_the_photos_in_its_folders(tmp_path: Path) -> None:
    for name in ("home/Pictures", "home/case/photos"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "a.jpg").write_bytes(b"x")
    home = tmp_path / "home"
    named = FolderChooser(home, roots=(home,))
    assert named.beginning()["is_chosen"] is False
    top = named.list_folders(str(named.beginning()["folder"]))
    assert (top["photos"], top["is_flight"]) == (1, False)
    assert [(one["name"], one["is_flight"]) for one in top["folders"]] == [
        ("case", True),
        ("Pictures", True),
    ]
    case = FolderChooser(home / "case", roots=(home,))
    assert case.beginning()["is_chosen"] is True
    inside = case.list_folders(str(case.beginning()["folder"]))
    assert (inside["photos"], inside["are_inner"], inside["is_flight"]) == (1, True, True)
    (home / "own.jpg").write_bytes(b"x")
    assert FolderChooser(home, roots=(home,)).beginning()["is_chosen"] is True
