"""What the page fetches, and what it says of itself while it does."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Never, cast

import httpx
import pytest
from own_loop import run_alone
from starlette.applications import Starlette

from uavgram.errors import InputError
from uavgram.picking.session.project import OpenProject
from uavgram.picking.web.routes import file_routes


@pytest.fixture
def picking() -> SimpleNamespace:
    shown: list[tuple[object, ...]] = []
    return SimpleNamespace(
        shown=shown, show=lambda *said: shown.append(said), tile=lambda *_: b"tile"
    )


def tile(picking: SimpleNamespace, **headers: str) -> httpx.Response:
    """The answer to a page that asks for a tile."""

    async def ask() -> httpx.Response:
        stand_in = cast("OpenProject", SimpleNamespace(picking=picking))  # all that is asked for
        door = httpx.ASGITransport(Starlette(routes=file_routes(stand_in)))
        async with httpx.AsyncClient(transport=door, base_url="http://page") as page:
            return await page.get("/photo/3/0/1/2.jpg", headers=headers)

    return run_alone(ask())


def test_a_page_says_with_each_tile_which_photos_it_shows(picking: SimpleNamespace) -> None:
    assert tile(picking, **{"x-shown": "k3f9x 3,12"}).content == b"tile"
    assert picking.shown == [("k3f9x", (3, 12))]


@pytest.mark.parametrize(
    "said",
    ["", "k3f9x", "k3f9x 1,2,3,4,5", "k3f9x -1", "k3f9x 1;2", "k3f9x 1 ", "K 1", f"{'k' * 17} 1"],
)
def test_what_does_not_say_so_is_passed_over_and_the_tile_comes(
    picking: SimpleNamespace, said: str
) -> None:
    assert tile(picking, **{"x-shown": said}).content == b"tile"
    assert picking.shown == []


def test_why_a_photo_cannot_be_shown_is_said(picking: SimpleNamespace) -> None:
    def refuse(*_: object) -> Never:
        raise InputError("photo.jpg", "is no photo that can be decoded")

    picking.tile = refuse
    answer = tile(picking)
    assert answer.status_code == 404
    assert "photo.jpg: is no photo that can be decoded" in answer.json()["why"]
