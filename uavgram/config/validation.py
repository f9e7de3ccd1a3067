"""Validation of plain data against frozen data classes, with all mistakes of a file in one error.

The dataclasses of the model are the schema: pydantic reads them, unknown keys are mistakes at every
level, and values are not converted silently (strict: text is no number, true is no number).
"""

from __future__ import annotations

import json
import types
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Any, Generic, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from uavgram.config.strict_yaml import Document, KeyPath, Plain, format_key_path
from uavgram.errors import InputError, suggest_spelling
from uavgram.model.limits import number_hint
from uavgram.model.options import OptionsError

LONGEST_VALUE_SHOWN = 60


@dataclass(frozen=True)
class Fault:
    """One mistake: its place, and a text with the invalid value."""

    at: KeyPath
    text: str


@dataclass(frozen=True)
class _Found:
    """One error of pydantic, with its place in the data instead of in the schema."""

    at: KeyPath
    union_at: KeyPath | None  # place of the union, if the error comes from one of its types
    kind: str
    details: ErrorDetails


def translate_errors(errors: Sequence[ErrorDetails], schema: type, data: Plain) -> list[Fault]:
    """Translate pydantic's errors; one fault for each place.

    Parameters
    ----------
    errors
        Errors of ``{"root": data}``.
    schema
        The data class that `data` should fit.
    data
        The file's content.
    """
    found = [_locate(details, data) for details in errors]
    faults: dict[KeyPath, Fault] = {}
    for one in found:
        rivals = [other for other in found if other.union_at == one.union_at]
        if one.union_at is None:
            new = _explain(one, schema, data)
        elif any(_is_meant(other) for other in rivals):
            new = _explain(one, schema, data) if _is_meant(one) else []
        else:
            new = [_explain_type_mismatch(one.union_at, rivals, data)]
        for fault in new:
            faults.setdefault(fault.at, fault)
    return list(faults.values())


def _locate(details: ErrorDetails, data: Plain) -> _Found:
    """Follow pydantic's location through the data; parts that are not in it name union types."""
    at: KeyPath = ()
    union_at: KeyPath | None = None
    here = data
    location = details["loc"][1:]
    for i, part in enumerate(location):
        is_absent = details["type"] == "missing" and i == len(location) - 1
        if isinstance(here, dict) and part in here:
            at, here = (*at, part), here[str(part)]
        elif isinstance(here, list) and isinstance(part, int) and part < len(here):
            at, here = (*at, part), here[part]
        elif is_absent:
            at = (*at, part)
        else:
            union_at = at
    return _Found(at, union_at, details["type"], details)


def _is_meant(found: _Found) -> bool:
    """Return whether the value has this type of a union, with a fault inside."""
    return found.at != found.union_at or found.kind in {"value_error", "too_long"}


def _explain_type_mismatch(at: KeyPath, rivals: Iterable[_Found], data: Plain) -> Fault:
    expected = " or ".join(dict.fromkeys(_describe_expected_type(rival) for rival in rivals))
    value = find_value(data, at)
    return Fault(at, f"must be {expected} (got {format_value(value)}){_number_hint(value)}")


def _describe_expected_type(found: _Found) -> str:
    if found.kind == "literal_error":
        return str(found.details["ctx"]["expected"]).replace("'", "")
    return _EXPECTED.get(found.kind, found.details["msg"])


_EXPECTED = {
    "string_type": "text",
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "finite_number": "a finite number",
    "tuple_type": "a list of numbers such as [1.0, 2.0]",
    "dataclass_type": "a block of keys",
    "dataclass_exact_type": "a block of keys",
    "none_required": "empty",
}


def _explain(found: _Found, schema: type, data: Plain) -> list[Fault]:
    """Explain one error in terms of the file."""
    at, details = found.at, found.details
    if found.kind == "value_error":
        return _explain_range(at, details["ctx"]["error"], data)
    if found.kind in {"unexpected_keyword_argument", "extra_forbidden"}:
        return [Fault(at, _explain_unknown_key(at, schema))]
    if found.kind in {"missing", "too_long"} and _is_tuple(find_type(schema, _list_of(found))):
        return [_explain_wrong_length(_list_of(found), schema, data)]
    if found.kind == "missing":
        return [Fault(at, f"is missing: add the line '{at[-1]}: ...'")]
    value = find_value(data, at)
    if value is None:
        return [Fault(at, "is empty: give it a value, or remove the line to have the default")]
    hint = ""
    if found.kind == "literal_error":
        known = str(details["ctx"]["expected"]).replace("'", "").replace(" or ", ", ").split(", ")
        hint = f": {guess}" if (guess := suggest_spelling(str(value), known)) else ""
    elif found.kind == "string_type":
        hint = ": put it in quotes" if isinstance(value, int | float) else ""
    elif found.kind == "float_type":
        hint = _number_hint(value)
    expected = _describe_expected_type(found)
    if found.kind == "tuple_type" and str in get_args(find_type(schema, at)):
        expected = "a list of names such as [a, b]"
    return [Fault(at, f"must be {expected} (got {format_value(value)}){hint}")]


def _explain_range(at: KeyPath, error: ValueError, data: Plain) -> list[Fault]:
    if not isinstance(error, OptionsError):
        return [Fault(at, str(error))]
    return [
        Fault((*at, name), f"{text} (got {format_value(find_value(data, (*at, name)))})")
        for name, text in error.faults
    ]


def _explain_unknown_key(at: KeyPath, schema: type) -> str:
    key = str(at[-1])
    known = _keys(find_type(schema, at[:-1]))
    text = f"unknown key {key!r}"
    if guess := suggest_spelling(key, known):
        return f"{text}: {guess}"
    for section, kind in get_type_hints(schema).items():
        if key in _keys(kind):
            return f"{text}: it belongs under '{section}:'"
    if key in _keys(schema):
        return f"{text} in here: it belongs at the left margin"
    return f"{text}: known here are {', '.join(known)}"


def _list_of(found: _Found) -> KeyPath:
    return found.at[:-1] if found.kind == "missing" else found.at


def _is_tuple(kind: Any) -> bool:  # noqa: ANN401
    return any(get_origin(option) is tuple for option in _options(kind))


def _explain_wrong_length(at: KeyPath, schema: type, data: Plain) -> Fault:
    kind = next(k for k in _options(find_type(schema, at)) if get_origin(k) is tuple)
    value = find_value(data, at)
    return Fault(at, f"must be a list of {len(get_args(kind))} numbers (got {format_value(value)})")


def _number_hint(value: Plain) -> str:
    return number_hint(value.strip(), "the key") if isinstance(value, str) else ""


def find_value(data: Plain, at: KeyPath) -> Plain:
    """Return the value at a path in plain data; None where there is none."""
    for part in at:
        if isinstance(data, dict):
            data = data.get(str(part))
        elif isinstance(data, list) and isinstance(part, int) and part < len(data):
            data = data[part]
        else:
            return None
    return data


def format_value(value: Plain) -> str:
    """Write an invalid value, shortened for a message."""
    text = repr(value) if isinstance(value, str) else _format_yaml(value)
    return text if len(text) <= LONGEST_VALUE_SHOWN else text[: LONGEST_VALUE_SHOWN - 3] + "..."


def _format_yaml(value: Plain) -> str:
    if isinstance(value, dict):
        return (
            "{" + ", ".join(f"{key}: {_format_yaml(inner)}" for key, inner in value.items()) + "}"
        )
    if isinstance(value, list):
        return "[" + ", ".join(_format_yaml(inner) for inner in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return "nothing" if value is None else str(value)


def find_type(schema: Any, at: KeyPath) -> Any:  # noqa: ANN401
    """Return the type annotation of a key of nested dataclasses; None for an unknown key.

    A mapping has keys of any name, with values of one type.
    """
    for part in at:
        owner = next((k for k in _options(schema) if is_dataclass(k)), None)
        named = next((k for k in _options(schema) if get_origin(k) is Mapping), None)
        if owner:
            schema = get_type_hints(owner).get(str(part))
        else:
            schema = get_args(named)[1] if named else None
    return schema


def _options(kind: Any) -> tuple[Any, ...]:  # noqa: ANN401
    return get_args(kind) if get_origin(kind) in {Union, types.UnionType} else (kind,)


def _keys(kind: Any) -> tuple[str, ...]:  # noqa: ANN401
    owner = next((k for k in _options(kind) if is_dataclass(k)), None)
    return tuple(f.name for f in fields(owner)) if owner else ()


Schema = TypeVar("Schema")


class _Root(BaseModel, Generic[Schema]):
    """Root model, the only source of configuration for plain dataclasses, also nested ones."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    root: Schema


@cache
def _root_of(schema: type[Schema]) -> type[_Root[Schema]]:
    """Return a cached model: building the validator takes longer than reading the file."""
    return _Root[schema]  # type: ignore[valid-type]


def validate(
    schema: type[Schema], document: Document, more_faults: tuple[Fault, ...] = ()
) -> Schema:
    """Convert a file's data to a `schema`.

    Parameters
    ----------
    schema
        A frozen dataclass of keyword-only fields, nested to any depth.
    document
        The file; its root must be a mapping.
    more_faults
        Mistakes found by the caller, to be reported together with the others.

    Raises
    ------
    InputError
        Names the line, key and value of every mistake.
    """
    if not isinstance(document.data, dict):
        raise InputError(document.path, "must consist of lines 'key: value'", 1)
    value, faults = _validate_all(schema, document.data)
    placed = [
        (
            document.line_of(fault.at),
            f"{format_key_path(fault.at)}: {fault.text}" if fault.at else fault.text,
        )
        for fault in (*more_faults, *faults)
    ]
    placed += document.faults
    if placed or value is None:
        raise InputError.of_all(document.path, placed)
    return value


def _validate_all(
    schema: type[Schema], data: dict[str, Plain]
) -> tuple[Schema | None, list[Fault]]:
    """Validate, and find every mistake.

    A dataclass checks the ranges of its fields only when all of them have the right type. So
    invalid values are removed (their defaults are used) and the rest is validated again, until no
    new faults are found.
    """
    faults: dict[KeyPath, Fault] = {}
    taken: set[KeyPath] = set()
    while True:
        try:
            # Strict JSON mode: mappings become dataclasses and lists tuples, without other
            # conversions; strict Python mode would require instances.
            text = json.dumps({"root": data})
            root = _root_of(schema)  # type: ignore[arg-type]  # a class is hashable
            return root.model_validate_json(text).root, list(faults.values())
        except ValidationError as error:
            new = [f for f in translate_errors(error.errors(), schema, data) if f.at not in faults]
        new = [fault for fault in new if fault.at not in taken]  # a removed key is not missing
        faults |= {fault.at: fault for fault in new}
        # Stop: only required keys without a default are left; or parts that are valid alone are
        # inconsistent, and it is unknown which of them to remove.
        if not all(fault.at for fault in new) or not new:
            return None, list(faults.values())
        data, out = _remove_keys(data, [fault.at for fault in new])
        taken |= out


def _remove_keys(
    data: dict[str, Plain], paths: list[KeyPath]
) -> tuple[dict[str, Plain], set[KeyPath]]:
    """Copy `data` without the named keys, of the top two levels at most; return their paths too."""
    copy: dict[str, Plain] = json.loads(json.dumps(data))
    out: set[KeyPath] = set()
    for path in paths:
        inner = copy.get(str(path[0]))
        key = path[:2] if isinstance(inner, dict) and len(path) > 1 else path[:1]
        (inner if isinstance(inner, dict) and len(key) > 1 else copy).pop(str(key[-1]), None)
        out.add(key)
    return copy, out
