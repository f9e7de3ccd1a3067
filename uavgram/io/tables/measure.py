"""Reading of measure.csv: the requested measurements."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import get_args

from uavgram.errors import suggest_spelling
from uavgram.io.tables.csv_tables import Columns, Table, number_hint, parse_number, read_table
from uavgram.model.limits import find_name_fault
from uavgram.model.naming import format_digits
from uavgram.model.observations import MEASUREMENT_FORMS, MeasurementKind, MeasurementRequest

MEASURE_COLUMNS = Columns(
    text=("name", "kind", "points"), optional_text=("parameters", "note"), others=True
)


def read_measure(path: str | Path) -> tuple[MeasurementRequest, ...]:
    """Read the requested measurements.

    Raises
    ------
    InputError
        Names file and line of every mistake: those of any table, an unknown kind, a wrong number of
        points, a repeated point where that is meaningless, missing, unknown or impossible
        parameters, a name used twice.
    """
    table = read_table(path, MEASURE_COLUMNS)
    table.require_unique("name", "measurement")
    requests = []
    for row, kind in enumerate(table.text["kind"]):
        if kind not in MEASUREMENT_FORMS:
            if kind:
                known = get_args(MeasurementKind)
                hint = suggest_spelling(kind, known) or f"known are {', '.join(known)}"
                table.add_fault(row, f"unknown kind {kind!r}: {hint}")
            continue
        form = MEASUREMENT_FORMS[kind]
        request = MeasurementRequest(
            name=table.text["name"][row],
            kind=kind,
            points=read_points(table, row, kind, form.points),
            parameters=read_parameters(table, row, kind, form.parameters, form.optional),
        )
        if fault := request_fault(request):
            table.add_fault(row, fault)
        requests.append(request)
    table.raise_faults()
    return tuple(requests)


def parameter_fault(name: str, value: float) -> str:
    """Explain why a number is impossible for a parameter; empty if it is possible, or NaN."""
    if name == "mu" and value <= 0:
        return "must be greater than 0"
    if name == "mu_sigma" and value < 0:
        return "must not be negative"
    if name in {"top", "plane"} and value != 1:
        return "can only be 1: leave it out where it is not wanted"
    return ""


def format_point_count(least: int, most: int | None) -> str:
    """Format the required number of labels of a kind in words."""
    if most is None:
        return f"at least {least}"
    return str(least) if least == most else f"{least} or {most}"


def points_fault(request: MeasurementRequest) -> str:
    """Explain why the labels or parameters of a measurement are invalid; empty if valid."""
    kind, points = request.kind, request.points
    form = MEASUREMENT_FORMS[kind]
    least, most = form.points
    if len(points) < least or (most is not None and len(points) > most):
        return f"a measurement of kind {kind} needs {format_point_count(least, most)} labels"
    twice = any(a == b for a, b in itertools.pairwise(points))
    if twice or (not form.may_return and len(set(points)) < len(points)):
        return f"a measurement of kind {kind} needs different labels"
    return request_fault(request)


def request_fault(request: MeasurementRequest) -> str:
    """Explain why a request's parameters do not fit each other or its points; empty if they do."""
    given = dict(request.parameters)
    if request.kind != "volume" or len(request.points) < 3:
        return ""
    if {"level", "plane"} <= given.keys():
        return "a volume is over a level or over a plane: remove one of the two parameters"
    least = 3 + ("top" in given) + 3 * ("plane" in given)
    if len(request.points) >= least:
        return ""
    more = [words for name, words in _MORE_POINTS.items() if name in given]
    return (
        f"this volume needs at least {least} labels: three or more around it, "
        f"{' and '.join(more)} (got {len(request.points)})"
    )


_RETURNING = {name for name, form in MEASUREMENT_FORMS.items() if form.may_return}
_MORE_POINTS = {"top": "one of its top", "plane": "three of the plane below"}


def read_points(
    table: Table, row: int, kind: str, count: tuple[int, int | None]
) -> tuple[str, ...]:
    """Read the labels in the cell `points` of a row, and report their mistakes.

    Parameters
    ----------
    table, row
        Position of the cell.
    kind
        Kind of measurement or known value.
    count
        Least and greatest number of points; None: any number.
    """
    written = table.text["points"][row]
    points = tuple(label.strip() for label in written.split(";"))
    if not written:
        return ()
    for label in filter(find_name_fault, points):
        table.add_fault(
            row, f"points: a label {find_name_fault(label)} (it begins with {label[:32]!r})"
        )
    if not all(points):
        table.add_fault(row, f"points holds an empty label (got {written!r})")
    least, most = count
    if len(points) < least or (most is not None and len(points) > most):
        table.add_fault(
            row,
            f"kind {kind} needs {format_point_count(least, most)} labels joined by ';' "
            f"(got {len(points)}: {written!r})",
        )
    if kind == "equal_lengths":  # the second line may begin where the first one ends
        for label in dict.fromkeys(
            a for a, b in zip(points[::2], points[1::2], strict=False) if a == b
        ):
            table.add_fault(row, f"points names a line from {label!r} to itself")
        return points
    # A polyline may return to a point, but no segment may go from a point to itself.
    for label in dict.fromkeys(a for a, b in itertools.pairwise(points) if a == b):
        table.add_fault(row, f"points names {label!r} twice in a row")
    if kind not in _RETURNING and len(set(points)) < len(points):
        table.add_fault(row, f"kind {kind} needs different points (got {written!r})")
    return points


def read_parameters(
    table: Table, row: int, kind: str, wanted: tuple[str, ...], optional: tuple[str, ...]
) -> tuple[tuple[str, float], ...]:
    """Read the numbers in the cell `parameters` of a row, and report their mistakes.

    Parameters
    ----------
    table, row
        Position of the cell.
    kind
        Kind of measurement or known value.
    wanted, optional
        Names of required and of optional parameters.
    """
    known = wanted + optional
    found: dict[str, float] = {}
    for part in filter(None, (p.strip() for p in table.text["parameters"][row].split(";"))):
        name, equals, text = (piece.strip() for piece in part.partition("="))
        number = parse_number(text)
        if not equals:
            table.add_fault(row, f"parameters must be name=number joined by ';' (got {part!r})")
        elif name not in known:
            hint = suggest_spelling(name, known) or f"it has {', '.join(known) or 'none'}"
            table.add_fault(row, f"unknown parameter {name!r} of kind {kind}: {hint}")
        elif name in found:
            table.add_fault(row, f"parameter {name!r} is there twice: remove one")
        elif number is None:
            table.add_fault(
                row, f"parameter {name} must be a number (got {text!r}){number_hint(text)}"
            )
        if equals:
            found.setdefault(name, float("nan") if number is None else number)
    if missing := [name for name in wanted if name not in found]:
        table.add_fault(
            row,
            f"kind {kind} needs the parameter {' and '.join(missing)}, "
            "such as mu=0.7;mu_sigma=0.05",
        )
    for name, value in found.items():
        if fault := parameter_fault(name, value):
            table.add_fault(row, f"parameter {name} {fault} (got {format_digits(value, 6)})")
    return tuple((name, found[name]) for name in known if name in found)
