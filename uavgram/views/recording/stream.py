"""Open recording: rows by frame and capture time, and static content.

Entity paths are fixed words: names given by people are in texts only, never in a path, where
Rerun would reject blanks and other characters.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats, Ints
from uavgram.views.style import Rgb

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

    def curve(self, path: str, values: Floats, name: str, colour: Rgb) -> None:
        """Log one curve over the frames.

        Parameters
        ----------
        path
            Path of the entity.
        values
            (F,) values; NaN gives no point.
        name
            Name for the legend, with its unit.
        colour
            Colour of the line.
        """
        known = np.flatnonzero(np.isfinite(values))
        if len(known):
            self.static(path, rr.SeriesLines(colors=colour, names=name, widths=2.0))
            self.rows(path, known, lambda some: rr.Scalars.columns(scalars=values[some]))

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

    def sheets(self, path: str, texts: Sequence[str]) -> None:
        """Log one page of Markdown for each frame, (F,) texts."""
        self.static(path, rr.TextDocument.from_fields(media_type=rr.MediaType.MARKDOWN))
        self.each(path, lambda some: rr.TextDocument.columns(text=[texts[i] for i in some]))

    def end_after_last(self, path: str, column: rr.ComponentColumnList) -> None:
        """Log one row at the place of the next frame."""
        indexes = [rr.TimeColumn(FRAME_TIMELINE, sequence=[FIRST + len(self.time_utc_s)])]
        known = np.sort(self.time_utc_s[np.isfinite(self.time_utc_s)])
        if len(known):
            step = float(np.median(np.diff(known))) if len(known) > 1 else 1.0
            nanoseconds = np.round((known[-1:] + step) * 1e9).astype("datetime64[ns]")
            indexes.append(rr.TimeColumn(TIME_TIMELINE, timestamp=nanoseconds))
        self.stream.send_columns(path, indexes=indexes, columns=column)


@contextmanager
def open_recording(
    path: Path, identity: object, name: str, time_utc_s: Floats
) -> Iterator[Recorder]:
    """Write a recording to a file; complete when the block ends.

    The batcher never flushes by the clock, so that two equal runs give equal chunks.

    Parameters
    ----------
    path
        The file.
    identity
        The same for the same program, inputs and options: a rerun replaces the earlier review.
    name
        Name shown by the viewer.
    time_utc_s
        (F,) times of the frames, NaN if unknown.

    Raises
    ------
    OSError
        If the file cannot be written.
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
            yield Recorder(stream, time_utc_s)
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
