"""An icon on the desktop, as each system takes it; the two that are not here by their rules."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from uavgram.errors import UavgramError
from uavgram.io.desktop import Computer, desktop_folder, write_shortcut

ODD = "/opt/Meine Programme/50% $HOME/bin/python"


def computer(home: Path, platform: str, python: str = sys.executable, **environ: str) -> Computer:
    icon = Path("/icons/icon.svg")
    return Computer(platform=platform, python=python, icon=icon, home=home, environ=environ)


class PowerShell:
    """Takes the place of `subprocess.run`: keeps the command, and writes the link or fails."""

    def __init__(self, status: int = 0, fault: Exception | None = None) -> None:
        self.status, self.fault = status, fault
        self.command: list[str] = []
        self.paths: dict[str, str] = {}

    def __call__(self, command: list[str], *, env: dict[str, str], **_: object) -> object:
        self.command = command
        self.paths = {k: v for k, v in env.items() if k.startswith("UAVGRAM_")}
        if self.fault is not None:
            raise self.fault
        if self.status == 0:
            Path(env["UAVGRAM_LINK"]).write_bytes(
                b"L\0" + env["UAVGRAM_TARGET"].encode("utf-16-le")
            )
        return subprocess.CompletedProcess(command, self.status)


def test_windows_gets_a_shortcut_with_its_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shell = PowerShell()
    monkeypatch.setattr(subprocess, "run", shell)
    desk, own = tmp_path / "Bürotisch", tmp_path / "local"
    desk.mkdir()
    windows = computer(tmp_path, "win32", LOCALAPPDATA=str(own), SystemRoot=r"D:\Win")
    for _ in range(2):  # the second replaces the first
        assert write_shortcut(windows, desk) == (desk / "uavgram.lnk",)
    assert shell.command[:-1] == [
        r"D:\Win\System32\WindowsPowerShell\v1.0\powershell.exe",
        *("-NoProfile", "-NonInteractive", "-Command"),
    ]
    assert shell.command[-1].isascii()
    assert '"' not in shell.command[-1]
    target = own / "uavgram" / "uavgram.cmd"
    assert shell.paths == {
        "UAVGRAM_LINK": str(desk / "uavgram.lnk"),
        "UAVGRAM_TARGET": str(target),
        "UAVGRAM_ICON": "/icons/icon.svg",
    }
    assert {f"$env:{name}" in shell.command[-1] for name in shell.paths} == {True}
    assert b"-m uavgram" in target.read_bytes()
    assert [path.name for path in desk.iterdir()] == ["uavgram.lnk"]
    (desk / "uavgram.lnk").write_bytes(b"L of something else")
    with pytest.raises(UavgramError, match="no shortcut"):
        write_shortcut(windows, desk)


@pytest.mark.parametrize(
    "shell",
    [
        PowerShell(status=1),
        PowerShell(fault=FileNotFoundError()),
        PowerShell(fault=subprocess.TimeoutExpired("powershell", 60)),
    ],
)
def test_without_powershell_it_is_a_batch_file_that_takes_a_dropped_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shell: PowerShell
) -> None:
    monkeypatch.setattr(subprocess, "run", shell)
    (path,) = write_shortcut(computer(tmp_path, "win32", r"C:\Prö 100%\python.exe"), tmp_path)
    assert path == tmp_path / "uavgram.cmd"
    lines = path.read_bytes().decode().split("\r\n")
    assert lines[1] == "chcp 65001 >nul"  # what follows is UTF-8
    assert 'set "python=C:\\Prö 100%%\\python.exe"' in lines
    # With & in its name a dropped path has no quotes: it comes from the whole command line.
    assert 'set "line=!cmdcmdline:~0,-1!"' in lines
    assert 'set "dropped=!line:*uavgram.cmd" =!"' in lines
    run = lines.index('"!python!" -P -m uavgram "!dropped!"')
    assert lines[run + 2] == "exit"  # else the name behind & is run
    assert "\n" not in path.read_bytes().decode().replace("\r\n", "")


def test_macos_gets_a_command_that_runs(tmp_path: Path) -> None:
    (path,) = write_shortcut(computer(tmp_path, "darwin", ODD), tmp_path)
    assert path.name == "uavgram.command"
    assert os.access(path, os.X_OK)
    assert shlex.split(path.read_text().splitlines()[-1]) == ["exec", ODD, "-P", "-m", "uavgram"]
    subprocess.run(["sh", "-n", path], check=True)


def exec_of(entry: str) -> str:
    """The program of an Exec line, unquoted as the desktop entry specification says."""
    line = next(one for one in entry.splitlines() if one.startswith("Exec="))
    value = line.removeprefix("Exec=").replace("\\\\", "\\")  # the rule for strings comes first
    assert value.endswith('" -P -m uavgram %f')
    inner = value.removesuffix('" -P -m uavgram %f').removeprefix('"')
    for letter in "$`\\":
        inner = inner.replace(f"\\{letter}", letter)
    return inner.replace("%%", "%")


def test_linux_gets_an_entry_on_the_desktop_and_in_the_menu(tmp_path: Path) -> None:
    desk = tmp_path / "Schreibtisch"
    desk.mkdir()
    on_desk, in_menu = write_shortcut(computer(tmp_path, "linux", ODD), desk)
    assert on_desk == desk / "uavgram.desktop"
    assert in_menu == tmp_path / ".local/share/applications/uavgram.desktop"
    text = on_desk.read_text()
    assert text == in_menu.read_text()
    assert text.startswith("[Desktop Entry]\nType=Application\n")
    assert "Icon=/icons/icon.svg\nTerminal=true\n" in text
    assert os.access(on_desk, os.X_OK)
    assert exec_of(text) == ODD


def test_a_desktop_that_is_not_there_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / ".config"))
    (tmp_path / ".config").mkdir()
    file = tmp_path / ".config" / "user-dirs.dirs"
    file.write_text('XDG_DESKTOP_DIR="$HOME/Schreibtisch"\n')
    assert desktop_folder() == tmp_path / "Schreibtisch"
    assert (tmp_path / "Schreibtisch").is_dir()
    file.write_text('XDG_DESKTOP_DIR="$HOME/"\n')  # as where a person wants none
    assert desktop_folder() == tmp_path / "Desktop"
    (tmp_path / "Desktop").rmdir()
    (tmp_path / "Desktop").write_text("a file")
    with pytest.raises(UavgramError, match="--folder"):
        desktop_folder()


@pytest.mark.parametrize("platform", ["linux", "darwin", "win32"])
def test_a_folder_that_is_not_there_is_an_error_and_nothing_is_written(
    tmp_path: Path, platform: str
) -> None:
    with pytest.raises(UavgramError, match="no such folder: make it, or name another --folder"):
        write_shortcut(computer(tmp_path, platform), tmp_path / "missing")
    assert not list(tmp_path.iterdir())


def test_what_is_there_already_is_replaced_only_where_it_is_ours(tmp_path: Path) -> None:
    mac = computer(tmp_path, "darwin")
    write_shortcut(mac, tmp_path)
    (path,) = write_shortcut(mac, tmp_path)
    path.write_text("something else")
    with pytest.raises(UavgramError, match="no shortcut"):
        write_shortcut(mac, tmp_path)
    path.unlink()
    path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(UavgramError, match="no shortcut"):
        write_shortcut(mac, tmp_path)
    assert not (tmp_path / "elsewhere").exists()
