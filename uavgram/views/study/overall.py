"""Common results of several studies: where each error matters most, and where not."""

from __future__ import annotations

from itertools import groupby

from uavgram.model.simulation import Study
from uavgram.views.study.words import (
    agreement,
    capital,
    millimetres,
    most,
    source_text,
    verb,
)


def overall(studies: tuple[Study, ...]) -> list[str]:
    """Describe over all studies where each error matters most, and where not.

    Parameters
    ----------
    studies
        The studies.
    """
    cells = [(study, cell) for study in studies for cell in study.cells]
    if len(studies) < 2 or not cells:
        return []
    found = [f"{len(cells)} conditions of single photos were studied."]
    for source in ("picks", "lengths", "log", "camera", "ground"):
        mine = [(study, cell) for study, cell in cells if most(cell) == source]
        matter = verb(source, "matter", "matters")
        if not mine:
            found.append(f"{capital(source_text(source))} {matter} most in none of them.")
            continue
        text = f"{capital(source_text(source))} {matter} most in {len(mine)} of them"
        if len(mine) < len(cells) / 2:
            grouped = groupby(mine, lambda pair: (pair[0].name, pair[1].curve))
            where = [
                f"{name}, {curve} (at {', '.join(cell.label for _, cell in group)})"
                for (name, curve), group in grouped
            ]
            text += f": {'; '.join(where)}"
        found.append(f"{text}.")
    return [*found, agreement(studies)]


def ranking(studies: tuple[Study, ...]) -> list[tuple[str, str, str, str]]:
    """Rank the effect of each varied quantity on the first curve of its study, greatest first.

    Parameters
    ----------
    studies
        The studies.
    """
    rows = []
    for study in studies:
        if not study.cells:
            continue
        cells = next(iter(study.curves.values()))
        ordered = sorted(cells, key=lambda cell: cell.predicted_m)
        best, worst = (
            f"{millimetres(c.predicted_m)} at {c.label}" for c in (ordered[0], ordered[-1])
        )
        rows.append((ordered[-1].predicted_m / ordered[0].predicted_m, study.title, best, worst))
    rows.sort(key=lambda row: -row[0])
    return [(title, best, worst, f"{times:.1f}") for times, title, best, worst in rows]
