"""Every command where Windows takes away what it has not: see `on_windows/sitecustomize.py`."""

from __future__ import annotations

import http.client
import json
import re
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from cyclopts import App
from windows_desk import WindowsDesk

from uavgram.cli.entry import app

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads Linux's /proc")

SURVEY = "Unfall Köln (2)"
SCENARIO = """
name: Köln
camera:
  width_px: 400
  height_px: 300
  parameters: [420.0, 420.2, 201.3, 148.8, -0.1, 0.03, 0.0003, -0.0002, 0.0]
  sigma: [0.8, 0.8, 0.5, 0.5, 0.002, 0.004, 0.0001, 0.0001, 0.001]
"""
GCP_LIST = "EPSG:32632\n356701.0 5645230.0 50.0 100.5 200.5 IMG_0001.jpg Dom\n"
COMMANDS = [
    ("check", SURVEY),
    ("log", f"{SURVEY}/flight.tlog", "--plot", "Höhe.png"),
    ("camera", f"{SURVEY}/camera.yaml", "--to", "opencv", "--output", "Kamera für alle.yml"),
    ("camera", f"{SURVEY}/camera.yaml", "--compare", f"{SURVEY}/camera.yaml", "--json"),
    ("explain", "--markdown"),
    ("picks", "import", "gcp_list.txt", "--output", "übernommen.csv"),
    ("picks", "match", SURVEY),
    ("picks", "match", SURVEY, "--undo"),
    ("picks", "ties", SURVEY),
    ("rectify", SURVEY),
    ("geotag", SURVEY, "--exif"),
    ("targets", "print", "--plates", "0-1", "--output", "Platten für alle.pdf"),
    ("plan", "--from", f"{SURVEY}/project.yaml", "--output", "Plan für Köln"),
    ("simulate", "Köln.yaml", "--repetitions", "2", "--output", "simuliert"),
    ("study", "view", "--repetitions", "20", "--workers", "1", "--output", "Studie"),
    ("batch", SURVEY, "--workers", "2", "--output", "alle"),
    ("shortcut", "--folder", "."),
]
BY_OTHER_TESTS = {"calibrate", "demo", "new", "pick", "picks targets", "run", "view"}


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> WindowsDesk:
    """A folder with the survey of `uavgram demo`."""
    desk = WindowsDesk(tmp_path_factory.mktemp("Meine Fälle"))
    (desk.folder / "Köln.yaml").write_text(SCENARIO, encoding="utf-8")
    (desk.folder / "gcp_list.txt").write_text(GCP_LIST, encoding="utf-8")
    done = desk.run("demo", "--scenario", "Köln.yaml", "--output", SURVEY)
    assert done.status == 0, done.stderr
    return desk


def commands_of(application: App, before: str = "") -> set[str]:
    """Names of all commands, with those below a command."""
    names = [name for name in application if not name.startswith("-")]
    below = [commands_of(application[name], f"{before}{name} ") for name in names]
    return set().union(*below) if names else {before.strip()}


def test_every_command_is_here() -> None:
    words = {" ".join(command) for command in COMMANDS}
    for name in commands_of(app) - BY_OTHER_TESTS:
        assert any(f"{one} ".startswith(f"{name} ") for one in words), name


def left_over(folder: Path) -> list[Path]:
    """Hidden files and folders of outputs that did not go."""
    return [one for one in folder.rglob(".*") if "unfinished" in one.name or "in-use" in one.name]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda words: " ".join(words[:2]))
def test_a_command_runs(desk: WindowsDesk, command: tuple[str, ...]) -> None:
    done = desk.run(*command)

    assert done.status == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert not left_over(desk.folder)


def test_a_project_is_made_and_a_board_calibrates(desk: WindowsDesk, data_dir: Path) -> None:
    (desk.folder / "neu").mkdir()
    for photo in (desk.folder / SURVEY / "photos").glob("*.jpg"):
        (desk.folder / "neu" / photo.name).write_bytes(photo.read_bytes())
    camera = desk.folder / SURVEY / "camera.yaml"
    done = desk.run("new", "neu", "--camera", camera)
    assert done.status == 0, done.stderr
    assert (desk.folder / "neu" / "project.yaml").is_file()

    photos = sorted((data_dir / "opencv_chess").glob("left0*.jpg"))[:5]
    done = desk.run("calibrate", *photos, "--board", "chessboard:9x6:25mm", "--output", "Eichung")
    assert done.status == 0, done.stderr


def test_what_excel_has_open_is_written_beside_it_and_no_run_is_lost(desk: WindowsDesk) -> None:
    out = desk.folder / SURVEY / "out"
    table, beside = out / "measurements.csv", out / "measurements.newer.csv"
    table.write_text("as Excel shows it", encoding="utf-8")
    excel = WindowsDesk(desk.folder, open_elsewhere=[table])

    done = excel.run("run", SURVEY, "--json", "--fail-on", "red")
    assert done.status == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["verdict"]["level"] == "green"
    assert said["written_beside"] == {table.name: beside.name}
    assert Path(said["results"]).name == "results.json"
    assert re.search(
        r"measurements\.csv is open in another program.*measurements\.newer", done.stderr
    )
    assert table.read_text(encoding="utf-8") == "as Excel shows it"
    assert beside.read_text(encoding="utf-8").startswith("name,")
    assert not left_over(out)

    assert desk.run("run", SURVEY, "--quiet").stdout == ""
    assert table.read_text(encoding="utf-8").startswith("name,")
    assert not beside.exists()


@pytest.fixture
def photos(desk: WindowsDesk) -> Path:
    """Photos and a camera file in a folder without a project."""
    folder = desk.folder / "Neue Fotos"
    folder.mkdir()
    for photo in (desk.folder / SURVEY / "photos").glob("*.jpg"):
        (folder / photo.name).write_bytes(photo.read_bytes())
    (folder / "camera.yaml").write_bytes((desk.folder / SURVEY / "camera.yaml").read_bytes())
    return folder


@pytest.fixture
def served(desk: WindowsDesk, request: pytest.FixtureRequest) -> Iterator[str]:
    """The address that a command serves, until Ctrl+C."""
    with desk.start(request.param) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if found := re.search(r"http://127\.0\.0\.1:\S+", line):
                yield found[0]
                break
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert "Traceback" not in err, err
    assert process.returncode in {0, 130}


@pytest.mark.parametrize(
    "served",
    [
        ("view", f"{SURVEY}/out/recording.rrd", "--web"),
        ("pick", SURVEY, "--no-browser"),
        ("pick", "--no-browser"),
    ],
    indirect=True,
    ids=["view", "pick", "door"],
)
def test_pages_are_served(served: str) -> None:
    parts = urlsplit(served)
    line = http.client.HTTPConnection(parts.netloc, timeout=60)
    line.request("GET", f"{parts.path or '/'}?{parts.query}")
    answer = line.getresponse()
    content = answer.read().lower()
    line.close()

    assert (answer.status == 303 and not content) or b"<html" in content  # a page's own address


@pytest.mark.parametrize("served", [("Neue Fotos", "--no-browser")], indirect=True)
def test_a_folder_becomes_a_project_on_the_page(photos: Path, served: str) -> None:
    parts = urlsplit(served)
    came = httpx.get(served, follow_redirects=False, timeout=60)
    key = came.headers["location"].partition("#")[2]
    cookie = came.headers["set-cookie"].split(";")[0]
    with httpx.Client(
        base_url=f"http://{parts.netloc}",
        headers={"Cookie": cookie},
        params={"tab": key},
        timeout=60,
    ) as browser:
        begun = browser.get("/door/beginning").json()
        assert begun["is_chosen"]
        found = browser.get("/door/look", params={"folder": begun["folder"]}).json()
        assert found["photos"][0]["count"] == len(list(photos.glob("*.jpg")))
        setup = {"pitch_deg": -45, "case": {"agency": "Polizei Köln"}}
        wanted = {"folder": begun["folder"], "camera": "camera.yaml", "setup": setup}
        answer = browser.post("/door/begin", json=wanted)
        assert (answer.status_code, answer.json()) == (200, {})
        assert browser.post("/door/close").status_code == 200
    text = (photos / "project.yaml").read_text(encoding="utf-8")
    assert "\n  agency: Polizei Köln\n" in text
    assert not left_over(photos)


def test_plates_are_looked_for(desk: WindowsDesk) -> None:
    done = desk.run("picks", "targets", SURVEY)

    assert done.status == 1
    assert "names no targets: add the family of your plates" in done.stderr


WRITE = """
import sys
from uavgram.errors import OutputError
from uavgram.io.outputs import stage_output
try:
    with stage_output(sys.argv[1]) as staging:
        (staging / "results.json").write_bytes(b"new")
except OutputError as fault:
    print(fault)
"""


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("aux/out", "Windows keeps the name aux for a device"),
        ("x" * 120 + "/" + "y" * 130, "letters is too long for Windows"),
        ("in Ordnung", ""),
    ],
)
def test_a_folder_that_windows_does_not_take_is_one_message(
    tmp_path: Path, name: str, told: str
) -> None:
    with WindowsDesk(tmp_path).python("-c", WRITE, name) as process:
        out, err = process.communicate(timeout=100)

    assert err == ""
    assert told in out
    assert out.count("\n") == (1 if told else 0)
    assert (tmp_path / name / "results.json").is_file() == (not told)
    assert not left_over(tmp_path)


LOCK = """
import sys
from pathlib import Path
from urllib.parse import urlsplit
from uavgram.errors import UavgramError
from uavgram.io.outputs import LOCK, ProjectLock, is_locked
lock = ProjectLock(Path("out"), "project.yaml")
print(is_locked(Path("out") / LOCK))
try:
    ProjectLock(Path("out"), "project.yaml")
except UavgramError as fault:
    print(fault)
lock.release()
print(is_locked(Path("out") / LOCK), *Path("out").iterdir())
"""


def test_a_project_is_locked_once(tmp_path: Path) -> None:
    with WindowsDesk(tmp_path).python("-c", LOCK) as process:
        out, err = process.communicate(timeout=100)

    assert err == ""
    held, refused, free = out.splitlines()
    assert (held, free) == ("True", "False")
    assert refused.startswith("project.yaml: is open in another picking page")
    assert f"process {process.pid}:" in refused


def test_the_harness_takes_away_what_it_should(tmp_path: Path) -> None:
    """Code that is filed below the package, as a planted bug would be."""
    planted = """
import os, sys
code = '''
import os, sys
from pathlib import Path
from urllib.parse import urlsplit
found = [sys.platform, hasattr(os, "pwrite"), hasattr(os, "O_BINARY")]
for attempt in (
    lambda: __import__("fcntl"),
    lambda: Path("a.txt").read_text(),
    lambda: os.open("a.txt", os.O_RDONLY),
    lambda: os.open(".", os.O_RDONLY),
    lambda: Path("nul.txt").write_bytes(b""),
    lambda: Path("a.txt").rename("b.txt"),
    lambda: Path("b.txt").replace("a.txt"),
    lambda: Path("a.txt").unlink(),
):
    try:
        attempt()
    except BaseException as fault:
        found.append(type(fault).__name__)
    else:
        found.append("done")
'''
open("a.txt", "w", encoding="utf-8").close()
open("b.txt", "w", encoding="utf-8").close()
names = {"__name__": "uavgram.planted"}
with open("a.txt", encoding="utf-8") as held:
    exec(compile(code, os.environ["UAVGRAM_PACKAGE"] + "/planted.py", "exec"), names)
print(*names["found"])
"""
    with WindowsDesk(tmp_path).python("-c", planted) as process:
        out, err = process.communicate(timeout=60)

    assert out.split() == [
        *("win32", "False", "True", "ModuleNotFoundError", "EncodingWarning", "AssertionError"),
        *("PermissionError", "OSError", "FileExistsError", "PermissionError", "PermissionError"),
    ], err
