"""Coded plates as observations: new picks of their corners, and known lengths of their sides."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import PLATE_CORNERS, corner_label, plate_label, plate_of
from uavgram.model.observations import (
    KnownLines,
    Picks,
    RejectedPlate,
    SeenPlate,
    Source,
    append_rows,
)

PLATE_TAPE = "targets"
"""Name of the tape of all plates, as one printer made them: they share its scale."""

OWN_SIGMA_SHARE = 0.5
"""Share of the sigma of a plate's side that differs from side to side."""

SIDES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3))
"""Pairs of corners whose distance is known: sides and diagonals."""

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def make_scale_prior(outline_m: Floats, sigma_m: float) -> tuple[tuple[str, float], ...]:
    """Return the prior of the common scale of all plates.

    Parameters
    ----------
    outline_m
        (4, 2) corners of a plate.
    sigma_m
        Standard deviation of its longest side.
    """
    return ((PLATE_TAPE, sigma_m / _longest(outline_m)),)


def add_plate_sides(
    lines: KnownLines, picks: Picks, outline_m: Floats, sigma_m: float
) -> KnownLines:
    """Add lengths between the corners of every plate that was found.

    Where a person measured between two corners of a plate, only that length is used.

    Parameters
    ----------
    lines
        Lengths of the project.
    picks
        All picks; those of source ``target`` give the plates.
    outline_m
        (4, 2) corners of a plate.
    sigma_m
        Standard deviation of its longest side.
    """
    taken = set(lines.name) | {
        f"{a} {b}"
        for a, b in zip((*lines.start, *lines.end), (*lines.end, *lines.start), strict=True)
    }
    pairs = [
        (
            corner_label(plate, a),
            corner_label(plate, b),
            float(np.linalg.norm(outline_m[b] - outline_m[a])),
        )
        for plate, corners in sorted(_find_plates(picks).items())
        for a, b in SIDES
        if {a, b} <= set(corners)
    ]
    new = [one for one in pairs if f"{one[0]} {one[1]}" not in taken]
    if not new:
        return lines
    sides = KnownLines(
        name=tuple(f"{a} {b}" for a, b, _ in new),
        start=tuple(a for a, _, _ in new),
        end=tuple(b for _, b, _ in new),
        length_m=np.array([length for _, _, length in new]),
        sigma_m=np.full(len(new), OWN_SIGMA_SHARE * sigma_m),
        adjust=np.ones(len(new), dtype=np.bool_),
        tape=(PLATE_TAPE,) * len(new),
    )
    return lines.append(sides)


def _find_plates(picks: Picks) -> dict[int, set[int]]:
    """Return the plates that the program found, with the numbers of all picked corners."""
    found: dict[int, set[int]] = {}
    made = picks.of_source("target")
    plates = {plate_of(label) for label, by_us in zip(picks.label, made, strict=True) if by_us}
    for label in dict.fromkeys(picks.label):
        plate = plate_of(label)
        if plate is not None and plate in plates:
            found.setdefault(plate, set()).add(int(label[-1]) - 1)
    return found


def _longest(outline_m: Floats) -> float:
    return float(np.linalg.norm(np.roll(outline_m, -1, axis=0) - outline_m, axis=1).max())


_CENTER_TOO = 2.0**0.5
"""Factor of the sigmas of a plate where its centre is picked beside its corners: the centre adds no
information to the corners, and four corners and a centre as good as their mean would count
twice."""


@dataclass(frozen=True)
class Rows:
    """Picks of a project with those of its plates, and messages."""

    picks: Picks
    plates: int
    messages: tuple[Message, ...]


def remove_targets(picks: Picks) -> Picks:
    """Return the picks that the program did not make from targets."""
    return picks.where(~picks.of_source("target"))


def add_targets(
    picks: Picks, seen: Mapping[str, Sequence[SeenPlate]], centers: Mapping[int, str]
) -> Rows:
    """Replace the picks of targets by those of newly found plates.

    Parameters
    ----------
    picks
        Picks of the project.
    seen
        Plates by photo.
    centers
        Label of the centre of each plate whose centre is requested.
    """
    kept = remove_targets(picks)
    taken = set(zip(kept.image, kept.label, strict=True))
    rows: list[TargetRow] = []
    by_hand: list[TargetRow] = []
    for row in rows_of(seen, centers):
        (by_hand if (row.image, row.label) in taken else rows).append(row)
    plates_found = {
        plate.plate for some in seen.values() for plate in some if not plate.left_out.value
    }
    messages = (*_left_out(seen), *_report_manual_picks(by_hand))
    return Rows(append_targets(kept, rows), len(plates_found), tuple(messages))


def list_requested_centers(
    plates: Collection[int], named: Collection[str], known: Collection[str], picks: Picks
) -> dict[int, str]:
    """Return labels of the plates' centres that the project names.

    Parameters
    ----------
    plates
        Ids that were found.
    named
        Labels in lengths, measurements and known things.
    known
        Labels with known coordinates: among them a bare number also means a plate.
    picks
        Picks; a number that a person picked does not mean a plate.
    """
    hand = set(remove_targets(picks).label)
    found = {}
    for plate in plates:
        own = plate_label(plate)
        if own in named or own in known:
            found[plate] = own
        elif str(plate) in known and str(plate) not in hand:
            found[plate] = str(plate)
    return found


@dataclass(frozen=True)
class TargetRow:
    """Pick of a target."""

    image: str
    label: str
    u_px: float
    v_px: float
    sigma_px: float
    score: float


def rows_of(
    seen: Mapping[str, Sequence[SeenPlate]], centers: Mapping[int, str]
) -> Iterator[TargetRow]:
    """Yield picks of the plates that were found, including those that a person picked.

    Parameters
    ----------
    seen, centers
        As for `with_targets`.
    """
    for image, plates in seen.items():
        for plate in plates:
            if plate.left_out is RejectedPlate.NO:
                yield from _rows(image, plate, centers.get(plate.plate))


def _rows(image: str, plate: SeenPlate, center: str | None) -> Iterator[TargetRow]:
    wider = 1.0 if center is None else _CENTER_TOO
    for corner in range(PLATE_CORNERS):
        sigma = float(plate.sigma_px[corner])
        if np.isfinite(sigma):
            u, v = plate.corner_px[corner].tolist()
            yield target_row(
                image, corner_label(plate.plate, corner), (u, v), wider * sigma, plate.score
            )
    if center is not None and np.isfinite(plate.center_sigma_px):
        u, v = plate.center_px.tolist()
        yield target_row(image, center, (u, v), wider * plate.center_sigma_px, plate.score)


def target_row(
    image: str, label: str, place: tuple[float, float], sigma_px: float, score: float
) -> TargetRow:
    """Make a row with the significant digits only.

    Parameters
    ----------
    image, label
        The photo, and the label of the pick.
    place
        (u, v) [px].
    sigma_px, score
        Sigma of the place; and its certainty, 0 to 1.
    """
    u, v = (round(one, 4) for one in place)
    return TargetRow(image, label, u, v, max(round(sigma_px, 4), 1e-4), round(score, 4))


def append_targets(kept: Picks, rows: Sequence[TargetRow]) -> Picks:
    """Append rows of targets to picks."""
    target: Source = "target"
    targets = Picks(
        image=tuple(row.image for row in rows),
        label=tuple(row.label for row in rows),
        pixel_px=np.reshape([[row.u_px, row.v_px] for row in rows], (len(rows), 2)),
        sigma_px=np.array([row.sigma_px for row in rows]),
        height_m=np.full(len(rows), np.nan),
        source=(target,) * len(rows),
        score=np.array([row.score for row in rows]),
    )
    return Picks(**append_rows(kept, targets) | {"line": ()})


def _left_out(seen: Mapping[str, Sequence[SeenPlate]]) -> Iterator[Message]:
    used = {p.plate for plates in seen.values() for p in plates if p.left_out is RejectedPlate.NO}
    for image, plates in seen.items():
        told = (
            p.plate
            for p in plates
            if p.left_out not in (RejectedPlate.NO, RejectedPlate.DOUBTFUL)
            or (p.left_out is RejectedPlate.DOUBTFUL and p.plate in used)
        )
        for number in dict.fromkeys(told):
            why = next(p.left_out for p in plates if p.plate == number and p.left_out.value)
            name = plate_label(number)
            several = MessagePlural(
                "{count} plates were recognised in photos and left out there",
                f"{name} in {image}",
                ending="Look at them there; pick their corners by hand where you can see them.",
            )
            text = (
                f"{image}: plate {name} was recognised but is not used there: {why.value}. Look "
                "at it there; pick its corners by hand where you can see them."
            )
            yield Message("warning", "target-left-out", text, frames=(image,), several=several)


def _report_manual_picks(rows: Sequence[TargetRow]) -> Iterator[Message]:
    if not rows:
        return
    first = rows[0]
    text = (
        f"{len(rows)} corners of plates are picked by hand already ({first.label} in {first.image}"
        f"{' and others' if len(rows) > 1 else ''}): those picks stay as they are. Take them out "
        "to have the program's."
    )
    yield Message(
        "info", "target-by-hand", text, frames=tuple(dict.fromkeys(r.image for r in rows))
    )
