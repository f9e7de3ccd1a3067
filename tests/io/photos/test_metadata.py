"""Metadata of photos: EXIF and XMP tags."""

import logging
import math
import struct
import tracemalloc
import zlib
from pathlib import Path
from typing import Literal, Protocol, Unpack

import cv2
import numpy as np
import pytest
import tagged_jpeg
from camera_facts import CameraFacts
from camera_photos import camera_photo
from PIL.TiffImagePlugin import IFDRational

from uavgram.errors import InputError
from uavgram.io.photos.catalogue import read_photos
from uavgram.io.photos.metadata import (
    DJI,
    PIX4D,
    exif_numbers,
    parse_xmp,
    read_all_camera_tags,
    read_camera_tags,
    read_exif_place,
    read_exif_tags,
    read_image_size,
    read_xmp,
)
from uavgram.model.camera import CameraTags
from uavgram.model.options import TimeOptions


def test_tags_are_read_by_their_names(data_dir: Path) -> None:
    tags = read_exif_tags(data_dir / "wind_oblique" / "photos" / "IMG_0025.jpg")

    assert str(tags["EXIF DateTimeOriginal"]) == "2026:11:21 09:29:17"
    assert str(tags["EXIF SubSecTimeOriginal"]) == "864"


def test_damaged_exif_is_read_or_refused_by_name(data_dir: Path, tmp_path: Path) -> None:
    whole = (data_dir / "brighton_beach" / "DJI_0025.JPG").read_bytes()[:40_000]
    rng = np.random.default_rng(0)
    refused = []
    for _ in range(300):
        damaged = bytearray(whole)
        for place in rng.integers(12, 4_000, 30):
            damaged[place] = rng.integers(256)
        path = tmp_path / "photo.jpg"
        path.write_bytes(damaged)
        try:
            read_exif_tags(path)
        except InputError as error:
            refused.append(str(error))

    assert refused
    assert all("photo.jpg: its EXIF is broken" in text for text in refused)


def test_a_photo_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.jpg: cannot be read"):
        read_exif_tags(tmp_path / "gone.jpg")
    with pytest.raises(InputError, match="gone"):
        read_photos((str(tmp_path / "gone.jpg"),), TimeOptions())


def png(chunk: bytes = b"") -> bytes:
    plain = cv2.imencode(".png", np.zeros((6, 8, 3), np.uint8))[1].tobytes()
    head = 8 + 25  # signature, and the first chunk: what it describes
    return plain[:head] + chunk + plain[head:]


def tiff(count: int, at: bytes) -> bytes:
    """An EXIF block with one tag, the camera's model."""
    entry = struct.pack(">HHI", 0x0110, 2, count) + at
    return b"MM\0*\0\0\0\x08" + struct.pack(">H", 1) + entry + bytes(4)


def test_a_png_without_exif_has_no_tags_and_nothing_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(png())

    assert read_exif_tags(path) == {}
    assert caplog.records == []
    logging.getLogger("exifread").warning("of someone else")
    assert [record.message for record in caplog.records] == ["of someone else"]


def test_the_exif_chunk_of_a_png_is_read(tmp_path: Path) -> None:
    """PNG, third edition, 11.3.4.5: length, name, the block without its ``Exif`` head, CRC."""
    body = b"eXIf" + tiff(4, b"Eye\0")
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    path = tmp_path / "a.png"
    path.write_bytes(png(chunk))

    assert str(read_exif_tags(path)["Image Model"]) == "Eye"


def test_a_tag_that_asks_for_gigabytes_is_refused_and_gets_none(tmp_path: Path) -> None:
    block = b"Exif\0\0" + tiff(3_800_000_000, struct.pack(">I", 8))
    plain = cv2.imencode(".jpg", np.zeros((6, 8, 3), np.uint8))[1].tobytes()
    path = tmp_path / "a.jpg"
    path.write_bytes(
        plain[:2] + b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block + plain[2:]
    )
    tracemalloc.start()
    with pytest.raises(InputError, match=r"a\.jpg: its EXIF is broken .*3,800,000,000 bytes"):
        read_exif_tags(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5_000_000


def test_a_tiff_that_says_it_is_huge_is_not_decoded(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    cv2.imwrite(str(path), np.zeros((6, 8, 3), np.uint8))
    data = bytearray(path.read_bytes())
    (at,) = struct.unpack_from("<I", data, 4)
    for k in range(struct.unpack_from("<H", data, at)[0]):
        tag, kind = struct.unpack_from("<HH", data, at + 2 + 12 * k)
        if tag in (256, 257):
            struct.pack_into("<HII", data, at + 4 + 12 * k, 4, 1, 30_000)
            assert kind in (3, 4)
    path.write_bytes(data)
    assert read_image_size(path) == (30_000, 30_000)


def tiff_file(
    path: Path, tag: int, kind: int, data: bytes, count: int = 1, order: Literal["<", ">"] = "<"
) -> Path:
    """A TIFF file whose GPS directory has one entry (two for a place's half)."""
    first = struct.pack(order + "HIHHIII", 42, 8, 1, 0x8825, 4, 1, 26)[0:]
    head = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, 8)
    assert first[:6] == head[2:]
    directory = struct.pack(order + "HHHIII", 1, 0x8825, 4, 1, 26, 0)
    value = data if len(data) > 4 else b""
    field = struct.pack(order + "I", 44) if value else data.ljust(4, b"\0")
    entry = struct.pack(order + "HHHI", 1, tag, kind, count) + field + bytes(4)
    path.write_bytes(head + directory + entry + value)
    return path


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("kind", "code", "values", "number"),
    [
        (1, "B", [7], 7.0),
        (3, "H", [7], 7.0),
        (4, "I", [70000], 70000.0),
        (5, "II", [47, 10], 4.7),
        (6, "b", [-7], -7.0),
        (8, "h", [-7], -7.0),
        (9, "i", [-70000], -70000.0),
        (10, "ii", [-47, 10], -4.7),
        (11, "f", [4.75], 4.75),
        (12, "d", [4.7], 4.7),
        (2, "4s", [b"4.7"], 4.7),
    ],
)
def test_a_number_of_any_type_that_exif_has_is_read(
    tmp_path: Path,
    order: Literal["<", ">"],
    kind: int,
    code: str,
    values: list[float | bytes],
    number: float,
) -> None:
    data = struct.pack(order + code, *values)
    count = len(data) if kind == 2 else 1
    path = tiff_file(tmp_path / "a.tif", 6, kind, data, count, order)

    assert exif_numbers(read_exif_tags(path)["GPS GPSAltitude"]) == [number]
    assert read_exif_place(path).altitude_m == number


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_a_number_that_is_none_counts_as_absent(tmp_path: Path, number: float) -> None:
    path = tiff_file(tmp_path / "a.tif", 6, 12, struct.pack("<d", number))

    assert exif_numbers(read_exif_tags(path)["GPS GPSAltitude"]) == []
    assert exif_numbers(None) == []


def test_a_place_in_doubles_is_read(tmp_path: Path) -> None:
    path = tiff_file(tmp_path / "a.tif", 2, 12, struct.pack("<3d", 50.0, 30.0, 36.0), 3)

    assert exif_numbers(read_exif_tags(path)["GPS GPSLatitude"]) == [50.0, 30.0, 36.0]


ELEMENTS = (
    '<rdf:Description xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/">'
    "<drone-dji:GimbalYawDegree> +9.50 </drone-dji:GimbalYawDegree>"
    "<drone-dji:GimbalPitchDegree>-16.60</drone-dji:GimbalPitchDegree></rdf:Description>"
)


def test_attributes_and_elements_say_the_same() -> None:
    as_attributes = parse_xmp(tagged_jpeg.dji(GimbalYawDegree="+9.50", GimbalPitchDegree="-16.60"))
    as_elements = parse_xmp(tagged_jpeg.packet(ELEMENTS))

    expected = {(DJI, "GimbalYawDegree"): "+9.50", (DJI, "GimbalPitchDegree"): "-16.60"}
    assert as_attributes == as_elements == expected


def test_the_prefix_does_not_matter_and_the_last_slash_of_a_namespace_neither() -> None:
    inner = '<rdf:Description xmlns:q="http://pix4d.com/camera/1.0" q:Yaw="4"/>'

    assert parse_xmp(tagged_jpeg.packet(inner))[PIX4D, "Yaw"] == "4"


def test_a_photo_without_a_packet_has_no_tags(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(tagged_jpeg.jpeg())

    assert read_xmp(path) == {}


def test_a_packet_behind_the_pixels_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(tagged_jpeg.jpeg() + tagged_jpeg.dji(GimbalYawDegree="1"))

    assert read_xmp(path) == {}


@pytest.mark.parametrize(
    "declaration",
    [
        '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;&b;&b;">]>',
        '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/hostname">]>',
        '<!DOCTYPE a SYSTEM "http://example.org/a.dtd">',
    ],
)
def test_entities_and_document_types_are_refused(declaration: str) -> None:
    bomb = declaration.encode() + tagged_jpeg.packet("<rdf:Description/>")
    with pytest.raises(ValueError, match="declares"):
        parse_xmp(bomb)


@pytest.mark.parametrize("rest", [b"", b"\0\0\0\x14meta" + bytes(60)], ids=["ends", "empty meta"])
def test_a_heic_with_the_name_of_a_jpeg_is_an_error_that_names_its_format(
    tmp_path: Path, rest: bytes
) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0heicmif1" + rest)
    with pytest.raises(InputError, match=r"a\.jpg: is a HEIC photo, which is not read"):
        read_exif_tags(path)


def test_a_broken_packet_is_an_error_that_names_the_photo(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(tagged_jpeg.jpeg(tagged_jpeg.packet("<rdf:Description>")))

    with pytest.raises(InputError, match=r"a\.jpg: its XMP packet cannot be read"):
        read_xmp(path)


# What photos say of their camera: tags written by Pillow, and DJI's own photos.


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
