"""Freezes what some surveys give, and shows what another version of the program changes.

Surveys: the demo, the examples of configs/, twins, real flight and streets of the data folder
($UAVGRAM_DATA), ordinary surveys, and 69 with one fault each (`study_trust.py`, fixed seeds). What
is run is the uavgram of the Python that runs this.

    python tests/benchmarks/golden_results.py make FOLDER             # a file for each survey
    python tests/benchmarks/golden_results.py make FOLDER --only demo  # names that begin so
    python tests/benchmarks/golden_results.py compare BEFORE AFTER    # what changed
    python tests/benchmarks/golden_results.py compare BEFORE AFTER --each       # value by value

`make` skips surveys whose file is there already. `compare` has a line for each survey that changed:

    value     largest change of a value, over its sigma before
    sigma     median, least and largest of sigma after over sigma before
    status    counts of changed statuses of measurements
    worst z   error over sigma of the worst value, before and after, where the truth is known
    verdict, first cause, left out or suspected, CPU seconds: before > after
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

from study_trust import drawn, jobs
from trust_world import true_value, write_survey

Row = dict[str, Any]
SEED = 7
ROOT = Path(__file__).resolve().parents[2]
DATA = ("calm_nadir", "wind_oblique", "cuav", "street_nadir", "street_oblique", "street_rolling")
CHANGED_SIGMAS, CHANGED_RATIO = 0.01, 0.01


Made = tuple[Path, dict[str, float]]
"""A project, and true values where they are known."""


def surveys(folder: Path) -> Iterator[tuple[str, Callable[[Path], Made]]]:
    """Names, and what makes each in a folder."""
    yield "demo", partial(demo, folder / "demo_project")
    for path in sorted((ROOT / "configs").glob("*.yaml")):
        if "\nimages:" in path.read_text(encoding="utf-8"):
            yield f"config-{path.stem}", partial(linked, ROOT, ("configs", "logs"), path.name)
    data = Path(os.environ.get("UAVGRAM_DATA", "/nowhere"))
    for name in DATA:
        if (data / name / "project.yaml").exists():
            yield f"data-{name}", partial(linked, data, (name,), "project.yaml")
    for what in ("ordinary", "faults"):
        for job in jobs(what, [], 1, SEED):
            yield f"{job[0]}-{job[1] or 'ordinary'}", partial(simulated, job)


def simulated(job: tuple[str, str, int], work: Path) -> Made:
    """Write a survey of the study."""
    survey = drawn(*job)
    truth = {name: true_value(survey, kind, labels) for name, kind, labels in survey.measure}
    return write_survey(survey, work), truth


def linked(root: Path, folders: tuple[str, ...], project: str, work: Path) -> Made:
    """Link the files of some folders into another; the project is in the first."""
    for name in folders:
        for path in sorted((root / name).rglob("*")):
            if path.is_file():
                place = work / path.relative_to(root)
                place.parent.mkdir(parents=True, exist_ok=True)
                place.symlink_to(path.resolve())
    return work / folders[0] / project, {}


def demo(kept: Path, work: Path) -> Made:
    """Link the demo's project, which is written once: all versions are to run the same files."""
    if not (kept / "project.yaml").exists():
        from uavgram.cli import main as command

        with contextlib.redirect_stdout(io.StringIO()):
            command(["demo", "--output", str(kept)])
    return linked(kept.parent, (kept.name,), "project.yaml", work)


def numbers(project: Path, truth: dict[str, float]) -> Row:
    """Run a project; what of its results is compared."""
    import uavgram  # the version of whose Python runs this

    start = time.process_time()
    try:
        result = uavgram.run(project, output=None)
    except Exception as error:  # noqa: BLE001  # a failure is a result too
        kind = (
            "" if isinstance(error, uavgram.UavgramError) else f"TRACEBACK {type(error).__name__}: "
        )
        text = kind + str(error).replace(str(project.parent), "")[:200]
        return {"failure": text, "cpu_s": round(time.process_time() - start, 2)}
    cpu_s = time.process_time() - start
    table = result.measurements
    rows = zip(table.name, table.value, table.sigma, table.status, strict=True)
    first = result.verdict.reasons[0] if result.verdict.reasons else None
    doubtful = [
        f"line {name} {status}"
        for name, status in zip(result.lines.name, result.lines.status, strict=True)
        if status in {"suspect", "removed"}
    ]
    doubtful += [
        f"pick {image} {label} {status}"
        for image, label, status in zip(
            result.picks.image, result.picks.label, result.picks.status, strict=True
        )
        if status in {"suspect", "removed"}
    ]
    doubtful += [
        f"frame {name} {status}"
        for name, status in zip(result.frames.frame_id, result.frames.status, strict=True)
        if status in {"rejected", "unmatched"}
    ]
    return {
        "values": {str(n): [_number(v), _number(s), str(t)] for n, v, s, t in rows},
        "truth": {name: _number(value) for name, value in truth.items()},
        "level": result.verdict.level,
        "first": first.cause if first else "",
        "first_names": sorted({*first.labels, *first.lengths, *first.frames}) if first else [],
        "causes": [reason.cause for reason in result.verdict.reasons],
        "messages": sorted(message.code for message in result.messages),
        "doubtful": sorted(doubtful),
        "variance_factor": _number(result.solution.variance_factor),
        "cpu_s": round(cpu_s, 2),
    }


def _number(value: float | None) -> float | None:
    if value is None or not np.isfinite(value):
        return None
    return float(f"{float(value):.9g}")


def make(folder: Path, only: list[str]) -> None:
    """Run all surveys; a file for each."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, made in surveys(folder):
        path = folder / f"{name}.json"
        if path.exists() or (only and not name.startswith(tuple(only))):
            continue
        with tempfile.TemporaryDirectory(prefix="golden-") as work:
            row = numbers(*made(Path(work)))
        path.write_text(json.dumps(row, indent=0), encoding="utf-8")
        print(
            f"{name:38s} {row['cpu_s']:6.2f} s {row.get('level', 'FAILED')} {row.get('first', '')}"
        )
        sys.stdout.flush()


def changes(before: Row, after: Row) -> list[str]:
    """What differs between two results of one survey, in words; empty where nothing does."""
    if "failure" in before or "failure" in after:
        told = [
            row.get("failure", f"{row.get('level')} {row.get('first')}") for row in (before, after)
        ]
        return [] if told[0] == told[1] else [f"{told[0]} > {told[1]}"]
    parts = []
    both = [name for name in before["values"] if name in after["values"]]
    moved = [moves(before["values"][n], after["values"][n]) for n in both]
    far = max((abs(m[0]) for m in moved if m[0] is not None), default=0.0)
    ratios = [m[1] for m in moved if m[1] is not None]
    if far > CHANGED_SIGMAS:
        parts.append(f"value {far:.2f} sigma")
    if ratios and max(abs(np.log(ratios))) > CHANGED_RATIO:
        parts.append(f"sigma x {np.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})")
    status = Counter(
        f"{before['values'][n][2]} > {after['values'][n][2]}"
        for n in both
        if before["values"][n][2] != after["values"][n][2]
    )
    parts += [f"status {change} ({n})" for change, n in status.items()]
    if parts and before["truth"]:
        parts.append(f"worst z {worst_z(before):.1f} > {worst_z(after):.1f}")
    if before["level"] != after["level"]:
        parts.append(f"verdict {before['level']} > {after['level']}")
    firsts = [" ".join([row["first"] or "-", *row["first_names"][:4]]) for row in (before, after)]
    if firsts[0] != firsts[1]:
        parts.append(f"first {firsts[0]} > {firsts[1]}")
    gone = sorted(set(before["doubtful"]) - set(after["doubtful"]))
    new = sorted(set(after["doubtful"]) - set(before["doubtful"]))
    if gone or new:
        parts.append(
            "in doubt " + ", ".join([f"-{x}" for x in gone[:6]] + [f"+{x}" for x in new[:6]])
        )
    return parts


def moves(before: list[Any], after: list[Any]) -> tuple[float | None, float | None]:
    """Change of a value over its sigma before, and sigma after over before."""
    if None in before[:2] or None in after[:2] or not before[1]:
        return None, None
    return (after[0] - before[0]) / before[1], after[1] / before[1]


def worst_z(row: Row) -> float:
    """Error over sigma of the worst value."""
    z = [
        abs(value - row["truth"][name]) / sigma
        for name, (value, sigma, _) in row["values"].items()
        if value is not None and sigma and name in row["truth"]
    ]
    return max(z, default=float("nan"))


def compare(one: Path, two: Path, *, each: bool) -> None:
    """Print what differs between two folders."""
    names, others = ({path.stem for path in folder.glob("*.json")} for folder in (one, two))
    same, cpu = 0, np.zeros(2)
    for name in sorted(names & others):
        before, after = (json.loads((at / f"{name}.json").read_text()) for at in (one, two))
        cpu += before["cpu_s"], after["cpu_s"]
        told = changes(before, after)
        same += not told
        seconds = f"cpu {before['cpu_s']:.2f} > {after['cpu_s']:.2f} s"
        if told:
            print(f"{name:38s} " + "; ".join([*told, seconds]))
        if told and each and "values" in before and "values" in after:
            for label, value in before["values"].items():
                other = after["values"].get(label, [None, None, "missing"])
                print(f"    {label:20s} {_told(value)}  >  {_told(other)}")
    count = len(names & others)
    print(f"{same} of {count} surveys unchanged; CPU {cpu[0]:.1f} > {cpu[1]:.1f} s")
    if names != others:
        print(f"{len(names ^ others)} surveys are in one folder only")


def _told(value: list[Any]) -> str:
    if None in value[:2]:
        return f"none ({value[2]})"
    return f"{value[0]:.4f} +- {value[1]:.4f} ({value[2]})"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["make", "compare"])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--only", nargs="+", default=[], help="names of surveys begin so")
    parser.add_argument("--each", action="store_true", help="every value of changed surveys")
    parser.add_argument("--demo", type=Path, help="project of the demo, of another golden folder")
    given = parser.parse_args()
    if given.what == "compare":
        compare(*given.folders, each=given.each)
        return
    if given.demo and not (given.folders[0] / "demo_project").exists():
        given.folders[0].mkdir(parents=True, exist_ok=True)
        (given.folders[0] / "demo_project").symlink_to(given.demo.resolve())
    make(given.folders[0], given.only)


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
