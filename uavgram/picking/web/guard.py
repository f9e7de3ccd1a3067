"""Access control: only this machine, this browser, this page.

The server listens on 127.0.0.1 alone, which keeps other machines out. Against other pages of the
same browser:

* The printed address has a random token. It is exchanged for a cookie that only this site sends
  (SameSite=Strict) and that scripts cannot read.
* The Host must be ours: otherwise a foreign name that resolves to 127.0.0.1 (DNS rebinding) would
  be accepted.
* The Origin of the socket must be ours, because browsers let any page open a socket anywhere.
* SameSite does not distinguish ports, so requests embedded in a page of another local server are
  recognised by Sec-Fetch-Site.

Cookies do not distinguish ports either: the browser sends ours to every other server of this
machine that it visits. So the token also brings the key of a tab, behind the # of the address,
which no browser sends. The page keeps it in its sessionStorage, which no other tab and no other
port has, and adds it to all its requests. The cookie alone gives access to the page's own files,
but to nothing of the project.

A page with access can still do harm by too many or too long messages: requests and messages have
a greatest length, and `RateLimit` slows a socket down.

A user who has lost the tab, or wants another browser, starts the program again and gets a fresh
address: see `running_server.py`.
"""

from __future__ import annotations

import contextlib
import hmac
import logging
import math
import os
import re
import secrets
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import unquote_to_bytes

from starlette.datastructures import URL, Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from uavgram.picking.web.running_server import (
    LASTS_S,
    PATH,
    USED,
    WAITS,
    address,
    make_redirect,
    make_refusal,
)

log = logging.getLogger(__name__)

MAX_OPEN = 16
"""Largest number of unused tokens; with one more, the oldest becomes invalid."""

HEADERS = {
    "content-security-policy": (
        "default-src 'self'; img-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'; "
        "form-action 'none'; object-src 'none'; require-trusted-types-for 'script'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "x-frame-options": "DENY",
}
KEY = "tab"
"""Query parameter of an address: the key of the requesting tab."""
_OF_THE_PROGRAM = re.compile(r"/(door|page/.*)?")  # the same for all users: nothing of a project
POLICY_VIOLATION = 1008
MAX_PATH = 1000
NO_KEY = "it does not come from the page"
WayTo = Callable[[Path | None, bool], str | None]
MESSAGES_A_SECOND = 300
"""Message rate; a mouse reports up to some 125 moves a second, and the page awaits each answer."""
MESSAGES_AT_ONCE = 600


class Tokens:
    """Tokens that were issued and not used yet.

    Parameters
    ----------
    clock
        Clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._ends_s: dict[str, float] = {}

    def new(self, lasts_s: float = math.inf) -> str:
        """Issue a token that is valid once, for `lasts_s` seconds."""
        token = secrets.token_urlsafe(32)
        self._ends_s[token] = self._clock() + lasts_s
        while len(self._ends_s) > MAX_OPEN:
            del self._ends_s[next(iter(self._ends_s))]
        return token

    def is_open(self, token: str) -> bool:
        """Return whether a token can still be used."""
        return self._ends_s.get(token, -math.inf) >= self._clock()

    def use(self, given: str) -> bool:
        """Return whether a token is valid, and consume it."""
        found = [
            token for token in self._ends_s if equal_in_constant_time(token, given)
        ]  # all: constant time
        return any(self._ends_s.pop(token) >= self._clock() for token in found)


def equal_in_constant_time(given: str, wanted: str) -> bool:
    """Return whether two texts are equal, in a time independent of where they differ."""
    return hmac.compare_digest(given.encode(), wanted.encode())


class RateLimit:
    """Rate limit of one page: a number of messages at once, then a number per second.

    A faster page is slowed down without loss: its messages stay in its socket, which is not read
    meanwhile.

    Parameters
    ----------
    per_second, at_once
        The two limits.
    clock
        Clock [s].

    Attributes
    ----------
    warned
        Whether a warning about the fast page was logged.
    """

    def __init__(
        self,
        per_second: float = MESSAGES_A_SECOND,
        at_once: float = MESSAGES_AT_ONCE,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._per_second, self._at_once, self._clock = per_second, at_once, clock
        self._left, self._then = at_once, clock()
        self.warned = False

    def wait_s(self) -> float:
        """Return the delay [s] before the message just received is processed."""
        now = self._clock()
        gained = (now - self._then) * self._per_second
        self._left = min(self._left + gained, self._at_once) - 1
        self._then = now
        return max(-self._left / self._per_second, 0.0)


class Tabs:
    """Number of open tabs, and the time without one: since the last was closed, or the beginning.

    Parameters
    ----------
    clock
        Clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._open = clock, 0
        self._none_since_s = clock()

    @contextlib.contextmanager
    def one(self) -> Iterator[None]:
        """Count a tab while it is open."""
        self._open += 1
        try:
            yield
        finally:
            self._open -= 1
            self._none_since_s = self._clock()

    def expect(self) -> None:
        """Restart the time without a tab, as a new address was given."""
        self._none_since_s = self._clock()

    def gone_s(self) -> float:
        """Return the time without a tab [s]; 0 while one is open."""
        return 0.0 if self._open else self._clock() - self._none_since_s


class Guard:
    """Filter that passes requests of the page, refuses others, and adds strict headers.

    Parameters
    ----------
    app
        Guarded application.
    port
        Port of the server.
    entered
        Called when a token has been used.
    way_to
        Returns the path of the page that shows a project, or what is open now (None); None if that
        project is not open, and only an open one is asked for.

    Attributes
    ----------
    secret
        Secret that entitles to a fresh address.
    tabs
        Tabs of browsers that show the page.
    """

    def __init__(
        self,
        app: ASGIApp,
        port: int,
        entered: Callable[[], None] = lambda: None,
        way_to: WayTo = lambda _wanted, _only_open: "/",
    ) -> None:
        self._app, self._entered, self._way_to = app, entered, way_to
        self.tabs = Tabs()
        self.secret = secrets.token_urlsafe(32)
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._cookie = f"uavgram-pick-{port}"  # cookies do not distinguish ports
        self._key, self._tab_key = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
        self._tokens = Tokens()
        self._port = port

    def address(self) -> str:
        """Return the address to open, with a token that is valid once."""
        return address(self._port, self._tokens.new(math.inf))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        refusal = self._refusal(connection)
        if refusal:
            log.warning("refused %r: %s", scope["path"][:80], refusal)
            await self._refuse(scope, receive, send, refusal)
            return
        if scope["type"] == "http" and scope["path"] == PATH and scope["method"] == "POST":
            await self._fresh(connection)(scope, receive, _strict(send))
            return
        given = connection.query_params.get("token")
        if scope["type"] == "http" and given is not None:
            await self._exchange_token(connection, given)(scope, receive, _strict(send))
            return
        has_key = equal_in_constant_time(connection.query_params.get(KEY, ""), self._tab_key)
        is_open = _OF_THE_PROGRAM.fullmatch(scope["path"]) is not None
        if not self._is_authorised(connection) or not (is_open or has_key):
            log.warning("refused %r: %s", scope["path"][:80], NO_KEY)
            await self._refuse(scope, receive, send, NO_KEY)
            return
        with self.tabs.one() if scope["type"] == "websocket" else contextlib.nullcontext():
            await self._app(scope, receive, _strict(send))

    def _refusal(self, connection: HTTPConnection) -> str:
        """Return why a request is not from this page; empty if it may be."""
        headers: Headers = connection.headers
        host = headers.get("host", "")
        if host not in self._hosts:
            return f"foreign host {host[:80]!r}"
        origin = headers.get("origin")
        ours = f"http://{host}"
        is_stated = origin is not None or connection.scope["type"] == "websocket"
        if is_stated and origin != ours:
            return f"foreign origin {str(origin)[:80]!r}"
        # https://www.w3.org/TR/fetch-metadata/: refuse embedded requests; links may be followed.
        site, mode = headers.get("sec-fetch-site", "none"), headers.get("sec-fetch-mode")
        if site not in {"same-origin", "none"} and mode != "navigate":
            return f"asked for by another page ({site[:20]!r})"
        if len(connection.scope["path"]) > MAX_PATH:
            return "an address of this page is never that long"
        return ""

    def _is_authorised(self, connection: HTTPConnection) -> bool:
        return equal_in_constant_time(connection.cookies.get(self._cookie, ""), self._key)

    def _fresh(self, connection: HTTPConnection) -> Response:
        """Answer with a way and a new token if the secret is right, or with a token's state."""
        if not equal_in_constant_time(connection.headers.get("x-secret", ""), self.secret):
            log.warning("refused a fresh address: the secret is another")
            return PlainTextResponse("", 403)
        token = connection.headers.get("x-token")
        if token is not None:
            return PlainTextResponse(WAITS if self._tokens.is_open(token) else USED)
        wanted = connection.headers.get("x-wanted")
        path = None if wanted is None else Path(os.fsdecode(unquote_to_bytes(wanted)))
        way = self._way_to(path, connection.headers.get("x-only") == "open")
        if way is None:
            return PlainTextResponse("")
        self.tabs.expect()
        return PlainTextResponse(f"{way}?token={self._tokens.new(LASTS_S)}")

    def _exchange_token(self, connection: HTTPConnection, given: str) -> Response:
        """Exchange a token, once, for cookie and key, and redirect to the address without it."""
        # A second slash at the beginning would lead to another computer.
        way = f"/{URL(scope=connection.scope).path.lstrip('/')}"
        if self._tokens.use(given):
            self._entered()
            way = f"{way}#{self._tab_key}"
        elif not self._is_authorised(connection):
            return HTMLResponse(make_refusal("This address was used already, or is too old."), 403)
        answer: Response = RedirectResponse(way, 303)
        if connection.headers.get("sec-fetch-site", "none") != "none":
            # Opened from a file: a strict cookie is only sent if a page of ours redirects.
            answer = HTMLResponse(make_redirect(way))
        answer.set_cookie(self._cookie, self._key, httponly=True, samesite="strict", path="/")
        return answer

    @staticmethod
    async def _refuse(scope: Scope, receive: Receive, send: Send, why: str) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": POLICY_VIOLATION, "reason": why[:100]})
            return
        answer: Response = PlainTextResponse(f"Refused: {why}", 403)
        if why == NO_KEY:
            answer = HTMLResponse(
                make_refusal("This tab of the browser has no key to the page."), 403
            )
        await answer(scope, receive, _strict(send))


def _strict(send: Send) -> Send:
    """Return a sender that adds strict headers to every answer."""

    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)  # a report has its own, stricter policy
        await send(message)

    return with_headers
