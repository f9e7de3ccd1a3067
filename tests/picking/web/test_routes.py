"""What the page fetches, and what it says of itself while it does."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Never, cast

import httpx
import pytest
from own_loop import run_alone
from starlette.applications import Starlette

from uavgram.errors import InputError
from uavgram.imaging.photos.preview import Tone
from uavgram.picking.session.project import OpenProject
from uavgram.picking.web.routes import file_routes


@pytest.fixture
def picking() -> SimpleNamespace:
    shown: list[tuple[object, ...]] = []
    asked: list[tuple[object, ...]] = []

    def tile(*place: object) -> bytes:
        asked.append(place)
        return b"tile"

    return SimpleNamespace(
        shown=shown,
        show=lambda *said: shown.append(said),
        asked=asked,
        tiled=SimpleNamespace(tile=tile),
    )


def tile(
    picking: SimpleNamespace, address: str = "/photo/3/0/1/2.jpg", **headers: str
) -> httpx.Response:
    """The answer to a page that asks for a tile, or for something else."""

    async def ask() -> httpx.Response:
        stand_in = cast("OpenProject", SimpleNamespace(picking=picking))  # all that is asked for
        door = httpx.ASGITransport(Starlette(routes=file_routes(stand_in)))
        async with httpx.AsyncClient(transport=door, base_url="http://page") as page:
            return await page.get(address, headers=headers)

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

    picking.tiled.tile = refuse
    answer = tile(picking)
    assert answer.status_code == 404
    assert "photo.jpg: is no photo that can be decoded" in answer.json()["why"]


@pytest.mark.parametrize(
    ("said", "tone"),
    [
        ("", None),
        ("?d1g&tone=first", None),
        ("?tone=0.0,255.0,1.00", Tone()),
        ("?d1g&tone=-127.5,382.5,0.5", Tone(-127.5, 382.5, 0.5)),
    ],
)
def test_a_tile_comes_as_bright_as_the_page_asks_for(
    picking: SimpleNamespace, said: str, tone: Tone | None
) -> None:
    assert tile(picking, f"/photo/3/0/1/2.jpg{said}").content == b"tile"
    assert picking.asked == [(3, 0, 1, 2, tone)]


@pytest.mark.parametrize(
    "said", ["", "1", "0,255", "0,255,1,1", "a,b,c", "255,0,1", "0,255,0", "0,255,11", "0,1e9,1"]
)
def test_what_is_no_curve_of_brightness_is_refused(picking: SimpleNamespace, said: str) -> None:
    assert tile(picking, f"/photo/3/0/1/2.jpg?tone={said}").status_code == 400
    assert picking.asked == []


def test_how_bright_a_photo_is_shown_first_is_told(picking: SimpleNamespace) -> None:
    picking.tiled.tones = lambda photo: (Tone(), Tone(30.0, 90.0, 1.5)) if photo == 3 else None

    assert tile(picking, "/photo/3/tones.json").json() == {
        "first": {"black": 0.0, "white": 255.0, "gamma": 1.0},
        "stretched": {"black": 30.0, "white": 90.0, "gamma": 1.5},
    }
    assert tile(picking, "/photo/4/tones.json").status_code == 404
