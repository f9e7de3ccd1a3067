"""The rendered streets of the data folder, with the corners of cars and houses declared free."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from csv_rows import read_rows, write_rows
from flight_projects import Truth, copy_project
from height_errors import Errors, errors

from uavgram.model.result.result import Result

LEAST_HEIGHT_M = 0.05
PARTNERS = 5
PICK_PX = 0.8


@dataclass(frozen=True, kw_only=True)
class Street:
    """A project's file, its truth, and the labels whose height is declared free."""

    project: Path
    truth: Truth
    free: tuple[str, ...]


def free_street(
    data: Path, name: str, folder: Path, *, redrawn: int | None = None, **changes: object
) -> Street:
    """Write a street's project with free heights, and distances from them to the ground.

    Parameters
    ----------
    data, name
        The data folder and the street.
    folder
        Where the project is written.
    redrawn
        Seed of fresh noise of the picks; None: the picks as they are.
    changes
        Of the project file.
    """
    truth: Truth = json.loads((data / "truth" / f"{name}.json").read_text(encoding="utf-8"))
    picks = read_rows(data / name / "picks.csv")
    if redrawn is not None:
        picks = _redrawn(picks, truth, np.random.default_rng(redrawn))
    above = truth["height_above_ground_m"]
    labels = sorted({row["label"] for row in picks})
    free = tuple(label for label in labels if above[label] > LEAST_HEIGHT_M)
    rows = [row | {"height_m": "free" if row["label"] in free else ""} for row in picks]
    write_rows(folder / "picks.csv", rows)
    ground = [label for label in labels if label not in free and _on_ground(label, truth)]
    rng = np.random.default_rng(0)
    pairs = [(a, b) for a in free for b in rng.choice(ground, PARTNERS, replace=False)]
    measured = [{"name": f"{a} to {b}", "kind": "distance", "points": f"{a};{b}"} for a, b in pairs]
    write_rows(folder / "measure.csv", measured)
    own = {table: str(folder / f"{table}.csv") for table in ("picks", "measure")}
    return Street(
        project=copy_project(data / name, folder, **own, **changes), truth=truth, free=free
    )


def picked_in(street: Street, photos: int) -> set[str]:
    """Free labels that are picked in so many photos at least."""
    count = Counter(row["label"] for row in read_rows(street.project.parent / "picks.csv"))
    return {label for label in street.free if count[label] >= photos}


def street_heights(street: Street, result: Result) -> Errors:
    """Of the free labels: heights over the ground."""
    points = result.points
    at = {label: row for row, label in enumerate(points.label)}
    rows = [at.get(label) for label in street.free]
    height, sigma = (
        np.array([np.nan if row is None else column[row] for row in rows])
        for column in (points.height_above_ground_m, points.height_sigma_m)
    )
    above = street.truth["height_above_ground_m"]
    true = np.array([above[label] for label in street.free])
    return errors(street.free, height - true, sigma)


def street_distances(street: Street, result: Result) -> Errors:
    """Of all distances, in three dimensions."""
    measured, place = result.measurements, street.truth["points"]
    ends = np.array([[place[label] for label in pair] for pair in measured.points])
    true = np.linalg.norm(np.diff(ends, axis=1)[:, 0], axis=1)
    return errors(measured.name, measured.value - true, measured.sigma)


def _on_ground(label: str, truth: Mapping[str, Any]) -> bool:
    return bool(abs(truth["height_above_ground_m"][label]) < 1e-6)


def _redrawn(
    picks: Iterable[Mapping[str, str]], truth: Truth, rng: np.random.Generator
) -> list[dict[str, str]]:
    """The same picks with noise drawn anew."""
    rows = []
    for row in picks:
        u, v = truth["pixels"][row["image"]][row["label"]][:2] + PICK_PX * rng.normal(size=2)
        rows.append(dict(row) | {"u_px": f"{u:.3f}", "v_px": f"{v:.3f}"})
    return rows
