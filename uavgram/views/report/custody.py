"""The chain of custody: options as they were understood."""

from __future__ import annotations

from uavgram.model.result.result import Result


def option_rows(result: Result) -> list[tuple[str, str]]:
    """Key and value of every option."""
    return [(key, _text(value)) for key, value in result.provenance.options]


def _text(value: object) -> str:
    if value is None:
        return "–"
    if isinstance(value, tuple | list):
        return ", ".join(map(_text, value))
    return str(value)
