"""What the browser is started with tells other users nothing, and is gone when it was used."""

from __future__ import annotations

import re
import webbrowser
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from pick_pages import small_project
from starlette.types import Receive, Scope, Send

from uavgram.cli.commands.picks import pick
from uavgram.picking.web import serving
from uavgram.picking.web.guard import Guard


def test_the_browser_is_given_a_file_and_not_the_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[str] = []
    written: list[str] = []
    still_there: list[bool] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)

    async def nobody(_scope: Scope, _receive: Receive, _send: Send) -> None:
        pytest.fail("nobody comes")

    def serve(
        _project: Path,
        announce: Callable[[str], None],
        _run: object,
        _port: int,
        entered: Callable[[], None],
    ) -> None:
        guard = Guard(nobody, 1234, entered)
        announce(guard.address())
        path = Path(urlsplit(opened[0]).path)
        written.append(path.read_text(encoding="utf-8"))
        entered()
        still_there.append(path.parent.exists())

    monkeypatch.setattr(serving, "serve", serve)
    assert pick(small_project(tmp_path)) == 0
    said = re.search(r"token=([-\w]+)", capsys.readouterr().out)
    assert said is not None
    token = said[1]
    assert opened[0].startswith("file:///")
    assert token not in opened[0]
    assert f"http://127.0.0.1:1234/?token={token}" in written[0]
    assert still_there == [False]
