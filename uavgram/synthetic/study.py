"""Studies of `uavgram study`: their grids, computation and output."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from uavgram.errors import UavgramError, suggest_spelling
from uavgram.io.json_codec import encode, replace_not_finite
from uavgram.io.outputs import stage_output
from uavgram.model.simulation import SOURCES, MethodRow, Study
from uavgram.pipeline.parallel import Progress, run_in_processes, silent
from uavgram.pipeline.threads import one_blas_thread
from uavgram.synthetic.pose_methods import LIMIT_SETTINGS, compare_methods
from uavgram.synthetic.single_photos import Setting, StudyCell, StudyScene, simulate_cell
from uavgram.views.study import figure_files, render_study_page

STUDY_SCHEMA = 1

Numbers = Mapping[str, float | str]
"""Values of a scene, by name."""

Scenes = Mapping[str, Numbers]
"""Scenes by the name of a curve."""


@dataclass(frozen=True, kw_only=True)
class StudyGrid:
    """A study before it is made; fields as of `Study`, with places instead of cells."""

    title: str
    question: str
    axis: str
    is_log: bool
    places: tuple[StudyCell, ...]


@dataclass(frozen=True, kw_only=True)
class _Axis:
    """Quantity that varies along the curves of a study: a number of the scene, and its label."""

    key: str
    values: tuple[float, ...]
    unit: str
    factor: float = 1.0

    def places(self, curve: str, others: Numbers) -> tuple[StudyCell, ...]:
        """Return the places along one curve; the other values are constant along it."""
        return tuple(
            StudyCell(
                curve=curve,
                at=self.factor * value,
                label=_label(self.factor * value, self.unit),
                scene=_scene({self.key: value, **others}),
            )
            for value in self.values
        )


def _grid(
    words: tuple[str, str, str], axis: _Axis, curves: Scenes, *, is_log: bool = False
) -> StudyGrid:
    """Return a study along one axis: its title, its question and the name of its axis."""
    title, question, name = words
    places = tuple(
        place for curve, others in curves.items() for place in axis.places(curve, others)
    )
    return StudyGrid(title=title, question=question, axis=name, is_log=is_log, places=places)


def _label(value: float, unit: str) -> str:
    return f"{value:g}°" if unit == "°" else f"{value:g} {unit}"


def _scene(numbers: dict[str, Any]) -> StudyScene:
    return StudyScene(**numbers)


def _heights(*heights_m: float) -> Scenes:
    return {f"from {height:g} m": {"height_m": height} for height in heights_m}


MM, PERCENT = 1e3, 1e2
TAPES: Scenes = {
    "picks to 0.8 px": {},
    "picks to 0.3 px": {"pick_px": 0.3},
    "picks to 1.5 px": {"pick_px": 1.5},
    "picks to 3 px": {"pick_px": 3.0},
    "0.8 px, and a tape scale of 0.1 %": {"tape_scale": 1e-3},
}
CAMERAS: Scenes = {
    "looking 20° to the side": {},
    "20°, principal point to 30 px": {"centre_px": 30.0},
    "20°, principal point to 100 px": {"centre_px": 100.0},
    "looking 50° to the side": {"tilt_deg": 50.0},
    "20°, one length and the log": {"lines": 1},
}

STUDY_GRIDS: dict[str, StudyGrid] = {
    "lengths": _grid(
        (
            "Errors in the reference lengths",
            "When does the error of the taped lengths matter more than that of the picks?",
            "standard deviation of a taped length [mm]",
        ),
        _Axis(
            key="tape_m", values=(0.001, 0.003, 0.01, 0.02, 0.03, 0.05, 0.1), unit="mm", factor=MM
        ),
        TAPES,
        is_log=True,
    ),
    "picks": _grid(
        (
            "Errors of picking",
            "What does it cost to click less carefully?",
            "standard deviation of a pick [px]",
        ),
        _Axis(key="pick_px", values=(0.1, 0.3, 0.8, 1.5, 3.0), unit="px"),
        _heights(30.0, 60.0, 100.0),
        is_log=True,
    ),
    "view": _grid(
        (
            "Camera height and look direction",
            "How high may the camera be, and how far may it look to the side?",
            "tilt of the view from straight down [degrees]",
        ),
        _Axis(key="tilt_deg", values=(0.0, 10.0, 20.0, 30.0, 45.0, 60.0), unit="°"),
        _heights(32.0, 50.0, 80.0, 120.0),
    ),
    "camera": _grid(
        (
            "Focal length and principal point",
            "How well must the camera be calibrated?",
            "standard deviation of the focal length [%]",
        ),
        _Axis(key="focal_share", values=(0.0, 0.002, 0.01, 0.02, 0.05), unit="%", factor=PERCENT),
        CAMERAS,
    ),
}
"""Studies by name, in the order of pages."""


JSON_FILE, PAGE_FILE = "study.json", "study.html"
METHODS = "methods"
STUDY_NAMES = (*STUDY_GRIDS, METHODS)

METHOD_SETTINGS = (Setting(name="usual"), *LIMIT_SETTINGS)
USUAL_DRAW_RATIO = 4
"""Ratio of scene numbers: fewer suffice to show where a method fails."""


def list_studies(asked: str) -> tuple[str, ...]:
    """Return the studies of a name, or all.

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
        return STUDY_NAMES
    if asked in STUDY_NAMES:
        return (asked,)
    hint = suggest_spelling(asked, [*STUDY_NAMES, "all"])
    raise UavgramError(
        f"there is no study {asked!r}{hint and f' ({hint})'}: "
        f"name one of {', '.join(STUDY_NAMES)}, or all of them by uavgram study all"
    )


def make_study(name: str, repetitions: int, workers: int = 0, progress: Progress = silent) -> Study:
    """Run a study.

    Parameters
    ----------
    name
        One of `STUDY_NAMES`.
    repetitions
        Of each of its cells.
    workers
        Processes; 0: as many as there are cores.
    progress
        Shows the loop.
    """
    began = time.perf_counter()
    if name == METHODS:
        made = run_in_processes(partial(_setting, repetitions), METHOD_SETTINGS, workers)
        rows = [
            row for rows in progress(made, f"study of {name}", len(METHOD_SETTINGS)) for row in rows
        ]
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
    grid = STUDY_GRIDS[name]
    found = run_in_processes(partial(simulate_cell, repetitions=repetitions), grid.places, workers)
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
    """Compare all methods in one setting."""
    count = scenes if setting == METHOD_SETTINGS[0] else scenes // USUAL_DRAW_RATIO
    with one_blas_thread():
        return compare_methods(setting, max(count, 20))


def make_studies(
    names: Iterable[str],
    folder: Path,
    repetitions: int,
    workers: int = 0,
    progress: Progress = silent,
) -> Iterator[Study]:
    """Run studies one after the other; after each, write a page of those made so far.

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
        with stage_output(folder) as hidden:
            write_studies(studies, hidden / JSON_FILE)
            for file, content in figures.items():
                (hidden / file).write_bytes(content)
            page = render_study_page(studies, figures)
            (hidden / PAGE_FILE).write_text(page, encoding="utf-8")
        yield made


def write_studies(studies: tuple[Study, ...], path: Path) -> None:
    """Write study.json: metres, seconds and shares; null for missing values.

    Parameters
    ----------
    studies
        Studies to write.
    path
        Output file.
    """
    record = {
        "schema": STUDY_SCHEMA,
        "sources": list(SOURCES),
        "studies": replace_not_finite(encode(studies)),
    }
    path.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
