"""A simulation in words, drawings and tables, on the terminal and in simulation.html."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import METRIC
from uavgram.model.result.reliability import VerdictLevel
from uavgram.model.simulation import Accuracy, Repetitions, Simulation, Variant
from uavgram.views.formatting import number
from uavgram.views.pages import page
from uavgram.views.survey.drawing import BLACK, Drawing, Look
from uavgram.views.survey.text_placement import Letters
from uavgram.views.tables import Cell, Row, Table, format_table, make_table
from uavgram.views.units import decimals, display_unit

WRONG_RATIO = 1.5
"""Errors over stated sigmas above which a survey is called wrong instead of optimistic."""

WORDS = {
    "slope_deg": "the ground slopes along the road",
    "crown_percent": "the road has a crown",
    "slope_break_percent": "the ground rises beside the road",
    "kerb_m": "there is a kerb",
    "relief_m": "the ground is uneven",
    "readout_ms": "the camera reads its photos row after row",
    "identification_m": "people pick another place of the same mark in each photo",
    "tape_long": "the tape reads too long",
    "level_tape": "the tape is held level on sloping ground",
    "focal_wrong": "the focal length is not the calibrated one",
    "lag_s": "the log's exposures are late",
    "yaw_deg": "the log's heading is off",
    "mount_deg": "the camera is tilted in its mount",
    "gps_jump_m": "the receiver jumps during the flight",
    "heavy_tails": "some picks are careless",
    "pick_factor": "picks are worse than stated",
    "raised": "points are off the ground without being marked so",
    "swapped": "labels are swapped in one photo",
    "wrong_lengths": "a length was misread",
}
"""Words for errors of a scenario, by key without its section."""


PRIORS = {
    "position_bias_m": ("the position of the whole flight", " m"),
    "heading_bias_deg": ("the heading of the whole flight", "°"),
    "boresight_deg": ("the camera in its mount", "°"),
    "lever_arm_sigma_m": ("the place of the camera", " m"),
    "tape_scale": ("the scale of the tape", ""),
    "height_sigma_m": ("the height of the ground", " m"),
    "slope_sigma_deg": ("the slope of the ground", "°"),
}
"""Words and unit of the priors that a scenario draws, by key without its section."""


def measurement_table(simulation: Simulation) -> Table:
    """Return the table of all measurements in the order of the scenario."""
    found, accuracy = simulation.repetitions, simulation.accuracy
    return make_table(
        "measurement | unit | >runs | >bias (95 % range) | *spread (95 % range) | >predicted | "
        ">stated | >in 68 % | >in 95 % (range) | >in 99.7 % | >error/stated (range)",
        [_row(found, accuracy, i) for i in range(len(found.name))],
    )


def _row(found: Repetitions, accuracy: Accuracy, i: int) -> Row:
    spread = float(accuracy.spread[i])
    one = display_unit(found.unit[i], METRIC)
    sized = spread if math.isfinite(spread) else float(found.predicted[i])
    places = decimals(sized * one.factor, one)

    def text(value: float, *, signed: bool = False) -> str:
        return number(float(value) * one.factor, places, signed=signed)

    def ranged(value: float, ends: Floats, look: str = "", *, signed: bool = False) -> Cell:
        if not math.isfinite(value):
            return Cell("–")
        low, high = (text(end, signed=signed) for end in ends)
        return Cell(text(value, signed=signed), below=f"({low} to {high})", look=look)

    z, (z_low, z_high) = float(accuracy.z[i]), accuracy.z_range[i].tolist()
    shares = [number(100 * share, 0) for share in accuracy.coverage[i].tolist()]
    low, high = (number(100 * end, 0) for end in accuracy.coverage_range[i, 1].tolist())
    cells = (
        *(found.name[i], one.symbol, str(int(accuracy.count[i]))),
        ranged(accuracy.bias[i], accuracy.bias_range[i], signed=True),
        ranged(spread, accuracy.spread_range[i], "value"),
        *(text(found.predicted[i]), text(accuracy.stated[i])),
        *(f"{shares[0]} %", Cell(f"{shares[1]} %", below=f"({low} to {high})"), f"{shares[2]} %"),
        Cell(number(z, 2), below=f"({number(z_low, 2)} to {number(z_high, 2)})" * bool(z > 0)),
    )
    return Row(cells, z_low > 1.0)


def rate_sigmas(simulation: Simulation) -> VerdictLevel:
    """Rate the sigmas: green if they hold; amber if errors are larger; red if much larger.

    It is also red if too many repetitions gave no result.
    """
    accuracy = simulation.accuracy
    known = np.isfinite(accuracy.z)
    lost = simulation.repetitions.failed + simulation.repetitions.unsettled
    if not known.any() or lost > 0.05 * len(simulation.repetitions.number):
        return "red"
    bold = accuracy.z_range[known, 0] > 1.0
    if bold.any():
        return "red" if float(np.median(accuracy.z[known])) > WRONG_RATIO else "amber"
    return "green"


def summarise_simulation(simulation: Simulation) -> str:
    """Describe the result in a sentence for everyone."""
    if not np.isfinite(simulation.accuracy.z).any():
        return "None of the repetitions gave a result."
    level = rate_sigmas(simulation)
    table = measurement_table(simulation)
    bad = [row[0].text for row, is_bad in zip(table.rows, table.bad, strict=True) if is_bad]
    if level == "green":
        return "The program's ± are reliable here: the errors were no larger than stated."
    if not bad:
        return (
            "Too many repetitions gave no result: the survey is too weak, or its errors too large."
        )
    which = f"{len(bad)} of {len(simulation.repetitions.name)} measurements"
    z, low = simulation.accuracy.z, simulation.accuracy.z_range[:, 0]
    factor = float(np.median(z[low > 1.0]))
    return (
        f"The program's ± are too small here: the errors of {which} were larger than stated "
        f"(typically {factor:.1f} times as large)."
    )


def count_repetitions(found: Repetitions) -> str:
    """Count the repetitions that gave a result, by colour."""
    colours = Counter(level for level in found.level if level is not None)
    told = ", ".join(f"{colours[one]} {one}" for one in ("green", "amber", "red") if colours[one])
    total = len(found.number)
    parts = [f"{total - found.failed} of {total} repetitions gave a result ({told or 'none'})"]
    if found.failed:
        parts.append(f"{found.failed} gave none")
    if found.unsettled:
        parts.append(f"{found.unsettled} did not converge and are not counted")
    return "; ".join(parts) + "."


def count_failures(found: Repetitions, most: int = 5) -> list[tuple[int, str]]:
    """Count the reasons of failed repetitions, in the words of the first of each kind."""
    told = [text for text in found.failure if text]
    kinds = Counter(_kind(text) for text in told)
    first = {_kind(text): text for text in reversed(told)}
    return [(count, first[kind]) for kind, count in kinds.most_common(most)]


def _kind(text: str) -> str:
    """Remove the digits from a message."""
    return "".join(letter for letter in text if not letter.isdigit())


def count_warnings(found: Repetitions, most: int = 8) -> list[tuple[str, str]]:
    """Return the most frequent warnings, and in how many repetitions each was given."""
    counts = Counter(code for codes in found.codes for code in codes).most_common(most)
    return [(code, f"in {count} repetitions") for code, count in counts]


def describe_changed_values(simulation: Simulation) -> str:
    """Describe the values drawn otherwise than stated, in a sentence; empty if there are none."""
    told = []
    for one in simulation.unlike:
        what, unit = PRIORS[one.key.rpartition(".")[2]]
        drawn, stated = (" and ".join(f"{v:.2g}" for v in vs) for vs in (one.drawn, one.stated))
        told.append(f"{what} (drawn ± {drawn}{unit}, stated ± {stated}{unit})")
    if not told:
        return ""
    return (
        f"Drawn with other sigmas than the project states: {', '.join(told)}. The errors may then "
        "differ from the prediction."
    )


def describe_unstated_errors(simulation: Simulation) -> str:
    """Describe the errors of the scenario that its project does not state; empty if none."""
    named = [_named(key) for key in simulation.deviations]
    if not named:
        return ""
    told = (
        f"The scenario has errors that its project does not state: {'; '.join(named)}. The ± may "
        "then be wrong"
    )
    return f"{told}." if simulation.variants else f"{told}; --compare shows the effect of each."


def _named(key: str) -> str:
    words = WORDS.get(key.rpartition(".")[2])
    return f"{words} ({key})" if words else key


def effect_table(simulation: Simulation) -> Table:
    """Return all variants of a simulation, and itself last; empty if none were requested."""
    whole = Variant(
        name="all of it together",
        repetitions=simulation.repetitions,
        accuracy=simulation.accuracy,
    )
    several = (*simulation.variants, whole) if simulation.variants else ()
    return make_table(
        "disturbance | *error, times | >error/stated | >in 95 % | >verdict green",
        [_error_effect(one, simulation.variants[0]) for one in several],
    )


def _error_effect(one: Variant, clean: Variant) -> tuple[str, ...]:
    ratio = _rms_error(one) / _rms_error(clean)
    known = ratio[np.isfinite(ratio)]
    z = one.accuracy.z[np.isfinite(one.accuracy.z)]
    within = one.accuracy.coverage[:, 1]
    green = sum(level == "green" for level in one.repetitions.level)
    return (
        _named(one.name),
        f"{np.median(known):.2f}" if known.size else "–",
        f"{np.sqrt(np.mean(z**2)):.2f}" if z.size else "–",
        f"{100 * np.nanmean(within):.0f} %" if np.isfinite(within).any() else "–",
        f"{green} of {len(one.repetitions.level)}",
    )


def _rms_error(one: Variant) -> Floats:
    """Compute the (M,) root mean square errors."""
    n = one.accuracy.count
    with np.errstate(invalid="ignore", divide="ignore"):
        # mean square error = bias^2 + variance with n instead of n - 1
        spread = one.accuracy.spread**2 * (n - 1) / n
        return np.asarray(np.sqrt(one.accuracy.bias**2 + spread))


LEFT, WIDTH, RIGHT = 210.0, 1000.0, 30.0
ROW, TOP, BOTTOM = 26.0, 22.0, 34.0
LOWEST, HIGHEST = 0.25, 8.0
"""Ratios at the ends of the axis; values beyond are drawn at the end."""

TICKS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
LETTERS = {"axis": Letters(13.0, colour="#5b6470"), "row": Letters(13.0)}
AXIS, ONE = Look("#d5d9de", 1.0), Look(BLACK, 1.5)
RIGHT_SIZE, WRONG = "#4078c8", "#b3261e"


def _across(ratio: float) -> float:
    """Return the position on the logarithmic axis."""
    share = math.log(min(max(ratio, LOWEST), HIGHEST) / LOWEST) / math.log(HIGHEST / LOWEST)
    return LEFT + (WIDTH - LEFT - RIGHT) * share


def draw_ranges(simulation: Simulation) -> Drawing:
    """Draw the error over stated sigma of each measurement, with its 95 % range.

    Parameters
    ----------
    simulation
        The simulation.
    """
    accuracy = simulation.accuracy
    known = np.flatnonzero(np.isfinite(accuracy.z)).tolist()
    height = TOP + ROW * len(known) + BOTTOM
    label = "Error over stated sigma of each measurement"
    drawing = Drawing(label, WIDTH, height, letters=LETTERS)
    for tick in TICKS:
        x = _across(tick)
        look = ONE if tick == 1.0 else AXIS
        drawing.lines("ticks", [np.array([[x, 14.0], [x, height - 26.0]])], look)
        drawing.write((x, height - 9.0), f"{tick:g}", "axis")
    for k, i in enumerate(known):
        y = TOP + ROW * (k + 0.5)
        low, high = accuracy.z_range[i].tolist()
        drawing.write((LEFT - 12.0, y + 4.0), simulation.repetitions.name[i], "row", side=1)
        ends = np.array([[_across(low), y], [_across(high), y]])
        drawing.lines("ranges", [ends], Look(WRONG if low > 1.0 else RIGHT_SIZE, 5.0))
        at = np.array([[_across(float(accuracy.z[i])), y]])
        drawing.signs("ratios", at, 4.5, Look(fill=BLACK))
    return drawing


def simulation_lines(simulation: Simulation) -> list[str]:
    """Format table, headline and counts.

    Parameters
    ----------
    simulation
        The simulation.
    """
    table, effects = measurement_table(simulation), effect_table(simulation)
    lines = [
        format_table(table, is_whole=True),
        "",
        summarise_simulation(simulation),
        count_repetitions(simulation.repetitions),
    ]
    lines += [
        text
        for text in (describe_unstated_errors(simulation), describe_changed_values(simulation))
        if text
    ]
    lines += [f"  {count} times: {text}" for count, text in count_failures(simulation.repetitions)]
    return [*lines, "", format_table(effects)] if effects.rows else lines


def render_simulation_page(simulation: Simulation) -> str:
    """Render the page as text; it loads nothing from elsewhere."""
    found = simulation.repetitions
    return page(
        "simulation.html",
        simulation=simulation,
        level=rate_sigmas(simulation),
        headline=summarise_simulation(simulation),
        counts=count_repetitions(found),
        rows=measurement_table(simulation),
        ranges=draw_ranges(simulation),
        reasons=count_failures(found),
        amiss=describe_unstated_errors(simulation),
        unlike=describe_changed_values(simulation),
        warned=count_warnings(found),
        costs=effect_table(simulation),
    )
