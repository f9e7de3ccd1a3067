"""Verdict in results.json: reasons, and their remedies where known."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from uavgram.io.results.codec import Record, encode, from_record
from uavgram.model.message import Correction, Remedy
from uavgram.model.result.verdict import Reason, Verdict

_ADDED: Record = {"plain": "", "mend": None, "instead": []}
"""Keys of a reason that are left out where they are empty."""


def dump_verdict(verdict: Verdict) -> Record:
    """Return level and reasons."""
    return {"level": verdict.level, "reasons": [_dump_reason(one) for one in verdict.reasons]}


def load_verdict(record: Record) -> Verdict:
    """Invert `dump_verdict`."""
    return from_record(
        Verdict, record, reasons=tuple(_load_reason(one) for one in record["reasons"])
    )


def _dump_reason(reason: Reason) -> Record:
    record: Record = encode(reason)
    if reason.mend is not None:
        record["mend"] = _dump_remedy(reason.mend)
    record["instead"] = [_dump_remedy(one) for one in reason.instead]
    return {key: value for key, value in record.items() if value != _ADDED.get(key, "always")}


def _load_reason(record: Record) -> Reason:
    record = _ADDED | record
    mend = None if record["mend"] is None else _load_remedy(record["mend"])
    instead = tuple(_load_remedy(one) for one in record["instead"])
    return from_record(Reason, record, mend=mend, instead=instead)


def _dump_remedy(remedy: Remedy) -> Record:
    changes = [_without_empty(encode(one)) for one in remedy.corrections]
    return {"action": remedy.action, "words": remedy.words, "corrections": changes}


def _without_empty(record: Record) -> Record:
    return {key: value for key, value in record.items() if value not in ("", None, [])}


def _load_remedy(record: Record) -> Remedy:
    changes = tuple(_load_correction(one) for one in record["corrections"])
    return from_record(Remedy, record, corrections=changes)


def _load_correction(record: Record) -> Correction:
    empty: dict[str, Any] = {one.name: encode(one.default) for one in fields(Correction)[1:]}
    return from_record(Correction, empty | record)
