"""What a results.json has that its schema does not, and the reverse."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from jsonschema import Draft202012Validator
from results_schema import results_schema


def closed(schema: Any) -> Any:  # noqa: ANN401
    """A schema in which objects have no keys but their own: what this version may write."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    own = {key: closed(item) for key, item in schema.items()}
    if own.get("type") == "object" and "properties" in own:
        own["additionalProperties"] = False
    return own


@cache
def _validator() -> Draft202012Validator:
    schema = closed(results_schema())
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def faults_of(text: str) -> list[str]:
    """Place and fault of everything in a results.json that the closed schema refuses."""
    found = _validator().iter_errors(json.loads(text))
    return [f"{'/'.join(map(str, one.absolute_path))}: {one.message}"[:200] for one in found]
