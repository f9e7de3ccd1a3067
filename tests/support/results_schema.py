"""JSON Schema of results.json (results.schema.json), from the types written by the codec.

Descriptions are those of the attributes in the data classes' docstrings. A file written by this
version has no other keys; later versions may add some.
"""

from __future__ import annotations

import inspect
import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from uavgram.io.json_codec import Record, Table
from uavgram.io.results.results_json import (
    CONTROL_LINES,
    EFFECTS,
    FRAMES,
    KNOWN,
    LEARNT_KEYS,
    LINE_CHECKS,
    LINES,
    MEASUREMENTS,
    PICKS,
    POINT_CHECKS,
    POINTS,
    POSES,
    PRIORS,
    PROFILES,
    RELATIVE,
    SCHEMA,
    SECOND_ORDER,
    WEAKEST,
)
from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.message import NUMBERS, SUBJECTS, Correction, Message, Remedy
from uavgram.model.provenance import Provenance
from uavgram.model.result.reliability import (
    AreaNoise,
    ChecksOverall,
    EstimatedSigma,
    PickNoise,
    Reason,
    RemovalRecord,
    Verdict,
)
from uavgram.model.result.result import CameraUpdate, OrientationCorrelation, SolutionSummary
from uavgram.model.result.tables import MonteCarloResults, TieSummary
from uavgram.model.survey import Geodetic, World

SIGMA_KEY = re.compile(r"(.*_)?sigma(_.*)?")
NOT_NEGATIVE = {
    *("bytes", "chi2", "count", "degrees_of_freedom", "height_px", "iterations", "mahalanobis"),
    *("mdb", "mdb_m", "observations", "rms_error_m", "rms_px", "samples", "semi_major_m"),
    *("semi_minor_m", "sightings", "ties", "ties_rms_px", "variance_factor", "width_px"),
}
"""Keys of standard deviations, and of other numbers that are never negative."""
UNITS = {
    "m": "metres", "m2": "square metres", "px": "pixels", "deg": "degrees", "rad": "radians",
    "s": "seconds", "ppm": "parts per million", "percent": "per cent",
}  # fmt: skip
UNITS_OF_KEYS = {
    "covariance_m3": "square metres, of east, north and up",
    "time_utc_s": "seconds since 1970-01-01 UTC",
}
"""Units by the end of a key, and by complete keys that have no such end."""

DIALECT = "https://json-schema.org/draft/2020-12/schema"

_TEXT: Record = {"type": "string"}
_WHOLE: Record = {"type": "integer"}
_KNOWN: Record = {"type": "number"}
_NUMBER: Record = {"type": ["number", "null"]}
_SCALARS: dict[Any, Record] = {
    str: _TEXT,
    int: _WHOLE,
    bool: {"type": "boolean"},
    float: _NUMBER,
    object: {},
}
_ITEMS: list[tuple[Any, Record]] = [
    (Floats, _KNOWN),
    (Ints, _WHOLE),
    (Bools, {"type": "boolean"}),
]


def dump_schema() -> str:
    """Return the text of results.schema.json."""
    return json.dumps(results_schema(), ensure_ascii=False, indent=1) + "\n"


def results_schema() -> Record:
    """Return the JSON Schema of the files that `dump_results` writes."""
    place = dict.fromkeys(Geodetic._fields, _NUMBER)
    effects, weakest = row_schema(EFFECTS), row_schema(WEAKEST)
    unchecked = weakest.pop("unchecked")
    links = {"weakest": _or_null(_object(weakest)), "unchecked": unchecked}
    sections: dict[str, Record] = {
        "schema": {"const": SCHEMA},
        "name": _TEXT,
        "verdict": _record(Verdict, reasons=_array(_reason())),
        "provenance": _record(
            Provenance,
            inputs=_make_mapping_schema(_object({"sha256": _TEXT, "bytes": _WHOLE})),
            options=_make_mapping_schema({}),
            packages=_make_mapping_schema(_TEXT),
        ),
        "world": _object(place | _properties(World, without=("origin",))),
        "camera": _record(Calibration),
        "clock": _object(
            dict.fromkeys(("offset_s", "sigma_s", "drift_ppm", "drift_sigma_ppm"), _NUMBER)
        ),
        "shared": _make_shared_schema(),
        "areas": _array(_object({"name": _TEXT} | _plane())),
        "frames": _array(_object(row_schema(FRAMES) | _poses())),
        "points": _array(_object(row_schema(POINTS) | _ellipse() | {"relative": _relative()})),
        "lines": _array(_object(row_schema(LINES) | effects, optional=effects)),
        "known": _array(_object(row_schema(KNOWN))),
        "control_lines": _array(_object(row_schema(CONTROL_LINES))),
        "picks": _array(_object(row_schema(PICKS) | effects, optional=effects)),
        "measurements": _measurements(links),
        "measurement_correlation": _array(_array(_NUMBER)),
        "profiles": _array(_object(row_schema(PROFILES))),
        "monte_carlo": _or_null(_record(MonteCarloResults)),
        "removals": _array(_object({"step": _WHOLE} | _properties(RemovalRecord))),
        "checks_overall": _or_null(_record(ChecksOverall)),
        "checks": _array(
            {
                "oneOf": [
                    _object(row_schema(POINT_CHECKS)),
                    _object(row_schema(LINE_CHECKS)),
                ]
            }
        ),
        "solution": _record(SolutionSummary),
        "noise": _or_null(_noise()),
        "orientation": _or_null(_record(OrientationCorrelation)),
        "ties": _or_null(_record(TieSummary)),
        "messages": _array(_message()),
        "error_budget": _object({"sources": _array(_TEXT), "shares": _array(_array(_NUMBER))}),
        "priors": _array(_object(row_schema(PRIORS) | effects)),
    }
    optional = ("error_budget", "priors")
    return {
        "$schema": DIALECT,
        "title": "results.json of uavgram",
        "description": "Everything that a run computed. Keys end with their unit; null: no value.",
        **_object(sections, optional),
    }


def schema_of(hint: Any) -> Record:  # noqa: ANN401
    """Return the schema of the value that `json_codec.encode` makes of this type.

    Raises
    ------
    TypeError
        If the type has no form in JSON.
    """
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _make_array_schema(inner[0], inner[1:])
    if origin in (Union, UnionType):
        return _or_null(schema_of(inner[0]))
    if origin is Literal:
        return {"enum": list(inner)}
    if origin is tuple:
        return _array(schema_of(inner[0]), None if inner[-1] is Ellipsis else len(inner))
    if isinstance(hint, type) and is_dataclass(hint):
        return _record(hint)
    if hint in _SCALARS:
        return dict(_SCALARS[hint])
    raise TypeError(f"{hint!r} has no form in JSON")


def _make_array_schema(kind: Any, marks: Sequence[object]) -> Record:  # noqa: ANN401
    """Return the schema of an array by its shape, or of a tuple."""
    item = next((item for one, item in _ITEMS if one == kind), None)
    if item is None:
        return schema_of(kind)
    item = dict(_NUMBER if NAN_IS_NONE in marks else item)
    sizes = [mark for mark in marks if isinstance(mark, int | str) and mark != NAN_IS_NONE]
    for size in reversed(sizes):
        item = _array(item, size if isinstance(size, int) else None)
    return item


def _properties(
    owner: type[Any], given: Mapping[str, Record] | None = None, without: Sequence[str] = ()
) -> dict[str, Record]:
    """Return the schema of each field of a data class; `given` ones replace those of fields."""
    hints = get_type_hints(owner, include_extras=True)
    about = _descriptions(owner)
    names = [one.name for one in fields(owner) if one.name not in without]
    schemas = {name: (given or {}).get(name) or schema_of(hints[name]) for name in names}
    return {name: _add_description(schema, about.get(name)) for name, schema in schemas.items()}


def _record(owner: type[Any], /, **given: Record) -> Record:
    return _object(_properties(owner, given))


def row_schema(table: Table[Any]) -> dict[str, Record]:
    """Return the schema of each key of a row of a table."""
    hints = get_type_hints(table.owner, include_extras=True)
    about = _descriptions(table.owner)
    found: dict[str, Record] = {}
    for name in table.names():
        column = schema_of(hints[name])
        names, one = table.column(name), column["items"]
        if names.keys:
            found |= {key: _add_description(one["items"], about.get(name)) for key in names.keys}
        else:
            found[names.key or name] = _add_description(one, about.get(name))
    return found


def _descriptions(owner: type[Any]) -> dict[str, str]:
    """Return the text of each attribute in the docstring of a data class, without its shape."""
    _, _, section = inspect.getdoc(owner).partition("Attributes\n----------\n")  # type: ignore[union-attr]
    about: dict[str, str] = {}
    for names, text in re.findall(r"^(\w.*)\n((?:[ \t]+.*\n?)+)", section, flags=re.MULTILINE):
        words = re.sub(r"^\([A-Z][^)]*\),? ", "", " ".join(text.split()))
        about |= dict.fromkeys(names.split(", "), words)
    return about


def _add_description(schema: Record, text: str | None) -> Record:
    return {**schema, "description": text} if text else schema


def _object(
    properties: Mapping[str, Record], optional: Sequence[str] | Mapping[str, Any] = ()
) -> Record:
    required = [key for key in properties if key not in optional]
    own = {key: _add_unit(key, _limit_by_key(key, one)) for key, one in properties.items()}
    return {"type": "object", "properties": own, "required": required}


def _limit_by_key(key: str, schema: Record) -> Record:
    """Return the schema of a value with the numeric limits for its key."""
    is_share = key.endswith("probability")
    if not is_share and not SIGMA_KEY.fullmatch(key) and key not in NOT_NEGATIVE:
        return schema
    return _add_limits(schema, {"minimum": 0, **({"maximum": 1} if is_share else {})})


def _add_limits(schema: Record, limits: Record) -> Record:
    if "items" in schema:
        return {**schema, "items": _add_limits(schema["items"], limits)}
    if "anyOf" in schema:
        return {**schema, "anyOf": [_add_limits(one, limits) for one in schema["anyOf"]]}
    kinds = schema.get("type", ())
    return {**schema, **limits} if "number" in kinds or kinds == "integer" else schema


def _add_unit(key: str, schema: Record) -> Record:
    """Return the schema of a value whose description includes the unit at the end of its key."""
    unit = UNITS_OF_KEYS.get(key) or UNITS.get(key.rpartition("_")[2] if "_" in key else "")
    if unit is None or schema.get("type") == "object":
        return schema
    about = str(schema.get("description", "")).rstrip(".")
    return {**schema, "description": f"{about}{'; ' if about else ''}unit: {unit}"}


def _array(item: Record, size: int | None = None) -> Record:
    bounds = {} if size is None else {"minItems": size, "maxItems": size}
    return {"type": "array", "items": item, **bounds}


def _make_mapping_schema(item: Record) -> Record:
    """Return the schema of an object whose keys are names of the survey."""
    return {"type": "object", "additionalProperties": item}


def _or_null(schema: Record) -> Record:
    return {"anyOf": [schema, {"type": "null"}]}


def _estimate(numbers: int) -> Record:
    """Return the schema of value and sigma, lists where there are several numbers."""
    part = _KNOWN if numbers == 1 else _array(_KNOWN, numbers or None)
    return _object({"value": part, "sigma": part})


def _make_shared_schema() -> Record:
    learnt = _properties(CameraUpdate)
    return _object(
        {
            **{
                key: _or_null(_estimate(3))
                for key in ("boresight_deg", "lever_arm_m", "position_bias_m")
            },
            "heading_bias_deg": _or_null(_estimate(1)),
            "readout_s": _or_null(_estimate(1)),
            "plane": _object(_plane()),
            "tape_scale": _make_mapping_schema(_estimate(1)),
            "intrinsics": _object({LEARNT_KEYS.get(key, key): one for key, one in learnt.items()}),
        }
    )


def _plane() -> dict[str, Record]:
    return {"height_m": _estimate(1), "slope_deg": _estimate(2), "pivot_m": _array(_KNOWN, 2)}


def _poses() -> dict[str, Record]:
    pose = _or_null(_object(row_schema(POSES)))
    return {"seed": pose, "refined": pose}


def _ellipse() -> dict[str, Record]:
    keys = ("semi_major_m", "semi_minor_m", "azimuth_deg", "azimuth_rad")
    return {"ellipse_95": _object(dict.fromkeys(keys, _KNOWN))}


def _relative() -> Record:
    return _object(row_schema(RELATIVE) | _ellipse(), optional=("covariance_m3",))


def _measurements(links: dict[str, Record]) -> Record:
    second = row_schema(SECOND_ORDER)
    return _array(_object(row_schema(MEASUREMENTS) | links | second, optional=links | second))


def _noise() -> Record:
    return _object(
        {
            "picks": _make_mapping_schema(_object(_properties(PickNoise, without=("source",)))),
            "roughness": _make_mapping_schema(_object(_properties(AreaNoise, without=("area",)))),
            "lengths": _or_null(_record(EstimatedSigma)),
            "identification": _or_null(_record(EstimatedSigma)),
        }
    )


def _message() -> Record:
    """Return the schema of a message, with optional subjects and numbers."""
    keys = ("level", "code", "text", *SUBJECTS, *NUMBERS)
    every = _properties(Message)
    return _object({key: every[key] for key in keys}, optional=(*SUBJECTS, *NUMBERS))


def _reason() -> Record:
    correction = _properties(Correction)
    change = _object(correction, optional=[key for key in correction if key != "action"])
    remedy = _record(Remedy, corrections=_array(change))
    reason = _properties(Reason, {"mend": remedy, "instead": _array(remedy)})
    return _object(reason, optional=("plain", "mend", "instead", "equals"))


if __name__ == "__main__":  # python tests/support/results_schema.py > uavgram/results.schema.json
    sys.stdout.write(dump_schema())
