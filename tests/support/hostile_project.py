"""Writes a made-up survey as the folder that `uavgram run` takes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from hostile_surveys import CLOCK_SIGMA_S, LENGTH_SIGMA_M, PICK_SIGMA_PX, HostileSurvey
from hostile_ties import MATCH_SIGMA_PX, TIE_SIGMA_PX

from uavgram.io.logs.tlog.writer import write_tlog
from uavgram.model.survey import TiePicks

Heights = Literal["free", "unstated", "stated"]
HEIGHT_SIGMA_M = 0.05
FOUND_COLUMNS = ",sigma_px,source,from_image,from_u_px,from_v_px"


def write_project(
    survey: HostileSurvey,
    folder: Path,
    options: Mapping[str, object] | None = None,
    heights: Heights = "free",
) -> Path:
    """Write a survey as a user would have it, and return its project file.

    Parameters
    ----------
    survey
        To write.
    folder
        Made where it is missing.
    options
        Further keys of project.yaml, those inside others with dots: ``solve.noise: stated``. One
        that begins with ``camera.`` goes to camera.yaml.
    heights
        What the picks of points off the ground state: ``free``, nothing, or the height with the
        error and sigma of HEIGHT_SIGMA_M.
    """
    folder.mkdir(parents=True, exist_ok=True)
    size = survey.camera.width_px, survey.camera.height_px
    for name in survey.photo:  # no two of the same bytes: they would count as copies
        (folder / f"{name}.jpg").write_bytes(_black_jpeg(*size) + name.encode())
    tables = {
        "picks": _pick_rows(survey, _height_columns(survey, heights)),
        "lines": _line_rows(survey),
        "measure": _measure_rows(survey),
    }
    for table, rows in tables.items():
        (folder / f"{table}.csv").write_text("\n".join(rows) + "\n")
    camera: dict[str, object] = {
        "name": "made-up camera",
        "model": "brown",
        "width_px": survey.camera.width_px,
        "height_px": survey.camera.height_px,
        "parameters": survey.camera.lens.tolist(),
        "covariance": survey.camera.covariance.tolist(),
    }
    project: dict[str, object] = {
        "name": "made-up survey",
        "images": "*.jpg",
        "camera": "camera.yaml",
        **{table: f"{table}.csv" for table in tables},
        "picks_sigma_px": PICK_SIGMA_PX,
    }
    if survey.log is not None:
        write_tlog(folder / "flight.tlog", survey.log)
        project["log"] = "flight.tlog"
        form = "%Y%m%d_%H%M%S_%f"
        time = {"source": "filename", "filename_format": form, "offset_s": 0.0}
        project["time"] = time | {"offset_sigma_s": CLOCK_SIGMA_S}
    for key, value in (options or {}).items():
        first, _, rest = key.partition(".")
        _put(*((camera, rest) if first == "camera" and rest else (project, key)), value)
    for name, content in {"camera": camera, "project": project}.items():
        (folder / f"{name}.yaml").write_text(json.dumps(content, indent=1))  # JSON is YAML
    return folder / "project.yaml"


def _put(document: dict[str, object], key: str, value: object) -> None:
    first, _, rest = key.partition(".")
    if not rest:
        document[first] = value
        return
    inner = document.setdefault(first, {})
    assert isinstance(inner, dict)
    _put(inner, rest, value)


@lru_cache
def _black_jpeg(width_px: int, height_px: int) -> bytes:
    black = np.zeros((height_px, width_px), np.uint8)
    return cv2.imencode(".jpg", black)[1].tobytes()


def _height_columns(survey: HostileSurvey, heights: Heights) -> list[str]:
    """(k,) what a pick's row has at its end; none where no point is known to be off the ground."""
    if heights == "unstated" or not survey.off_ground.any():
        return []
    if heights == "free":
        return [",free," if off else ",," for off in survey.off_ground]
    error = HEIGHT_SIGMA_M * np.random.default_rng(len(survey.pick_px)).standard_normal(
        len(survey.height_m)
    )
    stated = zip(survey.off_ground, survey.height_m + error, strict=True)
    return [f",{height:.4f},{HEIGHT_SIGMA_M}" if off else ",," for off, height in stated]


def _pick_rows(survey: HostileSurvey, height: Sequence[str]) -> Iterator[str]:
    columns = ",height_m,height_sigma_m" if height else ""
    found = survey.matches
    yield f"image,label,u_px,v_px{columns}" + (FOUND_COLUMNS if found is not None else "")
    at = {}
    for photo, label, (u, v) in zip(
        survey.pick_photo, survey.pick_label, survey.pick_px, strict=True
    ):
        end = height[label] if height else ""
        at[photo, label] = f"{u:.3f},{v:.3f}"
        yield f"{survey.photo[photo]}.jpg,P{label},{u:.3f},{v:.3f}{end}" + ",,,,," * (
            found is not None
        )
    if found is None:
        return
    for photo, label, (u, v), source in zip(
        found.photo, found.point, found.pixel_px, found.from_photo, strict=True
    ):
        end = height[label] if height else ""
        made = f"{MATCH_SIGMA_PX},match,{survey.photo[source]}.jpg,{at[source, label]}"
        yield f"{survey.photo[photo]}.jpg,P{label},{u:.3f},{v:.3f}{end},{made}"


def tie_picks(survey: HostileSurvey) -> TiePicks:
    """The tie points, as a table has them."""
    found = survey.ties
    assert found is not None
    return TiePicks(
        image=tuple(f"{survey.photo[k]}.jpg" for k in found.photo),
        tie=tuple(f"t{k}" for k in found.point),
        pixel_px=found.pixel_px,
        sigma_px=np.full(len(found.photo), TIE_SIGMA_PX),
    )


def _line_rows(survey: HostileSurvey) -> Iterator[str]:
    along = ",horizontal" if survey.level else ""
    yield "name,from,to,length_m,sigma_m" + (",along" if survey.level else "")
    for k, ((a, b), length) in enumerate(zip(survey.line, survey.line_length_m, strict=True)):
        yield f"L{k},P{a},P{b},{length:.5f},{LENGTH_SIGMA_M}{along}"


def _measure_rows(survey: HostileSurvey) -> Iterator[str]:
    yield "name,kind,points"
    for name, (kind, at) in survey.measure.items():
        yield f"{name},{kind},{';'.join(f'P{k}' for k in at)}"
