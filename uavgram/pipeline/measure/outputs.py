"""Outputs of a run: recording, report with parts of photos, results, files for other programs."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import groupby
from pathlib import Path
from threading import Lock

import numpy as np

from uavgram.geometry.geodesy import projected_from_enu
from uavgram.geometry.ground.top_view import View
from uavgram.imaging.photos.decoding import read_pixels
from uavgram.imaging.photos.preview import (
    Pixels,
    Preview,
    apply_tone,
    choose_tone,
    cut_parts,
    jpeg_preview_scale,
    make_preview_of_decoded,
    read_preview,
)
from uavgram.imaging.top_view.brightness import PhotoCache, estimate_exposure_gains
from uavgram.imaging.top_view.mosaic import GroundTexture, Mosaic, cut_ground
from uavgram.io.exports.dxf import place_texts, write_dxf
from uavgram.io.exports.dxf_layers import NumberFormat
from uavgram.io.exports.geojson_kml import write_geojson, write_kml
from uavgram.io.exports.geotiff import add_opacity, write_turned_picture
from uavgram.io.exports.gis import GROUND, write_geopackage, write_qgis_project
from uavgram.io.exports.measurements_csv import write_measurements_csv, write_profiles_csv
from uavgram.io.exports.photogrammetry import write_colmap_model, write_gcp_list, write_geo_txt
from uavgram.io.files import photo_files
from uavgram.io.outputs import LAST_MOVED, replace_bytes
from uavgram.io.results.results_json import dump_results, write_results
from uavgram.model.arrays import Floats
from uavgram.model.frames import GeoTags, PoseChoice
from uavgram.model.maps import PLAN_PDF, GroundRaster, Paper, Plan, PlanPaper, PlanSheet
from uavgram.model.message import Message
from uavgram.model.naming import Units
from uavgram.model.result.result import GroundPicture, Picture, Pictures, Region, Result
from uavgram.model.result.tables import TieCloud
from uavgram.pipeline.ground_picture import render_picture, select_photos
from uavgram.pipeline.measure.run import Journal
from uavgram.pipeline.parallel import Progress, prefetch, silent
from uavgram.stages.products.geotags import geotag
from uavgram.stages.products.map_layers import features_of, select_shown_poses
from uavgram.stages.products.picture_plan import picture_plan
from uavgram.stages.products.plan_sheets import (
    FOOT_STEPS,
    METRIC_STEPS,
    find_surveyed_extent,
    lay_plan,
)
from uavgram.stages.products.top_view import choose_view, photo_pixels_m
from uavgram.views.recording.write import write_recording
from uavgram.views.report import annex_of, ground_extent, report_pdf, write_report
from uavgram.views.site_plan import PlanContent, SheetPicture, plan_pages
from uavgram.views.style import LOOKS
from uavgram.views.units import format_quantity, table_unit, units_of

Writers = dict[str, Callable[[Path], None]]


def make_writers(result: Result, texture: GroundTexture | None = None) -> Writers:
    """Return the writer of each file in the output folder, by name.

    Files that need a place on earth are left out without one; points.geojson and survey.kml then
    state why they are empty.

    Parameters
    ----------
    result
        Result of a run.
    texture
        Picture of the ground from the photos, if any.
    """
    words = drawing_words(units_of(result))
    features = features_of(result, result.world.crs, words.length_m)
    texts = cache(lambda: place_texts(features, words))  # both drawings have the same
    writers: Writers = {
        "points.geojson": lambda path: write_geojson(result, path),
        "measurements.csv": lambda path: write_measurements_csv(result, path),
        "survey.gpkg": lambda path: write_geopackage(features, path, LOOKS, words.value),
        "survey.kml": lambda path: write_kml(features, path, LOOKS),
        "survey_local.dxf": lambda path: write_dxf(features, path, LOOKS, words, texts()),
        "colmap": lambda path: write_colmap_model(result, path),
    }
    if result.profiles.profile:
        writers["profiles.csv"] = lambda path: write_profiles_csv(result, path)
    if features.crs is not None:
        writers["survey_map.dxf"] = lambda path: write_dxf(
            features, path, LOOKS, words, texts(), on_map=True
        )
        writers["opendronemap/gcp_list.txt"] = lambda path: write_gcp_list(result, features, path)
        writers["opendronemap/geo.txt"] = lambda path: write_geo_txt(make_geotags(result), path)
    if texture is not None:
        writers[GROUND] = lambda path: write_ground(texture, result, path)
    writers["survey.qgs"] = lambda path: write_qgis_project(
        features, LOOKS, path, has_ground=texture is not None
    )
    return writers


def write_ground(texture: GroundTexture, result: Result, path: Path) -> None:
    """Write the ground of the recording for maps.

    Parameters
    ----------
    texture
        In local metres.
    result
        Result, which ties local metres to the map.
    path
        The file.
    """
    height, width = texture.covered.shape
    right, down = np.array([width, -height]) * texture.pixel_size_m
    corner = np.array([texture.west_m, texture.north_m])
    corners, crs = transform_to_map(
        result, corner + np.array([[0.0, 0.0], [right, 0.0], [0.0, down]])
    )
    tags = {"surface": "the adjusted ground plane: objects above it lean away from the photo"}
    rgba = add_opacity(texture.rgb, texture.covered)
    write_turned_picture(rgba, corners, crs, tags, path)


def transform_to_map(result: Result, local_m: Floats) -> tuple[Floats, str | None]:
    """Transform places (n, 2) on the ground plane to the map, and return its coordinate system.

    Parameters
    ----------
    result
        Result, which ties local metres to the map; without a tie, the places are returned
        unchanged, and no map.
    local_m
        (n, 2) east, north.
    """
    origin, crs = result.world.origin, result.world.crs
    if origin is None or crs is None:
        return local_m, None
    up = result.plane.height_at(local_m)
    return projected_from_enu(np.column_stack([local_m, up]), origin, crs)[:, :2], crs


def drawing_words(units: Units) -> NumberFormat:
    """Return the wording of numbers in a drawing: in the project's units, while it is in metres."""
    one = table_unit(units)
    return NumberFormat(
        value=partial(format_quantity, units=units),
        length_m=1.0 if one.symbol == "m" else 1.0 / one.factor,
        symbol=one.symbol,
        name="metres" if one.symbol == "m" else "feet",
    )


def make_geotags(result: Result) -> GeoTags:
    """Return tags of every photo with a pose: the adjusted one, or else the telemetry's."""
    rows, poses = select_shown_poses(result)
    kinds: list[PoseChoice] = ["refined" if result.has_refined[k] else "seed" for k in rows]
    files = photo_files(result.frames)
    paths = tuple(files[k] for k in rows)
    return geotag(poses, paths, tuple(kinds), result.world)


PLAN_PNG, PLAN_MAP = "plan.png", "plan.tif"
PICTURE_DPI = 200


def write_plan(result: Result, wish: PlanPaper, folder: Path) -> None:
    """Write plan.pdf, plan.png and plan.tif.

    Parameters
    ----------
    result
        Result of a run.
    wish
        Paper and scale.
    folder
        Output folder.

    Raises
    ------
    GeometryError
        There is nothing to draw, or it takes too many sheets.
    InputError
        A photo cannot be read.
    OutputError
        A file cannot be written.
    """
    extent = find_surveyed_extent(result)
    steps = METRIC_STEPS if units_of(result).length == "m" else FOOT_STEPS
    plan = lay_plan(extent, wish.paper, wish.scale, steps)
    overview = plan if len(plan.sheets) == 1 else lay_plan(extent, wish.paper, None, steps)
    ground = _Ground(choose_view(result), overview)
    content = PlanContent(
        result=result,
        plan=plan,
        overview=overview,
        pictures=ground.picture,
        notes=ground.notes(),
        digest=hashlib.sha256(dump_results(result).encode()).hexdigest(),
    )
    made = plan_pages(content)
    replace_bytes(folder / PLAN_PDF, made.pdf)
    replace_bytes(folder / PLAN_PNG, made.png)
    corners, crs = transform_to_map(result, made.map_corners_m)
    tags = {"surface": "the adjusted ground plane: objects above it lean away from the photo"}
    write_turned_picture(made.map_rgba, corners, crs, tags, folder / PLAN_MAP)


class _Ground:
    """Pictures of the ground of all sheets, with equal brightness."""

    def __init__(self, view: View, overview: Plan) -> None:
        self._view = view
        raster = _raster(view, overview, overview.sheets[0])
        coarse = raster.coarser(max(max(raster.width, raster.height) // 512, 1))
        self._gains = estimate_exposure_gains(view, coarse, select_photos(view, coarse))
        picture = render_picture(view, coarse, select_photos(view, coarse, self._gains))
        bright = picture[picture[..., 3] > 0]
        self._tone = choose_tone(np.ascontiguousarray(bright[:, None, 2::-1]))
        self._photos: dict[int, PhotoCache] = {}

    def picture(self, plan: Plan, sheet: PlanSheet) -> SheetPicture:
        """Return the picture of one sheet."""
        raster = _raster(self._view, plan, sheet)
        if plan.scale not in self._photos:
            self._photos = {plan.scale: select_photos(self._view, raster, self._gains)}
        rgba = render_picture(self._view, raster, self._photos[plan.scale])
        rgb = np.ascontiguousarray(rgba[..., :3])
        return SheetPicture(np.dstack([apply_tone(rgb, self._tone), rgba[..., 3]]), raster)

    def notes(self) -> tuple[str, ...]:
        """Describe the changes to the photos."""
        note = "The photos' brightness is evened out, to be seen; their files stay as they are."
        return (note,)


def _raster(view: View, plan: Plan, sheet: PlanSheet) -> GroundRaster:
    """Return the ground raster of a sheet in local metres, no finer than the photos."""
    finest = float(np.nanmin(photo_pixels_m(view), initial=np.inf))
    pixel = plan.scale * 0.0254 / PICTURE_DPI
    pixel = max(pixel, finest) if math.isfinite(finest) else pixel
    return GroundRaster(
        west_m=sheet.west_m,
        north_m=sheet.north_m,
        pixel_m=pixel,
        width=math.ceil((sheet.east_m - sheet.west_m) / pixel),
        height=math.ceil((sheet.north_m - sheet.south_m) / pixel),
        crs=None,
    )


MAX_BYTES = 9_000_000
"""Largest size of all pictures together. As text in report.html they are a third larger: it stays
below 15 MB."""

_ORDER = {"overview": 0, "measurement": 1, "point": 2}


class ReportPictures:
    """Parts of photos for a report, cut out while the photos are read for another purpose."""

    def __init__(self, result: Result) -> None:
        """Choose the parts of each photo."""
        self._result, self._plan = result, picture_plan(result)
        files = photo_files(result.frames)
        self._wanted = {
            files[frame]: tuple(regions)
            for frame, regions in groupby(sorted(self._plan.regions, key=_frame), _frame)
        }
        self._made: dict[str, tuple[Picture, ...]] = {}
        self._one = Lock()
        self._room: Pixels | None = None

    def needs_photo(self, path: str) -> bool:
        """Return whether any part of a photo is shown."""
        return path in self._wanted

    def cut_parts(self, path: str) -> tuple[Preview, Pixels]:
        """Cut the parts out of a photo, which is decoded once for all.

        Only one photo that is decoded as a whole is in memory at a time, for any number of threads.

        Returns
        -------
        As `read_preview`.

        Raises
        ------
        InputError
            The file cannot be read, or is no photo.
        """
        with self._one:
            whole = read_pixels(path, room=self._room)
            preview, pixels, halves = make_preview_of_decoded(whole)
            self._made[path] = cut_parts(halves, preview.tone, self._wanted[path])
            self._room = None if pixels is whole else whole
        return preview, pixels

    def pictures(self) -> Pictures:
        """Return all parts, once their photos have been read."""
        self._room = None
        made = [picture for path in self._wanted for picture in self._made[path]]
        made.sort(key=lambda one: (_ORDER[one.region.subject], one.region.row))
        shown: list[Picture] = []
        left_out = list(self._plan.left_out)
        weight = 0
        for picture in made:
            weight += len(picture.jpeg)
            if weight <= MAX_BYTES:
                shown.append(picture)
            else:
                left_out.append(_name(self._result, picture.region))
        return Pictures(shown=tuple(shown), left_out=tuple(left_out))


def cut_out_ground(result: Result, texture: GroundTexture | None) -> GroundPicture | None:
    """Cut out the ground below the report's plans; None where photos show none of it."""
    corners = ground_extent(result)
    return None if texture is None or corners is None else cut_ground(texture, *corners)


def _frame(region: Region) -> int:
    return region.frame


def _name(result: Result, region: Region) -> str:
    rows = result.points.label if region.subject == "point" else result.measurements.name
    return rows[region.row]


MAX_RECORDED = 5_000
"""Largest number of photos in a recording: at some 0.3 MB each the viewer needs gigabytes to open
more."""


def select_recorded(count: int) -> range:
    """Return rows of the photos in a recording of so many: all, or a regular selection."""
    return range(0, count, max(1, -(-count // MAX_RECORDED)))


def note_thinning(result: Result) -> Result:
    """Add a note where the recording has only some of the photos."""
    count = len(result.frames.frame_id)
    rows = select_recorded(count)
    if len(rows) == count:
        return result
    text = (
        f"The recording carries {len(rows)} of the {count} photos, one in {rows.step}: with all of "
        "them it would be too large to open. Nothing else is left out of it."
    )
    return replace(result, messages=(*result.messages, Message("info", "recording-thinned", text)))


def write_outputs(
    result: Result,
    ties: TieCloud | None,
    folder: Path,
    journal: Journal,
    progress: Progress,
    pdf: Paper | None = None,
    plan: PlanPaper | None = None,
) -> None:
    """Write all outputs into a folder.

    Parameters
    ----------
    result, ties
        Result of a run, and tie points if there are any.
    folder
        Where the files go.
    journal
        Notes how long each of them takes, and becomes run.jsonl.
    progress
        Shows long loops.
    pdf, plan
        Paper of a report.pdf, and of plan.pdf and plan.png; None: there is none.

    Raises
    ------
    UavgramError
        A photo cannot be read, or a file cannot be written.
    """
    parts = ReportPictures(result)
    with journal.step("write recording.rrd"):
        texture = write_review(result, folder / "recording.rrd", progress, ties, parts)
    with journal.step("put the report's pictures together"):
        pictures = replace(parts.pictures(), ground=cut_out_ground(result, texture))
    writers: dict[str, Callable[[Path], None]] = {
        **make_writers(result, texture),
        "report.html": lambda path: write_report(result, path, pictures),
        "results.json": lambda path: write_results(result, path),
    }
    if pdf is not None:
        writers["report.pdf"] = lambda path: write_pdf(result, path, pdf)
    if plan is not None:
        from uavgram.pipeline.measure.outputs import write_plan  # noqa: PLC0415 - loads matplotlib

        writers[PLAN_PDF] = lambda path: write_plan(result, plan, path.parent)
    for name, write in progress(writers.items(), "writing", len(writers)):
        with journal.step(f"write {name}"):
            (folder / name).parent.mkdir(exist_ok=True)
            write(folder / name)
    journal.write(folder / "run.jsonl")


NOT_ALWAYS = (
    *("report.pdf", "report-annex.pdf", PLAN_PDF, "plan.png", "plan.tif"),
    *("profiles.csv", "survey_map.dxf", GROUND),
)
"""Files that only some runs write, by their options or their data."""


def list_earlier(folder: Path, written: Path) -> list[str]:
    """List the files of an earlier run that a new one does not replace.

    Parameters
    ----------
    folder
        The output folder, before the new files are moved there.
    written
        Folder of the new files.
    """
    if not (folder / LAST_MOVED).is_file():
        return []
    there = (name for name in NOT_ALWAYS if (folder / name).is_file())
    return [name for name in there if not (written / name).exists()]


def write_pdf(result: Result, path: Path, paper: Paper) -> None:
    """Write report and annex as PDF, from their pages and results.json beside them.

    Parameters
    ----------
    result
        Result of a run.
    path
        The report to write; the annex is beside it, as by `annex_of`.
    paper
        Their size.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    results = path.with_name("results.json").read_text(encoding="utf-8")
    made = result.provenance.created_utc
    for file, attach in ((path, True), (annex_of(path), False)):
        html = file.with_suffix(".html").read_text(encoding="utf-8")
        replace_bytes(file, report_pdf(html, results, paper, result.name, made, attach=attach))


def write_review(
    result: Result,
    path: Path,
    progress: Progress = silent,
    ties: TieCloud | None = None,
    parts: ReportPictures | None = None,
) -> GroundTexture | None:
    """Write the recording of a result, with its photos and the ground in them.

    With very many photos it contains a selection (see `select_recorded`), while all show the
    ground. They are processed one by one: the used memory does not grow with their number.

    Parameters
    ----------
    result
        Result of a run.
    path
        The recording to write.
    progress
        Shows long loops.
    ties
        Tie points, where there are any.
    parts
        Parts of the photos for the report.

    Returns
    -------
    GroundTexture
        The ground; None where photos show none of it.

    Raises
    ------
    InputError
        A photo cannot be read.
    OutputError
        The file cannot be written.
    """
    names = result.frames.frame_id
    shown_photos = {names[row] for row in select_recorded(len(names))}
    mosaic = Mosaic(result, names, jpeg_preview_scale(result.camera.width_px))

    def reduced_photo(path: str) -> tuple[Preview, Pixels]:
        return parts.cut_parts(path) if parts and parts.needs_photo(path) else read_preview(path)

    def photos() -> Iterator[tuple[str, Preview]]:
        reduced = prefetch(reduced_photo, photo_files(result.frames))
        shown = progress(zip(names, reduced, strict=True), "photos", len(names))
        for name, (_, (preview, pixels)) in shown:
            mosaic.add(name, pixels)
            if name in shown_photos:
                yield name, preview

    shown: list[GroundTexture | None] = []

    def texture() -> GroundTexture | None:
        shown.append(mosaic.texture())
        return shown[-1]

    write_recording(result, photos(), texture, path, ties)
    return shown[-1] if shown else None
