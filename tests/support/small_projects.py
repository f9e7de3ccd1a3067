"""The simulated survey with small blank photos, to be broken, and what the command line says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
import yaml

from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.scenario import CameraSpec, Scenario
from uavgram.synthetic.survey import simulate

WIDTH_PX, HEIGHT_PX = 400, 300


def write_small_survey(folder: Path) -> Path:
    """Write the survey, and return its project file."""
    full = CameraSpec()
    pixels = [WIDTH_PX / full.width_px] * 4 + [1.0] * 5
    camera = CameraSpec(
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        parameters=tuple(np.multiply(full.parameters, pixels).tolist()),
        sigma=tuple(np.multiply(full.sigma, pixels).tolist()),
    )
    survey = simulate(replace(Scenario(), camera=camera))
    photos = (np.full((HEIGHT_PX, WIDTH_PX, 3), 90, np.uint8) for _ in survey.frame_id)
    return write_demo(folder, survey, photos)


class Done(NamedTuple):
    """How a command ended, and what it said."""

    status: int
    stdout: str
    stderr: str


class Command(Protocol):
    """The command line in this process."""

    def __call__(self, *arguments: object) -> Done: ...


class Fails(Protocol):
    """Run the project, which must fail and name every place; gives the message."""

    def __call__(self, *places: object) -> str: ...


class Project:
    """A copy of the small project that a test may break."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / "project.yaml"
        self.out = folder / "out"

    def __truediv__(self, name: str) -> Path:
        return self.folder / name

    def edit(self, name: str, old: str, new: str) -> None:
        """Replace the first occurrence of some text in a file."""
        text = (self.folder / name).read_text(encoding="utf-8")
        assert old in text, f"{name} holds no {old!r}"
        (self.folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")

    def cell(self, name: str, row: int, column: str, value: str) -> None:
        """Set one cell of a CSV file; rows count from 1, below the header."""
        lines = (self.folder / name).read_text(encoding="utf-8").splitlines()
        cells = lines[row].split(",")
        cells[lines[0].split(",").index(column)] = value
        lines[row] = ",".join(cells)
        (self.folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")

    def set(self, **changes: object) -> None:
        """Change keys of project.yaml; None removes one."""
        data = yaml.safe_load(self.path.read_text(encoding="utf-8")) | changes
        kept = {key: value for key, value in data.items() if value is not None}
        self.path.write_text(yaml.safe_dump(kept, sort_keys=False), encoding="utf-8")

    def outputs(self) -> dict[str, bytes]:
        """Every file of the output folder, hidden ones too, with its bytes."""
        files = self.out.rglob("*") if self.out.exists() else ()
        return {str(p.relative_to(self.out)): p.read_bytes() for p in files if p.is_file()}
