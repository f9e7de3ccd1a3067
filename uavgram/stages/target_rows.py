"""Convert plates in photos to picks: new rows, and messages on the others."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Bools
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import PLATE_CORNERS, corner_label, plate_label
from uavgram.model.observations import Picks, RejectedPlate, SeenPlate

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
    return chosen(picks, ~picks.of_source("target"))


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
    messages = (*_left_out(seen), *_by_hand(by_hand))
    return Rows(with_rows(kept, rows), len(plates_found), tuple(messages))


def asked_centers(
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


def chosen(picks: Picks, rows: Bools) -> Picks:
    """Select picks."""
    index = np.flatnonzero(rows).tolist()

    def some(texts: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(texts[i] for i in index) if texts else ()

    return Picks(
        image=some(picks.image),
        label=some(picks.label),
        pixel_px=picks.pixel_px[rows],
        sigma_px=picks.sigma_px[rows],
        height_m=picks.height_m[rows],
        height_sigma_m=picks.height_sigma_m[rows],
        is_free=picks.is_free[rows],
        area=some(picks.area),
        source=tuple(picks.source_of(i) for i in index),
        score=picks.score[rows],
        from_image=some(picks.from_image),
        from_px=picks.from_px[rows],
    )


def with_rows(kept: Picks, rows: Sequence[TargetRow]) -> Picks:
    """Append rows of targets to picks."""
    n, m = len(kept.image), len(rows)
    nothing = np.full(m, np.nan)
    return Picks(
        image=(*kept.image, *(row.image for row in rows)),
        label=(*kept.label, *(row.label for row in rows)),
        pixel_px=np.concatenate(
            [kept.pixel_px, np.reshape([[r.u_px, r.v_px] for r in rows], (m, 2))]
        ),
        sigma_px=np.append(kept.sigma_px, [row.sigma_px for row in rows]),
        height_m=np.append(kept.height_m, nothing),
        height_sigma_m=np.append(kept.height_sigma_m, nothing),
        is_free=np.append(kept.is_free, np.zeros(m, np.bool_)),
        area=(*kept.area, *[""] * m) if kept.area else (),
        source=(*(kept.source_of(i) for i in range(n)), *["target"] * m),  # type: ignore[arg-type]
        score=np.append(kept.score, [row.score for row in rows]),
        from_image=(*kept.from_image, *[""] * m) if kept.from_image else (),
        from_px=np.concatenate([kept.from_px, np.full((m, 2), np.nan)]),
    )


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


def _by_hand(rows: Sequence[TargetRow]) -> Iterator[Message]:
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
