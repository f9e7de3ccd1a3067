"""Studies, made and written: what `uavgram study` does."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

from uavgram.errors import UavgramError, near_miss
from uavgram.io.outputs import staged_output
from uavgram.io.results.study_json import write_studies
from uavgram.model.study.methods import MethodRow
from uavgram.model.study.study import Study
from uavgram.pipeline.parallel import in_processes
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.study.grids import GRIDS
from uavgram.pipeline.study.method_scenes import Setting
from uavgram.pipeline.study.methods import LIMITS, compared
from uavgram.pipeline.study.photo_cell import photo_cell
from uavgram.pipeline.threads import one_blas_thread
from uavgram.views.study.figures import figure_files
from uavgram.views.study.page import write_study_page

JSON_FILE, PAGE_FILE = "study.json", "study.html"
METHODS = "methods"
NAMES = (*GRIDS, METHODS)

SETTINGS = (Setting(name="usual"), *LIMITS)
USUAL_TO_LIMITS = 4
"""Of scenes: where a method ends shows in fewer."""


def study_names(asked: str) -> tuple[str, ...]:
    """Studies of a name, or all.

    Parameters
    ----------
    asked
        A name, or ``all``.

    Raises
    ------
    UavgramError
        There is no such study.
    """
    if asked == "all":
        return NAMES
    if asked in NAMES:
        return (asked,)
    hint = near_miss(asked, [*NAMES, "all"])
    raise UavgramError(
        f"there is no study {asked!r}{hint and f' ({hint})'}: name one of {', '.join(NAMES)}, "
        "or all of them by uavgram study all"
    )


def make_study(name: str, repetitions: int, workers: int = 0, progress: Progress = silent) -> Study:
    """Make a study.

    Parameters
    ----------
    name
        One of `NAMES`.
    repetitions
        Of each of its cells.
    workers
        Processes; 0: as many as there are cores.
    progress
        Shows the loop.
    """
    began = time.perf_counter()
    if name == METHODS:
        made = in_processes(partial(_setting, repetitions), SETTINGS, workers)
        rows = [row for rows in progress(made, f"study of {name}", len(SETTINGS)) for row in rows]
        return Study(
            name=name,
            title="Ways to find the pose, compared",
            question="Which kind of known thing places a photo best?",
            axis="",
            is_log=False,
            cells=(),
            seconds=time.perf_counter() - began,
            methods=tuple(rows),
        )
    grid = GRIDS[name]
    found = in_processes(partial(photo_cell, repetitions=repetitions), grid.places, workers)
    return Study(
        name=name,
        title=grid.title,
        question=grid.question,
        axis=grid.axis,
        is_log=grid.is_log,
        cells=tuple(progress(found, f"study of {name}", len(grid.places))),
        seconds=time.perf_counter() - began,
    )


def _setting(scenes: int, setting: Setting) -> list[MethodRow]:
    """All methods in one setting."""
    count = scenes if setting == SETTINGS[0] else scenes // USUAL_TO_LIMITS
    with one_blas_thread():
        return compared(setting, max(count, 20))


def make_studies(
    names: Iterable[str],
    folder: Path,
    repetitions: int,
    workers: int = 0,
    progress: Progress = silent,
) -> Iterator[Study]:
    """Make studies one after the other; after each, the folder has a page of those made so far.

    Parameters
    ----------
    names
        Of the studies.
    folder
        Of page, figures and tables.
    repetitions, workers, progress
        As for `make_study`.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    studies: tuple[Study, ...] = ()
    figures: dict[str, bytes] = {}
    for name in names:
        made = make_study(name, repetitions, workers, progress)
        studies, figures = (*studies, made), figures | figure_files((made,))
        with staged_output(folder) as hidden:
            write_studies(studies, hidden / JSON_FILE)
            for file, content in figures.items():
                (hidden / file).write_bytes(content)
            write_study_page(studies, figures, hidden / PAGE_FILE)
        yield made
