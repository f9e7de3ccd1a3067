"""Routes: files of the page, photos by number, outputs by name, and the end of a run."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import asdict
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from anyio import to_thread
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

from uavgram.errors import UavgramError
from uavgram.imaging.photos.preview import Tone
from uavgram.imaging.photos.tiles import FIRST_COARSE
from uavgram.io.files import read_own
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_quantities import word_for_page
from uavgram.picking.protocol.ways_on_page import name_on_page
from uavgram.picking.session.project import OpenProject

DOCUMENT_HEADERS = {
    # A separate document: free in style, without any rights.
    "content-security-policy": (
        "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; "
        "sandbox"
    )
}
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


class PageJSON(JSONResponse):
    """JSON with its sentences in the words of the page."""

    def render(self, content: object) -> bytes:
        """Encode it."""
        return super().render(word_for_page(content))


START, WORK = "door.html", "index.html"
"""Pages: the choice of a folder, at /door also while a project is open; and the open project."""

FIRST_TONE = "first"
"""Value of `tone` for a photo's default brightness."""

# Values that become black and white, and the lift of the middle.
_TONE = re.compile(
    r"(-?[0-9]{1,4}(?:\.[0-9])?),(-?[0-9]{1,4}(?:\.[0-9])?),([0-9]{1,2}(?:\.[0-9]{1,2})?)"
)

# Tiles finer than those of the overview are tens of megabytes per photo, and are cut in
# milliseconds: the browser would fill its memory or its disk with them.
_TILE = ("photo", "level", "column", "row")

# Identifier of a page, and the photos in its panes.
_SHOWN = re.compile(r"([0-9a-z]{1,16}) ([0-9]{1,6}(?:,[0-9]{1,6}){0,3})")


def page_routes(first: Callable[[], str]) -> list[Route]:
    """Return the routes to the files of the pages.

    Parameters
    ----------
    first
        Returns the name of the page to show now.
    """
    files = dict(_page_files(resources.files("uavgram.picking") / "page"))

    async def index(request: Request) -> Response:
        name = START if request.url.path == "/door" else first()
        return Response(
            files[name], media_type=_TYPES[".html"], headers={"cache-control": "no-store"}
        )

    async def page(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in files:
            return Response(status_code=404)
        kind = _TYPES[Path(name).suffix]
        return Response(files[name], media_type=kind, headers={"cache-control": "no-cache"})

    return [Route("/", index), Route("/door", index), Route("/page/{name:path}", page)]


def file_routes(project: OpenProject) -> list[Route]:
    """Return the routes to all other files."""
    files = Files(project)
    return [
        Route("/photo/{photo:int}/{level:int}/{column:int}/{row:int}.jpg", files.tile),
        Route("/photo/{photo:int}/thumbnail.jpg", files.thumbnail),
        Route("/photo/{photo:int}/tones.json", files.tones),
        Route("/output/{name}", files.output),
        Route("/results.json", files.results),
        Route("/plan.svg", files.plan),
        Route("/recording", files.recording),
        Route("/calibration", files.calibration),
    ]


class Files:
    """Handlers of file requests.

    Parameters
    ----------
    project
        The open project.
    """

    def __init__(self, project: OpenProject) -> None:
        self._project = project

    async def tile(self, request: Request) -> Response:
        """Serve a tile of a photo, with the requested brightness."""
        said = request.query_params.get("tone", FIRST_TONE)
        tone = None if said == FIRST_TONE else _tone(said)
        if said != FIRST_TONE and tone is None:
            return PlainTextResponse("That is no curve of brightness.", 400)
        shown = _SHOWN.fullmatch(request.headers.get("x-shown", ""))
        if shown:  # keep the neighbouring photos of the page in memory
            page, photos = shown.groups()
            self._project.picking.show(page, tuple(map(int, photos.split(","))))
        photo, level, *place = (request.path_params[key] for key in _TILE)
        make = self._project.picking.tiled.tile
        return await self._picture(make, photo, level, *place, tone, is_kept=level >= FIRST_COARSE)

    async def tones(self, request: Request) -> Response:
        """Serve the default and the stretched brightness curve of a photo."""
        make, photo = self._project.picking.tiled.tones, request.path_params["photo"]
        try:
            tones = await to_thread.run_sync(make, photo)
        except UavgramError as why:
            return PageJSON({"why": str(why)}, 404)
        if tones is None:
            return Response(status_code=404)
        first, stretched = map(asdict, tones)
        answer: m.Tones = {"first": first, "stretched": stretched}
        return JSONResponse(answer)

    async def thumbnail(self, request: Request) -> Response:
        """Serve a small picture of a photo."""
        return await self._picture(self._project.picking.thumbnail, request.path_params["photo"])

    @staticmethod
    async def _picture(
        make: Callable[..., bytes | None], *place: int | Tone | None, is_kept: bool = True
    ) -> Response:
        try:
            jpeg = await to_thread.run_sync(make, *place)
        except UavgramError as why:
            return PageJSON({"why": str(why)}, 404)
        if jpeg is None:
            return Response(status_code=404)
        keep = "private, max-age=86400" if is_kept else "no-store"
        return Response(jpeg, media_type="image/jpeg", headers={"cache-control": keep})

    async def output(self, request: Request) -> Response:
        """Serve a file that a run wrote: documents are displayed, all others downloaded."""
        name = request.path_params["name"]
        content = await to_thread.run_sync(self._project.outputs.read, name)
        if content is None:
            return PlainTextResponse("There is no such output yet: write them on the page.", 404)
        if name.endswith(".html"):
            return Response(content, media_type=_TYPES[".html"], headers=DOCUMENT_HEADERS)
        headers = {"content-disposition": f'attachment; filename="{name}"'}
        return Response(content, media_type="application/octet-stream", headers=headers)

    async def results(self, _: Request) -> Response:
        """Serve the findings of the last run, in words."""
        shown = await to_thread.run_sync(self._project.outputs.summarise_results)
        if shown is None:
            return PageJSON({"why": "There are no results yet: write them on the page."}, 404)
        return JSONResponse(shown, headers={"cache-control": "no-store"})

    async def plan(self, _: Request) -> Response:
        """Serve the plan of the last run."""
        drawing = await to_thread.run_sync(self._project.outputs.plan)
        if drawing is None:
            return PlainTextResponse("There is no plan.", 404)
        headers = {**DOCUMENT_HEADERS, "cache-control": "no-store"}
        return Response(drawing, media_type=_TYPES[".svg"], headers=headers)

    async def recording(self, _: Request) -> Response:
        """Redirect to the Rerun viewer, which is started if necessary."""
        try:
            address = await to_thread.run_sync(self._project.outputs.viewer)
        except UavgramError as why:
            return PlainTextResponse(name_on_page(str(why)), 404)
        return RedirectResponse(address, 303)

    async def calibration(self, _: Request) -> Response:
        """Serve the report of the last calibration."""
        report = self._project.calibration.report
        try:
            content = b"" if report is None else await to_thread.run_sync(read_own, report)
        except (OSError, UavgramError):
            content = b""
        if not content:
            return PlainTextResponse("There is no calibration yet.", 404)
        return Response(content, media_type=_TYPES[".html"], headers=DOCUMENT_HEADERS)


def _tone(text: str) -> Tone | None:
    """Parse a requested brightness curve; None if it is not valid."""
    said = _TONE.fullmatch(text)
    try:
        return None if said is None else Tone(*map(float, said.groups()))
    except ValueError:
        return None


def _page_files(folder: Traversable, above: str = "") -> Iterator[tuple[str, bytes]]:
    """Yield the files of the page by their paths in its folder; no others are served."""
    for one in folder.iterdir():
        name = f"{above}{one.name}"
        if one.is_dir():
            yield from _page_files(one, f"{name}/")
        elif Path(name).suffix in _TYPES:
            yield name, one.read_bytes()
