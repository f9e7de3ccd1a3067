"""Desktop icon that starts the program, in the file format of each system."""

from __future__ import annotations

import shlex
import stat
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from platformdirs import user_desktop_path

from uavgram.errors import OutputError, UavgramError
from uavgram.io.outputs import convert_output_errors, replace_bytes

NAME = "uavgram"
_NO_PYTHON_LETTERS = set('"\r\n')


@dataclass(frozen=True, kw_only=True)
class Computer:
    """A user's computer.

    Attributes
    ----------
    platform
        As of ``sys.platform``.
    python
        The interpreter in which the program is installed.
    icon
        A picture of the program.
    home, environ
        Of the user.
    """

    platform: str
    python: str
    icon: Path
    home: Path
    environ: Mapping[str, str]


def desktop_folder() -> Path:
    """Find the user's desktop, by its name in the system's language; make it if there is none.

    Raises
    ------
    OutputError
        It cannot be made.
    """
    desk, home = user_desktop_path(), Path.home()
    if desk == home:  # the user's setting for no desktop
        desk = home / "Desktop"
    with convert_output_errors(desk, "--folder"):
        desk.mkdir(parents=True, exist_ok=True)
    return desk


def write_shortcut(computer: Computer, folder: Path) -> tuple[Path, ...]:
    """Write the icon into a folder; return the files, the one in that folder first.

    Raises
    ------
    UavgramError
        The folder does not exist, a file cannot be written, or the interpreter's path cannot be
        named in one.
    """
    python = computer.python
    if not folder.is_dir():
        raise UavgramError(f"{folder}: there is no such folder: make it, or name another --folder")
    if _NO_PYTHON_LETTERS & set(python):
        raise UavgramError(f"{python!r}: a path with quotes cannot be named in a shortcut")
    if computer.platform == "win32":
        return (_windows_icon(computer, folder),)
    if computer.platform == "darwin":
        return (_write_file(folder / f"{NAME}.command", _macos(python), runs=True),)
    entry = _freedesktop(python, computer.icon)
    share = Path(computer.environ.get("XDG_DATA_HOME") or computer.home / ".local" / "share")
    menu = share / "applications"
    with convert_output_errors(menu):
        menu.mkdir(parents=True, exist_ok=True)
    return (
        _write_file(folder / f"{NAME}.desktop", entry, runs=True),
        _write_file(menu / f"{NAME}.desktop", entry),
    )


_MAKE_LINK = (
    "$ErrorActionPreference = 'Stop'; "
    "$link = (New-Object -ComObject WScript.Shell).CreateShortcut($env:UAVGRAM_LINK); "
    "$link.TargetPath = $env:UAVGRAM_TARGET; "
    "$link.IconLocation = $env:UAVGRAM_ICON + ',0'; "
    "$link.WorkingDirectory = $env:USERPROFILE; "
    "$link.Save(); "
    "if ($link.TargetPath -ne $env:UAVGRAM_TARGET) { exit 1 }"
)
"""PowerShell; paths come from the environment, where no letter has a meaning."""
_LONGEST_S = 60


def _windows_icon(computer: Computer, folder: Path) -> Path:
    """Write a shortcut to a batch file; where PowerShell makes none, the batch file itself."""
    link, text = folder / f"{NAME}.lnk", _windows(computer.python)
    _refuse_foreign(link)
    own = Path(computer.environ.get("LOCALAPPDATA") or computer.home / "AppData" / "Local") / NAME
    with convert_output_errors(own):
        own.mkdir(parents=True, exist_ok=True)
    if _is_linked(computer, link, _write_file(own / f"{NAME}.cmd", text)):
        return link
    link.unlink(missing_ok=True)  # it may lead elsewhere
    return _write_file(folder / f"{NAME}.cmd", text)


def _is_linked(computer: Computer, link: Path, target: Path) -> bool:
    """Make a shortcut with a picture by Windows itself; return whether that succeeded."""
    windows = computer.environ.get("SystemRoot", r"C:\Windows")
    shell = rf"{windows}\System32\WindowsPowerShell\v1.0\powershell.exe"
    paths = {"LINK": link.resolve(), "TARGET": target, "ICON": computer.icon}
    named = {f"UAVGRAM_{name}": str(path) for name, path in paths.items()}
    try:
        done = subprocess.run(  # noqa: S603 (a constant script)
            [shell, "-NoProfile", "-NonInteractive", "-Command", _MAKE_LINK],
            env={**computer.environ, **named},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_LONGEST_S,
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return False
    return done.returncode == 0 and link.is_file()


def _windows(python: str) -> str:
    """Return a batch file; a folder that is dropped on its icon is opened.

    Explorer does not quote a dropped path with an ``&`` but no blank, at which ``%1`` would end and
    the rest would be run. So the path is taken from the whole command line, without its quotes, and
    ``exit`` follows. No parentheses: a path may have some.
    """
    said = python.replace("%", "%%")
    lines = (
        "@echo off",
        "chcp 65001 >nul",
        "title uavgram - close this window to end it",
        'cd /d "%USERPROFILE%"',
        f'set "python={said}"',
        "setlocal EnableDelayedExpansion",
        'set "line=!cmdcmdline:~0,-1!"',
        f'set "dropped=!line:*{NAME}.cmd" =!"',
        'if "!dropped!"=="!line!" set "dropped="',
        'if defined dropped set "dropped=!dropped:"=!"',
        "if not defined dropped goto typed",
        '"!python!" -P -m uavgram "!dropped!"',
        "if errorlevel 1 pause",
        "exit",
        ":typed",
        '"!python!" -P -m uavgram %*',
        "if errorlevel 1 pause",
    )
    return "".join(f"{line}\r\n" for line in lines)


def _macos(python: str) -> str:
    return f"#!/bin/sh\ncd ~ || exit\nexec {shlex.quote(python)} -P -m uavgram\n"


def _freedesktop(python: str, icon: Path) -> str:
    """Return a desktop entry, https://specifications.freedesktop.org/desktop-entry-spec/latest/."""
    quoted = python.replace("\\", "\\\\\\\\").replace("`", "\\\\`").replace("$", "\\\\$")
    quoted = quoted.replace("%", "%%")
    return (
        "[Desktop Entry]\nType=Application\nVersion=1.0\nName=uavgram\n"
        "Comment=Ground measurements from a drone's photos\n"
        f'Exec="{quoted}" -P -m uavgram %f\nIcon={icon}\nTerminal=true\nPath=\n'
        "Categories=Graphics;Science;\n"
    )


def _refuse_foreign(path: Path) -> None:
    """Raise an error for a link, and for a file of another program."""
    names = (NAME.encode(), NAME.encode("utf-16-le"))
    if path.is_symlink() or (
        path.exists() and not any(name in path.read_bytes()[:4000] for name in names)
    ):
        raise OutputError(f"{path}: is there already, and no shortcut of uavgram: move it away")


def _write_file(path: Path, text: str, *, runs: bool = False) -> Path:
    """Write a file; a link, or a file of another program, is left unchanged."""
    _refuse_foreign(path)
    replace_bytes(path, text.encode(), "--folder")
    if runs:
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path
