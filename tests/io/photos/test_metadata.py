"""Metadata of photos: EXIF and XMP tags."""

import logging
import struct
import tracemalloc
import zlib
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import pytest
import tagged_jpeg

from uavgram.errors import InputError
from uavgram.io.photos.catalogue import read_photos
from uavgram.io.photos.metadata import (
    DJI,
    PIX4D,
    exif_numbers,
    parse_xmp,
    read_exif_place,
    read_exif_tags,
    read_image_size,
    read_xmp,
)
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
