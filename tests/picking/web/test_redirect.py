"""What the browser is started with tells other users nothing, and is gone when it was used."""

from __future__ import annotations

import re
import webbrowser
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from uavgram.cli.commands.pick import pick
from uavgram.picking.web import server
from uavgram.picking.web.guard import Guard


def test_the_browser_is_given_a_file_and_not_the_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened, found = [], {}
    monkeypatch.setattr(webbrowser, "open", opened.append)

    def serve(_project, announce, _run, _port, entered) -> None:
        guard = Guard(None, 1234, entered)
        announce(guard.address())
        path = Path(urlsplit(opened[0]).path)
        found["text"] = path.read_text(encoding="utf-8")
        entered()
        found["there"] = path.parent.exists()

    monkeypatch.setattr(server, "serve", serve)
    assert pick(tmp_path / "project.yaml") == 0
    token = re.search(r"token=([-\w]+)", capsys.readouterr().out)[1]
    assert opened[0].startswith("file:///")
    assert token not in opened[0]
    assert f"http://127.0.0.1:1234/?token={token}" in found["text"]
    assert not found["there"]
