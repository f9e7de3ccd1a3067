"""PDF pages with pictures as JPEG; Matplotlib's own storage takes ten times the space.

Matplotlib has no option for it (its issue 25130), so two of its methods are replaced. If they are
renamed one day, the pictures are stored without loss again.
"""

from __future__ import annotations

import io
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_pdf import Name, PdfFile, PdfPages
from PIL import Image

from uavgram.imaging.photos.preview import Pixels

QUALITY = 88
"""Quality for libjpeg at which no difference is visible on paper."""


class JpegPages(PdfPages):
    """`PdfPages` that stores colour pictures as JPEG."""

    def _ensure_file(self) -> Any:  # noqa: ANN401
        if self._file is None:
            make: Any = _JpegFile  # Matplotlib's own class has no types
            self._file = make(self._filename, metadata=self._metadata)
        return self._file


class _JpegFile(PdfFile):
    def _writeImg(self, data: Pixels, id: int, smask: Any = None) -> None:  # noqa: A002, ANN401, N802
        """Store (H, W, 3) RGB without opacity as JPEG, all else as Matplotlib does."""
        height, width, bands = data.shape
        if bands != 3 or smask is not None:
            super()._writeImg(data, id, smask)  # type: ignore[no-untyped-call]
            return
        file: Any = self
        name: Any = Name
        stored = io.BytesIO()
        Image.fromarray(data).save(stored, format="jpeg", quality=QUALITY)
        with rc_context({"pdf.compression": 0}):  # JPEG is compressed already
            file.beginStream(
                id,
                file.reserveObject("length of image stream"),
                {
                    "Type": name("XObject"),
                    "Subtype": name("Image"),
                    "Width": width,
                    "Height": height,
                    "ColorSpace": name("DeviceRGB"),
                    "BitsPerComponent": 8,
                    "Filter": name("DCTDecode"),
                },
            )
            file.currentstream.write(stored.getvalue())
            file.endStream()
