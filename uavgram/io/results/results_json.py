"""`Result` <-> results.json (schema 1): every number exactly, NaN as null, one record a line.

The reader gives back the object that was written. Which key holds what stands once for both
directions, in results_tables.py; here are the parts that are no tables.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from uavgram.errors import InputError
from uavgram.io.json_text import parse_json
from uavgram.io.outputs import replace_text
from uavgram.io.results import records as parts
from uavgram.io.results import reliability as evidence
from uavgram.io.results import tables
from uavgram.model.result.result import Result

SCHEMA = 1


def dump_results(result: Result) -> str:
    """Write a result as the text of results.json.

    Deterministic: the same result gives the same text. Floats are written by repr (shortest text
    that reads back as the same number).

    Raises
    ------
    ValueError
        A number is infinite: a bug, results have none.
    """
    point_checks = tables.dump_point_checks(result.point_checks)
    lines, picks, measurements = evidence.with_evidence(
        result,
        tables.dump_lines(result.lines),
        tables.dump_picks(result.picks),
        tables.dump_measurements(result.measurements),
    )
    content = {
        "schema": SCHEMA,
        "name": result.name,
        "provenance": parts.dump_provenance(result.provenance),
        "world": parts.dump_world(result.world),
        "camera": parts.dump_camera(result.camera),
        "clock": parts.dump_clock(result.shared),
        "shared": parts.dump_shared(result.shared, result.camera),
        "areas": parts.dump_areas(result.areas),
        "frames": tables.dump_frames(result.frames),
        "points": tables.dump_points(result.points),
        "lines": lines,
        "picks": picks,
        "measurements": measurements,
        "measurement_correlation": tables.plain(result.measurements.correlation),
        "monte_carlo": parts.dump_monte_carlo(result.monte_carlo),
        "removals": evidence.dump_removals(result.removals),
        "checks_overall": evidence.dump_checks_overall(result.checks_overall),
        "checks": point_checks + tables.dump_line_checks(result.line_checks),
        "solution": parts.dump_solution(result.solution),
        "messages": [message.record() for message in result.messages],
    }
    if result.evidence is not None:
        content["priors"] = evidence.dump_priors(result.evidence.priors)
    if result.error_budget is not None:
        content["error_budget"] = parts.dump_error_budget(result.error_budget)
    return one_record_a_line(content)


def write_results(result: Result, path: str | Path) -> None:
    """Write results.json, in one step.

    Raises
    ------
    OutputError
        The file cannot be written; an earlier one is untouched.
    """
    replace_text(Path(path), dump_results(result))


def load_results(path: str | Path) -> Result:
    """Read results.json: the same object that was written.

    Raises
    ------
    InputError
        The file cannot be read, is cut short, is no JSON, is of another schema, or lacks
        something.
    """
    path = Path(path)
    content = _parse(path)
    try:
        return _result(content)
    except (KeyError, TypeError, ValueError, IndexError) as fault:
        what = f"there is no key {fault}" if isinstance(fault, KeyError) else str(fault)
        raise InputError(
            path, f"is not a complete results file of schema {SCHEMA} ({what}): run again"
        ) from fault


def _result(content: dict[str, Any]) -> Result:
    checks = content["checks"]
    return Result(
        name=tables.text(content["name"]),
        provenance=parts.load_provenance(content["provenance"]),
        world=parts.load_world(content["world"]),
        camera=parts.load_camera(content["camera"]),
        shared=parts.load_shared(content["shared"], content["clock"]),
        areas=parts.load_areas(content.get("areas", [])),  # files of before have none
        frames=tables.load_frames(content["frames"]),
        points=tables.load_points(content["points"]),
        lines=tables.load_lines(content["lines"]),
        picks=tables.load_picks(content["picks"]),
        measurements=tables.load_measurements(
            content["measurements"], content["measurement_correlation"]
        ),
        monte_carlo=parts.load_monte_carlo(content["monte_carlo"]),
        second_order=evidence.load_second_order(content["measurements"]),
        evidence=evidence.load_evidence(content),
        removals=evidence.load_removals(content.get("removals", [])),
        error_budget=parts.load_error_budget(content.get("error_budget")),
        checks_overall=evidence.load_checks_overall(content.get("checks_overall")),
        point_checks=tables.load_point_checks([c for c in checks if "label" in c]),
        line_checks=tables.load_line_checks([c for c in checks if "label" not in c]),
        solution=parts.load_solution(content["solution"]),
        messages=tuple(parts.load_message(message) for message in content["messages"]),
    )


def one_record_a_line(content: dict[str, Any]) -> str:
    """JSON with a line for each key, and for each record of a list: small, and fit for diff."""
    lines = []
    for key, value in content.items():
        if isinstance(value, list) and value:
            text = "[\n  " + ",\n  ".join(_compact(record) for record in value) + "\n ]"
        else:
            text = _compact(value)
        lines.append(f" {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _compact(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _parse(path: Path) -> dict[str, Any]:
    try:
        content = parse_json(path, path.read_bytes().decode("utf-8"), constant=_refuse_constant)
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    except UnicodeDecodeError as fault:
        raise InputError(path, "is not UTF-8 text, so no results file") from fault
    except json.JSONDecodeError as fault:
        raise InputError(
            path,
            f"is not complete JSON ({fault.msg}): it was cut short or edited; run again",
            fault.lineno,
        ) from fault
    except ValueError as fault:
        raise InputError(path, f"{fault}: it was edited; run again") from fault
    if not isinstance(content, dict) or "schema" not in content:
        raise InputError(path, "is no results file: it names no schema")
    if content["schema"] != SCHEMA:
        raise InputError(
            path,
            f"is of schema {content['schema']!r}, this program reads schema {SCHEMA}: read it with "
            "the version that wrote it (provenance.version), or run again",
        )
    return content


def _refuse_constant(name: str) -> float:
    raise ValueError(f"holds {name}, which is no JSON")
