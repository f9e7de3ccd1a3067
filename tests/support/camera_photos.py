"""Small photos that say what a test wants of their camera: EXIF by Pillow, XMP by hand."""

from __future__ import annotations

from pathlib import Path

from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from uavgram.imaging.photos.decoding import Segment
from uavgram.io.photos.metadata import APP1, XMP_HEAD, build_jpeg, parse_jpeg

_MAKE, _MODEL, _EXIF = 271, 272, 0x8769
_FOCAL, _DISTANCE, _ZOOM, _EQUIVALENT, _SERIAL = 37386, 37382, 41988, 41989, 42033


def camera_photo(
    path: Path,
    size: tuple[int, int] = (400, 300),
    *,
    make: str = "",
    model: str = "",
    focal: tuple[int, int] | float | None = None,
    equivalent: int | None = None,
    zoom: tuple[int, int] | None = None,
    distance: tuple[int, int] | None = None,
    serial: str = "",
    dji: dict[str, str] | None = None,
    details: dict[int, float | IFDRational] | None = None,
) -> Path:
    """Write a grey JPEG with these tags; `dji` are attributes of DJI's XMP.

    `details`: more tags of EXIF by their numbers; Pillow writes a Python float as a double.
    """
    exif = Image.Exif()
    for key, text in ((_MAKE, make), (_MODEL, model)):
        if text:
            exif[key] = text
    stated = exif.get_ifd(_EXIF)
    stated.update(details or {})
    for key, ratio in ((_FOCAL, focal), (_ZOOM, zoom), (_DISTANCE, distance)):
        if ratio is not None:
            stated[key] = IFDRational(*ratio) if isinstance(ratio, tuple) else ratio
    if equivalent is not None:
        stated[_EQUIVALENT] = equivalent
    if serial:
        stated[_SERIAL] = serial
    Image.new("L", size, 128).save(path, "JPEG", exif=exif)
    if dji is not None:
        attributes = " ".join(f'drone-dji:{name}="{value}"' for name, value in dji.items())
        packet = (
            '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
            'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description '
            f'xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/" {attributes}/></rdf:RDF>'
            "</x:xmpmeta>"
        ).encode()
        parsed = parse_jpeg(path.read_bytes())
        assert parsed is not None
        segments = [*parsed.segments, Segment(APP1, XMP_HEAD + packet)]
        path.write_bytes(build_jpeg(segments, parsed.scan))
    return path
