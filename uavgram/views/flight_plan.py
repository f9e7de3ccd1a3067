"""A planned flight in words: tables of lines and plates to lay out, and sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.naming import METRIC, Units, format_count, join_names
from uavgram.model.planned import FlightPlanned
from uavgram.views.formatting import KIND_WORDS
from uavgram.views.tables import Cell, Cells, Table, make_table
from uavgram.views.units import format_sigma, format_value


def metres(length_m: float) -> str:
    """Format a length in metres: ``14.2 m``; ``40 m``."""
    return f"{round(length_m, 1):g} m" if length_m < 100 else f"{length_m:.0f} m"


def centimetres(*several_m: float) -> str:
    """Format lengths: ``1.2 to 1.4 cm``; from a metre on ``1.3 m``; an en dash if not finite."""
    if not all(map(math.isfinite, several_m)):
        return "–"
    is_large = max(several_m) >= 1.0
    scale, unit = (1.0, "m") if is_large else (100.0, "cm")
    return " to ".join(f"{scale * one:.1f}" for one in several_m) + f" {unit}"


ROUGHLY = 10.0
"""Rounding of a wanted value, in its standard deviations: it is only approximate."""

ON_THE_SIDE_M = 0.05


@dataclass(frozen=True)
class LineRow:
    """Line to lay out.

    Attributes
    ----------
    name, length, start, end
        As on the drawing.
    start_place, end_place
        How to get there from a corner of the area.
    photos
        Number of photos that show both ends.
    mistake
        The smallest wrong reading that is detected; empty if none is.
    without
        The accuracy if this line is lost; empty if the loss hardly matters.
    is_needed
        Whether the survey has no scale without it.
    """

    name: str
    length: str
    start: str
    end: str
    start_place: str
    end_place: str
    photos: int
    mistake: str
    without: str
    is_needed: bool


@dataclass(frozen=True)
class PlateRow:
    """Plate to lay out: name, way to its middle, number of photos, and as in `LineRow`."""

    name: str
    place: str
    photos: int
    without: str
    is_needed: bool


def line_rows(planned: FlightPlanned) -> tuple[LineRow, ...]:
    """Return the rows of all lines in their order."""
    lines, area = planned.lines, planned.area_world_m
    rows = []
    for k, name in enumerate(lines.name):
        mistake, without = float(lines.mdb_m[k]), float(lines.mean_sigma_without[k])
        is_worse = without > WORTH_SAYING * planned.mean_sigma
        rows.append(
            LineRow(
                name=name,
                length=metres(float(lines.length_m[k])),
                start=lines.start_label[k],
                end=lines.end_label[k],
                start_place=place_in_area(area, lines.start_world_m[k]),
                end_place=place_in_area(area, lines.end_world_m[k]),
                photos=round(float(lines.frames_seen[k])),
                mistake=centimetres(mistake) if math.isfinite(mistake) else "",
                without=centimetres(without) if is_worse else "",
                is_needed=math.isnan(without),
            )
        )
    return tuple(rows)


def plate_rows(planned: FlightPlanned) -> tuple[PlateRow, ...]:
    """Return the rows of all plates in their order."""
    plates = planned.plates
    worse = WORTH_SAYING * planned.mean_sigma
    return tuple(
        PlateRow(
            name=name,
            place=place_in_area(planned.area_world_m, middle),
            photos=round(photos),
            without=centimetres(without) if without > worse else "",
            is_needed=math.isnan(without),
        )
        for name, middle, photos, without in zip(
            plates.name,
            plates.center_world_m,
            plates.frames_seen.tolist(),
            plates.mean_sigma_without.tolist(),
            strict=True,
        )
    )


def value_table(planned: FlightPlanned, units: Units = METRIC) -> Table:
    """Return the table of all wanted values, in the units of the project."""
    rows, made = planned.measurements, []
    for k, unit in enumerate(rows.unit):
        sigma, wanted = float(rows.sigma[k]), float(rows.wanted_sigma[k])
        is_asked = math.isfinite(wanted)
        made.append(
            (
                Cell(rows.name[k], look="tag"),
                KIND_WORDS.get(rows.kind[k], rows.kind[k]),
                format_value(float(rows.value[k]), ROUGHLY * sigma, unit, units),
                f"± {_spread(sigma, unit, units)}",
                f"± {_spread(wanted, unit, units)}" if is_asked else "–",
                Cell("yes" if sigma <= wanted else "NO", look="tag") if is_asked else "–",
            )
        )
    titles = "value | kind | >about | *will be known to | >wished | good enough?"
    return make_table(titles, made)


def lay_table(planned: FlightPlanned, read: str = "", *, are_ways_shown: bool = True) -> Table:
    """Return the table of the lines, or else of the plates, to lay out.

    Parameters
    ----------
    planned
        The plan.
    read
        Title of a column for handwriting; empty: without it.
    are_ways_shown
        Whether the ways to the ends of each line are shown.
    """
    write = [Cell("", look="write")] if read else []
    more = f" | {read}" if read else ""
    if plates := plate_rows(planned):
        cells: list[Cells] = [
            (Cell(row.name, look="tag"), row.place, str(row.photos), _loss(row), *write)
            for row in plates
        ]
        return make_table(f"plate | its middle | >photos | if it is lost{more}", cells)
    rows: list[Cells] = [
        (
            Cell(row.name, look="tag"),
            Cell(row.length, look="value"),
            *((f"{row.start}: {row.start_place}", f"{row.end}: {row.end_place}") * are_ways_shown),
            str(row.photos),
            row.mistake or "never: tape it twice",
            _loss(row),
            *write,
        )
        for row in line_rows(planned)
    ]
    ways = " | from | to" * are_ways_shown
    titles = f"line | >about{ways} | >photos | mistake noticed from | if it is lost{more}"
    return make_table(titles, rows)


def _loss(row: LineRow | PlateRow) -> Cell:
    """Return the consequence of the loss of a line or a plate."""
    if row.is_needed:
        return Cell("do not fly", look="tag")
    return Cell(f"± {row.without}" if row.without else "little changes")


def _spread(sigma: float, unit: str, units: Units) -> str:
    return centimetres(sigma) if unit == "m" else format_sigma(sigma, unit, units)


def place_in_area(area_m: Floats, place_m: Floats) -> str:
    """Describe a place in an area: ``1.7 m from corner 1 towards corner 2, then 1.2 m inwards``.

    It follows the nearest side, from the nearer of its corners.

    Parameters
    ----------
    area_m
        (V, 3) corners, counterclockwise from above.
    place_m
        (3,) the place.
    """
    start, side = area_m[:, :2], (np.roll(area_m, -1, axis=0) - area_m)[:, :2]
    length = np.linalg.norm(side, axis=1)
    along_side = side / length[:, None]
    away = place_m[:2] - start
    # coordinates of the place along each side, and at a right angle to it
    along = np.einsum("vi,vi->v", away, along_side)
    inwards = along_side[:, 0] * away[:, 1] - along_side[:, 1] * away[:, 0]
    beyond = np.maximum(np.maximum(-along, along - length), 0.0)
    # nearest side: distance to the segment, beyond its ends to the corner
    k = int(np.argmin(np.hypot(inwards, beyond)))
    ends = (k + 1, (k + 1) % len(area_m) + 1)
    on_way = float(along[k])
    if on_way > length[k] / 2:
        ends, on_way = ends[::-1], float(length[k]) - on_way
    # beyond the end of the side, the way leads back from the corner
    towards = "towards" if on_way >= 0 else "away from"
    told = f"{metres(abs(on_way))} from corner {ends[0]} {towards} corner {ends[1]}"
    aside = float(inwards[k])
    if abs(aside) < ON_THE_SIDE_M:
        return told
    return f"{told}, then {metres(abs(aside))} {'inwards' if aside > 0 else 'outwards'}"


LOW_CHECK = 0.1
"""Redundancy of a reading below which a mistake is practically unchecked (Baarda 1968)."""

WORTH_SAYING = 1.1
"""Ratio of sigmas below which a loss of accuracy is not mentioned."""

SAME_DEG, SAME_M = 0.5, 0.5
"""Differences below which several values are one number for a pilot."""

LOGS = {
    "none": "no flight log",
    "consumer": "the log of an ordinary drone",
    "rtk": "the log of a drone with RTK",
    "ppk": "the log of a drone with PPK",
}


def summarise_work(planned: FlightPlanned) -> str:
    """State the work in one sentence."""
    lines, photos = len(planned.lines.name), len(planned.frames.name)
    lay = f"Lay and tape {format_count(lines, 'line')}, then take" if lines else "Take"
    if planned.plates.name:
        plates = format_count(len(planned.plates.name), "plate")
        lay = f"Lay {plates} of {plate_side(planned)}, then take"
    height = metres(planned.flight.height_m)
    return f"{lay} {format_count(photos, 'photo')} from {height} above the ground."


def plate_side(planned: FlightPlanned) -> str:
    """Format the side of the plates, as exactly as it is stated."""
    return f"{100 * planned.plates.side_m:g} cm"


def describe_accuracy(planned: FlightPlanned) -> tuple[str, ...]:
    """Describe the accuracy to expect."""
    wanted = planned.measurements
    told = []
    asked = np.isfinite(wanted.wanted_sigma)
    missed = asked & (wanted.sigma > wanted.wanted_sigma)
    if missed.any():
        names = [name for name, misses in zip(wanted.name, missed, strict=True) if misses]
        told.append(f"Not as good as you wish, even if all goes well: {join_names(names, None)}.")
    elif asked.any():
        told.append("Everything will be as good as you wish, if all goes as planned.")
    sigma = planned.grid.sigma_m[np.isfinite(planned.grid.sigma_m)]
    if len(sigma):
        reach = centimetres(float(sigma.min()), float(sigma.max()))
        told.append(
            f"A length of {metres(planned.grid.length_m)} within the area will be known to "
            f"± {reach}: two of three errors are smaller, and nearly all are below twice that."
        )
    return tuple(told)


def flight_facts(planned: FlightPlanned) -> tuple[tuple[str, str], ...]:
    """List the settings for the pilot, as pairs of name and value."""
    flight, frames = planned.flight, planned.frames
    heights, pitch, heading = (
        frames.height_above_ground_m,
        frames.gimbal_pitch_deg,
        frames.heading_deg,
    )
    turned = (heading - heading[0] + 180.0) % 360.0 - 180.0  # 359.9° and 0.1° are one direction
    is_one_way = float(np.ptp(turned)) < SAME_DEG
    nose = round(float(heading[0] + turned.mean())) % 360
    is_nadir = float((pitch + 90.0).max()) < SAME_DEG
    low, high = float(heights.min()), float(heights.max())
    height = f"{metres(low)} above the ground"
    if high - low >= SAME_M:
        middle = metres(flight.height_m)
        height = (
            f"{middle} above the middle of the area; {low:.1f} to {high:.1f} m above the ground"
        )
    return (
        ("Drone", planned.drone or "–"),
        ("Photos", str(len(frames.name))),
        ("Height", height),
        ("Camera", "straight down" if is_nadir else f"{_span(-pitch)}° below level"),
        ("Nose", f"{nose}° from north" if is_one_way else "turns: see each photo"),
        ("At each photo", f"hover {flight.seconds_per_photo:.0f} s, then trigger"),
        ("Way", f"{metres(flight.path_m)} at {flight.speed_m_s:g} m/s"),
        ("In the air", f"{_minutes(flight.duration_s)} of {_minutes(flight.battery_s)}"),
    )


def corners_on_earth(planned: FlightPlanned) -> tuple[str, ...]:
    """Return latitude and longitude of each corner, as map programs take them, if known."""
    if any(message.code == "plan-nowhere" for message in planned.messages):
        return ()
    site = planned.site
    origin = (site.latitude_deg, site.longitude_deg, site.height_msl_m)
    latitude, longitude, _ = geodetic_from_enu(planned.area_world_m, origin)
    return tuple(f"{a:.6f}, {b:.6f}" for a, b in zip(latitude, longitude, strict=True))


def describe_criterion(planned: FlightPlanned) -> str:
    """State the criterion by which lines or plates were placed; empty if there are none."""
    if not planned.laid.name:
        return ""
    what = "plates" if planned.plates.name else "lines"
    lie = f"The {what} lie where"
    if planned.chosen_by == "mean":
        over = "" if planned.measurements.name else " of lengths all over the area"
        return f"{lie} the average ±{over} is smallest."
    wished = np.isfinite(planned.measurements.wanted_sigma).any()
    against = "the ± you wish" if wished else "its usual ±"
    return (
        f"{lie} the ± are smallest on average when each is compared with {against}, so other "
        f"places may have a smaller plain average. Each average ± here is the plain one"
        f"{specify_lengths(planned)}."
    )


def specify_lengths(planned: FlightPlanned) -> str:
    """Specify that averages are of lengths, if there are other values too."""
    unit = planned.measurements.unit
    return " of the lengths" if "m" in unit and set(unit) != {"m"} else ""


def find_unchecked_lines(planned: FlightPlanned) -> tuple[str, ...]:
    """Return the lines for which a wrong reading would not be detected."""
    lines = planned.lines
    weak = ~np.isfinite(lines.mdb_m) | (lines.redundancy < LOW_CHECK)
    return tuple(name for name, is_weak in zip(lines.name, weak, strict=True) if is_weak)


def describe_alternatives(planned: FlightPlanned) -> tuple[str, ...]:
    """Describe alternatives if a line or plate cannot be laid out, and the worst loss."""
    lines = planned.laid
    if not lines.name:
        return ()
    without = lines.mean_sigma_without
    told = [
        "Lay it as near to its place as you can, flat and completely in view. Its position is "
        "found from the photos; only its number and its size must be right."
        if planned.plates.name
        else "Lay another one of about the same length and direction, as near to it as you can. "
        "Mark and tape it, and draw it into the sheet with its length. Never guess a length.",
    ]
    fatal = [name for name, sigma in zip(lines.name, without, strict=True) if math.isnan(sigma)]
    if fatal:
        told.append(
            f"Without {join_names(fatal, None)} the survey has no scale: if it "
            "cannot be laid, and nothing in its place, do not fly."
        )
    worst = int(np.nanargmax(without)) if np.isfinite(without).any() else 0
    if without[worst] <= WORTH_SAYING * planned.mean_sigma:
        told.append(f"The loss of {'another' if fatal else 'a single'} one changes little.")
    elif np.isfinite(without[worst]):
        told.append(
            f"Of the others {lines.name[worst]} matters most: without it, expect "
            if fatal
            else f"{lines.name[worst]} matters most: without it, expect "
        )
        told[-1] += (
            f"± {centimetres(float(without[worst]))} where you would have "
            f"± {centimetres(planned.mean_sigma)}."
        )
    return tuple(told)


def take_off_words(planned: FlightPlanned) -> str:
    """Instruct a pilot who flies the mission file."""
    return (
        "With the mission file: take off by hand beside the area, climb to the height of the first "
        "photo, then start the mission. After the last photo the drone hovers: bring it home by "
        "hand. The file counts heights from where you take off: from lower ground the drone flies "
        f"lower by as much. Never fly higher than {metres(planned.flight.max_height_m)} above the "
        "ground."
    )


def list_assumptions(planned: FlightPlanned) -> str:
    """List the assumptions of the prediction."""
    rests = planned.assumptions
    log = LOGS.get(rests.telemetry, f"a log of the class {rests.telemetry}")
    pixel = centimetres(planned.flight.ground_sample_m)
    tape = f"tape readings to ± {centimetres(rests.tape_sigma_m)}, "
    tape = "plates as exact as the scenario states, " if planned.plates.name else tape
    return (
        f"All ± hold with {log}, {tape if planned.laid.name else ''}points "
        f"clicked to ± {rests.pick_sigma_px:g} pixels (each is {pixel} on the ground), ground that "
        f"departs from a plane by ± {centimetres(rests.roughness_m)}, and a drone within "
        f"± {metres(rests.deviation_m)} and ± {rests.deviation_deg:g}° of the plan. Rougher ground "
        "or worse readings make them larger: the report after the flight states what was reached."
    )


def _span(degrees: Floats) -> str:
    low, high = float(degrees.min()), float(degrees.max())
    return f"{low:.0f}" if high - low < SAME_DEG else f"{low:.0f} to {high:.0f}"


def _minutes(seconds: float) -> str:
    return f"{seconds / 60:.1f} min"
