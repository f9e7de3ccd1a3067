"""Every input broken in turn: status 1, a message that names the place, earlier results kept."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_projects import Command, Fails, Project

TABLES = ("picks", "lines", "measure", "check")


def line_of(project: Project, key: str) -> int:
    lines = project.path.read_text(encoding="utf-8").splitlines()
    return next(k for k, text in enumerate(lines, 1) if text.startswith(key))


@pytest.mark.parametrize("key", ["log", "camera", *TABLES])
def test_a_missing_file_is_named_with_the_line_that_names_it(
    project: Project, fails: Fails, key: str
) -> None:
    name = next(
        n.name for n in project.folder.iterdir() if n.stem == {"log": "flight"}.get(key, key)
    )
    (project / name).unlink()
    fails(f"{project.path}:{line_of(project, f'{key}:')}", name)


def test_no_project_file_is_named(project: Project, fails: Fails) -> None:
    project.path.unlink()
    fails(project.path)


def test_no_photos_are_told_with_the_pattern(project: Project, fails: Fails) -> None:
    project.set(images="photos/*.png")
    fails("photos/*.png")


@pytest.mark.parametrize(
    ("addition", "places"),
    [
        ("grond:\n  height_m: 0\n", ("grond", "ground")),
        ("name: again\n", ("name",)),
        ("picks_sigma_px: [1\n", ()),
        ("telemetry:\n  position_sigma_m: [1e-3x, 2]\n", ("1e-3x",)),
        ("telemetry:\n  heading_bias_sigma_deg: .nan\n", ("heading_bias_sigma_deg",)),
        ("telemetry:\n  heading_bias_sigma_deg: -1\n", ("heading_bias_sigma_deg", "-1")),
        ("solve:\n  outliers: maybe\n", ("outliers", "maybe")),
    ],
)
def test_a_wrong_project_file_is_named_with_its_line(
    project: Project, fails: Fails, addition: str, places: tuple[str, ...]
) -> None:
    before = project.path.read_text(encoding="utf-8")
    project.path.write_text(before + addition, encoding="utf-8")
    line = before.count("\n") + 1
    told = fails(project.path, *places)
    assert any(f"{project.path}:{k}" in told for k in range(line, line + 3)), told


@pytest.mark.parametrize(
    ("old", "new", "places"),
    [
        ("parameters:", "paramters:", ("paramters",)),
        ("width_px: 400", "width_px: wide", ("width_px", "wide")),
        ("width_px: 400", "width_px: 0", ("width_px",)),
        ("width_px: 400", "width_px: 400\nwidth_px: 400", ("width_px",)),
    ],
)
def test_a_wrong_camera_file_is_named_with_its_line(
    project: Project, fails: Fails, old: str, new: str, places: tuple[str, ...]
) -> None:
    project.edit("camera.yaml", old, new)
    fails(f"{project / 'camera.yaml'}:", *places)


@pytest.mark.parametrize("name", TABLES)
def test_a_wrong_column_is_named(project: Project, fails: Fails, name: str) -> None:
    file = project / f"{name}.csv"
    column = file.read_text(encoding="utf-8").split(",")[1]
    project.edit(f"{name}.csv", column, f"{column}x")
    fails(f"{file}:1", f"{column}x", column)


@pytest.mark.parametrize("name", TABLES)
def test_a_file_without_a_word_is_named(project: Project, fails: Fails, name: str) -> None:
    (project / f"{name}.csv").write_bytes(b"")
    fails(project / f"{name}.csv", "empty")


CELLS = [
    ("picks", "u_px", "left", ("u_px", "left")),
    ("picks", "v_px", "nan", ("v_px", "nan")),
    ("picks", "v_px", "inf", ("v_px", "inf")),
    ("picks", "label", "", ("label",)),
    ("picks", "sigma_px", "0", ("sigma_px",)),
    ("lines", "length_m", "0", ("length_m",)),
    ("lines", "length_m", "-3.2", ("length_m", "-3.2")),
    ("lines", "length_m", "12 m", ("length_m", "12 m")),
    ("lines", "length_m", "NaN", ("length_m", "NaN")),
    ("lines", "sigma_m", "0", ("sigma_m",)),
    ("lines", "use", "chek", ("chek", "check")),
    ("measure", "kind", "distnce", ("distnce", "distance")),
    ("measure", "points", "P1", ("needs at least 2", "'P1'")),
    ("check", "east_m", "far", ("east_m", "far")),
    ("check", "sigma_m", "-1", ("sigma_m",)),
]


@pytest.mark.parametrize(("table", "column", "value", "places"), CELLS)
def test_a_wrong_cell_is_named_with_its_line(
    project: Project, fails: Fails, table: str, column: str, value: str, places: tuple[str, ...]
) -> None:
    project.cell(f"{table}.csv", 2, column, value)
    fails(f"{project / table}.csv:3", *places)


def test_a_measurement_named_twice_is_named(project: Project, fails: Fails) -> None:
    project.cell("measure.csv", 2, "name", "skid left")
    fails(f"{project / 'measure.csv'}:3", "skid left")


def test_a_photo_that_is_no_photo_is_named(project: Project, fails: Fails) -> None:
    (project / "photos" / "IMG_0003.jpg").write_bytes(b"this is no photo")
    fails(project / "photos" / "IMG_0003.jpg")


def test_an_empty_photo_is_named(project: Project, fails: Fails) -> None:
    (project / "photos" / "IMG_0003.jpg").write_bytes(b"")
    fails(project / "photos" / "IMG_0003.jpg")


def test_a_photo_with_nothing_behind_its_header_is_named(project: Project, fails: Fails) -> None:
    photo = project / "photos" / "IMG_0003.jpg"
    encoded = photo.read_bytes()
    frame = encoded.index(b"\xff\xc0")
    photo.write_bytes(encoded[: frame + 12])
    fails(photo)


@pytest.mark.parametrize("missing", [2, 200])
def test_a_photo_that_is_cut_off_is_named_by_check_too(
    project: Project, fails: Fails, command: Command, missing: int
) -> None:
    photo = project / "photos" / "IMG_0003.jpg"
    photo.write_bytes(photo.read_bytes()[:-missing])
    fails(photo, "cut off")
    assert command("check", project.path).status == 1


@pytest.mark.parametrize(
    "words", [("match",), ("match", "--undo"), ("targets",), ("targets", "--undo"), ("ties",)]
)
def test_no_command_changes_picks_while_a_photo_is_damaged(
    project: Project, command: Command, words: tuple[str, ...]
) -> None:
    photo = project / "photos" / "IMG_0003.jpg"
    photo.write_bytes(photo.read_bytes()[:-200])
    before = (project / "picks.csv").read_bytes()
    done = command("picks", words[0], project.path, *words[1:])
    assert (project / "picks.csv").read_bytes() == before
    assert done.status == 1
    assert f"{photo}: is cut off" in done.stderr


def test_every_damaged_photo_is_named_and_the_project_can_go_on_without_them(
    project: Project, command: Command
) -> None:
    for k in (3, 5):
        photo = project / "photos" / f"IMG_000{k}.jpg"
        photo.write_bytes(photo.read_bytes()[:-200])
    (project / "photos" / "IMG_0007.jpg").write_bytes(b"")
    done = command("check", project.path)
    assert done.status == 1
    for k in (3, 5, 7):
        assert f"{project / 'photos' / f'IMG_000{k}.jpg'}: is " in done.stderr
    setting = "leave_out: [IMG_0003.jpg, IMG_0005.jpg, IMG_0007.jpg]"
    assert done.stderr.endswith(f"Or write `{setting}` into project.yaml to go on without them\n")

    with project.path.open("a", encoding="utf-8") as file:
        file.write(f"{setting}\n")
    picks = (project / "picks.csv").read_text(encoding="utf-8")
    assert "IMG_0003.jpg" in picks
    run = command("run", project.path)
    assert run.status == 0, run.stderr
    assert "leaves out" in run.stdout
    result = json.loads((project.out / "results.json").read_text(encoding="utf-8"))
    assert not {"IMG_0003.jpg", "IMG_0005.jpg", "IMG_0007.jpg"} & {
        pick["image"] for pick in result["picks"]
    }

    for words in (("match",), ("match", "--undo")):
        assert command("picks", words[0], project.path, *words[1:]).status == 0
    assert (project / "picks.csv").read_text(encoding="utf-8") == picks


def test_hundreds_of_damaged_photos_make_a_short_message(
    project: Project, command: Command
) -> None:
    for k in range(40):
        (project / "photos" / f"X{k}.jpg").write_bytes(b"")
    done = command("check", project.path)
    assert "... and 30 more photos that cannot be used" in done.stderr
    assert len(done.stderr.splitlines()) == 12
    assert "`uavgram pick`" in done.stderr.splitlines()[-1]


def test_a_photo_that_is_gone_can_be_left_out_with_its_picks(
    project: Project, command: Command, fails: Fails
) -> None:
    (project / "photos" / "IMG_0003.jpg").unlink()
    said = fails("IMG_0003.jpg: is not among the project's photos, though picks.csv (line ")
    assert "copy it back" in said
    assert "`leave_out: [IMG_0003.jpg]`" in said
    project.set(leave_out=["photos/IMG_0003.jpg"])
    assert command("check", project.path).status == 0


def test_only_a_photo_that_no_table_names_is_proposed_for_a_lost_one(
    project: Project, command: Command
) -> None:
    (project / "photos" / "IMG_0003.jpg").rename(project / "photos" / "IMG_0003_b.jpg")
    assert "(did you mean 'IMG_0003_b.jpg'?)" in command("check", project.path).stderr
    (project / "photos" / "IMG_0003_b.jpg").unlink()
    said = command("check", project.path).stderr
    assert "IMG_0003.jpg: is not among the project's photos" in said
    assert "did you mean" not in said


def test_photos_that_are_all_lost_are_told_together(project: Project, fails: Fails) -> None:
    photos = sorted((project / "photos").iterdir())
    project.set(images=[f"photos/{photo.name}" for photo in photos])
    for photo in photos:
        photo.unlink()
    fails(f"nor is any other of the {len(photos)} photos that `images` names: copy them back")


def test_lost_photos_are_named_together_with_damaged_ones(
    project: Project, command: Command, fails: Fails
) -> None:
    photos = sorted((project / "photos").iterdir())
    project.set(images=[f"photos/{photo.name}" for photo in photos])
    (project / "ties.csv").write_text(
        f"image,tie,u_px,v_px,sigma_px\n{photos[0].name},T1,10,10,1\nIMG_7777.jpg,T1,10,10,1\n",
        encoding="utf-8",
    )
    project.set(ties="ties.csv")
    gone, cut = photos[4], photos[6]
    gone.unlink()
    cut.write_bytes(cut.read_bytes()[:-200])
    said = fails(
        f"{cut}: is cut off",
        f"{gone.name}: is not among the project's photos, though `images` names it",
        "IMG_7777.jpg: is not among the project's photos, though ties.csv (line 3) names it",
    )
    assert f"`leave_out: [{cut.name}, {gone.name}, IMG_7777.jpg]`" in said
    project.set(leave_out=[cut.name, gone.name, "IMG_7777.jpg"])
    done = command("check", project.path)
    assert done.status == 0
    assert "leaves out 2 photos" in done.stdout
    assert "leaves out IMG_7777.jpg" in done.stdout
    assert "no photo of the project has that name" not in done.stdout


def test_a_name_of_no_photo_that_is_left_out_is_told(project: Project, command: Command) -> None:
    project.set(leave_out="IMG_003.jpg")
    done = command("check", project.path)
    assert done.status == 0
    assert "`leave_out` names IMG_003.jpg" in done.stdout
    assert "did you mean 'IMG_00" in done.stdout


def test_not_all_photos_can_be_left_out(project: Project, fails: Fails) -> None:
    project.set(leave_out=sorted(path.name for path in (project / "photos").iterdir()))
    fails("all of its photos are left out")


def test_no_result_replaces_an_input(project: Project, fails: Fails) -> None:
    measure = project / "measure.csv"
    taken = measure.rename(project / "measurements.csv")
    before = taken.read_bytes()
    project.set(measure=taken.name, output=".")
    fails(taken, "is an input", "--output")
    assert taken.read_bytes() == before


def test_files_of_an_earlier_run_are_named(project: Project, command: Command) -> None:
    (project.out / "plan.pdf").write_bytes(b"%PDF of other picks")
    done = command("run", project.path)
    assert done.status == 0
    assert f"an earlier run wrote plan.pdf in {project.out}, and this one did not" in done.stderr
    assert (project.out / "plan.pdf").is_file()


def test_an_image_whose_name_differs_in_case_is_suggested(project: Project, fails: Fails) -> None:
    project.cell("picks.csv", 2, "image", "img_0003.JPG")
    fails("did you mean 'IMG_0003.jpg'?")


def test_an_origin_that_is_no_place_of_the_flight_is_told_by_its_distance(
    project: Project, command: Command, fails: Fails
) -> None:
    found = json.loads((project.out / "results.json").read_text(encoding="utf-8"))["world"]
    near = {key: found[key] for key in ("latitude_deg", "longitude_deg", "height_m")}
    project.set(world={"origin": near | {"latitude_deg": near["latitude_deg"] + 1.0}})
    line = line_of(project, "world:") + 1
    fails(f"{project.path}:{line}: world.origin: is 111 km from the flight")
    project.set(world={"origin": near | {"latitude_deg": near["latitude_deg"] + 0.1}})
    said = command("check", project.path)
    assert said.status == 0
    assert "11.1 km from the flight, where the ground is 9.68 m below" in said.stdout  # d^2 / 2R


def test_a_system_of_another_country_is_told_with_its_line(project: Project, fails: Fails) -> None:
    project.set(crs="EPSG:2193")
    fails(f"{project.path}:{line_of(project, 'crs:')}: crs: 'EPSG:2193'", "longitude")


def test_photos_of_another_size_are_named(project: Project, fails: Fails) -> None:
    photo = project / "photos" / "IMG_0005.jpg"
    assert cv2.imwrite(str(photo), np.zeros((90, 160, 3), np.uint8))
    fails(photo, "160 x 90", "400 x 300")


def test_a_pick_in_an_unknown_photo_is_named(project: Project, fails: Fails) -> None:
    project.cell("picks.csv", 4, "image", "IMG_9002.jpg")
    fails("picks.csv (line 5)", "IMG_9002.jpg")


def test_a_pick_outside_the_photo_is_named(project: Project, fails: Fails) -> None:
    project.cell("picks.csv", 4, "u_px", "400.1")
    fails(f"{project / 'picks.csv'}", "400.1", "400 x 300")


def test_an_empty_log_is_named(project: Project, fails: Fails) -> None:
    (project / "flight.tlog").write_bytes(b"")
    fails(project / "flight.tlog")


@pytest.mark.parametrize("name", ["flight.tlog", "flight.bin", "flight.dat"])
def test_a_log_of_garbage_is_named(project: Project, fails: Fails, name: str) -> None:
    noise = np.random.default_rng(7).integers(0, 256, 20_000, dtype=np.uint8)
    (project / name).write_bytes(noise.tobytes())
    project.set(log=name)
    fails(project / name)


def test_a_log_of_another_day_is_told_with_both_times(
    project: Project, fails: Fails, repository: Path
) -> None:
    log = repository / "logs" / "twin_short.tlog"
    project.set(log=str(log), time={"offset_s": 0.0})
    fails(log, "another flight", "2026-05-09", "2026-11-21")


def test_an_alignment_that_is_not_unique_says_how_to_settle_it(
    project: Project, fails: Fails
) -> None:
    for photo in sorted((project / "photos").iterdir())[1:]:
        photo.unlink()
    lines = (project / "picks.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if line.startswith(("image", "IMG_0001"))]
    (project / "picks.csv").write_text("".join(kept), encoding="utf-8")
    fails(project / "flight.tlog", "time.offset_s")


def test_a_clock_that_is_an_hour_wrong_is_told_by_how_much(project: Project, fails: Fails) -> None:
    project.set(time={"offset_s": -3600.0})
    fails(project / "flight.tlog", "+1.01 h")


def test_no_usable_frame_is_an_error_that_names_the_way_to_the_reasons(
    project: Project, fails: Fails
) -> None:
    """The only picks lie in a photo that was taken hours after the flight."""
    photo = project / "photos" / "IMG_0013.jpg"
    photo.write_bytes(photo.read_bytes().replace(b"2026:05:09 07:", b"2026:05:09 11:"))
    lines = (project / "picks.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if line.startswith(("image", "IMG_0013"))]
    assert len(kept) > 1
    (project / "picks.csv").write_text("".join(kept), encoding="utf-8")
    fails("no usable frame", "uavgram check")


def test_a_truncated_log_is_read_with_a_note(project: Project, command: Command) -> None:
    log = project / "flight.tlog"
    log.write_bytes(log.read_bytes()[:-7])
    done = command("run", project.path)
    assert done.status == 0, done.stderr
    assert "warning: flight.tlog: " in done.stdout


def test_all_mistakes_of_a_file_are_told_at_once(project: Project, fails: Fails) -> None:
    project.cell("picks.csv", 2, "u_px", "left")
    project.cell("picks.csv", 5, "v_px", "right")
    told = fails(f"{project / 'picks.csv'}:3", f"{project / 'picks.csv'}:6")
    assert len(told.splitlines()) == 2


def test_check_refuses_what_run_refuses(project: Project, command: Command) -> None:
    project.cell("lines.csv", 1, "length_m", "0")
    done = command("check", project.path)
    assert done.status == 1
    assert f"{project / 'lines.csv'}:2" in done.stderr


def test_a_map_of_another_country_is_refused_with_one_that_fits(
    project: Project, fails: Fails
) -> None:
    project.set(crs="EPSG:25833")
    fails(project.path, "EPSG:25833", "longitude 12.00 to 18.01", "EPSG:32613")


# Formats that are not read: one message with the way out, wherever they are handed in.


DNG = cv2.imencode(".tif", np.zeros((8, 8), np.uint8))[1].tobytes()[:8] + (
    b"\x01\x00\x12\xc6\x01\x00\x04\x00\x00\x00\x01\x04\x00\x00\x00\x00\x00\x00"
)
FILES = {
    "flight.SRT": (
        b"\xef\xbb\xbf1\r\n00:00:00,000 --> 00:00:00,033\r\n[latitude: 47.1]\r\n\r\n",
        "subtitle file",
    ),
    "subtitles.txt": (b"7\n00:00:01,000 --> 00:00:02,000\nF/2.8\n", "subtitle file"),
    "rover.pos": (b"% program   : RTKPOST ver.2.4.3\n% obs start : 2024/02/03\n", "RTKLIB"),
    "events.txt": (b"%  GPST   latitude(deg) longitude(deg)\n2024/02/03 1 2\n", "RTKLIB"),
    "IMG_1.HEIC": (b"\0\0\0\x24ftypheic\0\0\0\0mif1MiHE", "HEIC"),
    "wrongly_named.jpg": (b"\0\0\0\x1cftypmif1\0\0\0\0mif1heic", "HEIC"),
    "DJI_1.DNG": (DNG, "raw photo"),
    "raw.tif": (DNG, "raw photo"),
    "DJI_1.MP4": (b"\0\0\0\x1cftypisom\0\0\x02\0isom", "video"),
    "old.avi": (b"RIFF\x10\x27\0\0AVI LIST", "video"),
    "pointer.jpg": (b"version https://git-lfs.github.com/spec/v1\noid sha256:1f\n", "git lfs pull"),
    "pointer.BIN": (b"version https://git-lfs.github.com/spec/v1\noid sha256:1f\n", "git lfs pull"),
    "._DJI_1.jpg": (b"\0\x05\x16\x07\0\x02\0\0Mac OS X        ", "AppleDouble"),
}


@pytest.mark.parametrize("name", FILES)
def test_one_message_wherever_it_is_handed_in(
    project: Project, command: Command, tmp_path: Path, name: str
) -> None:
    content, said = FILES[name]
    path = tmp_path / name
    path.write_bytes(content)
    photos = {"images": [str(project / "photos" / "*.jpg"), str(path)]}
    ways: dict[str, tuple[object, ...]] = {
        "log": ("log", path),
        "import": ("picks", "import", path, "--output", tmp_path / "p.csv"),
        "new --images": ("new", tmp_path, "--images", name),
    }
    for key, value in ("images", photos["images"]), ("log", str(path)), ("poses", str(path)):
        changed = project / f"with_{key}.yaml"
        shutil.copy(project.path, changed)
        of_file = Project(project.folder)
        of_file.path = changed
        of_file.set(**{key: value} | ({"log": None} if key == "poses" else {}))
        ways[f"{key}:"] = ("check", changed)

    for way, arguments in ways.items():
        done = command(*arguments)
        assert done.status == 1, way
        assert said in done.stderr, (way, done.stderr)
        assert str(path) in done.stderr, way
        assert done.stderr.count("uavgram: ") == 1
        assert len(done.stderr.splitlines()) == 1, (way, done.stderr)
    assert not (tmp_path / "p.csv").exists()


POINTER = FILES["pointer.jpg"][0]


@pytest.mark.parametrize("name", ["project.yaml", "camera.yaml", "picks.csv", "lines.csv"])
def test_a_pointer_in_place_of_a_file_of_the_project_is_named(
    project: Project, command: Command, name: str
) -> None:
    (project / name).write_bytes(POINTER)
    done = command("check", project.path)

    assert done.status == 1
    assert f"{name}: is a pointer of Git LFS" in done.stderr
    assert "git lfs pull" in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", "a.yaml"),
        ("simulate", "a.yaml"),
        ("camera", "a.json"),
        ("view", "a.rrd"),
        ("picks", "import", "gcp_list.txt", "--output", "p.csv"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_pointer_is_named_wherever_a_file_is_read(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    file = next(name for name in arguments if "." in name)
    (tmp_path / file).write_bytes(POINTER)
    done = command(*arguments)

    assert done.status == 1
    assert "is a pointer of Git LFS" in done.stderr
    assert "git lfs pull" in done.stderr


def test_new_lists_what_it_passed_over_by_kind_and_number(
    small_survey: Path, command: Command, tmp_path: Path
) -> None:
    shutil.copytree(small_survey / "photos", tmp_path / "photos")
    for name in ("a.MP4", "b.MP4"):
        (tmp_path / name).write_bytes(FILES["DJI_1.MP4"][0])
    (tmp_path / "photos" / "._a.jpg").write_bytes(FILES["._DJI_1.jpg"][0])
    (tmp_path / "a.SRT").write_bytes(FILES["flight.SRT"][0])
    (tmp_path / "offer.pdf").write_text("x")
    done = command("new", tmp_path)

    assert done.status == 0
    (line,) = [line for line in done.stdout.splitlines() if "Passed over" in line]
    for counted in ("2 x video", "1 x companion file of macOS", "1 x subtitle", "1 x *.pdf"):
        assert counted in line
    assert "ffmpeg" in line
    assert "AppleDouble" not in (tmp_path / "project.yaml").read_text()


def test_files_that_only_have_the_name_of_a_photo_are_passed_over(
    small_survey: Path, command: Command, tmp_path: Path
) -> None:
    shutil.copytree(small_survey / "photos", tmp_path / "photos")
    first = min((tmp_path / "photos").iterdir())
    for name in ("x1", "x2"):
        first.with_name(f"{name}{first.suffix}").write_bytes(POINTER)
    first.with_name(f"x3{first.suffix}").write_bytes(FILES["._DJI_1.jpg"][0])
    done = command("new", tmp_path)

    assert done.status == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if "Passed over" in line]
    assert "2 x pointer of Git LFS" in line
    assert "1 x companion file of macOS" in line
    assert "git lfs pull" in line
    assert "without ._" not in line

    checked = command("check", tmp_path)
    assert checked.status == 0, checked.stderr
    assert "Passed over: 2 x pointer of Git LFS" in checked.stdout

    (tmp_path / "picks.csv").write_text(f"image,label,u_px,v_px\nx1{first.suffix},A,9,9\n")
    picked = command("check", tmp_path)
    assert picked.status == 1
    assert "git lfs pull" in picked.stderr


def test_a_folder_of_nothing_but_pointers_has_no_photo(command: Command, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(POINTER)
    done = command("new", tmp_path)

    assert done.status == 1
    assert "holds no photo" in done.stderr
    assert "1 x pointer of Git LFS" in done.stderr


def test_a_folder_without_a_photo_that_is_read_names_those_that_are_not(
    command: Command, tmp_path: Path
) -> None:
    (tmp_path / "a.heic").write_bytes(FILES["IMG_1.HEIC"][0])
    done = command("new", tmp_path)

    assert done.status == 1
    assert "1 x HEIC photo" in done.stderr
    assert "save it as JPEG" in done.stderr


def test_a_jpeg_that_is_named_heic_is_read(project: Project, command: Command) -> None:
    photo = next(project.folder.glob("photos/*.jpg"))
    photo.rename(photo.with_suffix(".HEIC"))
    rows = (project / "picks.csv").read_text()
    (project / "picks.csv").write_text(rows.replace(photo.name, f"{photo.stem}.HEIC"))
    project.set(images="photos/*")

    assert command("check", project.path).status == 0


def test_a_pipe_is_not_waited_for(command: Command, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.srt")

    assert (
        command("picks", "import", tmp_path / "a.srt", "--output", tmp_path / "p.csv").status == 1
    )
