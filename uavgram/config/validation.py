"""Plain data from a file -> frozen dataclasses, with every mistake of the file in one error.

The dataclasses of the model are the schema: pydantic reads them, unknown keys are mistakes at every
level, and nothing is converted silently (strict: text is no number, true is no number).
"""

from __future__ import annotations

import json
from functools import cache
from typing import Generic, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from uavgram.config.faults import Fault, faults_of
from uavgram.config.strict_yaml import Document, KeyPath, Plain, dotted
from uavgram.errors import InputError

Schema = TypeVar("Schema")


class _Root(BaseModel, Generic[Schema]):
    """Carries the configuration: plain dataclasses, nested ones too, inherit it from here only."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    root: Schema


@cache
def _root_of(schema: type[Schema]) -> type[_Root[Schema]]:
    """Made once: building what checks a project's settings takes longer than reading its file."""
    return _Root[schema]  # type: ignore[valid-type]


def validate(
    schema: type[Schema], document: Document, more_faults: tuple[Fault, ...] = ()
) -> Schema:
    """Make a `schema` of a file's data.

    Parameters
    ----------
    schema
        A frozen dataclass of keyword-only fields, nested at will.
    document
        The file; its root must be a mapping.
    more_faults
        Mistakes that the caller found, to be reported together with the others.

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
            f"{dotted(fault.at)}: {fault.text}" if fault.at else fault.text,
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

    A dataclass checks the ranges of its fields only once all of them have the right type. So
    what is wrong is taken out (its default steps in) and the rest tried again, until nothing new
    turns up.
    """
    faults: dict[KeyPath, Fault] = {}
    taken: set[KeyPath] = set()
    while True:
        try:
            # Strict JSON mode: mappings become dataclasses and lists tuples, and nothing else is
            # converted; strict Python mode would want instances.
            text = json.dumps({"root": data})
            root = _root_of(schema)  # type: ignore[arg-type]  # a class is hashable
            return root.model_validate_json(text).root, list(faults.values())
        except ValidationError as error:
            new = [f for f in faults_of(error.errors(), schema, data) if f.at not in faults]
        new = [fault for fault in new if fault.at not in taken]  # a key taken out is not missing
        faults |= {fault.at: fault for fault in new}
        # Only required keys are left, which no default can stand in for; or parts that are right by
        # themselves do not go together, and nothing says which of them to take out.
        if not all(fault.at for fault in new) or not new:
            return None, list(faults.values())
        data, out = _without(data, [fault.at for fault in new])
        taken |= out


def _without(data: dict[str, Plain], paths: list[KeyPath]) -> tuple[dict[str, Plain], set[KeyPath]]:
    """Copy `data` without the named keys, of the top two levels at most; and which these are."""
    copy: dict[str, Plain] = json.loads(json.dumps(data))
    out: set[KeyPath] = set()
    for path in paths:
        inner = copy.get(str(path[0]))
        key = path[:2] if isinstance(inner, dict) and len(path) > 1 else path[:1]
        (inner if isinstance(inner, dict) and len(key) > 1 else copy).pop(str(key[-1]), None)
        out.add(key)
    return copy, out
