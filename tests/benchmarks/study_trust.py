"""Do sigmas, statuses and verdicts hold in ordinary worlds, and when one thing is wrong?

Draws surveys by mathematics of its own (`tests/support/trust_world.py`: numpy alone), runs each as
a user would (`uavgram.run`), and compares with the truth. Works with every version of uavgram: run
it by the Python of the version that is to be judged.

    python tests/benchmarks/study_trust.py ordinary --surveys 40 --seed 1 --json ordinary.jsonl
    python tests/benchmarks/study_trust.py faults --surveys 20 --json faults.jsonl
    python tests/benchmarks/study_trust.py ordinary --only nadir_log exact --surveys 6
    python tests/benchmarks/study_trust.py small --surveys 300 --seed 1000
    python tests/benchmarks/study_trust.py table ordinary.jsonl faults.jsonl

`ordinary`, `faults` and `small` (random surveys of one to six photos) append a line of JSON for
each survey and skip those that the file has already, so that a study can be stopped and continued.
Columns of the tables:

    z          root mean square of error over sigma; by kind of measurement after it
    in95       per cent of values inside their 95 % interval
    >3, >3.5   per cent of values beyond so many sigmas
    oracle     mean sigma over that of an estimator that knows the errors' true sizes
    z/oracle   root mean square of error over the oracle's sigma: how good the estimates are
    ok>3.5     per cent of the values that are `ok`, beyond 3.5 sigmas
    green, amber, red, fail   per cent of surveys
    G>3.5      surveys with a value beyond 3.5 sigmas, of the green ones; likewise A and R
    spoilt     per cent of surveys with a value beyond 5 sigmas
    (checked)  likewise, of those where other observations check the wrong one
    cause      per cent of surveys whose first cause is right, of those where the fault does harm or
               the verdict names a cause
    innocent   per cent of surveys where the cause named first accuses a right observation
    cpu        seconds for a survey
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

from trust_conditions import BASES, CONDITIONS, draw
from trust_faults import FAULTS, accepts, accused_rightly, draw_small, is_accusation
from trust_oracle import oracle_sigmas
from trust_world import Survey, true_value, write_survey

Row = dict[str, Any]
KINDS = ("distance", "area", "angle", "line_distance", "height")
SPOILT, WRONG = 5.0, 3.5


def judged(survey: Survey, row: Row) -> Row:
    """Run a survey, and compare it with the truth."""
    import uavgram  # the version of whose Python runs this

    with tempfile.TemporaryDirectory(prefix="trust-") as name:
        project = write_survey(survey, Path(name))
        start = time.process_time()
        try:
            result = uavgram.run(project, output=None)
        except uavgram.UavgramError as error:
            return row | {"failure": str(error)[:300], "cpu_s": time.process_time() - start}
        except Exception as error:  # noqa: BLE001  # a traceback is a result of the study too
            text = f"TRACEBACK {type(error).__name__}: {error}"[:300]
            return row | {"failure": text, "cpu_s": time.process_time() - start}
        row["cpu_s"] = time.process_time() - start
    table = result.measurements
    world = CONDITIONS.get(row["world"])
    oracle = [] if row["fault"] or world is None else oracle_sigmas(survey, world)
    values = []
    for k, (label, kind, points) in enumerate(survey.measure):
        at = list(table.name).index(label)
        value, sigma = float(table.value[at]), float(table.sigma[at])
        if kind == "angle" and str(table.unit[at]) == "rad":
            value, sigma = np.degrees(value), np.degrees(sigma)
        low, high = (float(x) for x in table.interval_95[at])
        if kind == "angle" and str(table.unit[at]) == "rad":
            low, high = np.degrees(low), np.degrees(high)
        true = true_value(survey, kind, points)
        values.append(
            {
                "name": label,
                "kind": kind,
                "true": true,
                "value": value if np.isfinite(value) else None,
                "sigma": sigma if np.isfinite(sigma) else None,
                "in95": bool(low <= true <= high),
                "status": str(table.status[at]),
                "oracle": oracle[k] if oracle else None,
            }
        )
    reasons = [
        {
            "cause": one.cause,
            "text": one.text[:400],
            "frames": list(one.frames),
            "labels": list(one.labels),
            "lengths": list(one.lengths),
        }
        for one in result.verdict.reasons
    ]
    codes = [f"{one.level}:{one.code}" for one in result.messages]
    return row | {
        "level": result.verdict.level,
        "reasons": reasons,
        "messages": codes,
        "values": values,
    }


def jobs(what: str, only: list[str], surveys: int, seed: int) -> Iterable[tuple[str, str, int]]:
    """Names of worlds and faults, and seeds."""
    for k in range(surveys):
        if what == "small":
            yield "small", draw_small(seed + k)[0], seed + k
            continue
        if what == "ordinary":
            for world in CONDITIONS:
                if not only or world in only:
                    yield world, "", seed + k
            continue
        for world in BASES:
            for fault, one in FAULTS.items():
                if world in one.bases and (not only or fault in only or world in only):
                    yield world, fault, seed + k


def drawn(world: str, fault: str, seed: int) -> Survey:
    """Draw a survey; the same names and seed give the same one."""
    if world == "small":
        return draw_small(seed)[1]
    rng = np.random.default_rng([zlib.crc32(f"{world} {fault}".encode()), seed])
    if not fault:
        return draw(CONDITIONS[world], rng)
    one = FAULTS[fault]
    survey = draw(one.changed(BASES[world]), rng)
    one.plant(survey, rng)
    return survey


def study(what: str, only: list[str], surveys: int, seed: int, path: Path) -> list[Row]:
    """Run all surveys that the file has not yet; a line for each."""
    rows = read(path) if path.exists() else []
    done = {(row["world"], row["fault"], row["seed"]) for row in rows}
    with path.open("a", encoding="utf-8") as file:
        for world, fault, number in jobs(what, only, surveys, seed):
            if (world, fault, number) in done:
                continue
            survey = drawn(world, fault, number)
            row: Row = {"world": world, "fault": fault, "seed": number}
            row["wrong"] = {kind: sorted(names) for kind, names in survey.wrong.items()}
            row["redundant"] = survey.redundant
            row = judged(survey, row)
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(progress(row), flush=True)
    return rows


def progress(row: Row) -> str:
    """One line of one survey."""
    head = f"{row['world']:17s} {row['fault']:17s} {row['seed']:5d} {row['cpu_s']:6.2f} s "
    if "failure" in row:
        return f"{head}FAILED {row['failure'][:120]}".replace("\n", " ")
    z = zs(row)
    first = row["reasons"][0]["cause"] if row["reasons"] else "-"
    return (
        head + f"z {rms(z):6.2f} worst {max(map(abs, z), default=0):7.1f} {row['level']:6s} {first}"
    )


def read(path: Path) -> list[Row]:
    """Rows of a file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines if line]


def zs(row: Row, status: str = "", kind: str = "") -> list[float]:
    """Errors over sigmas of a survey's values."""
    return [
        (one["value"] - one["true"]) / one["sigma"]
        for one in row.get("values", ())
        if one["value"] is not None
        and one["sigma"]
        and (not status or one["status"] == status)
        and (not kind or kind_of(one) == kind)
    ]


def kind_of(one: Mapping[str, Any]) -> str:
    """Vertical distances count as heights."""
    return "height" if one["kind"] == "vertical_distance" else str(one["kind"])


def rms(some: Iterable[float]) -> float:
    """Root mean square; NaN of none."""
    array = np.array(list(some))
    return float(np.sqrt((array**2).mean())) if len(array) else float("nan")


def share(holds: Iterable[bool]) -> str:
    """Per cent, or a dash of none."""
    some = list(holds)
    return f"{100 * sum(some) / len(some):.1f}" if some else "-"


def is_wrong(row: Row, beyond: float = WRONG) -> bool:
    """Whether any value is beyond so many sigmas."""
    return any(abs(z) > beyond for z in zs(row))


def colours(rows: list[Row]) -> list[str]:
    """Shares of the colours, and how many of each have a wrong value."""
    good = [row for row in rows if "level" in row]
    cells = [
        share(row.get("level") == level for row in rows) for level in ("green", "amber", "red")
    ]
    cells.append(share("failure" in row for row in rows))
    for level in ("green", "amber", "red"):
        some = [row for row in good if row["level"] == level]
        cells.append(f"{sum(map(is_wrong, some))}/{len(some)}")
    return cells


def trust_cells(rows: list[Row]) -> list[str]:
    """Cells that ordinary and faulty surveys have in common."""
    z = [x for row in rows for x in zs(row)]
    ok = [x for row in rows for x in zs(row, status="ok")]
    inside = [
        one["in95"] for row in rows for one in row.get("values", ()) if one["value"] is not None
    ]
    cells = [f"{rms(z):.2f}", share(inside)]
    cells += [share(abs(x) > beyond for x in z) for beyond in (3.0, WRONG)]
    total = sum(len(row.get("values", ())) for row in rows)
    return [*cells, f"{100 * len(ok) / max(1, total):.0f}", share(abs(x) > WRONG for x in ok)]


def over_oracle(rows: list[Row]) -> list[str]:
    """Geometric mean of sigma over the oracle's; and z by the oracle's sigmas."""
    both = [
        one
        for row in rows
        for one in row.get("values", ())
        if one["sigma"] and one["oracle"] and one["value"] is not None
    ]
    if not both:
        return ["-", "-"]
    ratios = np.log([one["sigma"] / one["oracle"] for one in both])
    z = rms((one["value"] - one["true"]) / one["oracle"] for one in both)
    return [f"{np.exp(ratios.mean()):.2f}", f"{z:.2f}"]


def ordinary_table(rows: list[Row]) -> list[list[str]]:
    """One line for each condition, and for all."""
    heads = ["condition", "n", "z", "in95", ">3", ">3.5", "ok", "ok>3.5", "oracle", "z/oracle"]
    heads += [f"z {kind}" for kind in KINDS]
    heads += ["green", "amber", "red", "fail", "G>3.5", "A>3.5", "R>3.5", "innocent", "cpu"]
    table = [heads]
    names = [name for name in (*CONDITIONS, "small") if any(row["world"] == name for row in rows)]
    for name in [*names, "all"]:
        some = [row for row in rows if name in {row["world"], "all"}]
        line = [name, str(len(some)), *trust_cells(some), *over_oracle(some)]
        line += [
            f"{rms(x for row in some for x in zs(row, kind=kind)):.2f}".replace("nan", "-")
            for kind in KINDS
        ]
        line += colours(some)
        line.append(share(accuses_first(row) for row in some if "level" in row))
        line.append(f"{np.mean([row['cpu_s'] for row in some]):.2f}")
        table.append(line)
    return table


def accuses_first(row: Row) -> bool:
    """Whether the cause named first accuses an observation that is right."""
    first = row["reasons"][0] if row["reasons"] else None
    return (
        first is not None
        and is_accusation(first["cause"])
        and not accused_rightly(first, row["wrong"])
    )


def is_right(row: Row) -> bool:
    """Whether the cause named first is the fault, or one of several that nothing tells apart."""
    if not row["reasons"]:
        return False
    first = row["reasons"][0]
    named = first["cause"] == "blunder-not-located" and accused_rightly(first, row["wrong"])
    return named or accepts(row["fault"], first["cause"])


def is_due(row: Row) -> bool:
    """Whether the fault does harm, or any cause of a misfit is named."""
    if "level" not in row:
        return False
    named = bool(row["reasons"]) and is_accusation(row["reasons"][0]["cause"])
    return is_wrong(row) or named or row["level"] == "red" or is_right(row)


def fault_table(rows: list[Row], by: str) -> list[list[str]]:
    """One line for each fault or base survey, and for all."""
    heads = [by, "n", "z", "in95", ">3", ">3.5", "ok", "ok>3.5", "spoilt", "(checked)"]
    heads += [
        "green",
        "amber",
        "red",
        "fail",
        "G>3.5",
        "A>3.5",
        "R>3.5",
        "due",
        "cause",
        "innocent",
    ]
    heads += ["cpu", "first causes"]
    table = [heads]
    names = list(dict.fromkeys(row[by] for row in rows))
    for name in [*names, "all"]:
        some = [row for row in rows if name in {row[by], "all"}]
        due = [row for row in some if is_due(row)]
        line = [name, str(len(some)), *trust_cells(some)]
        line.append(share(is_wrong(row, SPOILT) for row in some))
        line.append(share(is_wrong(row, SPOILT) for row in some if row["redundant"]))
        line += [*colours(some), str(len(due)), share(map(is_right, due))]
        line.append(share(accuses_first(row) for row in some if "level" in row))
        line.append(f"{np.mean([row['cpu_s'] for row in some]):.2f}")
        causes = Counter(
            row["reasons"][0]["cause"] if row["reasons"] else "-" for row in some if "level" in row
        )
        line.append(", ".join(f"{cause} {n}" for cause, n in causes.most_common(4)))
        table.append(line)
    return table


def printed(table: list[list[str]]) -> str:
    """A table in Markdown, its columns in line."""
    width = [max(len(line[k]) for line in table) for k in range(len(table[0]))]
    lines = [
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, width, strict=True)) + " |"
        for line in table
    ]
    lines.insert(1, "| " + " | ".join("-" * max(3, w) for w in width) + " |")
    return "\n".join(lines)


def tables(rows: list[Row]) -> str:
    """All tables of some rows."""
    ordinary, faulty = (
        [row for row in rows if bool(row["fault"]) is some] for some in (False, True)
    )
    parts = []
    if ordinary:
        parts.append("Ordinary surveys\n\n" + printed(ordinary_table(ordinary)))
    if faulty:
        parts.append("One fault each\n\n" + printed(fault_table(faulty, "fault")))
        parts.append("By base survey\n\n" + printed(fault_table(faulty, "world")))
    if ordinary and faulty:
        parts.append(
            "Mixed: green, amber, red, fail, and wrong of each: " + ", ".join(colours(rows))
        )
    return "\n\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["ordinary", "faults", "small", "table", "write"])
    parser.add_argument("files", nargs="*", type=Path, help="of `table`")
    parser.add_argument("--only", nargs="+", default=[], help="conditions, faults or base surveys")
    parser.add_argument("--surveys", type=int, default=6, help="of each condition or fault")
    parser.add_argument("--seed", type=int, default=1, help="of the first survey")
    parser.add_argument("--json", type=Path, help="file of the results, continued where it exists")
    parser.add_argument("--folder", type=Path, help="of `write`: projects to look at")
    given = parser.parse_args()
    if given.what == "table":
        print(tables([row for path in given.files for row in read(path)]))
        return
    if given.what == "write":
        for world, fault, seed in (
            job
            for kind in ("ordinary", "faults")
            for job in jobs(kind, given.only, given.surveys, given.seed)
        ):
            folder = given.folder / f"{world}-{fault or 'none'}-{seed}"
            print(write_survey(drawn(world, fault, seed), folder))
        return
    path = given.json or Path(tempfile.mkstemp(suffix=".jsonl", prefix="trust-")[1])
    print(tables(study(given.what, given.only, given.surveys, given.seed, path)))
    print(f"\nresults: {path}")


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
