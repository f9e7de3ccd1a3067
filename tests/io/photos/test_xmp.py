"""XMP: attribute and element form, and nothing that could expand or hang."""

from pathlib import Path

import pytest
import tagged_jpeg

from uavgram.errors import InputError
from uavgram.io.photos.metadata import DJI, PIX4D, parse_xmp, read_xmp

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


def test_a_broken_packet_is_an_error_that_names_the_photo(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(tagged_jpeg.jpeg(tagged_jpeg.packet("<rdf:Description>")))

    with pytest.raises(InputError, match=r"a\.jpg: its XMP packet cannot be read"):
        read_xmp(path)
