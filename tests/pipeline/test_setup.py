"""What a folder holds, and what the page writes about it: comments and all else stay."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Literal

import pytest
import yaml
from pick_pages import small_project

from uavgram.config.project import load_project
from uavgram.config.project_text import Settings, apply_settings
from uavgram.errors import UavgramError
from uavgram.model.naming import IMPERIAL
from uavgram.model.provenance import Case
from uavgram.pipeline.new import Choices
from uavgram.pipeline.setup import (
    Setup,
    SetupChoices,
    change_left_out,
    inspect_folder,
    set_up,
    use_recorded_angles,
)

GCP = """EPSG:32632
350000.0 5650000.0 100.0 120.5 130.5 P1.jpg A
350010.0 5650000.0 100.0 320.5 130.5 P1.jpg B
350000.0 5650000.0 100.0 120.5 330.5 P2.jpg A
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Photos and a camera file, no project."""
    small_project(tmp_path / "case").unlink()
    return tmp_path / "case"


def test_a_gcp_list_of_another_flight_is_named_and_not_offered(folder: Path) -> None:
    (folder / "gcp_list.txt").write_text(
        GCP.replace("P1.jpg", "X1.jpg").replace("P2.jpg", "X2.jpg")
    )
    found = inspect_folder(folder)

    assert found.gcp_lists == ()
    assert found.unusable == ("gcp_list.txt is not used: it names none of the photos here.",)


def test_photos_in_a_format_without_a_reader_are_named_unless_they_are_there_as_jpeg(
    folder: Path,
) -> None:
    heic = b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"
    for name in ("P1.heic", "P8.HEIC", "P9.HEIC"):
        (folder / name).write_bytes(heic)
    found = inspect_folder(folder)

    (named,) = found.unusable
    assert named == (
        "Passed over: 2 x HEIC photo. A HEIC photo: save it as JPEG, with its tags and in its full "
        "size."
    )
    assert "1 x HEIC photo" in found.passed_over


def test_a_photo_of_another_format_than_its_ending_is_named(folder: Path) -> None:
    (folder / "P9.jpg").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic")

    (named,) = inspect_folder(folder).unusable
    assert named.startswith("Passed over: 1 x HEIC photo. P9.jpg is a HEIC photo. A HEIC photo: ")


def test_a_gcp_list_is_taken_with_its_sigma(folder: Path) -> None:
    (folder / "gcp_list.txt").write_text(GCP)
    (folder / "notes.odt").write_bytes(b"x")
    found = inspect_folder(folder)
    assert found.gcp_lists == ("gcp_list.txt",)
    assert "odt" in found.passed_over
    path = set_up(
        folder,
        SetupChoices(choices=Choices(), setup=Setup(), gcp_list="gcp_list.txt", gcp_sigma_m=0.03),
    )
    assert load_project(path).control == str(folder / "control.csv")
    assert "0.03" in (folder / "control.csv").read_text()
    assert (folder / "picks.csv").read_text().count("\n") == 4


def test_what_cannot_be_taken_leaves_the_folder_as_it_was(folder: Path) -> None:
    (folder / "gcp_list.txt").write_text("EPSG:32632\nnonsense\n")
    before = sorted(folder.rglob("*"))
    wanted = SetupChoices(choices=Choices(), setup=Setup(), gcp_list="gcp_list.txt")
    with pytest.raises(UavgramError):
        set_up(folder, wanted)
    assert sorted(folder.rglob("*")) == before


def test_a_project_that_is_there_is_changed_only_in_what_differs(folder: Path) -> None:
    wanted = Setup(
        pitch_deg=-30.0, reading_sigma_m=0.004, units=IMPERIAL, case=Case(number="no", place="a: #")
    )
    path = set_up(folder, SetupChoices(choices=Choices(camera=Path("unknown")), setup=wanted))
    text = path.read_text()
    found = inspect_folder(folder)
    assert (found.setup, found.camera, found.fault) == (wanted, "unknown", "")
    set_up(folder, SetupChoices(choices=Choices(camera=Path("unknown")), setup=wanted))
    assert path.read_text() == text
    set_up(folder, SetupChoices(choices=Choices(camera=Path("camera.yaml")), setup=wanted))
    assert path.read_text() == text.replace("camera: unknown", "camera: camera.yaml")


def test_photos_of_one_name_in_two_folders_are_two_kinds_of_which_one_is_chosen(
    folder: Path,
) -> None:
    (first,) = inspect_folder(folder).photos
    photos = sorted(folder.glob(first.pattern))
    (folder / "again").mkdir()
    shutil.copy(photos[0], folder / "again")
    found = {one.pattern: one.kind for one in inspect_folder(folder).photos}
    assert sorted(found.values()) == [0, 1]
    with pytest.raises(UavgramError, match=r"same file name in several folders \(1 names") as why:
        set_up(folder, SetupChoices(choices=Choices(), setup=Setup()))
    assert all(pattern in str(why.value) for pattern in found)
    choices = Choices(images=(first.pattern,))
    path = set_up(folder, SetupChoices(choices=choices, setup=Setup()))
    assert len(load_project(path, unfinished=True).images) == 1


def test_a_log_is_left_out_taken_and_taken_back(folder: Path, data_dir: Path) -> None:
    shutil.copy(data_dir / "street_oblique" / "flight.tlog", folder)
    found = inspect_folder(folder)
    assert (found.logs, found.log, found.has_gimbal) == (("flight.tlog",), None, False)
    path = set_up(folder, SetupChoices(choices=Choices(log="none"), setup=Setup()))
    assert load_project(path).log is None
    chosen: tuple[tuple[Path | Literal["none"] | None, str | None], ...] = (
        (Path("flight.tlog"), "flight.tlog"),
        (None, "flight.tlog"),
        ("none", None),
    )
    for choice, named in chosen:
        set_up(folder, SetupChoices(choices=Choices(log=choice), setup=Setup()))
        assert inspect_folder(folder).log == named
    assert load_project(path).log is None


@pytest.mark.parametrize(
    ("before", "settings", "after"),
    [
        ("a: 1\nmount: {gimbal: none} # x", {"mount": {"pitch_deg": -45.0}}, None),
        ("mount:\n    gimbal: none\nb: 2\n", {"mount": {"pitch_deg": -1.5}}, None),
        (
            "a: 1\r\n# units: metric # read\r\n",
            {"units": "imperial"},
            "a: 1\r\nunits: imperial # read\r\n",
        ),
        ("# case:  # head\n#   number: ''  # n\n# b\n", {"case": {"number": "7"}}, None),
        ("a: [1,\n  2]\n", {"case": {"title": "x: y # z"}}, None),
        ("mount: &m\n  gimbal: none\n", {"mount": {"pitch_deg": 0.0}}, ""),
        ("mount: {gimbal: none,\n  pitch_deg: 0}\n", {"mount": {"pitch_deg": -1.0}}, ""),
    ],
)
def test_settings_are_written_where_a_person_would(
    before: str, settings: Settings, after: str | None
) -> None:
    """`after`: the text; empty: it cannot be changed; None: as YAML reads it, nothing is lost."""
    changed = apply_settings(before, settings)
    if after == "":
        assert changed is None
        return
    assert changed is not None
    if after is not None:
        assert changed == after
    said = yaml.safe_load(changed)
    for key, value in settings.items():
        old = (yaml.safe_load(before) or {}).get(key) or {}
        assert said[key] == ({**old, **value} if isinstance(value, dict) else value)
    assert changed.count("#") >= before.count("#") - before.count("\n#") - before.startswith("#")


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("images: a\n", "images: a\nleave_out: [b.jpg, c.jpg]\n"),
        (
            "images: a\n# leave_out: [IMG_0007.JPG] # which\n",
            "images: a\nleave_out: [b.jpg, c.jpg] # which\n",
        ),
        ("leave_out: b.jpg\nname: x\n", "leave_out: [b.jpg, c.jpg]\nname: x\n"),
        ("leave_out: []\n", "leave_out: [b.jpg, c.jpg]\n"),
        (
            "leave_out: # which\n  - b.jpg\n  - z.jpg\nname: x\n",
            "leave_out: [b.jpg, c.jpg] # which\nname: x\n",
        ),
    ],
)
def test_a_list_is_set_however_it_is_written(before: str, after: str) -> None:
    assert apply_settings(before, {"leave_out": ["b.jpg", "c.jpg"]}) == after


def test_photos_are_left_out_by_name_and_taken_back(tmp_path: Path) -> None:
    project = small_project(tmp_path)
    change_left_out(project, ["P1.jpg", "a, b]: '1'.jpg"], is_taken_back=False)
    change_left_out(project, ["P1.jpg"], is_taken_back=False)
    assert load_project(project, unfinished=True).leave_out == ("a, b]: '1'.jpg", "P1.jpg")
    change_left_out(project, ["P1.jpg"], is_taken_back=True)
    assert load_project(project, unfinished=True).leave_out == ("a, b]: '1'.jpg",)


def test_the_recorded_angles_take_the_place_of_a_stated_mount(folder: Path) -> None:
    turned = Setup(pitch_deg=-45.0, yaw_deg=90.0, roll_deg=-5.0)
    path = set_up(folder, SetupChoices(choices=Choices(), setup=turned))
    use_recorded_angles(path)
    mount = load_project(path, unfinished=True).mount
    assert (mount.gimbal, mount.pitch_deg, mount.yaw_deg, mount.roll_deg) == ("auto",) * 4


def test_a_camera_that_is_turned_on_the_drone_is_written_and_taken_back(folder: Path) -> None:
    path = set_up(folder, SetupChoices(choices=Choices(), setup=Setup(pitch_deg=-45.0)))
    assert "\n  yaw_deg" not in path.read_text()  # nobody turned it
    turned = Setup(pitch_deg=-45.0, yaw_deg=90.0, roll_deg=-5.0)
    set_up(folder, SetupChoices(choices=Choices(), setup=turned))
    mount = load_project(path, unfinished=True).mount
    assert (mount.gimbal, mount.angles_deg()) == ("none", (90.0, -45.0, -5.0))
    assert inspect_folder(folder).setup == turned
    set_up(folder, SetupChoices(choices=Choices(), setup=Setup()))
    assert inspect_folder(folder).setup == Setup()


def test_a_date_of_the_case_that_does_not_exist_is_refused_with_its_line(folder: Path) -> None:
    path = set_up(folder, SetupChoices(choices=Choices(), setup=Setup()))
    path.write_text(path.read_text() + "case:\n  date: 31.02.2026\n")
    with pytest.raises(UavgramError, match=r"case.date: there is no such date as 31.02.2026"):
        load_project(path, unfinished=True)
