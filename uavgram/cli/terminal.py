"""What the commands do to a terminal: text, log lines, progress bars."""

from __future__ import annotations

import errno
import io
import json
import logging
import os
import sys
from collections.abc import Iterable
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from uavgram.errors import OutputError, UavgramError
from uavgram.model.naming import METRIC, Units

if TYPE_CHECKING:
    from uavgram.model.result.result import Result
    from uavgram.pipeline.progress import Progress

Item = TypeVar("Item")

_UNITS: ContextVar[Units] = ContextVar("units of what is told", default=METRIC)
_QUIET: ContextVar[bool] = ContextVar("nothing but problems is told", default=False)
_KNOWN: ContextVar[tuple[tuple[str, ...], tuple[float, ...]]] = ContextVar(
    "names that look like lengths, and lengths that are told rounded", default=((), ())
)


def be_quiet(*, quiet: bool) -> None:
    """From now on write no text but problems, and no progress; JSON is written all the same."""
    _QUIET.set(quiet)


def tell_in(units: Units) -> None:
    """From now on tell lengths and speeds in these units, and of no result yet."""
    _UNITS.set(units)
    _KNOWN.set(((), ()))


def tell_of(result: Result) -> None:
    """From now on tell lengths of this result from their exact values, its names as they are."""
    from uavgram.views.unit_words import exact_lengths, names_like_lengths

    if _UNITS.get() != METRIC:
        _KNOWN.set((names_like_lengths(result), exact_lengths(result)))


def tell_as(project: Path) -> Units:
    """From now on tell lengths and speeds, of errors too, as a project file says.

    A file that cannot be read is no error here: whoever needs it says so.
    """
    from uavgram.config.project import load_project

    try:
        units = load_project(project, unfinished=True).units
    except UavgramError:
        units = METRIC
    tell_in(units)
    return units


def as_told(text: str) -> str:
    """A text with its lengths and speeds in the units of the project."""
    from uavgram.views.unit_words import in_units

    return in_units(text, _UNITS.get(), *_KNOWN.get())


def say(*lines: str) -> None:
    """Write lines to standard output, their lengths and speeds in the units of the project."""
    say_as_is(*map(as_told, lines))


def say_as_is(*lines: str) -> None:
    """Write lines to standard output, such as converted files, which keep metres.

    Raises
    ------
    OutputError
        It takes no more, such as a full disk; what the command did stays done.
    """
    if not _QUIET.get():
        _write("\n".join(lines))


def say_json(content: object) -> None:
    """Write a JSON object to standard output, in ASCII: no encoding of a pipe harms it.

    Raises
    ------
    OutputError
        It takes no more; what the command did stays done.
    """
    _write(json.dumps(content, indent=1, allow_nan=False))


def _write(text: str) -> None:
    if sys.stdout is None:  # closed by who started the program, as some schedulers do
        return
    if isinstance(sys.stdout, io.TextIOWrapper):  # a terminal without ± is no reason to fail
        sys.stdout.reconfigure(errors="replace")
    try:
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except OSError as fault:
        drop_output()
        # A reader that has left (head, less) misses nothing, and the status stays the command's.
        if isinstance(fault, BrokenPipeError) or (
            sys.platform == "win32" and fault.errno == errno.EINVAL
        ):
            return
        raise OutputError(
            f"standard output takes no text ({fault.strerror}): what was asked for is done, only "
            "what there was to say of it is lost"
        ) from fault


def say_written(folder: Path, files: Iterable[str]) -> None:
    """Name the files that were written, below their folder."""
    say_as_is("", f"written:   {folder}", *(f"           {file}" for file in files))


def drop_output() -> None:
    """Let go of what standard output did not take, which would fail again at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def log_to_stderr(*, verbose: bool) -> None:
    """Show log messages on standard error: warnings, and with `verbose` what is being done."""
    level = logging.INFO if verbose else logging.WARNING
    logging.basicConfig(stream=sys.stderr, level=level, force=True)
    for handler in logging.getLogger().handlers:
        handler.setFormatter(_Told("%(message)s"))


class _Told(logging.Formatter):
    """Log messages in the units of the project."""

    def format(self, record: logging.LogRecord) -> str:
        return as_told(super().format(record))


def progress() -> Progress:
    """Progress bars on a terminal, nothing elsewhere."""
    from uavgram.pipeline.progress import silent

    if _QUIET.get() or not sys.stderr.isatty():
        return silent
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)

    def bar(items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
        return track(items, description=what, total=total, console=console, transient=True)

    return bar
