"""A desk with a Windows computer, as far as Linux can be one: see `on_windows/sitecustomize.py`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import uavgram

HARNESS = Path(__file__).parent / "on_windows"
OF_A_PIPE = "cp1252"
"""In which a program on a western Windows writes to a pipe or a file."""


@dataclass(frozen=True)
class Ended:
    """What a command left: its exit status and what it wrote."""

    status: int
    stdout: str
    stderr: str


@dataclass
class WindowsDesk:
    """Runs commands as on Windows.

    Attributes
    ----------
    folder
        In which they run.
    open_elsewhere
        Files that another program has open.
    """

    folder: Path
    open_elsewhere: list[Path] = field(default_factory=list)

    @property
    def environment(self) -> dict[str, str]:
        return {
            **os.environ,
            "PYTHONPATH": str(HARNESS),
            "PYTHONDONTWRITEBYTECODE": "1",  # compiled files of the harness's imports stay away
            "PYTHONIOENCODING": OF_A_PIPE,
            "PYTHONWARNDEFAULTENCODING": "1",
            "UAVGRAM_PACKAGE": str(Path(uavgram.__file__).parent),
            "UAVGRAM_OPEN_ELSEWHERE": os.pathsep.join(map(str, self.open_elsewhere)),
        }

    def start(self, arguments: Iterable[object]) -> subprocess.Popen[str]:
        """Start a command."""
        return self.python("-m", "uavgram", *arguments)

    def python(self, *arguments: object) -> subprocess.Popen[str]:
        """Start Python."""
        return subprocess.Popen(
            [sys.executable, "-P", *map(str, arguments)],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding=OF_A_PIPE,
            errors="strict",
        )

    def run(self, *arguments: object) -> Ended:
        """Run a command to its end."""
        with self.start(arguments) as process:
            out, err = process.communicate(timeout=500)
        return Ended(process.returncode, out, err)
