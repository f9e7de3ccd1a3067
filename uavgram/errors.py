"""Exceptions that a user can act on.

``UavgramError`` is the root; the command line prints it as one message, with exit status 1. All
other exceptions are bugs and keep their traceback.

::

    UavgramError
    ├── InputError        an invalid input file: names file and line
    ├── GeometryError     the scene, as given, has no solution: names frame or label
    └── OutputError       a result that could not be written
"""

from __future__ import annotations

import difflib
import importlib.util
import os
import re
import stat
import sys
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import Path

MOST_FAULTS_SHOWN = 20


class UavgramError(Exception):
    """Problem that the user can solve; the message gives finding, place and action."""

    def __init__(self, message: str) -> None:
        super().__init__(message)


def describe_unread(fault: OSError) -> str:
    """Return why a file cannot be read, and what to do."""
    way_out = "check its name, and that of its folder"
    if not isinstance(fault, FileNotFoundError):
        way_out = "check the right to read it, and whether its disk is connected"
    return f"cannot be read: {fault.strerror}; {way_out}"


class InputError(UavgramError):
    """Invalid input file.

    Parameters
    ----------
    path
        The file.
    message
        Finding and remedy.
    line
        Line number in the file, from 1; None for files without lines.
    """

    def __init__(self, path: str | os.PathLike[str], message: str, line: int | None = None) -> None:
        self.path = os.fspath(path)
        self.line = line
        self.message = message
        place = self.path if line is None else f"{self.path}:{line}"
        super().__init__(f"{place}: {message}")

    @classmethod
    def of_all(
        cls, path: str | os.PathLike[str], faults: Sequence[tuple[int | None, str]]
    ) -> InputError:
        """Make one error of all mistakes in a file, in the order of their lines.

        Parameters
        ----------
        path
            The file.
        faults
            At least one pair of line number (None for files without lines) and message; each
            message but the first gets its own ``path:line:``, as in compilers. A message of many
            lines is given once.
        """
        lines: dict[str, list[int | None]] = {}
        for at, text in sorted(faults, key=lambda fault: fault[0] or 0):
            lines.setdefault(text, []).append(at)
        named = [(places[0], text + _list_more_lines(places[1:])) for text, places in lines.items()]
        (line, message), *rest = named[:MOST_FAULTS_SHOWN]
        texts = [message, *(str(cls(path, text, at)) for at, text in rest)]
        if len(named) > MOST_FAULTS_SHOWN:
            texts.append(f"... and {len(named) - MOST_FAULTS_SHOWN} more mistakes in this file")
        return cls(path, "\n".join(texts), line)


def _list_more_lines(lines: Sequence[int | None]) -> str:
    """Return the words for further lines with the same mistake; none for no line."""
    if not lines:
        return ""
    shown = ", ".join(map(str, lines[:MOST_FAULTS_SHOWN]))
    more = len(lines) - MOST_FAULTS_SHOWN
    return f" (also line{'s' * (len(lines) > 1)} {shown}{f' and {more} more' if more > 0 else ''})"


class GeometryError(UavgramError):
    """Scene without a solution, as given; the message names the frame or label."""


class OutputError(UavgramError):
    """Result that could not be written; earlier results are unchanged."""


# Letters that look alike in lower case, including Cyrillic and Greek ones.
_ALIKE = str.maketrans("il|oавекмнорстухαβεηικμνορτυχ", "1110abekmh0pctyxabeh1kmn0ptyx")


_SEPARATORS = r"[\s_./\u2010-\u2015-]+"
# Between two digits they separate numbers: 1-11 and 11-1 are two names.
_NEEDLESS = re.compile(rf"(?<!\d){_SEPARATORS}|{_SEPARATORS}(?!\d)")
# The first letter of a name is meant as one: B1 is in no series with 81.
_LETTER_FOR_DIGIT = re.compile(r"(?<=.)[sbz]")
_DIGITS = {"s": "5", "b": "8", "z": "2"}


def replace_lookalikes(name: str) -> str:
    """Replace characters that look alike in print: ``Pl`` and ``P_1`` become ``p1``."""
    plain = unicodedata.normalize("NFKC", name).casefold().translate(_ALIKE)
    plain = _NEEDLESS.sub("", plain)
    return _LETTER_FOR_DIGIT.sub(lambda letter: _DIGITS[letter[0]], plain)


def suggest_spelling(word: str, known: Iterable[str]) -> str:
    """Suggest the known word whose spelling is closest to `word`.

    Returns
    -------
    str
        ``did you mean 'boresight_sigma_deg'?``, or an empty string where none is close.
    """
    by_look = {replace_lookalikes(name): name for name in known}
    close = difflib.get_close_matches(replace_lookalikes(word), by_look, n=1, cutoff=0.6)
    return f"did you mean {by_look[close[0]]!r}?" if close else ""


def install_command(package: str) -> str:
    """Return the command that installs a package beside this program, however it was installed."""
    if (Path(sys.prefix) / "pipx_metadata.json").is_file():
        return f"pipx inject uavgram {package}"
    if importlib.util.find_spec("pip") is None:  # by uv, which installs no pip
        return f'uv pip install --python "{sys.executable}" {package}'
    return f'"{sys.executable}" -m pip install {package}'


_KINDS = (
    (stat.S_ISDIR, "a folder, no file"),
    (stat.S_ISFIFO, "a FIFO (a pipe between programs), no file"),
    (stat.S_ISCHR, "a device, no file"),
    (stat.S_ISBLK, "a device, no file"),
    (stat.S_ISSOCK, "a socket (a door of a program), no file"),
)


def describe_non_file(path: str | os.PathLike[str]) -> str:
    """Return the kind of a path that is not a file; opening a FIFO or a device may block forever.

    Returns
    -------
    str
        ``a folder, no file`` and the like; empty where it is a file, or does not exist.
    """
    try:
        mode = Path(path).stat().st_mode
    except (OSError, ValueError):
        return "a link to a file that is not there" if Path(path).is_symlink() else ""
    return next((what for is_one, what in _KINDS if is_one(mode)), "")
