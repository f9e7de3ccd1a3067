"""Terminal of the commands: text, log lines, progress bars."""

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
    from uavgram.pipeline.parallel import Progress

Item = TypeVar("Item")

_UNITS: ContextVar[Units] = ContextVar("units of printed values", default=METRIC)
_QUIET: ContextVar[bool] = ContextVar("only problems are printed", default=False)
_KNOWN: ContextVar[tuple[tuple[str, ...], tuple[float, ...]]] = ContextVar(
    "names that look like lengths, and lengths that are printed rounded", default=((), ())
)


def be_quiet(*, quiet: bool) -> None:
    """Suppress all text but problems, and progress, from now on; JSON is still written."""
    _QUIET.set(quiet)


def set_units(units: Units) -> None:
    """Set the units of lengths and speeds in texts from now on, without a result."""
    _UNITS.set(units)
    _KNOWN.set(((), ()))


def set_result(result: Result) -> None:
    """Convert lengths of this result from their exact values from now on; keep names unchanged."""
    from uavgram.views.units import exact_lengths, list_names_like_lengths

    if _UNITS.get() != METRIC:
        _KNOWN.set((list_names_like_lengths(result), exact_lengths(result)))


def set_project_units(project: Path) -> Units:
    """Set the units of lengths and speeds, also in errors, from a project file.

    A file that cannot be read is no error here: the code that needs it reports it.
    """
    from uavgram.config.project import load_project

    try:
        units = load_project(project, unfinished=True).units
    except UavgramError:
        units = METRIC
    set_units(units)
    return units


def convert_units(text: str) -> str:
    """Return a text with its lengths and speeds in the units of the project."""
    from uavgram.views.units import convert_sentence

    return convert_sentence(text, _UNITS.get(), *_KNOWN.get())


def print_lines(*lines: str) -> None:
    """Write lines to standard output, their lengths and speeds in the units of the project."""
    print_unchanged(*map(convert_units, lines))


def print_unchanged(*lines: str) -> None:
    """Write lines to standard output, such as converted files, which keep metres.

    Raises
    ------
    OutputError
        It takes no more, such as a full disk; the work of the command is done.
    """
    if not _QUIET.get():
        _write("\n".join(lines))


def warn_of(text: str, *, only_quiet: bool = False) -> None:
    """Write one line to standard error; `only_quiet`: only where standard output has no text."""
    if _QUIET.get() or not only_quiet:
        sys.stderr.write(convert_units(f"uavgram: {text}\n"))


def print_json(content: object) -> None:
    """Write a JSON object to standard output, in ASCII, safe for every encoding of a pipe.

    Numbers that are not finite become null.

    Raises
    ------
    OutputError
        It takes no more; the work of the command is done.
    """
    from uavgram.io.json_codec import replace_not_finite

    _write(json.dumps(replace_not_finite(content), indent=1, allow_nan=False))


def _write(text: str) -> None:
    if sys.stdout is None:  # closed by the parent, as by some schedulers
        return
    if isinstance(sys.stdout, io.TextIOWrapper):  # a terminal without ± is no reason to fail
        sys.stdout.reconfigure(errors="replace")
    try:
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except OSError as fault:
        drop_output()
        # If the reader has ended (head, less), the status of the command is kept.
        if isinstance(fault, BrokenPipeError) or (
            sys.platform == "win32" and fault.errno == errno.EINVAL
        ):
            return
        raise OutputError(
            f"standard output takes no text ({fault.strerror}): the command is done, and only "
            "its printed text is lost"
        ) from fault


def print_written_files(folder: Path, files: Iterable[str]) -> None:
    """List the files that were written, below their folder."""
    print_unchanged("", f"written:   {folder}", *(f"           {file}" for file in files))


def drop_output() -> None:
    """Discard unwritten standard output, which would fail again at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def log_to_stderr(*, verbose: bool) -> None:
    """Show log messages on standard error: warnings, and with `verbose` the steps of the work."""
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING, force=True)
    logging.getLogger("uavgram").setLevel(logging.INFO if verbose else logging.WARNING)
    for handler in logging.getLogger().handlers:
        handler.setFormatter(_UnitFormatter("%(message)s"))


class _UnitFormatter(logging.Formatter):
    """Formatter of log messages in the units of the project."""

    def format(self, record: logging.LogRecord) -> str:
        return convert_units(super().format(record))


def progress() -> Progress:
    """Return progress bars on a terminal, nothing elsewhere."""
    from uavgram.pipeline.parallel import silent

    if _QUIET.get() or not sys.stderr.isatty():
        return silent
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)

    def bar(items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
        return track(items, description=what, total=total, console=console, transient=True)

    return bar
