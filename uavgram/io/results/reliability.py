"""Reliability, second order, removals and overall checks <-> results.json.

What belongs to a row of a table that is there already stands as further keys of that row. Files of
earlier versions lack all of it: then there is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uavgram.io.results.records import truth
from uavgram.io.results.tables import Record, column, dump_records, numbers, plain, text, texts
from uavgram.model.result.reliability import (
    ChecksOverall,
    Effects,
    Evidence,
    PriorResults,
    RemovalRecord,
    SecondOrder,
    WeakestLinks,
)
from uavgram.model.result.result import Result

_PRIOR_NUMBERS = {
    "residual": "residual_sigmas",
    "w": "w",
    "redundancy": "redundancy",
    "bias": "mdb",
}
_CHECK_NUMBERS = ("chi2", "probability", "rms_error_m", "mean_error_percent")


def with_evidence(
    result: Result, lines: list[Record], picks: list[Record], measurements: list[Record]
) -> tuple[list[Record], list[Record], list[Record]]:
    """The records of three tables with what is known of their reliability."""
    evidence, second = result.evidence, result.second_order
    if evidence is not None:
        lines = _joined(lines, _dump_effects(evidence.lines))
        picks = _joined(picks, _dump_effects(evidence.picks))
        measurements = _joined(measurements, _dump_weakest(evidence.weakest))
    if second is not None:
        measurements = _joined(
            measurements,
            dump_records(
                second_order_bias=plain(second.bias),
                second_order_sigma=plain(second.sigma),
                curvature=plain(second.curvature),
                first_order_off=[bool(off) for off in second.off],
            ),
        )
    return lines, picks, measurements


def load_evidence(content: dict[str, Any]) -> Evidence | None:
    """Evidence of a results file; None where it has none."""
    if "priors" not in content:
        return None
    records = content["priors"]
    return Evidence(
        lines=_load_effects(content["lines"]),
        picks=_load_effects(content["picks"]),
        priors=PriorResults(
            kind=texts(records, "kind"),
            name=texts(records, "name"),
            frame_id=texts(records, "frame_id"),
            unit=texts(records, "unit"),
            **{field: column(records, key) for field, key in _PRIOR_NUMBERS.items()},
            effects=_load_effects(records),
        ),
        weakest=_load_weakest(content["measurements"]),
    )


def load_second_order(records: Sequence[Record]) -> SecondOrder | None:
    """Second-order terms of the measurements; None where there are none."""
    if not records or "second_order_sigma" not in records[0]:
        return None
    return SecondOrder(
        bias=column(records, "second_order_bias"),
        sigma=column(records, "second_order_sigma"),
        curvature=column(records, "curvature"),
        off=np.array([truth(record["first_order_off"]) for record in records]),
    )


def dump_priors(priors: PriorResults) -> list[Record]:
    """All numbers known beforehand."""
    records = dump_records(
        kind=priors.kind,
        name=priors.name,
        frame_id=priors.frame_id,
        unit=priors.unit,
        **{key: plain(getattr(priors, field)) for field, key in _PRIOR_NUMBERS.items()},
    )
    return _joined(records, _dump_effects(priors.effects))


def dump_removals(removals: Sequence[RemovalRecord]) -> list[Record]:
    """What was taken out, step by step."""
    return [
        {
            "step": step,
            "what": one.what,
            "w": one.w,
            "group": list(one.group),
            "rivals": list(one.rivals),
            "variance_factor_before": plain(one.variance_factor_before),
            "variance_factor_after": plain(one.variance_factor_after),
            "change": plain(one.change),
        }
        for step, one in enumerate(removals, start=1)
    ]


def load_removals(records: Sequence[Record]) -> tuple[RemovalRecord, ...]:
    """Inverse of `dump_removals`."""
    return tuple(
        RemovalRecord(
            what=text(one["what"]),
            w=float(numbers(one["w"])),
            group=tuple(text(name) for name in one["group"]),
            rivals=tuple(text(name) for name in one["rivals"]),
            variance_factor_before=float(numbers(one["variance_factor_before"])),
            variance_factor_after=float(numbers(one["variance_factor_after"])),
            change=tuple(numbers(one["change"], len(one["change"])).tolist()),
        )
        for one in records
    )


def dump_checks_overall(checks: ChecksOverall | None) -> Record | None:
    """All checks together; null where nothing was withheld."""
    if checks is None:
        return None
    return {
        "count": checks.count,
        **{key: plain(getattr(checks, key)) for key in _CHECK_NUMBERS},
    }


def load_checks_overall(record: Record | None) -> ChecksOverall | None:
    """Inverse of `dump_checks_overall`."""
    if record is None:
        return None
    return ChecksOverall(
        count=int(numbers(record["count"])),
        **{key: float(numbers(record[key])) for key in _CHECK_NUMBERS},
    )


def _joined(records: list[Record], further: list[Record]) -> list[Record]:
    return [one | more for one, more in zip(records, further, strict=True)]


def _dump_effects(effects: Effects) -> list[Record]:
    return dump_records(
        external_on=effects.on,
        external=plain(effects.change),
        external_sigmas=plain(effects.sigmas),
    )


def _load_effects(records: Sequence[Record]) -> Effects:
    return Effects(
        on=texts(records, "external_on"),
        change=column(records, "external"),
        sigmas=column(records, "external_sigmas"),
    )


def _dump_weakest(weakest: WeakestLinks) -> list[Record]:
    links = dump_records(
        what=weakest.what,
        mdb=plain(weakest.bias),
        unit=weakest.unit,
        change=plain(weakest.change),
    )
    return dump_records(
        weakest=[link if link["what"] else None for link in links],
        unchecked=[list(names) for names in weakest.unchecked],
    )


def _load_weakest(records: Sequence[Record]) -> WeakestLinks:
    none = {"what": "", "mdb": None, "unit": "", "change": None}
    links = [record["weakest"] or none for record in records]
    return WeakestLinks(
        what=texts(links, "what"),
        bias=column(links, "mdb"),
        unit=texts(links, "unit"),
        change=column(links, "change"),
        unchecked=tuple(tuple(text(name) for name in record["unchecked"]) for record in records),
    )
