"""What photos say of their camera: tags written by Pillow, and DJI's own photos."""

import math
from pathlib import Path
from typing import Protocol, Unpack

import numpy as np
import pytest
from camera_facts import CameraFacts
from camera_photos import camera_photo
from PIL.TiffImagePlugin import IFDRational

from uavgram.errors import InputError
from uavgram.io.photos.camera_tags import read_all_camera_tags, read_camera_tags
from uavgram.model.camera.tags import CameraTags


class TagsOf(Protocol):
    def __call__(self, **facts: Unpack[CameraFacts]) -> CameraTags: ...


# As a Phantom 4 RTK writes it (published in Agisoft's forum, topic 10220).
DEWARP = (
    "2018-09-06;3684.480000000000,3677.570000000000,2.240000000000,22.050000000000,"
    "-0.263482000000,0.106788000000,0.000037110700,-0.000327247000,-0.030078300000"
)


@pytest.fixture
def tags_of(tmp_path: Path) -> TagsOf:
    def read(**facts: Unpack[CameraFacts]) -> CameraTags:
        return read_camera_tags(camera_photo(tmp_path / "photo.jpg", **facts))

    return read


def test_what_exif_says_is_read(tags_of: TagsOf) -> None:
    tags = tags_of(
        make="DJI", model="FC220", focal=(47, 10), equivalent=26, distance=(5, 2), serial="0AB"
    )

    assert (tags.make, tags.model, tags.camera_name) == ("DJI", "FC220", "DJI FC220")
    assert (tags.width_px, tags.height_px, tags.serial) == (400, 300, "0AB")
    assert (tags.focal_mm, tags.focal_step_mm, tags.focal_35mm_mm) == (4.7, 0.1, 26.0)
    assert (tags.focus_m, tags.digital_zoom) == (2.5, 1.0)
    assert (tags.dewarp, tags.dewarped) == ((), False)


def test_what_exif_does_not_say_is_unknown(tags_of: TagsOf) -> None:
    tags = tags_of(focal=(0, 0), equivalent=0, zoom=(0, 0), distance=(0, 1))

    assert all(map(math.isnan, (tags.focal_mm, tags.focal_35mm_mm, tags.focus_m)))
    assert tags.digital_zoom == 1.0
    assert tags.camera_name == ""


def test_digital_zoom_is_read(tags_of: TagsOf) -> None:
    assert tags_of(zoom=(2, 1)).digital_zoom == 2.0


@pytest.mark.parametrize("text", [DEWARP, " " + DEWARP.replace(",", ", ")])
def test_djis_calibration_is_read(tags_of: TagsOf, text: str) -> None:
    tags = tags_of(dji={"DewarpData": text, "DewarpFlag": "0"})

    assert tags.dewarp[:4] == (3684.48, 3677.57, 2.24, 22.05)
    assert tags.dewarp[4:] == (-0.263482, 0.106788, 0.0000371107, -0.000327247, -0.0300783)
    assert not tags.dewarped
    assert tags_of(dji={"DewarpData": text, "DewarpFlag": "1"}).dewarped


def test_the_one_with_twelve_parameters_goes_first(tags_of: TagsOf) -> None:
    longer = DEWARP + ",0.1,0.2,0.3"

    assert tags_of(dji={"DewarpData": DEWARP, "DewarpDataK6": longer}).dewarp[9:] == (0.1, 0.2, 0.3)


def test_a_camera_that_was_never_calibrated_says_zeros(tags_of: TagsOf) -> None:
    assert tags_of(dji={"DewarpData": "2020-01-01;0,0,0,0,0,0,0,0,0"}).dewarp == ()


@pytest.mark.parametrize(
    "text", ["2018-09-06;1,2,3", DEWARP.replace("2.24", "x"), "nan," * 8 + "1"]
)
def test_a_broken_calibration_is_refused_by_name(tags_of: TagsOf, text: str) -> None:
    with pytest.raises(InputError, match=r"photo\.jpg: its tag DewarpData is no calibration"):
        tags_of(dji={"DewarpData": text})
    with pytest.raises(InputError, match="no positive focal lengths"):
        tags_of(dji={"DewarpData": DEWARP.replace(";3684", ";-3684")})


def test_real_photos_say_their_camera(data_dir: Path) -> None:
    beach = data_dir / "brighton_beach"
    tags = read_all_camera_tags(str(beach / f"DJI_00{n}.JPG") for n in (25, 26, 33))

    assert {t.camera_name for t in tags} == {"DJI FC300S"}
    assert {(t.focal_mm, t.focal_step_mm, t.focal_35mm_mm) for t in tags} == {(3.61, 0.01, 20.0)}


@pytest.mark.parametrize(
    ("value", "focal", "step"),
    [((473, 100), 4.73, 0.01), (4.73, 4.73, 0.01), (50.0, 50.0, 1.0), (np.pi, np.pi, 0.0)],
)
def test_a_focal_length_of_any_number_type_is_read(
    tags_of: TagsOf, value: tuple[int, int] | float, focal: float, step: float
) -> None:
    """Pillow writes a float as a double: it was a TypeError."""
    tags = tags_of(focal=value)

    assert tags.focal_mm == pytest.approx(focal)
    assert tags.focal_step_mm == pytest.approx(step)


def test_all_numbers_may_be_doubles(tags_of: TagsOf) -> None:
    names = {41486: 137.5, 41487: 138.0, 41988: 2.0, 41989: 35.0, 37382: 12.5, 40962: 800.0}
    tags = tags_of(focal=10.0, details={**names, 40963: 600.0, 41488: 4})

    assert (tags.focal_35mm_mm, tags.digital_zoom, tags.focus_m) == (35.0, 2.0, 12.5)
    assert tags.focal_plane_per_mm == (137.5, 138.0)
    assert tags.original_px == (800.0, 600.0)


@pytest.mark.parametrize("unit", [(None, 25.4), (2, 25.4), (3, 10.0), (4, 1.0), (5, 0.001)])
def test_the_sensors_resolution_is_read_in_its_unit(
    tags_of: TagsOf, unit: tuple[int | None, float]
) -> None:
    code, mm = unit
    stated: dict[int, float | IFDRational] = {
        41486: IFDRational(5616000, 1459),
        **({} if code is None else {41488: code}),
    }
    across, down = tags_of(details=stated).focal_plane_per_mm

    assert across == down == pytest.approx(5616000 / 1459 / mm)


@pytest.mark.parametrize("code", [1, 6, 77])
def test_a_resolution_without_a_length_is_unknown(tags_of: TagsOf, code: int) -> None:
    assert all(map(math.isnan, tags_of(details={41486: 3849.0, 41488: code}).focal_plane_per_mm))


@pytest.mark.parametrize(
    ("make", "model", "name"),
    [
        ("Canon", "Canon EOS 6D", "Canon EOS 6D"),
        ("NIKON CORPORATION", "NIKON D850", "NIKON D850"),
        ("SONY", "ILCE-7RM4", "SONY ILCE-7RM4"),
        ("DJI", "FC220", "DJI FC220"),
        ("", "Eye", "Eye"),
        ("Canon", "", "Canon"),
    ],
)
def test_a_make_is_said_once(tags_of: TagsOf, make: str, model: str, name: str) -> None:
    assert tags_of(make=make, model=model).camera_name == name
