"""project.yaml: every key, its default, and every way to get it wrong."""

from __future__ import annotations

import glob
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Protocol

import pytest

from uavgram.config.project import load_project, make_paths_relative
from uavgram.errors import InputError
from uavgram.model.naming import IMPERIAL, METRIC, Units
from uavgram.model.options import GeodeticOrigin, OptionsError, Project, SolveOptions, option_pairs


class Load(Protocol):
    def __call__(self, more: str, base: str = ...) -> Project: ...


MINIMUM = "images: photos/*.jpg\ncamera: camera.yaml\npicks: picks.csv\n"


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Write a project beside the files that it names, and load it."""
    folder = tmp_path / "crossing"
    folder.mkdir()
    for name in ("camera.yaml", "picks.csv", "lines.csv", "flight.BIN"):
        (folder / name).touch()

    def _load(more: str, base: str = MINIMUM) -> Project:
        path = folder / "project.yaml"
        path.write_text(base + more)
        return load_project(path)

    return _load


def test_the_three_required_keys_are_enough(load: Load, tmp_path: Path) -> None:
    project = load("")

    assert project.name == "crossing"
    assert project.camera == str(tmp_path / "crossing" / "camera.yaml")
    assert project.output == str(tmp_path / "crossing" / "out")
    assert project.log is None
    assert project.telemetry.position_bias_sigma_m == (2.0, 3.0)


def test_a_table_is_no_project_file(tmp_path: Path) -> None:
    (tmp_path / "picks.csv").write_text("image,label,u_px,v_px\na.jpg,P,1,2\n")
    with pytest.raises(InputError, match="is no project file: name the project file"):
        load_project(tmp_path / "picks.csv")


def test_a_decimal_comma_that_can_mean_nothing_else_is_read(load: Load) -> None:
    assert load("picks_sigma_px: 1,5\n").picks_sigma_px == 1.5
    assert load("ground:\n  height_m: -0,125\n").ground.height_m == -0.125


def test_every_key_of_a_real_project_arrives(load: Load) -> None:
    project = load(
        "name: 'x'\nlog: flight.BIN\nlines: lines.csv\noutput: results\n"
        "world: {origin: {latitude_deg: 50, longitude_deg: -104.5, height_m: 577}, "
        "heights: ellipsoid}\n"
        "ground: {height_m: 1e-1, roughness_sigma_m: 0.02}\n"
        "mount: {gimbal: none, lever_arm_m: [1, 0.5, -2]}\n"
        "time: {source: filename, filename_format: '%H', offset_s: -3}\n"
        "telemetry: {position_sigma_m: [1, 2]}\n"
        "picks_sigma_px: 2\nsolve: {outliers: remove}\n"
    )

    assert project.world.origin == GeodeticOrigin(
        latitude_deg=50.0, longitude_deg=-104.5, height_m=577.0
    )
    assert project.ground.height_m == 0.1
    assert project.mount.lever_arm_m == (1.0, 0.5, -2.0)
    assert project.time.offset_s == -3.0
    assert isinstance(project.time.offset_s, float)
    assert project.telemetry.position_sigma_m == (1.0, 2.0)
    assert project.telemetry.attitude_sigma_deg == "auto"
    assert project.solve == SolveOptions(outliers="remove")


def test_images_may_be_a_list_of_patterns(load: Load) -> None:
    project = load("", base="images: [a/*.jpg, b/x.png]\ncamera: camera.yaml\npicks: picks.csv\n")

    assert [Path(pattern).name for pattern in project.images] == ["*.jpg", "x.png"]


def test_patterns_find_photos_in_a_folder_whose_name_holds_glob_characters(tmp_path: Path) -> None:
    folder = tmp_path / "site [3]*"
    (folder / "photos").mkdir(parents=True)
    for name in ("camera.yaml", "picks.csv", "photos/a.jpg"):
        (folder / name).touch()
    (folder / "project.yaml").write_text(MINIMUM)

    project = load_project(folder / "project.yaml")

    found = glob.glob(project.images[0])  # noqa: PTH207
    assert found == [str(folder / "photos" / "a.jpg")]


@pytest.mark.parametrize(
    ("more", "line", "words"),
    [
        # unknown keys, at every level
        ("pics: x\n", 4, "pics: unknown key 'pics': did you mean 'picks'?"),
        ("mount:\n  boresight_sigma: 2\n", 5, "did you mean 'boresight_sigma_deg'?"),
        (
            "world:\n  origin: {latitude_deg: 1, longitude_deg: 2, height_m: 3, height: 3}\n",
            5,
            "world.origin.height: unknown key 'height': did you mean 'height_m'?",
        ),
        ("solve:\n  qqq: 1\n", 5, "solve.qqq: unknown key 'qqq': known here are outliers"),
        ("gimbal: none\n", 4, "it belongs under 'mount:'"),
        ("ground:\n  control: c.csv\n", 5, "it belongs at the left margin"),
        # duplicates
        ("name: a\nname: b\n", 5, "name: is given twice, first in line 4"),
        # types
        ("name: 3\n", 4, "name: must be text (got 3): put it in quotes"),
        ("picks_sigma_px: true\n", 4, "picks_sigma_px: must be a number (got true)"),
        ("picks_sigma_px: no\n", 4, "must be a number (got 'no')"),
        ("picks_sigma_px: 12:30\n", 4, "must be a number (got '12:30')"),
        ("picks_sigma_px: 010\n", 4, "without the leading zero"),
        ("picks_sigma_px: 12,001\n", 4, "is it 12.001 or 12001? Write it without a comma"),
        ("picks_sigma_px: 1.000,5\n", 4, "decimal point"),
        ("picks_sigma_px: 2 px\n", 4, "the key's name says the unit"),
        ("picks_sigma_px: .nan\n", 4, "must be a number (got '.nan')"),
        ("picks_sigma_px: 1e999\n", 4, "must be a number"),
        ("picks_sigma_px:\n", 4, "is empty"),
        ("solve:\n", 4, "solve: is empty"),
        ("solve: remove\n", 4, "solve: must be a block of keys (got 'remove')"),
        ("time:\n  source: exiff\n", 5, "(got 'exiff'): did you mean 'exif'?"),
        ("time:\n  offset_s: maybe\n", 5, "must be a number or auto (got 'maybe')"),
        ("time:\n  offset_s: true\n", 5, "must be a number or auto (got true)"),
        ("world:\n  origin: hom\n", 5, "must be home or a block of keys (got 'hom')"),
        (
            "world:\n  origin:\n    latitude_deg: 1\n    height_m: 2\n",
            5,
            "longitude_deg: is missing",
        ),
        ("telemetry:\n  position_sigma_m: [1]\n", 5, "must be a list of 2 numbers (got [1])"),
        ("leave_out: 34\n", 4, "leave_out: must be a list of names such as [a, b] (got 34)"),
        ("telemetry:\n  position_sigma_m: 1\n", 5, "list of numbers such as [1.0, 2.0] or auto"),
        ("telemetry:\n  position_bias_sigma_m: [1, 2, 3]\n", 5, "must be a list of 2 numbers"),
        ("mount:\n  lever_arm_m:\n    - 0\n    - x\n    - 0\n", 7, "mount.lever_arm_m[1]: must be"),
        # ranges
        ("picks_sigma_px: 0\n", 4, "picks_sigma_px: must be greater than 0 (got 0)"),
        ("ground:\n  height_sigma_m: -0.3\n", 5, "must be greater than 0 (got -0.3)"),
        ("ground:\n  slope_sigma_deg: 45\n", 5, "between 0 and 45 (got 45)"),
        ("ground:\n  roughness_sigma_m: -1\n", 5, "must not be negative (got -1)"),
        ("mount:\n  lever_arm_sigma_m: 0\n", 5, "must be greater than 0"),
        ("time:\n  offset_sigma_s: 0\n", 5, "must be greater than 0"),
        (
            "time:\n  offset_s: 1.0e+300\n",
            5,
            "offset_s: must lie between -10000000000 and 10000000000 (got 1e+300)",
        ),
        ("ground:\n  height_sigma_m: 1.0e-300\n", 5, "must lie between 0.000001 and 1000000"),
        ("ground:\n  roughness_sigma_m: 1.0e-9\n", 5, "must lie between 0.000001 and 1000000"),
        ("ground:\n  slope_sigma_deg: 1.0e-9\n", 5, "must lie between 0.000001 and 1000000"),
        ("solve:\n  significance: 1.0e-300\n", 5, "must be at least 1e-12 (got 1e-300)"),
        ("time:\n  filename_format: IMG\n", 5, "strptime"),
        ("telemetry:\n  attitude_sigma_deg: [1, -2]\n", 5, "must be greater than 0 (got [1, -2])"),
        ("telemetry:\n  heading_bias_sigma_deg: 0\n", 5, "must be greater than 0"),
        ("solve:\n  significance: 0.5\n", 5, "between 0 and 0.5"),
        (
            "world:\n  origin:\n    latitude_deg: 91\n    longitude_deg: 0\n    height_m: 0\n",
            6,
            "world.origin.latitude_deg: must lie between -90 and 90 (got 91)",
        ),
        ("lines: ''\n", 4, "must not be empty"),
        # files
        ("lines: line.csv\n", 4, "no such file 'line.csv'"),
        ("log: flight.bin\n", 4, "did you mean 'flight.BIN'?"),
        ("log: elsewhere/flight.bin\n", 4, "there is no folder"),
        ("log: .\n", 4, "is a folder"),
    ],
)
def test_a_mistake_is_named_with_line_key_and_value(
    load: Load, more: str, line: int, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        load(more)

    assert caught.value.line == line
    assert words in caught.value.message
    assert "\n" not in caught.value.message  # one mistake, one message


def test_a_missing_required_key_is_named(load: Load) -> None:
    with pytest.raises(InputError, match=r"project.yaml:1: picks: is missing: add the line"):
        load("", base="images: '*.jpg'\ncamera: camera.yaml\n")


def test_all_mistakes_come_in_one_error_in_the_order_of_lines(load: Load) -> None:
    with pytest.raises(InputError) as caught:
        load(
            "picks_sigma_px: 0\n"
            "ground:\n"
            "  height_sigma_m: -1\n"
            "  slope_sigma_deg: x\n"
            "  slope: 2\n"
            "time:\n"
            "  source: log\n"
            "  offset_sigma_s: -1\n"
            "log: nothing.bin\n"
            "name: a\n"
            "name: b\n"
        )

    lines = str(caught.value).splitlines()
    places = [int(line.split("project.yaml:")[1].split(":")[0]) for line in lines]
    assert places == [4, 6, 7, 8, 10, 11, 12, 14]
    assert str(caught.value.path) in lines[-1]


@pytest.mark.parametrize("content", ["- a\n", "text\n", "3\n"])
def test_a_file_that_is_no_mapping_is_refused(load: Load, content: str) -> None:
    with pytest.raises(InputError, match="key: value"):
        load("", base=content)


def test_a_long_list_of_mistakes_is_cut(load: Load) -> None:
    with pytest.raises(InputError, match="and 10 more mistakes"):
        load("".join(f"zz{i}: 1\n" for i in range(30)))


@pytest.mark.parametrize(
    ("targets", "told"),
    [
        ("{family: aruco-4x4-5, side_m: 0.6}", r"family.*did you mean 'aruco-4x4-50'"),
        ("{family: apriltag-36h11}", r"side_m: is missing: the side of the black square"),
        ("{family: apriltag-36h11, side_m: 60}", r"side_m.*at most 10 m"),
        ("{family: apriltag-36h11, side_m: 0.6, sigma_m: 0.1}", r"sigma_m.*a tenth of the side"),
        ('{family: "charuco:8x6:30mm:40mm:DICT_5X5_100"}', r"the marker is not smaller"),
        ('{family: "charuco:8x6:30mm:20mm:DICT_5X5_100", side_m: 0.3}', r"states its own"),
        ("{family: apriltag-36h11, side: 0.6}", r"unknown key 'side'"),
    ],
)
def test_targets_that_cannot_be_are_refused(load: Load, targets: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        load(f"targets: {targets}\n")


def test_targets_are_plates_or_a_board(load: Load) -> None:
    plates = load("targets: {family: apriltag-36h11, side_m: 0.6, sigma_m: 0.002}\n").targets
    assert plates is not None
    assert (plates.side_m, plates.sigma_m, plates.is_board) == (0.6, 0.002, False)
    board = load('targets: {family: "charuco:8x6:30mm:20mm:DICT_5X5_100"}\n').targets
    assert board is not None
    assert board.is_board
    assert load("").targets is None


def test_options_made_in_python_are_checked_by_the_same_rules() -> None:
    with pytest.raises(OptionsError, match=r"significance must lie between 0 and 0.5, got 1"):
        SolveOptions(significance=1.0)
    with pytest.raises(OptionsError, match="must be a finite number"):
        GeodeticOrigin(latitude_deg=1.0, longitude_deg=2.0, height_m=float("nan"))


def test_option_pairs_name_every_option_once(load: Load) -> None:
    pairs = option_pairs(load(""))
    keys = [key for key, _ in pairs]

    assert len(keys) == len(set(keys))
    assert ("mount.pitch_deg", "auto") in pairs
    assert not any(is_dataclass(value) for _, value in pairs)
    assert {key.split(".")[0] for key in keys} == {f.name for f in fields(Project)}


@pytest.mark.parametrize("flight", ["cuav", "calm_nadir", "wind_oblique"])
def test_the_real_projects_load(data_dir: Path, flight: str) -> None:
    project = load_project(data_dir / flight / "project.yaml")

    assert project.name == flight
    assert project.images[0].endswith("photos/*.jpg")


def test_areas_of_the_ground_state_what_they_have_of_their_own(load: Load) -> None:
    project = load("ground: {height_sigma_m: 0.2, areas: {verge: {height_m: 0.4}, lawn: {}}}\n")

    assert set(project.ground.areas) == {"verge", "lawn"}
    verge = project.ground.of("verge")
    assert (verge.height_m, verge.height_sigma_m, verge.slope_sigma_deg) == (0.4, 0.2, 3.0)
    assert project.ground.of("never stated").height_m == 0.0
    assert dict(option_pairs(project))["ground.areas.verge.height_m"] == 0.4
    with pytest.raises(TypeError):
        project.ground.areas["road"] = verge  # type: ignore[index]  # what must fail


@pytest.mark.parametrize(
    ("areas", "line", "words"),
    [
        ("    verge: {hight_m: 1}\n", 6, "unknown key 'hight_m': did you mean 'height_m'?"),
        ("    verge:\n      height_sigma_m: 0\n", 7, "must be greater than 0 (got 0)"),
        ("    verge: {slope_sigma_deg: 50}\n", 6, "must lie between 0 and 45 (got 50)"),
        ("    verge: 3\n", 6, "must be a block of keys"),
        ("    default: {}\n", 5, "must not name the area 'default'"),
    ],
)
def test_a_mistake_in_an_area_is_told_with_its_line(
    load: Load, areas: str, line: int, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        load("ground:\n  areas:\n" + areas)
    assert words in str(caught.value)
    assert f":{line}:" in str(caught.value)


def test_poses_may_be_a_list_of_sources(load: Load, tmp_path: Path) -> None:
    folder = tmp_path / "crossing"
    (folder / "a.mrk").touch()

    assert load("poses: exif\n").pose_sources == ("exif",)
    assert load("poses: a.mrk\n").pose_sources == (str(folder / "a.mrk"),)
    both = load("poses: [a.mrk, exif]\n")
    assert both.pose_sources == both.poses == (str(folder / "a.mrk"), "exif")
    assert dict(option_pairs(both))["poses"] == both.poses
    assert make_paths_relative(both, folder).poses == ("a.mrk", "exif")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("[a.mrk, exif]", "no such file 'a.mrk'"),
        ("[]", "must not be empty"),
        ("[exif, exif]", "must name each source once"),
        ("[exif, 3]", "must be text"),
    ],
)
def test_a_mistake_in_the_list_of_poses_is_told_with_its_line(
    load: Load, value: str, words: str
) -> None:
    with pytest.raises(InputError, match=rf"project\.yaml:4: poses.*{words}"):
        load(f"poses: {value}\n")


# `ties` of project.yaml: a file, `auto`, or nothing.


def project(folder: Path, more: str) -> Path:
    for name in ("camera.yaml", "picks.csv"):
        (folder / name).touch()
    path = folder / "project.yaml"
    path.write_text(f"images: '*.jpg'\ncamera: camera.yaml\npicks: picks.csv\n{more}")
    return path


def test_a_project_need_not_name_any(tmp_path: Path) -> None:
    assert load_project(project(tmp_path, "")).ties is None


def test_a_file_becomes_absolute_and_auto_stays(tmp_path: Path) -> None:
    (tmp_path / "t.csv").touch()

    assert load_project(project(tmp_path, "ties: t.csv\n")).ties == str(tmp_path / "t.csv")
    assert load_project(project(tmp_path, "ties: auto\n")).ties == "auto"


def test_a_file_that_is_missing_says_who_makes_it(tmp_path: Path) -> None:
    path = project(tmp_path, "ties: ties.csv\n")

    with pytest.raises(
        InputError, match=r":4: .*no such file 'ties.csv'.*`ties: auto` to have them found"
    ):
        load_project(path)
    assert load_project(path, unfinished=True).ties == str(tmp_path / "ties.csv")


def test_an_empty_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="ties"):
        load_project(project(tmp_path, "ties: ''\n"))


# `units:` of a project file.


def project_with(folder: Path, line: str) -> Path:
    (folder / "camera.yaml").touch()
    file = folder / "project.yaml"
    file.write_text(f"images: '*.jpg'\ncamera: camera.yaml\npicks: picks.csv\n{line}\n")
    return file


@pytest.mark.parametrize(
    ("line", "units"),
    [
        ("", METRIC),
        ("units: metric", METRIC),
        ("units: imperial", IMPERIAL),
        ("units: {length: ft}", Units(length="ft")),
        ("units: {length: ft-in, speed: m/s}", Units(length="ft-in", speed="m/s")),
    ],
)
def test_units_are_read_in_full_and_in_one_word(line: str, units: Units, tmp_path: Path) -> None:
    assert load_project(project_with(tmp_path, line), unfinished=True).units == units


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("units: yards", "must be metric, imperial, or such as"),
        ("units: US survey feet", "write ft, the international foot of 0.3048 m"),
        ("units: {length: inch}", "must be m, ft or ft-in"),
        ("units: {width: m}", "unknown key 'width'"),
        ("units: {speed: knots}", "must be km/h, mph or m/s"),
    ],
)
def test_other_units_are_refused_with_a_way_out(line: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=why) as refused:
        load_project(project_with(tmp_path, line), unfinished=True)

    assert ":4: units" in str(refused.value)
