"""`uavgram new`: from a folder of photos to a project that check accepts and the page can open."""

from __future__ import annotations

import re
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
import pytest
import tagged_jpeg
import yaml
from camera_photos import camera_photo
from pick_pages import CAMERA, PROJECT, Page, running, small_project
from planned_sample import sample_plan

from uavgram.cli import main
from uavgram.config.project import load_project
from uavgram.config.project_text import ProjectText, project_text
from uavgram.imaging.photos.decoding import Segment
from uavgram.io.photos.metadata import APP1, EXIF_HEAD, XMP_HEAD, build_jpeg, parse_jpeg
from uavgram.io.photos.tagging import ExifGps, set_gps
from uavgram.io.results.command_json import write_plan
from uavgram.model.options import GeodeticOrigin

FLIGHT = (Path(__file__).parents[3] / "logs" / "twin_short.tlog").read_bytes()


def linked(source: Path, target: Path, *patterns: str) -> Path:
    """A folder with links to some files of another one, in folders of the same names."""
    target.mkdir(parents=True)
    for pattern in patterns:
        for path in sorted(source.glob(pattern)):
            link = target / path.relative_to(source)
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(path)
    return target


def bare(folder: Path) -> Path:
    """Two small photos and their camera file, no project."""
    small_project(folder).unlink()
    return folder


def snapshot(folder: Path) -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_photos_log_and_camera_become_a_project_that_check_accepts_and_the_page_opens(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = ("photos/*.jpg", "flight.BIN", "camera.yaml")
    folder = linked(data_dir / "calm_nadir", tmp_path / "calm", *files)
    assert main(["new", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "10 photos of 3000 x 2250 px: photos/*.jpg" in said
    assert "No point is picked yet" in said
    assert f"Next: uavgram pick {folder / 'project.yaml'}" in said
    project = load_project(folder / "project.yaml")
    assert project.log is not None
    assert project.camera is not None
    assert Path(project.log).name == "flight.BIN"
    assert Path(project.camera).name == "camera.yaml"
    assert project.poses is None

    assert main(["check", str(folder / "project.yaml")]) == 0
    checked = capsys.readouterr().out
    assert "every input can be read" in checked
    assert str(folder) in checked.partition("pick some with `uavgram pick ")[2]
    assert main(["run", str(folder / "project.yaml")]) == 1
    assert "picks.csv:1: holds no pick: pick points with `uavgram pick`" in capsys.readouterr().err

    with running(folder / "project.yaml") as server, Page(server) as page:
        assert len(page.initial_state["photos"]) == 10
        assert all(photo["matched"] for photo in page.initial_state["photos"])
        empty: dict[str, list[object]] = {
            "picks": [],
            "repeated": [],
            "lines": [],
            "measurements": [],
        }
        assert page.initial_state["state"] == empty


def test_an_offset_of_the_clock_that_had_to_be_assumed_is_said(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The camera events of this flight come at equal steps, so they fit several offsets."""
    files = ("photos/*.jpg", "flight.BIN", "camera.yaml")
    folder = linked(data_dir / "calm_nadir", tmp_path / "calm", *files)
    assert main(["new", str(folder)]) == 0
    assert "warning: The camera's clock is taken to show UTC" in capsys.readouterr().out
    assert load_project(folder / "project.yaml").time.offset_s == 0.0


def test_times_in_the_names_of_photos_are_found_and_said(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = ("photos/*.jpg", "flight.tlog", "camera.yaml")
    folder = linked(data_dir / "cuav", tmp_path / "flight", *files)
    assert main(["new", str(folder)]) == 0
    assert "2018080501005009Z.jpg by %Y%m%d%H%M%S%fZ" in capsys.readouterr().out
    time = load_project(folder / "project.yaml").time
    assert (time.source, time.offset_s) == ("filename", 0.0)
    assert main(["check", str(folder / "project.yaml")]) == 0


def test_photos_that_know_camera_and_place_need_neither_file(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = linked(data_dir / "brighton_beach", tmp_path / "beach", "*")
    assert main(["new", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "camera: auto" in said
    assert "The photos state where they were taken" in said
    project = load_project(folder / "project.yaml")
    assert (project.camera, project.poses, project.log) == ("auto", "exif", None)
    assert main(["check", str(folder / "project.yaml")]) == 0


def test_photos_of_two_sizes_are_listed_and_one_kind_is_chosen(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = linked(data_dir / "narrabeen_mavic", tmp_path / "beach", "*.*", "frames/*.jpg")
    assert main(["new", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "*.JPG: 1 of 4000 x 2250 px, such as snapshotNarrabeen.JPG" in said
    assert "frames/*.jpg: 3 of 3840 x 2160 px, such as narrabeenFrames0001.jpg" in said
    assert not (folder / "project.yaml").exists()

    assert main(["new", str(folder), "--images", "*.JPG"]) == 0
    assert load_project(folder / "project.yaml").camera == "auto"
    assert main(["check", str(folder / "project.yaml")]) == 0


def test_a_camera_of_which_nothing_is_known_is_an_ordinary_one_until_it_is_calibrated(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = linked(data_dir / "narrabeen_mavic", tmp_path / "beach", "*.*", "frames/*.jpg")
    assert main(["new", str(folder), "--images", "frames/*.jpg"]) == 0
    said = capsys.readouterr().out
    assert "camera: unknown, so an ordinary drone camera" in said
    assert said.count("Nothing is known of this camera") == 1
    assert "does not name its camera" in said
    assert "calibrate it from these photos" in said
    project = folder / "project.yaml"
    assert f"Next: uavgram pick {project}" in said
    assert load_project(project).camera == "unknown"
    assert main(["check", str(project)]) == 0
    checked = capsys.readouterr().out
    assert "Nothing is known of this camera" in checked
    assert "every input can be read" in checked

    with running(project) as server, Page(server) as page:
        camera = page.initial_state["camera"]
    assert camera["file"] == ""
    assert camera["source"] == [
        "The camera is not known, so an ordinary drone camera is assumed (`camera: unknown`)."
    ]
    assert [message["code"] for message in camera["messages"]] == ["camera-unknown"]


def test_a_fisheye_is_not_taken_for_an_ordinary_camera(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    camera_photo(tmp_path / "a.jpg", (400, 300), make="Parrot", model="BEBOP 2")
    assert main(["new", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert "a.jpg: was taken with a fisheye lens (Parrot BEBOP 2)" in said
    assert "uavgram calibrate" in said
    assert "Put a camera file beside the photos" in said
    assert [path.name for path in tmp_path.iterdir()] == ["a.jpg"]


def test_photos_of_two_cameras_are_told_apart_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    camera_photo(tmp_path / "a.jpg", (400, 300), make="ACME", model="Eye")
    camera_photo(tmp_path / "b.jpg", (400, 300), make="ACME", model="Ear")
    assert main(["new", str(tmp_path)]) == 1
    assert "choose photos with --images" in capsys.readouterr().err
    assert not (tmp_path / "project.yaml").exists()
    assert main(["new", str(tmp_path), "--images", "a.jpg"]) == 0
    assert load_project(tmp_path / "project.yaml").camera == "unknown"


def test_a_project_without_log_and_lengths_says_that_nothing_gives_it_a_scale(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path / "flight")
    assert main(["new", str(folder)]) == 0
    assert "without one of them the scale is unknown" in capsys.readouterr().out
    assert main(["check", str(folder / "project.yaml")]) == 0


def test_tables_that_are_there_are_named_and_left_as_they_are(tmp_path: Path) -> None:
    folder = bare(tmp_path / "flight")
    (folder / "picks.csv").write_text("image,label,u_px,v_px\nP1.jpg,A,1,2\n", encoding="utf-8")
    (folder / "tape.csv").write_text("name,from,to,length_m,sigma_m\n", encoding="utf-8")
    (folder / "things.csv").write_text("name,kind,points,value,sigma\n", encoding="utf-8")
    (folder / "check points.csv").write_text(
        "label,east_m,north_m,up_m,sigma_m\nA,0,0,0,1\n", encoding="utf-8"
    )
    before = snapshot(folder)
    assert main(["new", str(folder)]) == 0
    project = load_project(folder / "project.yaml")
    assert project.lines is not None
    assert project.known is not None
    assert Path(project.known).name == "things.csv"
    assert project.check is not None
    assert Path(project.lines).name == "tape.csv"
    assert Path(project.check).name == "check points.csv"
    assert project.control is None
    after = snapshot(folder)
    assert {name: after[name] for name in before} == before
    assert {Path(name).name for name in set(after) - set(before)} == {"project.yaml", "measure.csv"}


def test_a_project_that_is_there_is_never_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = small_project(tmp_path / "flight")
    before = snapshot(tmp_path)
    assert main(["new", str(project.parent)]) == 1
    assert "is there already" in capsys.readouterr().err
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize(
    ("files", "words", "way"),
    [
        (
            dict.fromkeys(("a.tlog", "b.tlog"), FLIGHT),
            "flight log: a.tlog, b.tlog",
            "--log",
        ),
        ({"other.yaml": CAMERA.encode()}, "the camera: camera.yaml, other.yaml", "--camera"),
        (
            dict.fromkeys(("one.csv", "two.csv"), b"image,label,u_px,v_px\n"),
            "tables of picks: one.csv, two.csv",
            "picks.csv",
        ),
    ],
)
def test_what_is_found_twice_is_listed_and_nothing_is_written(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    files: dict[str, bytes],
    words: str,
    way: str,
) -> None:
    folder = bare(tmp_path / "flight")
    for name, content in files.items():
        (folder / name).write_bytes(content)
    before = snapshot(folder)
    assert main(["new", str(folder)]) == 1
    said = capsys.readouterr().err
    assert words in said
    assert way in said
    assert snapshot(folder) == before


def test_a_camera_can_be_chosen_and_one_of_another_size_is_passed_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path / "flight")
    (folder / "other.yaml").write_text(CAMERA, encoding="utf-8")
    assert main(["new", str(folder), "--camera", "other.yaml"]) == 0
    assert Path(load_project(folder / "project.yaml").camera).name == "other.yaml"
    (folder / "project.yaml").unlink()
    larger = CAMERA.replace("640", "1280").replace("480", "960")
    (folder / "other.yaml").write_text(larger, encoding="utf-8")
    capsys.readouterr()
    assert main(["new", str(folder)]) == 0
    assert "other.yaml was passed over: it is for 1280 x 960 px" in capsys.readouterr().out
    assert Path(load_project(folder / "project.yaml").camera).name == "camera.yaml"


@pytest.mark.parametrize("images", [[], ["--images", "photos/*.jpg"]])
def test_a_damaged_photo_among_others_is_passed_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], images: list[str]
) -> None:
    folder = bare(tmp_path / "flight")
    whole = sorted((folder / "photos").glob("*.jpg"))
    (folder / "photos" / "P0.jpg").touch()
    (folder / "photos" / "Q[1].jpg").write_bytes(whole[0].read_bytes()[:300])
    (folder / "photos" / "R.jpg").symlink_to(tmp_path / "gone.jpg")
    assert main(["new", str(folder), *images]) == 0

    said = capsys.readouterr().out
    assert "3 photos cannot be used: P0.jpg (is empty" in said
    assert "Q[1].jpg (" in said
    assert "R.jpg (is a link to a file that is not there)" in said
    project = load_project(folder / "project.yaml")
    assert [Path(pattern).name for pattern in project.images] == ["*.jpg"]
    assert project.leave_out == ("P0.jpg", "Q[1].jpg", "R.jpg")
    assert main(["check", str(folder)]) == 0


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("flight.tlog", b"", "is empty"),
        ("flight.BIN", b"", "is empty"),
        ("flight.tlog", b"no log " * 9, "does not begin as a flight log does"),
        ("flight.ulg", b"ULog\x01\x12\x35", "holds no complete message"),
    ],
)
def test_a_damaged_log_is_named_with_the_reason_and_what_follows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes, reason: str
) -> None:
    folder = bare(tmp_path / "flight")
    (folder / name).write_bytes(content)
    assert main(["new", str(folder)]) == 0

    said = capsys.readouterr().out
    assert f"warning: The flight log {name} is not used, as it {reason}" in said
    assert "Without a flight log, the photos are placed by their own positions" in said
    assert load_project(folder / "project.yaml").log is None


def test_a_whole_log_is_taken_beside_a_damaged_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path / "flight")
    for name, content in (("a.tlog", b""), ("b.tlog", FLIGHT), ("c.tlog", FLIGHT[:40])):
        (folder / name).write_bytes(content)
    main(["new", str(folder)])

    said = capsys.readouterr()
    assert "several" not in said.err
    assert "choose with --log" not in said.err


def test_tables_in_other_text_and_broken_links_stop_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path / "flight")
    (folder / "lines.csv").write_bytes("name,from,to,length_m\nä,A,B,3\n".encode("latin-1"))
    (folder / "picks.csv").symlink_to(tmp_path / "gone.csv")
    (folder / "flight.tlog").symlink_to(tmp_path / "gone.tlog")
    assert main(["new", str(folder)]) == 0

    said = capsys.readouterr().out
    assert "The table lines.csv is not used, as it is not UTF-8 text" in said
    assert "flight.tlog is not used, as it is a link to a file that is not there" in said
    project = load_project(folder / "project.yaml")
    assert [Path(name or "").name for name in (project.picks, project.lines)] == [
        "picks-2.csv",
        "lines-2.csv",
    ]


def test_tables_of_another_program_stay_and_the_project_has_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path / "flight")
    foreign = {"picks.csv": "foto;punkt;x;y\n", "lines.csv": "von;bis;laenge\n", "measure.csv": ""}
    for name, text in foreign.items():
        (folder / name).write_text(text, encoding="utf-8")
    assert main(["new", str(folder)]) == 0

    said = capsys.readouterr().out
    for name, text in foreign.items():
        assert f"The table {name} is not used, as it has not the columns of such a table" in said
        assert (folder / name).read_text(encoding="utf-8") == text
    project = load_project(folder / "project.yaml")
    used = (project.picks, project.lines, project.measure)
    assert [Path(name or "").name for name in used] == [
        "picks-2.csv",
        "lines-2.csv",
        "measure-2.csv",
    ]


def test_files_that_only_look_like_what_is_looked_for_are_not_taken(tmp_path: Path) -> None:
    folder = bare(tmp_path / "flight")
    (folder / "install.log").write_text("nothing flew here\n", encoding="utf-8")
    (folder / "firmware.bin").write_bytes(bytes(100))
    (folder / "settings.json").write_text('{"volume": 11}', encoding="utf-8")
    (folder / "broken.jpg").write_text("no photo", encoding="utf-8")
    (folder / "results").mkdir()
    (folder / "results" / "results.json").write_text("{}", encoding="utf-8")
    (folder / "results" / "preview.png").write_bytes((folder / "photos" / "P1.jpg").read_bytes())
    assert main(["new", str(folder)]) == 0
    project = load_project(folder / "project.yaml")
    assert project.log is None
    assert [Path(pattern).parent.name for pattern in project.images] == ["photos"]


def test_of_a_calibration_beside_the_photos_the_camera_is_taken_and_no_picture(
    tmp_path: Path,
) -> None:
    folder = bare(tmp_path / "flight")
    results = folder / "calibration"
    (results / "found").mkdir(parents=True)
    (folder / "camera.yaml").rename(results / "camera.yaml")
    (results / "calibration.json").write_text("{}", encoding="utf-8")
    (results / "opencv.yml").write_text("%YAML:1.0\n", encoding="utf-8")
    (results / "found" / "board.jpg").write_bytes((folder / "photos" / "P1.jpg").read_bytes())
    assert main(["new", str(folder)]) == 0
    project = load_project(folder / "project.yaml")
    assert Path(project.camera) == results / "camera.yaml"
    assert [Path(pattern).parent.name for pattern in project.images] == ["photos"]


def test_sizes_that_lie_mixed_in_one_folder_are_told_by_how_their_names_begin(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path / "flight")
    photo = (folder / "photos" / "P1.jpg").read_bytes()
    small = cv2.imencode(".jpg", np.zeros((30, 40, 3), np.uint8))[1].tobytes()
    for k in range(3):
        (folder / "photos" / f"IMG [{k}].jpg").write_bytes(photo + b" " * k)
        (folder / "photos" / f"P{k + 1}.jpg").write_bytes(small)
    assert main(["new", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "photos/IMG [[]*.jpg: 3 of 640 x 480 px" in said
    assert "photos/P*.jpg: 3 of 40 x 30 px" in said
    (pattern,) = re.findall(r"such as with --images '(.*)'", said)
    assert main(["new", str(folder), "--images", pattern]) == 0
    assert main(["check", str(folder / "project.yaml")]) == 0


def test_a_wrong_file_is_told_and_nothing_is_left_behind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path / "flight")
    picks = "image,label,u_px,v_px\nP1.jpg,A,one,2\n"
    (folder / "picks.csv").write_text(picks, encoding="utf-8")
    before = snapshot(folder)
    assert main(["new", str(folder)]) == 1
    assert "picks.csv:2: u_px must be a number" in capsys.readouterr().err
    assert snapshot(folder) == before


def test_an_empty_folder_and_none_at_all_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", str(tmp_path)]) == 1
    assert "holds no photo" in capsys.readouterr().err
    assert main(["new", str(tmp_path / "nowhere")]) == 1
    assert "is no folder" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_without_the_right_to_write_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = bare(tmp_path / "flight")
    before = snapshot(folder)
    real = Path.open

    def refused(  # who runs the tests may be allowed everything
        self: Path,
        mode: str = "r",
        buffering: int = -1,
        encoding: str | None = None,
        errors: str | None = None,
        newline: str | None = None,
    ) -> IO[Any]:
        if "x" in mode and self.name == "project.yaml":
            raise PermissionError(13, "Permission denied", str(self))
        return real(self, mode, buffering, encoding, errors, newline)

    monkeypatch.setattr(Path, "open", refused)
    assert main(["new", str(folder)]) == 1
    assert "cannot be written to (Permission denied)" in capsys.readouterr().err
    monkeypatch.undo()
    assert snapshot(folder) == before


NAMES = [
    "plain",
    "two words",
    "a: b",
    "yes",
    "12",
    "# no",
    "[x]*",
    "é",
    "- a",
    "1e-3",
    "*.JPG",
    "'q'",
]


@pytest.mark.parametrize("name", NAMES)
def test_names_mean_what_they_are_in_yaml(name: str) -> None:
    """The truth is PyYAML, which reads the text."""
    for log, poses in (("flight.BIN", None), (None, "exif"), (None, None)):
        text = project_text(
            ProjectText(
                name=name,
                images=(name, "b/*.jpg"),
                camera=name,
                log=log,
                poses=poses,
                tables={"picks": name},
                offset_s=None if log is None else -3600.5,
            )
        )
        read = yaml.safe_load(text)
        assert read["name"] == read["camera"] == read["picks"] == name
        assert read["images"] == [name, "b/*.jpg"]
        assert (read.get("log"), read.get("poses")) == (log, poses)
        assert read.get("time") == (None if log is None else {"offset_s": -3600.5})
        assert max(len(line) for line in text.splitlines()) <= 110


def test_what_new_writes_is_what_a_person_would(tmp_path: Path) -> None:
    folder = bare(tmp_path / "flight")
    assert main(["new", str(folder)]) == 0
    written = yaml.safe_load((folder / "project.yaml").read_text(encoding="utf-8"))
    assert written == {**yaml.safe_load(PROJECT), "name": "flight"}


def test_a_plan_in_the_folder_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = bare(tmp_path)
    (folder / "before").mkdir()
    write_plan(sample_plan(), folder / "before" / "plan.json")
    (folder / "other.json").write_text('{"plan": 1}')
    assert main(["new", str(folder)]) == 0
    assert "plan: before/plan.json" in capsys.readouterr().out
    project = load_project(folder / "project.yaml", unfinished=True)
    assert project.plan == str(folder / "before" / "plan.json")


def test_of_two_plans_one_is_to_be_called_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = bare(tmp_path)
    for name in ("monday.json", "tuesday.json"):
        write_plan(sample_plan(), folder / name)
    assert main(["new", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "holds 2 plans: monday.json, tuesday.json; call the one to use plan.json" in said
    assert not (folder / "project.yaml").exists()


# `uavgram new` beside photos that say where they were taken, and nothing else does.


PIX4D = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax'
    '-ns#"><rdf:Description xmlns:Camera="http://pix4d.com/camera/1.0/" Camera:Yaw="10" '
    'Camera:Pitch="0" Camera:Roll="0" Camera:VertCS="{}"/></rdf:RDF></x:xmpmeta>'
)
MARKERS = '<?xml version="1.0"?>\n<document version="1.2.0"><chunk/></document>\n'


def placed(folder: Path, count: int, xmp: str | None = None, height_m: float = 500.0) -> Path:
    """Photos 11 m apart, 500 m high, which say so in EXIF."""
    folder.mkdir()
    noise = np.random.default_rng(1).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    plain = parse_jpeg(cv2.imencode(".jpg", noise)[1].tobytes())
    assert plain is not None
    for k in range(count):
        gps = ExifGps(
            latitude_deg=47 + 1e-4 * k,
            longitude_deg=8.0,
            height_m=height_m,
            sigma_horizontal_m=2.0,
        )
        tags = [Segment(APP1, EXIF_HEAD + set_gps(None, gps))]
        tags += [Segment(APP1, XMP_HEAD + xmp.encode())] if xmp else []
        data = build_jpeg([*tags, *plain.segments], plain.scan)
        (folder / f"P{k}.jpg").write_bytes(data)
    return folder


@pytest.mark.parametrize(
    ("count", "xmp", "datum"),
    [
        (3, None, "msl"),
        (2, PIX4D.format(""), "msl"),
        (1, PIX4D.format("ellipsoidal"), "ellipsoid"),
    ],
)
def test_the_places_of_the_photos_are_used_and_the_assumed_ground_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], count: int, xmp: str | None, datum: str
) -> None:
    folder = placed(tmp_path / "flight", count, xmp)
    assert main(["new", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "The photos state where they were taken: `poses: exif` uses that." in said
    assert "60 m ± 40 m was assumed" in said
    assert "nor poses" not in said
    project = load_project(folder / "project.yaml")
    assert project.poses == "exif"
    origin = project.world.origin
    assert isinstance(origin, GeodeticOrigin)
    assert (origin.latitude_deg, origin.longitude_deg, origin.height_m) == (47.0, 8.0, 440.0)
    assert (project.ground.height_sigma_m, project.world.heights) == (40.0, datum)
    assert main(["check", str(folder / "project.yaml")]) == 0


def test_a_height_above_take_off_with_the_wrong_sign_is_reported_and_not_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tags = tagged_jpeg.dji(AbsoluteAltitude="+500.00", RelativeAltitude="-60.00").decode()
    folder = placed(tmp_path / "flight", 3, tags)
    assert main(["new", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "the height above take-off that the tags state (-60.0 m)" in said
    origin = load_project(folder / "project.yaml").world.origin
    assert isinstance(origin, GeodeticOrigin)
    assert origin.height_m == 440.0


@pytest.mark.parametrize("height_m", [0.0, -440.0])
def test_an_altitude_that_cannot_be_right_is_named_where_no_home_remains(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], height_m: float
) -> None:
    folder = placed(tmp_path / "flight", 2, tagged_jpeg.dji().decode(), height_m)
    assert main(["new", str(folder)]) == 0
    project = folder / "project.yaml"
    text = re.sub(r"world:\n(?: .*\n)*", "", project.read_text())
    project.write_text(text if "poses: exif" in text else f"{text}poses: exif\n")
    capsys.readouterr()
    assert main(["check", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "P0 and P1 cannot have been taken at the altitude that the tags state" in said
    assert f"({height_m:.1f} m)" in said
    assert "set world.origin" in said


def test_every_table_that_a_new_project_names_is_there(tmp_path: Path) -> None:
    folder = placed(tmp_path / "flight", 2)
    assert main(["new", str(folder)]) == 0
    project = load_project(folder / "project.yaml")
    for name in (project.picks, project.lines, project.measure):
        assert name is not None
        assert (folder / name).is_file()


def test_markers_of_another_program_are_no_camera(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = placed(tmp_path / "flight", 2)
    (folder / "marker.xml").write_text(MARKERS, encoding="utf-8")
    assert main(["new", str(folder)]) == 0
    assert "marker.xml" not in capsys.readouterr().out
    assert main(["camera", str(folder / "marker.xml")]) == 1
    assert "marker.xml: is XML of another program" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("a.yml", "%YAML:1.0\n---\ncamera_matrix: [1, 2\n", 3),
        ("b.yaml", "width: 3\nK: [1, 2\nz: }", 3),
        ("c.json", '{"K": [1,2}', 1),
        ("d.xml", '<?xml version="1.0"?>\n<opencv_storage><a>1</a>', 2),
    ],
)
def test_a_broken_calibration_is_told_by_its_line_and_without_a_librarys_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, line: int
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert main(["camera", str(tmp_path / name)]) == 1
    said = capsys.readouterr().err
    assert f"{name}:{line}: cannot be read as a calibration file" in said
    assert ".cpp" not in said
    assert "OpenCV(" not in said
