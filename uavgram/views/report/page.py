"""Report and its annex as pages and PDF: their sections, and the basis of the result."""

from __future__ import annotations

import hashlib
import os
import re
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from uavgram.estimation.measuring.error_budget import SOURCES
from uavgram.estimation.reliability.redundancy import (
    TEST_POWER,
    compute_critical_value,
    compute_noncentrality,
)
from uavgram.geometry.ground.figures import ELLIPSE_95
from uavgram.model.arrays import Floats
from uavgram.model.maps import Paper
from uavgram.model.naming import format_count, format_digits
from uavgram.model.result.result import NO_PICTURES, POSE_NAMES, Pictures, Result
from uavgram.views import formatting
from uavgram.views.pages import PAPER_SIZES, make_unit_variables, page, page_pdf, weasyprint_for
from uavgram.views.report import measurements
from uavgram.views.report.first_page import MAX_REASONS, Brief, lay_out_brief, report_plan
from uavgram.views.report.pictures import embed_pictures, gallery
from uavgram.views.result_tables import Source, result_table, select_most_doubtful, select_rows
from uavgram.views.style import INK
from uavgram.views.survey.fit import checks_summary, fit_tables
from uavgram.views.survey.heights import collect_departures, profile_drawings
from uavgram.views.survey.key_facts import (
    ONLY_PROGRAM,
    format_frame_ties,
    frame_origins,
    has_automatic_picks,
    key_facts,
    picks_text,
    ties_text,
)
from uavgram.views.survey.outlines import flight_order, largest_sigmas
from uavgram.views.survey.reliability import (
    overall_words,
    prior_table,
    removal_rows,
    significance_of,
    weakest_table,
)
from uavgram.views.survey.top_view import count_unnamed, key_plan, top_view
from uavgram.views.survey.verdict import verdict_words
from uavgram.views.tables import Cell, Row, Table, make_table
from uavgram.views.units import units_of

MAX_POSES, MAX_MATRICES = 120, 16
"""Largest numbers of printed poses and of their matrices; results.json has them all."""

TO_PHOTO_AXES = np.diag([1.0, -1.0, -1.0])
"""Rotation from right, down, forward to photogrammetry's right, up, back."""


SHORT = {
    "plane height": "plane",
    "slope east": "slope E",
    "slope north": "slope N",
    "readout time": "readout",
}
"""Column heads of parameters whose name is long."""


class Matrix(NamedTuple):
    """Correlations: a title, names of the parameters, and rows of correlations with them."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[str, ...]], ...]

    @property
    def heads(self) -> tuple[str, ...]:
        """Short names of the columns."""
        return tuple(SHORT.get(name, name) for name in self.columns)


class Annex(NamedTuple):
    """Content of the annex.

    Attributes
    ----------
    poses, poses_more
        Adjusted photos, and the number of those not shown.
    pairs, correlations
        Names of the columns of correlations within a pose, and these by photo.
    shared, matrices, matrices_more
        Correlations among the shared parameters; of each pose with them; number not shown.
    residuals, residuals_more
        Residuals by photo, the largest ones of many; number not shown.
    """

    poses: Table
    poses_more: int
    pairs: tuple[str, ...]
    correlations: tuple[tuple[str, tuple[str, ...]], ...]
    shared: Matrix | None
    matrices: tuple[Matrix, ...]
    matrices_more: int
    residuals: Table
    residuals_more: int


def lay_out_annex(result: Result) -> Annex:
    """Lay out the annex, photos in the order of flight."""
    order = [int(f) for f in flight_order(result) if result.has_refined[f]]
    shared, matrices, more = _matrices(result, order)
    rows = _rows_by_photo(result)
    size = np.linalg.norm(result.picks.residual_px, axis=1)
    largest = np.array([size[rows[frame]].max(initial=-1.0) for frame in order])
    shown = [order[k] for k in select_most_doubtful(largest)]
    short = ("E", "N", "U", "x", "y", "z")
    upper = zip(*np.triu_indices(6, 1), strict=True)
    return Annex(
        poses=_list_poses(result, order[:MAX_POSES]),
        poses_more=len(order[MAX_POSES:]),
        pairs=tuple(f"{short[i]}{short[j]}" for i, j in upper),
        correlations=tuple(_correlate(result, frame) for frame in order[:MAX_POSES]),
        shared=shared,
        matrices=matrices,
        matrices_more=more,
        residuals=make_table(
            "photo | >picks used | >rms right [px] | >rms down [px] | >largest [px] | of point",
            (_residuals(result, frame, rows[frame]) for frame in shown),
        ),
        residuals_more=len(order) - len(shown),
    )


def omega_phi_kappa_deg(world_from_camera: Floats) -> Floats:
    """Compute the (3,) angles that turn photo axes (right, up, back) into east, north, up.

    R = Rx(omega) Ry(phi) Rz(kappa): Luhmann et al., Close-Range Photogrammetry, 2.2.2.

    Parameters
    ----------
    world_from_camera
        (3, 3) of axes right, down, forward.
    """
    turn = world_from_camera @ TO_PHOTO_AXES
    # R[0,2] = sin(phi); R[1,2] / R[2,2] = -tan(omega); R[0,1] / R[0,0] = -tan(kappa)
    omega = np.arctan2(-turn[1, 2], turn[2, 2])
    phi = np.arcsin(np.clip(turn[0, 2], -1.0, 1.0))
    kappa = np.arctan2(-turn[0, 1], turn[0, 0])
    return np.asarray(np.degrees([omega, phi, kappa]), dtype=np.float64)


def _list_poses(result: Result, order: list[int]) -> Table:
    """Return centre, rotation and sigmas of photos; the sigmas of rotation are about their axes."""
    source, poses, rows = Source(result), result.frames.refined, []
    for frame in order:
        sigma = np.sqrt(np.diagonal(poses.covariance[frame]))
        angles_deg = omega_phi_kappa_deg(poses.world_from_camera[frame])
        rows.append(
            (
                result.frames.frame_id[frame],
                *map(source.length_with_sigma, poses.center_world_m[frame], sigma[:3]),
                *map(formatting.number, (*angles_deg, *np.degrees(sigma[3:]))),
            )
        )
    return make_table(
        "photo | >east [m] | >north [m] | >up [m] | >omega [°] | >phi [°] | >kappa [°] | "
        ">sigma x [°] | >sigma y [°] | >sigma z [°]",
        rows,
        source.units,
    )


def _correlate(result: Result, frame: int) -> tuple[str, tuple[str, ...]]:
    """Return the name of a photo, and the correlations within its pose."""
    covariance = result.frames.refined.covariance[frame]
    sigma = np.sqrt(np.diagonal(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance / np.outer(sigma, sigma)
    return result.frames.frame_id[frame], _numbers(correlation[np.triu_indices(6, 1)])


def _numbers(values: Floats) -> tuple[str, ...]:
    return tuple(formatting.number(float(value), 2) for value in values)


def _matrices(result: Result, order: list[int]) -> tuple[Matrix | None, tuple[Matrix, ...], int]:
    """Return the shared parameters' matrix, those of photos with it, and the number left out."""
    known = result.orientation
    if known is None:
        return None, (), 0
    names = known.parameters
    shared = Matrix(
        "",
        names,
        tuple((name, _numbers(row)) for name, row in zip(names, known.shared, strict=True)),
    )
    at = {name: k for k, name in enumerate(known.frame_id)}
    every = [name for frame in order if (name := result.frames.frame_id[frame]) in at]
    titles = every[:MAX_MATRICES]
    matrices = tuple(
        Matrix(
            title,
            names,
            tuple(
                (name, _numbers(row))
                for name, row in zip(POSE_NAMES, known.with_pose[at[title]], strict=True)
            ),
        )
        for title in titles
    )
    return shared, matrices, len(every) - len(titles)


def _rows_by_photo(result: Result) -> list[list[int]]:
    """Return the rows of the used picks of each photo."""
    at = {name: k for k, name in enumerate(result.frames.frame_id)}
    rows: list[list[int]] = [[] for _ in at]
    for i, (image, status) in enumerate(zip(result.picks.image, result.picks.status, strict=True)):
        if status in ("used", "suspect"):
            rows[at[image]].append(i)
    return rows


def _residuals(result: Result, frame: int, rows: list[int]) -> tuple[str, ...]:
    picks, name = result.picks, result.frames.frame_id[frame]
    if not rows:
        return (name, "0", "–", "–", "–", "–")
    residual = picks.residual_px[rows]
    rms = np.sqrt(np.mean(residual**2, axis=0))
    size = np.linalg.norm(residual, axis=1)
    worst = int(np.argmax(size))
    sizes = (formatting.number(float(one), 2) for one in (*rms, size[worst]))
    return (name, str(len(rows)), *sizes, picks.label[rows[worst]])


MAX_FILES = 40
"""Number of files whose checksums are in the report; the annex has all."""


def list_foundations(result: Result) -> tuple[tuple[str, str], ...]:
    """List photos, camera, lengths, flight log, points, place and largest uncertainty.

    Returns
    -------
    Pairs of question and answer; missing items are omitted, or stated to be missing.
    """
    camera, options = result.camera, dict(result.provenance.options)
    log = options.get("log") or options.get("poses")
    sources = ", ".join(log) if isinstance(log, tuple) else str(log or "")
    facts = (
        ("Photos", _photos(result)),
        ("Camera", f"{camera.name}, {camera.width_px} x {camera.height_px} px"),
        ("Known lengths", _lengths(result)),
        ("Flight log", sources if result.has_seed.any() else "none"),
        ("Points", picks_text(result) or "all picked by people"),
        ("Place", formatting.describe_origin(result)),
        ("Largest uncertainty", _largest_source(result)),
    )
    return tuple((question, answer) for question, answer in facts if answer)


def select_files(result: Result) -> Table:
    """Return the files whose checksums the report has: photos after all others."""
    photos = {Path(path).name for path in result.frames.path}
    files = sorted(result.provenance.inputs, key=lambda one: Path(one.path).name in photos)
    rows = [(one.path, Cell(one.sha256, look="mono")) for one in files[:MAX_FILES]]
    return make_table("file | SHA-256", rows)


def _list_custody(result: Result, rows: Sequence[int]) -> Table:
    """Return the inputs with their checksums."""
    inputs = [result.provenance.inputs[k] for k in rows]
    cells = ((one.path, str(one.size_bytes), Cell(one.sha256, look="mono")) for one in inputs)
    return make_table("input | >bytes | SHA-256", cells)


def _list_messages(result: Result) -> Table:
    """Return the messages, problems first."""
    words = {"error": "problem", "warning": "warning", "info": "note"}
    rows = [
        Row((Cell(words[one.level], look="tag"), one.text, Cell(one.code, look="mono code")),
            one.level == "error")
        for one in sorted(result.messages, key=lambda one: formatting.LEVEL_RANK[one.level])
    ]  # fmt: skip
    return make_table(" |  | ", rows)


def _list_photos(result: Result, rows: Sequence[int]) -> Table:
    """Return the photos with their times and places, and how well these are known."""
    frames, source, ties = result.frames, Source(result), ties_text(result)
    position_m, attitude_deg = largest_sigmas(frames.refined)
    count, made, tied = (
        Counter(result.picks.image),
        frame_origins(result),
        format_frame_ties(result),
    )
    cells = (
        Row(
            (
                (name := frames.frame_id[i]),
                formatting.utc(frames.time_utc_s[i]),
                ": ".join(
                    filter(
                        None, (formatting.FRAME_STATUS_WORDS[frames.status[i]], frames.reason[i])
                    )
                ),
                Cell(str(count[name]), below=made[i]),
                *([tied[i]] if ties else []),
                source.length(frames.refined.center_world_m[i, 2], 2),
                source.length(position_m[i], 2),
                formatting.number(attitude_deg[i], 2),
            ),
            frames.status[i] in ("rejected", "unmatched"),
        )
        for i in rows
    )
    return make_table(
        f"photo | exposure (UTC) | status | >picks{' | >tie points (rms)' if ties else ''} | "
        ">height [m] | >position sigma [m] | >attitude sigma [°]",
        cells,
        source.units,
    )


def _photos(result: Result) -> str:
    used = sum(status == "refined" for status in result.frames.status)
    return f"{used} of {format_count(len(result.frames.status), 'photo')} used"


def _lengths(result: Result) -> str:
    status = result.lines.status
    if not status:
        return "none"
    used = sum(one in ("used", "suspect") for one in status)
    withheld = sum(one == "checked" for one in status)
    checks = f", {withheld} withheld as a check" if withheld else ""
    return f"{used} of {format_count(len(status), 'length')} used{checks}"


def _largest_source(result: Result) -> str:
    """Name the source that is most often the largest in the error budget, and its remedy."""
    budget = result.error_budget
    if budget is None or not np.isfinite(budget.share).any():
        return ""
    known = budget.share[np.isfinite(budget.share).all(axis=1)]
    largest = np.bincount(np.argmax(known, axis=1), minlength=len(budget.source))
    row = int(np.argmax(largest))
    source = SOURCES[budget.source[row]]
    how_often = f"the largest in {largest[row]} of {format_count(len(known), 'value')}"
    return f"{source.words}: {how_often}. {source.advice}"


def method_facts(result: Result) -> dict[str, str | bool]:
    """Return the values for the section on the method, by their names in the template.

    The lens is ``brown``, ``rational`` or ``fisheye``; a log may be photo poses; the ellipse is in
    sigmas; the rest belongs to the tests of single observations.
    """
    camera, significance = result.camera, significance_of(result)
    rational = camera.model == "brown" and len(camera.parameters) > 9
    return {
        "lens": "rational" if rational else camera.model,
        "has_log": bool(result.has_seed.any()),
        "has_heights": bool(result.points.is_off_ground.any()),
        "has_skid": "skid_speed" in result.measurements.kind,
        "has_volume": "volume" in result.measurements.kind,
        "ellipse": formatting.number(ELLIPSE_95, 4),
        "significance": f"{format_digits(significance, 6)}",
        "critical": formatting.number(compute_critical_value(significance), 2),
        "noncentrality": formatting.number(compute_noncentrality(significance), 2),
        "power": f"{100 * TEST_POWER:.0f} %",
    }


PLACE = "<!-- contents -->"
_HEADING = re.compile(r'<section id="([\w-]+)">\s*<h2>(.*?)</h2>', re.DOTALL)


def insert_contents(html: str) -> str:
    """Insert the list of sections at its place in the page; the PDF adds page numbers."""
    rows = [f'<li><a href="#{name}">{words}</a></li>' for name, words in _HEADING.findall(html)]
    listed = "\n".join(rows)
    title = '<p class="title"><b>Contents</b></p>'
    nav = f'<nav class="contents">\n{title}\n<ol>\n{listed}\n</ol>\n</nav>'
    return html.replace(PLACE, nav, 1)


BESIDE_HEIGHT = 480.0
"""Height of the top view, below which the key plan fits."""

REPORT, ANNEX = "report.html", "report_annex.html"
"""Templates."""

MAX_LENGTHS, MAX_WARNINGS = 12, 12
"""Numbers of known lengths, worst fit first, and of warnings in the report; the annex has all."""


def write_report(
    result: Result, path: str | os.PathLike[str], pictures: Pictures = NO_PICTURES
) -> None:
    """Write the report and its annex, into a folder whose files appear once all are complete.

    Parameters
    ----------
    result
        Result of a run.
    path
        The file to write; the annex is beside it, see `annex_of`.
    pictures
        Parts of its photos.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    target = Path(path)
    facts = _facts(result, pictures, target)
    for template, file in ((REPORT, target), (ANNEX, annex_of(target))):
        with file.open("wb") as stream:
            stream.writelines(embed_pictures(_page(template, facts), pictures))


def annex_of(report: Path) -> Path:
    """Name the annex of a report: ``report.html`` has ``report-annex.html``."""
    return report.with_stem(f"{report.stem}-annex")


def render_report(result: Result, pictures: Pictures = NO_PICTURES) -> str:
    """Return the report as text; names written by people are escaped, nothing is loaded."""
    return _render(REPORT, result, pictures)


def render_annex(result: Result, pictures: Pictures = NO_PICTURES) -> str:
    """Return the annex of the report as text, as `render_report` does."""
    return _render(ANNEX, result, pictures)


def _render(template: str, result: Result, pictures: Pictures) -> str:
    page = _page(template, _facts(result, pictures, Path("report.html")))
    return b"".join(embed_pictures(page, pictures)).decode()


def _page(template: str, facts: dict[str, Any]) -> str:
    """Fill in a template, with marks for its pictures."""
    return insert_contents(page(template, **facts))


def _facts(result: Result, pictures: Pictures, report: Path) -> dict[str, Any]:
    """Compute the variables of both templates."""
    first, chosen, links = lay_out_brief(result), select_rows(result), weakest_table(result)
    fits = formatting.order_worst_fit_first(result.lines.w)
    unwithheld = [int(i) for i in fits if result.lines.status[i] != "checked"]
    return dict(
        result=result,
        options=list_options(result),
        verdict=verdict_words(result),
        annex=lay_out_annex(result),
        brief=first,
        facts=key_facts(result),
        warnings=_warnings(result),
        messages=_list_messages(result),
        report_file=report.name,
        annex_file=annex_of(report).name,
        foundations=list_foundations(result),
        files_shown=select_files(result),
        used_lengths=unwithheld,
        most_lengths=MAX_LENGTHS,
        most_warnings=MAX_WARNINGS,
        measured=formatting.order_shapes_first(result.measurements),
        not_unique=formatting.NOT_UNIQUE if result.measurements.is_ambiguous.any() else "",
        relief=measurements.relief_notes(result),
        relief_step=formatting.relief_text(units_of(result)),
        table=partial(result_table, result=result),
        learnt=measurements.describe_learnt_noise(result),
        uneven=collect_departures(result),
        sampled=measurements.describe_sampling(result),
        second_order=measurements.second_order_note(result),
        alternatives=measurements.alternative_tables(result),
        profiles=profile_drawings(result),
        gallery=gallery(result, pictures),
        **_plans(result, pictures, first),
        ink=INK,
        place=formatting.describe_origin(result),
        why_to_neighbours=formatting.WHY_TO_NEIGHBOURS,
        why_two_ellipses=formatting.WHY_TWO_ELLIPSES,
        budget=measurements.budget_table(result),
        unwithheld=unwithheld,
        **fit_tables(result),
        removals=removal_rows(result),
        checks=checks_summary(result),
        checks_together=overall_words(result),
        weakest=links._replace(rows=links.rows[: measurements.MAX_ROWS]),
        links_more=len(links.rows) - measurements.MAX_ROWS,
        most_rows=measurements.MAX_ROWS,
        priors=prior_table(result),
        photos=_list_photos(result, chosen["photos_told"]),
        custody=_list_custody(result, chosen["files_told"]),
        method=method_facts(result),
        made=f"{datetime.fromisoformat(result.provenance.created_utc):%Y-%m-%d %H:%M} UTC",
        found_any=has_automatic_picks(result),
        only_program=ONLY_PROGRAM,
        ties=ties_text(result),
        picks_made=picks_text(result),
        **chosen,
        **make_unit_variables(result),
    )


def _warnings(result: Result) -> tuple[str, ...]:
    """Return the errors and warnings that the first page does not state."""
    stated = tuple(reason.text for reason in result.verdict.reasons[: 1 + MAX_REASONS])
    return tuple(
        message.text
        for message in result.messages
        if message.level != "info" and not message.text.startswith(stated)
    )


def _plans(result: Result, pictures: Pictures, first: Brief) -> dict[str, object]:
    """Draw the views from above: both plans, and the key plan of the photos."""
    return {
        "plan_view": report_plan(result, first, pictures),
        "plan_unnamed": count_unnamed(result),
        "view": top_view(result, BESIDE_HEIGHT),
        "has_ground": pictures.ground is not None,
        "brightened": pictures.ground is not None and pictures.ground.brightened,
        "key": key_plan(result),
        "units_word": "metres" if units_of(result).length == "m" else "feet",
        "grid_words": "east (E) and north (N) of the origin"
        if result.world.gauge == "world"
        else "from the origin to the right (x) and up (y); no direction of the compass is known",
    }


def list_options(result: Result) -> Table:
    """Return names and texts of the options that have a value, two beside each other."""
    every = result.provenance.options
    stated = [
        (key, option_text(value)) for key, value in every if value is not None and value != ""
    ]
    halves = zip_longest(stated[::2], stated[1::2], fillvalue=("", ""))
    return make_table(" |  |  | ", ((*one, *other) for one, other in halves))


def option_text(value: object) -> str:
    """Format an option as it was understood."""
    if value is None or value == "":
        return "–"
    if isinstance(value, tuple | list):
        return ", ".join(map(option_text, value))
    return str(value)


_NAME = "report"

_BESIDE = re.compile(r'href="([^":#]+)\.html"')
"""Link to the page beside this one, which on paper becomes a link to its PDF."""

HEIGHTS_MM: dict[Paper, float] = {"a4": 297.0, "letter": 279.4}
MARGINS_MM = (16.0, 20.0)
"""Heights of the papers, and their margins above and below the text."""

_SHEET = """
@page {{
  size: {size} !important; margin: {margins[0]}mm 14mm {margins[1]}mm !important;
  @bottom-left {{
    content: "{name} \\B7  results.json SHA-256 {digest}";
    font: 6.5pt sans-serif; color: #5b6470; width: 85%;
  }}
  @bottom-right {{
    content: "page " counter(page) " of " counter(pages);
    font: 6.5pt sans-serif; color: #5b6470; width: 15%;
  }}
}}
.contents a::after {{ content: leader(".") target-counter(attr(href), page); }}
.brief {{ min-height: {text_mm}mm; }}
"""
"""The plan takes what the text of the first page leaves of it: see report.css."""


def check_pdf() -> None:
    """Check that a PDF can be made here, before anything is computed.

    Raises
    ------
    UavgramError
        If WeasyPrint, or a library of the system that it needs, is missing.
    """
    weasyprint_for(_NAME)


def report_pdf(
    html: str, results: str, paper: Paper, name: str, made_utc: str, *, attach: bool = True
) -> bytes:
    """Lay out the report, or its annex, as a PDF/A-3b file.

    Fonts are embedded, colours are sRGB. Equal input gives equal bytes.

    Parameters
    ----------
    html
        The page of the report or of the annex.
    results
        The text of ``results.json``; its SHA-256 is at the foot of every page.
    paper
        Size of the paper.
    name
        Name of the project.
    made_utc
        Time of the computation, from the result.
    attach
        Whether ``results.json`` is attached.

    Raises
    ------
    UavgramError
        If WeasyPrint, or a library of the system that it needs, is missing.
    """
    digest = hashlib.sha256(results.encode()).hexdigest()
    made = datetime.fromisoformat(made_utc)
    attached = weasyprint_for(_NAME).Attachment(
        string=results,
        name="results.json",
        description="All results of the report, as numbers",
        created=made,
        modified=made,
        relationship="Data",
    )
    shown = name.translate({ord(c): " " for c in '"\\\n'})
    sheet = _SHEET.format(
        size=PAPER_SIZES[paper],
        digest=digest,
        name=shown,
        margins=MARGINS_MM,
        text_mm=HEIGHTS_MM[paper] - sum(MARGINS_MM),
    )
    return page_pdf(
        _BESIDE.sub(r'href="\1.pdf"', html),
        sheet,
        _NAME,
        attachments=[attached] if attach else [],
        pdf_variant="pdf/a-3b",
        pdf_identifier=bytes.fromhex(digest)[:16],
        finisher=_finish,
    )


def _finish(_: object, pdf: Any) -> None:  # noqa: ANN401
    """Restore two rules of the archive format that WeasyPrint breaks.

    ISO 19005-3, 6.2.8: no image may ask to be interpolated; 6.8: each attachment is listed once.
    """
    for one in pdf.objects:
        image = getattr(one, "extra", {})
        if "Interpolate" in image:
            image["Interpolate"] = "false"
    if "AF" in pdf.catalog:
        pdf.catalog["AF"][:] = dict.fromkeys(pdf.catalog["AF"])
