"""A fresh address of a page that runs: from the terminal, for who can read the project's files."""

from __future__ import annotations

import errno
import json
import re
import signal
import subprocess
import sys
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from pick_pages import LONGEST_WAIT_S, Server, ask, entry_by, entry_of, running, small_project
from starlette.types import Receive, Scope, Send

from uavgram.cli import main
from uavgram.cli.commands.picks import pick
from uavgram.io.outputs import LOCK, is_locked
from uavgram.picking.web import serving
from uavgram.picking.web.guard import MAX_OPEN, Guard, Tokens
from uavgram.picking.web.running_server import PATH, ServerAddress, request_address, servers_folder


def only_where_open(_door: ServerAddress) -> bool:
    """Ask only the server that has the project open."""
    return False


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_project(tmp_path_factory.mktemp("running"))


@pytest.fixture(scope="module")
def server(project: Path) -> Iterator[Server]:
    with running(project) as server:
        yield server


def asked(server: Server, **headers: str) -> httpx.Response:
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return httpx.post(server.origin + PATH, headers=named, timeout=LONGEST_WAIT_S)


def door_of(server: Server) -> Path:
    """The file that a server has left."""
    (path,) = servers_folder().glob(f"*-{urlsplit(server.origin).port}.door")
    return path


def secret(server: Server) -> str:
    return str(json.loads(door_of(server).read_text(encoding="utf-8"))["secret"])


@pytest.fixture
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user of whom no page runs."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "uavgram"


def test_the_same_command_gives_another_browser_an_address_of_its_own(
    project: Path, server: Server, capsys: pytest.CaptureFixture[str]
) -> None:
    first = entry_of(server)
    assert main(["pick", str(project), "--no-browser"]) == 0
    said = capsys.readouterr().out
    (word,) = (word for word in said.split() if word.startswith("http"))
    assert word.startswith(server.origin)
    answer = ask(word, follow_redirects=False)
    assert entry_by(answer) == first  # the same page, by another way
    assert ask(word, follow_redirects=False).status_code == 403


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Linux and macOS")
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGHUP])
def test_who_ends_the_server_leaves_no_door(
    tmp_path: Path, own_state: Path, how: signal.Signals
) -> None:
    project = small_project(tmp_path)
    command = [sys.executable, "-m", "uavgram", "pick", str(project), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert "http://" in process.stdout.readline()
            assert len(list(own_state.glob("*.door"))) == 1
            process.send_signal(how)
            process.wait(LONGEST_WAIT_S)
        finally:
            process.kill()
    assert process.returncode == 128 + signal.SIGTERM
    assert not list(own_state.iterdir())
    assert not is_locked(tmp_path / "out" / LOCK)


def test_the_browser_is_led_by_a_file_that_is_gone_when_it_has_come(
    project: Path, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    came: list[tuple[Path, int]] = []

    def browse(uri: str) -> bool:
        file = Path(urlsplit(uri).path)
        found = re.search(r"url=([^\"]+)", file.read_text(encoding="utf-8"))
        assert found is not None
        came.append((file, ask(found[1], follow_redirects=False).status_code))
        return True

    monkeypatch.setattr(webbrowser, "open", browse)
    assert main(["pick", str(project)]) == 0
    ((file, status),) = came
    assert status == 303
    assert not file.parent.exists()
    assert server.is_alive


def test_whoever_waits_for_the_browser_is_told_when_it_has_come(
    project: Path, server: Server
) -> None:
    fresh = request_address(project)
    assert fresh is not None
    known = {"X_Secret": secret(server), "X_Token": fresh.token}
    assert asked(server, **known).text == "waits"
    ask(fresh.text)
    assert asked(server, **known).text == "used"
    fresh.wait_until_used()


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"X_Secret": ""},
        {"X_Secret": "guess"},
        {"X_Secret": "OURS", "Host": "evil.example"},
        {"X_Secret": "OURS", "Origin": "http://evil.example"},
        {"X_Secret": "OURS", "Sec_Fetch_Site": "same-site", "Sec_Fetch_Mode": "no-cors"},
    ],
    ids=range(6),
)
def test_others_get_no_address(server: Server, headers: dict[str, str]) -> None:
    given = {name: secret(server) if value == "OURS" else value for name, value in headers.items()}
    answer = asked(server, **given)
    assert answer.status_code == 403
    assert "token" not in answer.text


def test_the_secret_opens_nothing_else(server: Server) -> None:
    known = {"X-Secret": secret(server)}
    assert ask(server.origin + "/", headers=known).status_code == 403
    assert ask(server.origin + PATH, headers=known).status_code == 403
    name = f"uavgram-pick-{urlsplit(server.origin).port}"
    with_cookie = {"Cookie": f"{name}={secret(server)}"}
    assert ask(server.origin + "/", headers=with_cookie).status_code == 403


def test_only_its_user_can_read_the_file_and_it_goes_with_the_server(tmp_path: Path) -> None:
    with running(small_project(tmp_path)) as server:
        file = door_of(server)
        assert [one.stat().st_mode & 0o777 for one in (file, file.parent)] == [0o600, 0o700]
    assert not file.exists()


def test_what_a_killed_server_left_behind_leads_nowhere_and_is_removed(tmp_path: Path) -> None:
    project = small_project(tmp_path)
    killed = Server(project)
    file = door_of(killed)
    killed.kill()
    assert file.exists()  # nobody holds its lock: another program may have the port by now
    assert request_address(project, only_where_open) is None
    assert not file.exists()
    with running(project) as server:
        fresh = request_address(project)
        assert fresh is not None
        assert fresh.text.startswith(server.origin)


def test_a_page_is_found_where_the_system_cannot_lock_files(
    server: Server, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("uavgram.io.outputs.lock", refuse)
    fresh = request_address(project)

    assert fresh is not None
    assert door_of(server).exists()


def test_a_server_of_another_machine_with_the_same_home_is_not_asked(
    project: Path, server: Server
) -> None:
    assert server.is_alive
    own = door_of(server)
    other = own.with_name(f"other-{own.name.rpartition('-')[2]}")
    other.write_bytes(own.read_bytes())
    assert request_address(project) is not None
    assert other.exists()
    other.unlink()


def test_a_page_without_its_cookie_says_which_command_helps(server: Server) -> None:
    answer = ask(server.origin + "/")
    assert answer.status_code == 403
    assert answer.headers["content-type"].startswith("text/html")
    assert "icon on the desktop" in answer.text


def test_a_token_serves_once_and_not_for_ever() -> None:
    now = 0.0
    tokens = Tokens(clock=lambda: now)
    first, short = tokens.new(), tokens.new(lasts_s=5)
    now = 6.0
    assert not tokens.is_open(short)
    assert not tokens.use(short)
    assert tokens.is_open(first)
    assert tokens.use(first)
    assert not tokens.use(first)
    many = [tokens.new() for _ in range(MAX_OPEN + 1)]
    assert [tokens.use(token) for token in many] == [False, *[True] * MAX_OPEN]
    assert not tokens.use("")
    assert not tokens.use("\u00e9")


# What the browser is started with tells other users nothing, and is gone when it was used.


@pytest.mark.usefixtures("own_state")
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
