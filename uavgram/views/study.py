"""Studies in words, as study.html and as figures: all from the study's numbers."""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from operator import attrgetter
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator

from uavgram.model.simulation import SOURCES, Cell, MethodRow, Study
from uavgram.views.formatting import number
from uavgram.views.pages import page
from uavgram.views.tables import Row, Table, make_table

AGREES = (0.95, 1.05)
"""Range of errors over predicted ones within which a prediction is called right."""

SOURCE_WORDS = {
    "lengths": "the readings of the lengths",
    "picks": "the picks",
    "log": "the flight log",
    "camera": "the camera file",
    "tape": "the scale of the tape",
    "ground": "the ground's plane",
}
LENGTHS = ("lengths", "tape")
"""Sources that are errors of the reference lengths."""

MAX_NAMED = 6

MANY, TOO_FEW = 0.05, 0.9
"""Share of useless photos of a failing method, and least share of errors within 95 %."""


def describe_study(study: Study) -> list[str]:
    """Describe the results of a study, the most general first.

    Parameters
    ----------
    study
        The study.
    """
    if study.methods:
        return list(_compare_methods(study))
    found = [*_thesis(study)] if study.name == "lengths" else []
    found += [_describe_curve(name, cells) for name, cells in study.curves.items()]
    return [*found, describe_agreement((study,))]


def describe_agreement(studies: tuple[Study, ...]) -> str:
    """Describe the agreement of prediction and simulation.

    Parameters
    ----------
    studies
        Studies whose cells are used.
    """
    cells = [cell for study in studies for cell in study.cells]
    ratios = [cell.ratio for cell in cells]
    low, high = AGREES
    inside = sum(low <= ratio <= high for ratio in ratios)
    apart = [c for c in cells if c.ratio_range[0] > high or c.ratio_range[1] < low]
    text = (
        f"The errors were {min(ratios):.2f} to {max(ratios):.2f} times the predicted ones; "
        f"{inside} of {len(cells)} cells are between {low:.2f} and {high:.2f}"
    )
    if inside < len(cells):
        text += (
            f", and of the others {len(apart)} differ by more than their number of repetitions "
            "explains"
        )
    if apart:
        named = (f"{c.curve}, {c.label} ({c.ratio:.2f})" for c in apart[:MAX_NAMED])
        text += f": {'; '.join(named)}" + (" and others" if len(apart) > MAX_NAMED else "")
    return f"{text}. {_count_lost(cells)}"


def _count_lost(cells: list[Cell]) -> str:
    """Count the repetitions without a result, by cell."""
    losing = {cell: cell.lost for cell in cells if cell.lost}
    drawn = sum(cell.repetitions for cell in cells)
    text = f"{sum(losing.values())} of {drawn} repetitions gave no result"
    return f"{text}: {_list_largest(losing)}." if losing else f"{text}."


def _list_largest(number: dict[Cell, int]) -> str:
    """List the cells with the largest numbers, and these numbers."""
    by_size = sorted(number, key=lambda cell: -number[cell])[:MAX_NAMED]
    named = (f"{c.curve}, {c.label} ({number[c]} of {c.repetitions})" for c in by_size)
    return "; ".join(named) + (" and others" if len(number) > MAX_NAMED else "")


def lengths_share(cell: Cell) -> float:
    """Return the share of the reference lengths' errors in the variance, including tape scale."""
    return sum(cell.share(source) for source in LENGTHS)


def largest_source(cell: Cell) -> str:
    """Return the source of most of the variance; readings and tape count together."""
    shares = {source: cell.share(source) for source in SOURCES if source not in LENGTHS}
    shares["lengths"] = lengths_share(cell)
    return max(shares, key=lambda source: shares[source])


def _describe_curve(name: str, cells: tuple[Cell, ...]) -> str:
    """Describe the error along a curve, and its sources."""
    predicted_m = attrgetter("predicted_m")
    first, last = cells[0], cells[-1]
    least, worst = min(cells, key=predicted_m), max(cells, key=predicted_m)
    text = (
        f"{capitalise(name)}: the error is {millimetres(first.predicted_m)} at {first.label} and "
        f"{millimetres(last.predicted_m)} at {last.label}"
    )
    if _is_apart(worst, first) and _is_apart(worst, last):
        text += f", and largest at {worst.label} ({millimetres(worst.predicted_m)})"
    elif _is_apart(least, first) and _is_apart(least, last):
        text += f", and smallest at {least.label} ({millimetres(least.predicted_m)})"
    parts = []
    for source, group in groupby(cells, largest_source):
        some = list(group)
        share = [_share(cell, source) for cell in some]
        where = some[0].label if len(some) == 1 else f"{some[0].at:g} to {some[-1].label}"
        parts.append(f"{source_text(source)} at {where} ({_percents(share)})")
    text += f". The largest part of the predicted variance comes from {'; '.join(parts)}"
    return f"{text}."


def _is_apart(one: Cell, other: Cell) -> bool:
    """Return whether the errors of two cells differ as they are shown."""
    return millimetres(one.predicted_m) != millimetres(other.predicted_m)


def _thesis(study: Study) -> Iterator[str]:
    """Describe the conditions under which the length error is the most significant."""
    cells = study.cells
    holding = [cell for cell in cells if largest_source(cell) == "lengths"]
    yield (
        f'"The error of the reference lengths is the most significant" holds in {len(holding)} of '
        f"the {len(cells)} conditions studied here, and not in the other "
        f"{len(cells) - len(holding)}."
    )
    for name, along in study.curves.items():
        found = _crossing(along)
        if found is None:
            always = largest_source(along[0]) == "lengths"
            where = "at every" if always else "at no"
            yield f"{capitalise(name)}: the lengths matter most {where} precision studied."
        else:
            source = largest_source(along[0])
            yield (
                f"{capitalise(name)}: the lengths matter most from about {found:.0f} mm on; below "
                f"that, {source_text(source)} {verb_form(source, 'do', 'does')}."
            )


def _crossing(cells: tuple[Cell, ...]) -> float | None:
    """Find where the lengths become the greatest source, by the logarithm of the axis."""
    lead = []
    for cell in cells:
        others = [cell.share(source) for source in SOURCES if source not in LENGTHS]
        lead.append(lengths_share(cell) - max(others))
    for k in range(1, len(cells)):
        if lead[k - 1] < 0 <= lead[k]:
            # linear interpolation of the zero of the lead, in the logarithm of the axis
            part = -lead[k - 1] / (lead[k] - lead[k - 1])
            return float(cells[k - 1].at ** (1 - part) * cells[k].at ** part)
    return None


def _compare_methods(study: Study) -> Iterator[str]:
    usual, *limits = study.settings.values()
    rows = [row for row in usual if np.isfinite(row.rms_m)]
    best, worst = min(rows, key=lambda r: r.rms_m), max(rows, key=lambda r: r.rms_m)
    yield (
        f'On the same {best.scenes} photos "{best.method}" is the best: '
        f"{millimetres(best.rms_m)} in the middle one, nine tenths are better than "
        f'{millimetres(best.ninth_m)}; "{worst.method}" is the worst with '
        f"{millimetres(worst.rms_m)}."
    )
    for row in rows:
        if row.failed > 0:
            yield (
                f'"{row.method}" gives useless distances in {_percent(row.failed)} of the photos, '
                f"in {_percent(row.failed_silently)} without a warning."
            )
    for row in rows:
        if np.isfinite(row.coverage) and not 0.93 <= row.coverage <= 0.97:
            yield (
                f'"{row.method}" states sigmas whose 95 % intervals contain '
                f"{_percent(row.coverage)} of the errors."
            )
    for ending in limits:
        # Poses from a log alone are no better in any of them.
        told = "; ".join(_endings([row for row in ending if row.method != "log"]))
        yield (
            f"{capitalise(ending[0].setting)} ({ending[0].scenes} photos): "
            f"{told or 'every method holds'}."
        )


def _endings(rows: list[MethodRow]) -> Iterator[str]:
    """Describe how methods fail in a setting."""
    none = [row for row in rows if not np.isfinite(row.rms_m)]
    useless = [row for row in rows if row.failed > MANY and row not in none]
    bold = [row for row in rows if row.coverage < TOO_FEW and row not in none]
    if none:
        yield f"no result by {', '.join(_quote(row) for row in none)}"
    if useless:
        parts = (
            f"{_quote(row)} ({_percent(row.failed)}, {_percent(row.failed_silently)} without a "
            "warning)"
            for row in useless
        )
        yield f"useless distances by {', '.join(parts)}"
    if bold:
        parts = (f"{_quote(row)} {_percent(row.coverage)}" for row in bold)
        yield f"of the errors are within the 95 % intervals: {', '.join(parts)}"


def _quote(row: MethodRow) -> str:
    return f'"{row.method}"'


def _share(cell: Cell, source: str) -> float:
    return lengths_share(cell) if source == "lengths" else cell.share(source)


def source_text(source: str) -> str:
    """Return the name of a source of errors in a sentence."""
    return "the reference lengths" if source == "lengths" else SOURCE_WORDS[source]


def verb_form(source: str, plural: str, singular: str) -> str:
    """Return the form of a verb behind a source.

    Parameters
    ----------
    source
        One of `SOURCES`.
    plural, singular
        Both forms.
    """
    return plural if source in {"lengths", "picks"} else singular


def millimetres(size_m: float) -> str:
    """Format an error in millimetres, small ones to a tenth."""
    return f"{1e3 * size_m:.1f} mm" if size_m < 0.01 else f"{1e3 * size_m:.0f} mm"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share == 0 or share >= 0.05 else f"{100 * share:.1f} %"


def _percents(shares: list[float]) -> str:
    low, high = (f"{100 * one:.0f}" for one in (min(shares), max(shares)))
    return f"{low} %" if low == high else f"{low} to {high} %"


def capitalise(text: str) -> str:
    """Capitalise the first letter."""
    return text[:1].upper() + text[1:]


def compare_studies(studies: tuple[Study, ...]) -> list[str]:
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
        mine = [(study, cell) for study, cell in cells if largest_source(cell) == source]
        matter = verb_form(source, "matter", "matters")
        if not mine:
            found.append(f"{capitalise(source_text(source))} {matter} most in none of them.")
            continue
        text = f"{capitalise(source_text(source))} {matter} most in {len(mine)} of them"
        if len(mine) < len(cells) / 2:
            grouped = groupby(mine, lambda pair: (pair[0].name, pair[1].curve))
            where = [
                f"{name}, {curve} (at {', '.join(cell.label for _, cell in group)})"
                for (name, curve), group in grouped
            ]
            text += f": {'; '.join(where)}"
        found.append(f"{text}.")
    return [*found, describe_agreement(studies)]


def rank_effects(studies: tuple[Study, ...]) -> list[tuple[str, str, str, str]]:
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


def render_study_page(studies: tuple[Study, ...], figures: Mapping[str, bytes]) -> str:
    """Render the page as text; it loads nothing from elsewhere."""
    parts = [
        {
            "study": study,
            "said": describe_study(study),
            "picture": b64encode(figures[f"{study.name}.svg"]).decode(),
            "cells": _cell_table(study),
            "settings": {name: _method_table(rows) for name, rows in study.settings.items()},
        }
        for study in studies
    ]
    return page(
        "study.html",
        parts=parts,
        overall=compare_studies(studies),
        ranking=make_table(
            "study | best | worst | *times", rank_effects(studies) if len(studies) > 1 else []
        ),
        seconds=sum(study.seconds for study in studies),
    )


def _cell_table(study: Study) -> Table:
    """Return all conditions as numbers."""
    rows = []
    for cell in study.cells:
        low, high = cell.ratio_range
        texts = (
            *(cell.curve, cell.label, f"{1e3 * cell.predicted_m:.1f}"),
            *(f"{1e3 * cell.simulated_m:.1f}", f"{cell.ratio:.3f}", f"{low:.3f} to {high:.3f}"),
            *(f"{1e3 * cell.bias_m:.1f}", *(f"{100 * share:.0f}" for share in cell.shares)),
            f"{cell.repetitions - cell.lost} of {cell.repetitions}",
        )
        rows.append(Row(texts, low > AGREES[1] or high < AGREES[0]))
    return make_table(
        "curve | at | >predicted [mm] | *simulated [mm] | >simulated / predicted | >95 % range | "
        ">mean error [mm] | >lengths [%] | >picks [%] | >log [%] | >camera [%] | >tape scale [%] | "
        ">ground [%] | >with a result",
        rows,
    )


def _method_table(methods: Sequence[MethodRow]) -> Table:
    """Return the errors of each method in a setting."""
    rows = []
    for row in methods:
        sizes = (row.rms_m, row.ninth_m, row.fewest_m, row.most_m)
        shares = (row.failed, row.failed_silently, row.ambiguous, row.coverage)
        rows.append(
            (
                row.method,
                *(f"{1e3 * size:.0f}" if size < 1e3 else "–" for size in sizes),
                *(number(100 * share, 1) for share in shares),
                f"{row.z:.2f}" if row.z < 100 else "–",
            )
        )
    return make_table(
        "method | >median [mm] | >nine tenths [mm] | >fewest features [mm] | >most features [mm] | "
        ">useless [%] | >without a warning [%] | >another pose fits as well [%] | "
        ">errors within 95 % [%] | >error / stated",
        rows,
    )


COLOURS = ("#2f6fb5", "#d9730d", "#2b8a3e", "#8e44ad", "#c92a2a")
SOURCE_COLOURS = ("#6b7280", "#e0b000", "#17a2a2", "#e377c2", "#8a6d3b", "#a8c686")
"""Colours of curves, and of sources of errors: each colour has one meaning."""
MARKERS = ("o", "s", "^", "D", "v")
MAX_TICKS = 8
GRID, GREY = "#e3e5e8", "#8a8f98"
_BELOW: dict[str, Any] = {
    "fontsize": 8.5,
    "loc": "upper center",
    "bbox_to_anchor": (0.5, -0.15),
    "ncols": 2,
    "frameon": False,
}
"""Legend below its own axes."""


def figure_files(studies: tuple[Study, ...]) -> dict[str, bytes]:
    """Return the contents of the files NAME.svg and NAME.png of each study.

    Parameters
    ----------
    studies
        The studies.
    """
    files = {}
    # Paths instead of fonts: the same picture wherever it is opened. A fixed salt and no date: the
    # same study gives the same file.
    with rc_context({"svg.fonttype": "path", "svg.hashsalt": "uavgram", "font.size": 9.5}):
        for study in studies:
            usual = next(iter(study.settings.values()), ())
            figure = _methods(usual) if usual else _cells(study)
            FigureCanvasAgg(figure)
            for kind in ("svg", "png"):
                drawn = io.BytesIO()
                metadata = {"Date": None} if kind == "svg" else {}
                figure.savefig(drawn, format=kind, dpi=110, metadata=metadata)
                files[f"{study.name}.{kind}"] = drawn.getvalue()
    return files


def _cells(study: Study) -> Figure:
    """Draw errors to the left, ratios in the middle, sources to the right."""
    figure = Figure(figsize=(12.0, 4.6), dpi=110, layout="constrained")
    axes = figure.subplots(1, 3)
    _errors(axes[0], study)
    _ratios(axes[1], study)
    _sources(axes[2], study)
    axes[0].legend(**_BELOW)
    return figure


def _errors(axis: Axes, study: Study) -> None:
    for k, (name, cells) in enumerate(study.curves.items()):
        colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
        at = [cell.at for cell in cells]
        predicted = [1e3 * cell.predicted_m for cell in cells]
        simulated = [1e3 * cell.simulated_m for cell in cells]
        axis.plot(at, predicted, color=colour, linewidth=1.4, label=name)
        axis.plot(at, simulated, marker, color=colour, markersize=5, fillstyle="none")
    axis.set_yscale("log")
    _plain_ticks(axis)
    _dress(axis, study, "Errors of measured distances [mm]\nline: predicted, marks: simulated")


def _plain_ticks(axis: Axes) -> None:
    """Set plain numbers as ticks of a logarithmic axis: 1, 2, 5 and tens, more if these are few."""
    low, high = axis.get_ylim()
    steps = [m * 10.0**k for k in range(-2, 6) for m in (1, 1.5, 2, 3, 4, 5, 7)]
    shown = [step for step in steps if low <= step <= high]
    if len(shown) > MAX_TICKS:
        shown = [step for step in shown if f"{step:e}"[0:3] in {"1.0", "2.0", "5.0"}]
    axis.set_yticks(shown, [f"{step:g}" for step in shown])
    axis.yaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_minor_formatter(NullFormatter())


def _ratios(axis: Axes, study: Study) -> None:
    axis.axhspan(*AGREES, color=GREY, alpha=0.2, linewidth=0)
    axis.axhline(1.0, color=GREY, linewidth=1.0)
    curves = study.curves
    for k, cells in enumerate(curves.values()):
        shift = (k - (len(curves) - 1) / 2) * 0.012
        for cell in cells:
            low, high = cell.ratio_range
            at = _beside(cell.at, shift, study)
            axis.plot([at, at], [low, high], color=COLOURS[k % len(COLOURS)], linewidth=1.6)
            axis.plot(
                at, cell.ratio, MARKERS[k % len(MARKERS)], color=COLOURS[k % len(COLOURS)],
                markersize=4.5,
            )  # fmt: skip
    if max(cell.ratio_range[1] for cell in study.cells) > 3.0:
        axis.set_yscale("log")
        _plain_ticks(axis)
    else:
        low = min(0.9, *(cell.ratio_range[0] for cell in study.cells))
        axis.set_ylim(low - 0.02, max(1.1, *(c.ratio_range[1] for c in study.cells)) + 0.02)
    _dress(
        axis,
        study,
        "Errors over predicted errors\ncolours as on the left; bars: 95 %; grey: 0.95 to 1.05",
    )


def _beside(at: float, shift: float, study: Study) -> float:
    """Shift a position by a share of the axis, so that curves do not overlap."""
    every = [cell.at for cell in study.cells]
    if study.is_log:
        return float(at * (max(every) / min(every)) ** shift)
    return float(at + shift * (max(every) - min(every)))


def _sources(axis: Axes, study: Study) -> None:
    """Draw the share of each source in the predicted variance, for the first curve."""
    name, cells = next(iter(study.curves.items()))
    bottom = np.zeros(len(cells))
    for source, colour in zip(SOURCES, SOURCE_COLOURS, strict=True):
        part = np.array([100 * cell.share(source) for cell in cells])
        if part.max() < 0.5:
            continue
        axis.bar(
            np.arange(len(cells)), part, 0.75, bottom, color=colour, label=SOURCE_WORDS[source]
        )
        bottom += part
    axis.set_xticks(np.arange(len(cells)), [f"{cell.at:g}" for cell in cells], fontsize=8)
    axis.set_ylim(0, 100)
    axis.set_xlabel(study.axis)
    axis.legend(**_BELOW)
    axis.set_title(
        f"Where the errors come from [% of the variance]\n{name}", fontsize=9.5, loc="left"
    )


def _dress(axis: Axes, study: Study, title: str) -> None:
    axis.set_title(title, fontsize=9.5, loc="left")
    axis.grid(visible=True, color=GRID, linewidth=0.8)
    axis.set_axisbelow(True)
    if study.is_log:
        axis.set_xscale("log")
        axis.xaxis.set_minor_locator(NullLocator())
    shown = _apart(sorted({cell.at for cell in study.cells}), is_log=study.is_log)
    axis.set_xticks(shown, [f"{at:g}" for at in shown], fontsize=8)
    axis.set_xlabel(study.axis)


def _apart(at: list[float], *, is_log: bool) -> list[float]:
    """Select ticks whose texts do not overlap, including the last."""
    place = np.log(at) if is_log else np.array(at)
    room = 0.06 * (place[-1] - place[0])
    kept = [len(at) - 1]
    for k in range(len(at) - 2, -1, -1):
        if place[kept[-1]] - place[k] >= room:
            kept.append(k)
    return [at[k] for k in reversed(kept)]


def _methods(rows: tuple[MethodRow, ...]) -> Figure:
    """Draw the errors of each method: the median of scenes, and the range to the worst tenth."""
    figure = Figure(figsize=(9.0, 3.9), dpi=110, layout="constrained")
    axis = figure.subplots()
    for k, row in enumerate(rows):
        y = len(rows) - k
        axis.plot([1e3 * row.rms_m, 1e3 * row.ninth_m], [y, y], color=COLOURS[0], linewidth=2)
        axis.plot(1e3 * row.rms_m, y, "o", color=COLOURS[0], markersize=6)
        axis.plot(1e3 * row.ninth_m, y, "|", color=COLOURS[0], markersize=10)
    axis.set_yticks(range(len(rows), 0, -1), [row.method for row in rows])
    axis.set_xscale("log")
    axis.grid(visible=True, color=GRID, linewidth=0.8)
    axis.set_xlabel(
        "error of withheld distances [mm]: dot: half of the scenes are better; bar: nine tenths"
    )
    return figure
