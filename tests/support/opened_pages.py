"""Pages of the picking page's server in a real browser, and what went wrong in them."""

from __future__ import annotations

import re

from picking_server import Served
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, Request


class PageOpener:
    """Opens a server's page: ``open_page(server, width, height, ratio)``.

    Attributes
    ----------
    errors
        What the opened pages told as errors.
    strangers
        Addresses elsewhere that they asked for.
    """

    def __init__(self, chromium: Browser) -> None:
        self.errors: list[str] = []
        self.strangers: list[str] = []
        self._chromium = chromium
        self._opened: list[BrowserContext] = []

    def __call__(
        self, server: Served, width: int = 1280, height: int = 720, ratio: float = 1.0
    ) -> Page:
        context = self._chromium.new_context(
            viewport={"width": width, "height": height}, device_scale_factor=ratio
        )
        context.set_default_timeout(60_000)
        self._opened.append(context)
        page = context.new_page()
        home = re.compile(rf"(http|ws)://127\.0\.0\.1:{server.port}/|blob:|data:")

        def said(message: ConsoleMessage) -> None:
            if message.type == "error":
                self.errors.append(f"{message.text} {message.location.get('url', '')}")

        def asked(request: Request) -> None:
            if not home.match(request.url):
                self.strangers.append(request.url)

        page.on("pageerror", lambda fault: self.errors.append(str(fault)))
        page.on("console", said)
        page.on("request", asked)
        page.goto(server.guard.address())
        page.wait_for_selector('.pane[data-sharp="true"], body.door[aria-busy="false"]')
        return page

    def close(self) -> None:
        """Close all that was opened."""
        for context in self._opened:
            context.close()
