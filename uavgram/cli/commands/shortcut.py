"""Command `uavgram shortcut`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, app
from uavgram.cli.terminal import print_lines


@app.command
def shortcut(*, folder: Path | None = None) -> int:
    """Put an icon on the desktop that opens the page, as `uavgram` alone does.

    On Windows a folder that is dropped on the icon is opened too. On Linux the icon is also put
    into the menu of programs; GNOME shows only that.

    Parameters
    ----------
    folder
        Folder of the icon, instead of the desktop.
    """
    import os
    import sys
    from importlib.resources import files

    from uavgram.io.desktop import Computer, desktop_folder, write_shortcut

    picture = "icon.ico" if sys.platform == "win32" else "icon.svg"
    computer = Computer(
        platform=sys.platform,
        python=sys.executable,
        icon=Path(str(files("uavgram.picking") / "page" / picture)),
        home=Path.home(),
        environ=os.environ,
    )
    written = write_shortcut(computer, desktop_folder() if folder is None else folder)
    print_lines(
        f"Icon: {written[0]}", *(f"In the menu of programs: {path}" for path in written[1:])
    )
    if written[0].suffix == ".cmd":
        print_lines(
            "PowerShell made no shortcut (.lnk), so this is a batch file: it opens the same page, "
            "but has the picture of all batch files."
        )
    print_lines("It opens the page, and a lost tab again. Close its window to end the program.")
    return DONE
