"""The errors that a user can act on.

``UavgramError`` is the root; the command line turns it into one message and exit status 1.
Anything else that is raised is a bug and keeps its traceback.

::

    UavgramError
    ├── InputError        a file that a person wrote or handed over: names file and line
    ├── GeometryError     the scene, as given, has no solution: names frame or label
    └── OutputError       a result that could not be written
"""

from __future__ import annotations

import os


class UavgramError(Exception):
    """A problem that the user can solve: says what, where, and what to do."""


class InputError(UavgramError):
    """A wrong input file.

    Parameters
    ----------
    path
        The file.
    message
        What is wrong, and the way out.
    line
        Line number in the file, from 1; None where lines mean nothing.
    """

    def __init__(self, path: str | os.PathLike[str], message: str, line: int | None = None) -> None:
        self.path = os.fspath(path)
        self.line = line
        self.message = message
        place = self.path if line is None else f"{self.path}:{line}"
        super().__init__(f"{place}: {message}")


class GeometryError(UavgramError):
    """The scene, as given, has no solution; the message names the frame or label."""


class OutputError(UavgramError):
    """A result that could not be written; earlier results are untouched."""
