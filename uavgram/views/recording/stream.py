"""Open recording: rows by frame and capture time, and static content.

Entity paths are fixed words: names given by people are in texts only, never in a path, where
Rerun would reject blanks and other characters.
"""

from __future__ import annotations

import errno
import hashlib
import logging
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import rerun as rr
from PIL.Image import Image

from uavgram.errors import OutputError
from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats, Ints
from uavgram.views.style import OBSERVED, Rgb

log = logging.getLogger(__name__)

PIECE_BYTES = 1 << 20
# Opening one of these duplicates the file descriptor (Linux, macOS; not Windows).
DESCRIPTORS = Path("/dev/fd")
_HAS_DESCRIPTORS = sys.platform != "win32" and DESCRIPTORS.is_dir()


class FileSink:
    """Copy of the bytes written to `path` into a file.

    Rerun's own file writer is a thread that ends at the first error (such as a full disk), and a
    flush or a disconnect that waits for it then never returns (rerun-sdk 0.41). A pipe that is
    always read to its end has no such error; errors of the file are raised as an exception.

    Open `path` for writing, then `start`; when it is closed, `finish`.

    Attributes
    ----------
    path
        Path to which Rerun writes; without such pipes (on Windows) the file itself.
    """

    def __init__(self, target: Path) -> None:
        self._target = target
        self._failure: OSError | None = None
        self._thread: threading.Thread | None = None
        self._ends: tuple[int, int] | None = os.pipe() if _HAS_DESCRIPTORS else None
        self.path = target if self._ends is None else DESCRIPTORS / str(self._ends[1])

    def start(self) -> None:
        """Begin to copy; `path` must be open, so that the copy ends with its writer."""
        if self._ends is None:
            return
        read_end, write_end = self._ends
        os.close(write_end)
        self._ends = None
        self._thread = threading.Thread(
            target=self._copy, args=(os.fdopen(read_end, "rb", buffering=0),)
        )
        self._thread.start()

    def finish(self) -> None:
        """Wait for the end.

        Raises
        ------
        OSError
            If the file could not be written.
        """
        if self._ends is not None:  # never started
            for end in self._ends:
                os.close(end)
            self._ends = None
        if self._thread is not None:
            self._thread.join()
        if self._failure is not None:
            raise self._failure

    def _copy(self, source: BinaryIO) -> None:
        with source:
            try:
                with self._target.open("wb") as file:
                    shutil.copyfileobj(source, file, PIECE_BYTES)
            except OSError as failure:
                self._failure = failure
                while source.read(PIECE_BYTES):  # the writer must never wait for a reader
                    pass


APPLICATION_ID = "uavgram"
FRAME_TIMELINE = "frame"
TIME_TIMELINE = "capture_time"

FIRST = 1
"""Number of the first frame: the viewer opens at the first instant, so nothing is before it."""

# Rerun ends a complete file with a footer that ends with this mark and 4 bytes of its version.
FOOTER_MARK = b"RRF2FOOT"
FOOTER_VERSION_BYTES = 4

# Rerun puts the corner of the first pixel at (0, 0), this program its centre.
CENTRE_PX = 0.5
JPEG_QUALITY = 92
# Rerun draws at most 60 000 ellipsoids of one entity.
MAX_ELLIPSOIDS = 50_000
Colours = Rgb | Pixels | Sequence[Rgb]

# Function that makes the columns of one archetype for some of the frames.
Columns = Callable[[Ints], rr.ComponentColumnList]


@contextmanager
def strict_rerun() -> Iterator[None]:
    """Make Rerun raise instead of warn, only within the block: the switch is global."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


@dataclass(frozen=True, eq=False)
class Recorder:
    """Recording stream with the times of the frames.

    Attributes
    ----------
    stream
        Rerun's recording stream.
    time_utc_s
        (F,) times, NaN if unknown: such a row is on the timeline ``frame`` only.
    """

    stream: rr.RecordingStream
    time_utc_s: Floats

    def static(self, path: str, *archetypes: rr.AsComponents) -> None:
        """Log content that does not change with time."""
        self.stream.log(path, *archetypes, static=True)

    def each(self, path: str, *columns: Columns) -> None:
        """Log one row for every frame; see `rows`."""
        self.rows(path, np.arange(len(self.time_utc_s)), *columns)

    def rows(self, path: str, frames: Ints, *columns: Columns) -> None:
        """Log one row for each of these frames.

        Parameters
        ----------
        path
            Path of the entity.
        frames
            (n,) rows of the frames.
        columns
            Functions that make the columns of one archetype each, for some of these frames.
        """
        timed = np.isfinite(self.time_utc_s[frames])
        for some in (frames[timed], frames[~timed]):
            if not len(some):
                continue
            indexes = [rr.TimeColumn(FRAME_TIMELINE, sequence=FIRST + some)]
            if timed.any() and np.isfinite(self.time_utc_s[some[0]]):
                nanoseconds = np.round(self.time_utc_s[some] * 1e9).astype("datetime64[ns]")
                indexes.append(rr.TimeColumn(TIME_TIMELINE, timestamp=nanoseconds))
            for make in columns:
                self.stream.send_columns(path, indexes=indexes, columns=make(some))

    def curve(
        self, path: str, values: Floats, name: str, colour: Rgb, variance: Floats | None = None
    ) -> None:
        """Log one curve over the frames.

        Parameters
        ----------
        path
            Path of the entity.
        values
            (F,) values; NaN gives no point.
        name
            Name for the legend.
        colour
            Colour of the line.
        variance
            (F,) variances, drawn as a band.
        """
        known = np.flatnonzero(np.isfinite(values if variance is None else values + variance))
        if not len(known):
            return
        if variance is None:
            self.static(path, rr.SeriesLines(colors=colour, names=name, widths=2.0))
            self.rows(path, known, lambda some: rr.Scalars.columns(scalars=values[some]))
            return
        self.static(path, rr.Measurements.from_fields(colors=colour, names=name, widths=2.0))
        self.rows(
            path,
            known,
            lambda some: rr.Measurements.columns(values=values[some], variances=variance[some]),
        )

    def states(
        self, path: str, states: Sequence[str], colours: Mapping[str, Rgb], words: Mapping[str, str]
    ) -> None:
        """Log a strip of states over the frames.

        Parameters
        ----------
        path
            Path of the entity.
        states
            (F,) states of the frames.
        colours, words
            Colour and text of each possible state.
        """
        labels = [words[state] for state in colours]
        self.static(
            path,
            rr.StateConfiguration(
                values=list(colours), labels=labels, colors=list(colours.values())
            ),
        )
        each = np.array(states, dtype=str)
        every = np.arange(len(each))
        self.rows(path, every, lambda some: rr.StateChange.columns(state=each[some]))

    def page(self, path: str, text: str) -> None:
        """Log a page of Markdown."""
        self.static(path, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))

    def sheets(self, path: str, texts: Sequence[str]) -> None:
        """Log one page of Markdown for each frame, (F,) texts."""
        self.static(path, rr.TextDocument.from_fields(media_type=rr.MediaType.MARKDOWN))
        self.each(path, lambda some: rr.TextDocument.columns(text=[texts[i] for i in some]))

    def picture(self, path: str, image: Image) -> None:
        """Log a picture as JPEG."""
        made = rr.Image(np.asarray(image), color_model="RGB")
        self.static(path, made.compress(jpeg_quality=JPEG_QUALITY))

    def camera(
        self, path: str, parameters: Floats, size_px: tuple[int, int], depth_m: float | None = None
    ) -> None:
        """Log a pinhole camera.

        Parameters
        ----------
        path
            Path of the entity.
        parameters
            (n,) fx fy cx cy and more [px].
        size_px
            Width and height of its photos.
        depth_m
            Depth of its frustum.
        """
        fx, fy, cx, cy = parameters[:4]
        self.static(
            path,
            rr.Pinhole.from_fields(
                image_from_camera=[[fx, 0, cx + CENTRE_PX], [0, fy, cy + CENTRE_PX], [0, 0, 1]],
                resolution=size_px,
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=depth_m,
                color=OBSERVED,
            ),
        )

    def poses(self, path: str, center_m: Floats, world_from_camera: Floats) -> None:
        """Log the pose of the camera of each frame.

        Parameters
        ----------
        path
            Path of the entity.
        center_m, world_from_camera
            (F, 3) and (F, 3, 3), world from camera.
        """
        self.each(
            path,
            lambda some: rr.Transform3D.columns(
                translation=center_m[some],
                # Rerun stores matrices by columns
                mat3x3=np.swapaxes(world_from_camera[some], 1, 2).reshape(-1, 9),
            ),
        )

    def lines(
        self,
        path: str,
        lines: Floats | Sequence[Floats],
        colours: Colours,
        width: float,
        labels: Sequence[str] | None = None,
        *,
        is_labelled: bool = False,
    ) -> None:
        """Log polylines in a plane or in space, if there are any.

        Parameters
        ----------
        path
            Path of the entity.
        lines
            (N, n, D) or N polylines (n, D).
        colours
            Colour of all, or of each.
        width
            Width in points of the screen.
        labels, is_labelled
            Texts of the lines, and whether they are always visible.
        """
        if not len(lines):
            return
        kind = rr.LineStrips2D if lines[0].shape[-1] == 2 else rr.LineStrips3D
        strips = np.asarray(lines, np.float32) if isinstance(lines, np.ndarray) else list(lines)
        radii, shown = rr.Radius.ui_points(width / 2), None if labels is None else is_labelled
        self.static(
            path, kind(strips, colors=colours, radii=radii, labels=labels, show_labels=shown)
        )

    def lines_of_frames(
        self, path: str, per_frame: Sequence[Sequence[Floats]], colour: Rgb, width: float
    ) -> None:
        """Log polylines in the photo or in space, different ones in each frame.

        Parameters
        ----------
        path
            Path of the entity.
        per_frame
            (F,) lists of (n, 2) polylines in original pixels, or (n, 3) in space.
        colour
            Colour of all lines.
        width
            Width in points of the screen.
        """
        is_flat = all(line.shape[1] == 2 for some in per_frame for line in some)
        kind = rr.LineStrips2D if is_flat else rr.LineStrips3D
        self.static(path, kind.from_fields(colors=colour, radii=rr.Radius.ui_points(width / 2)))
        self._log_frames(
            path,
            [len(some) for some in per_frame],
            lambda rows: kind.columns(
                strips=_pack_polylines(
                    [line for i in rows for line in per_frame[i]], is_flat=is_flat
                )
            ),
        )

    def dots(
        self,
        path: str,
        places: Floats | Sequence[Floats],
        colours: Colours,
        radius: float,
        labels: Sequence[str] | None = None,
        *,
        is_labelled: bool = False,
    ) -> None:
        """Log dots in a plane or in space.

        Parameters
        ----------
        path
            Path of the entity.
        places
            (N, D) places.
        colours
            Colour of all, or of each.
        radius
            Radius in points of the screen.
        labels, is_labelled
            Texts of the dots, and whether they are always visible.
        """
        kind = rr.Points2D if np.shape(places)[-1] == 2 else rr.Points3D
        radii, shown = rr.Radius.ui_points(radius), None if labels is None else is_labelled
        self.static(
            path, kind(places, colors=colours, radii=radii, labels=labels, show_labels=shown)
        )

    def texts(self, path: str, places: Floats | Sequence[Floats], words: Sequence[str]) -> None:
        """Log white texts without dots: coloured text is hard to read over photos.

        Parameters
        ----------
        path
            Path of the entity.
        places
            (N, D) places.
        words
            (N,) texts.
        """
        self.dots(path, places, OBSERVED, 0.0, words, is_labelled=True)

    def dots_of_frames(
        self,
        path: str,
        per_frame: Sequence[Floats],
        colour: Rgb,
        radius: float,
        words: Sequence[Sequence[str]] | None = None,
    ) -> None:
        """Log dots on the photo, different ones in each frame.

        Parameters
        ----------
        path
            Path of the entity.
        per_frame
            (F,) arrays (n, 2) of original pixels.
        colour
            Colour of all dots.
        radius
            Radius in points of the screen.
        words
            (F,) lists of n texts, which are always visible.
        """
        shown, radii = None if words is None else True, rr.Radius.ui_points(radius)
        self.static(path, rr.Points2D.from_fields(colors=colour, radii=radii, show_labels=shown))
        self._log_frames(
            path,
            [len(pixel) for pixel in per_frame],
            lambda rows: rr.Points2D.columns(
                positions=np.concatenate([per_frame[i] for i in rows]) + CENTRE_PX,
                labels=None if words is None else [text for i in rows for text in words[i]],
            ),
        )

    def _log_frames(self, path: str, lengths: list[int], columns: Columns) -> None:
        """Log one row per frame; an empty row clears the drawing of the frame before."""
        counts = np.array(lengths, dtype=np.int64)
        if counts.any():
            self.each(path, lambda some: columns(some).partition(counts[some]))

    def ellipsoids(
        self,
        path: str,
        centers: Floats,
        half_axes: Floats,
        xyzw: Floats,
        colours: Pixels,
        *,
        is_solid: bool = True,
    ) -> None:
        """Log (N,) ellipsoids, in entities of so many as Rerun draws.

        Parameters
        ----------
        path
            Parent of the entities.
        centers, half_axes, xyzw
            (N, 3) middles, (N, 3) half axes, and (N, 4) quaternions of their directions.
        colours
            (N, 3 or 4) colours.
        is_solid
            Whether they are filled, or transparent with rings.
        """
        fill = rr.components.FillMode
        mode = fill.Solid if is_solid else fill.TransparentFillMajorWireframe
        for start in range(0, len(centers), MAX_ELLIPSOIDS):
            part = slice(start, start + MAX_ELLIPSOIDS)
            self.static(
                f"{path}/{start // MAX_ELLIPSOIDS}",
                rr.Ellipsoids3D(
                    centers=centers[part],
                    half_sizes=half_axes[part],
                    quaternions=xyzw[part],
                    colors=colours[part],
                    fill_mode=mode,
                ),
            )

    def squares(self, path: str, corners: Floats, colours: Pixels) -> None:
        """Log the (N, 4, 3) corners of squares as a mesh.

        Parameters
        ----------
        path
            Path of the entity.
        corners
            (N, 4, 3) corners around each.
        colours
            (N, 3) colours.
        """
        first = 4 * np.arange(len(corners))[:, None, None]
        self.static(
            path,
            rr.Mesh3D(
                vertex_positions=corners.reshape(-1, 3),
                triangle_indices=(first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3),
                vertex_colors=np.repeat(colours, 4, axis=0),
            ),
        )

    def end_after_last(self, path: str, column: rr.ComponentColumnList) -> None:
        """Log one row at the place of the next frame."""
        indexes = [rr.TimeColumn(FRAME_TIMELINE, sequence=[FIRST + len(self.time_utc_s)])]
        known = np.sort(self.time_utc_s[np.isfinite(self.time_utc_s)])
        if len(known):
            step = float(np.median(np.diff(known))) if len(known) > 1 else 1.0
            nanoseconds = np.round((known[-1:] + step) * 1e9).astype("datetime64[ns]")
            indexes.append(rr.TimeColumn(TIME_TIMELINE, timestamp=nanoseconds))
        self.stream.send_columns(path, indexes=indexes, columns=column)


def _pack_polylines(strips: list[Floats], *, is_flat: bool) -> Any:  # noqa: ANN401 (Arrow's arrays have no types)
    """Pack all polylines into one array; Rerun needs a tenth of a millisecond for each."""
    made = rr.components
    none: Any = (made.LineStrip2DBatch if is_flat else made.LineStrip3DBatch)([]).as_arrow_array()
    corners = np.concatenate([np.zeros((0, 2 if is_flat else 3)), *strips])
    if is_flat:
        places = made.Position2DBatch(corners + CENTRE_PX).as_arrow_array()
    else:
        places = made.Position3DBatch(corners).as_arrow_array()
    ends = np.cumsum([0, *(len(strip) for strip in strips)])
    return type(none).from_arrays(ends, places, type=none.type)


@contextmanager
def open_recording(
    path: str | os.PathLike[str], identity: object, name: str, time_utc_s: Floats
) -> Iterator[Recorder]:
    """Write a recording to a file, complete or not at all.

    Parameters
    ----------
    path
        The file; replaced only once the new one is complete.
    identity
        The same for the same program, inputs and options: a rerun replaces the earlier review.
    name
        Name shown by the viewer.
    time_utc_s
        (F,) times of the frames, NaN if unknown.

    Raises
    ------
    OutputError
        If the file cannot be written.
    OSError
        If the disk is full.
    """
    target = Path(path)
    unfinished = target.with_name(f".{target.name}.unfinished")
    try:
        unfinished.touch()  # Rerun's own error for a missing folder is no OSError
        with _open_stream(unfinished, identity, name) as stream:
            yield Recorder(stream, time_utc_s)
        unfinished.replace(target)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise  # the caller, who chose the folder, may use another one
        raise OutputError(f"{target}: the recording cannot be written: {error}") from error
    finally:
        unfinished.unlink(missing_ok=True)
    log.info("recording of %d frames: %s", len(time_utc_s), target)


@contextmanager
def _open_stream(path: Path, identity: object, name: str) -> Iterator[rr.RecordingStream]:
    """Open Rerun's stream to a file, complete when the block ends.

    The batcher never flushes by the clock, so that two equal runs give equal chunks.
    """
    sink = FileSink(path)
    with strict_rerun():
        stream = rr.RecordingStream(
            APPLICATION_ID,
            recording_id=hashlib.sha256(repr(identity).encode()).hexdigest()[:32],
            send_properties=False,
            batcher_config=rr.ChunkBatcherConfig.NEVER(),
        )
        stream.set_log_time_enabled(False)
        try:
            stream.save(sink.path)
            sink.start()
            stream.send_recording_name(name)
            yield stream
            stream.flush()
        finally:
            stream.disconnect()
            sink.finish()
    if not _has_footer(path):
        raise OSError("Rerun did not write it to its end")


def _has_footer(path: Path) -> bool:
    length = len(FOOTER_MARK) + FOOTER_VERSION_BYTES
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - length, 0))
        return file.read(len(FOOTER_MARK)) == FOOTER_MARK
