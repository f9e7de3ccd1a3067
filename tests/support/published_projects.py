"""Projects of the published scenes: what is known in each, and what is withheld."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from published_scenes import (
    NARRABEEN_ORIGIN,
    Published,
    Targets,
    camera_file,
    write_project,
    write_table,
)

Pair = tuple[str, str]
Known = tuple[Pair, ...]

STILL = "snapshotNarrabeen.JPG"
PLACE = (-33.72990203, 151.30057472, 98.03, 9.5, -16.6, 0)  # as the still's tags have it
VIDEO_CAMERA = (3320, 3319, 1758, 1090, 0.01638, 0.02744, -0.01, 0, 0.00105)
"""Of the 3840 x 2160 video, as published with the frames."""

CROP = np.array([(4000 - 3840) / 2, (2250 - 2160) / 2])
"""Where the middle of a still has a video frame, both read from the same sensor."""

TARGETS = ("GCP1", "GCP2", "GCP3", "GCP4")
LENGTHS = tuple(combinations(TARGETS, 2))


def narrabeen_project(
    scene: Targets, folder: Path, kind: str, adjust: Known, slope_deg: float | None
) -> Path:
    """Some of the six lengths are known, the others withheld; `kind` is still or video."""
    ground = {"height_sigma_m": 0.2}
    if slope_deg is not None:
        ground["slope_sigma_deg"] = slope_deg
    still = kind == "still"
    names = [STILL] if still else [name for name in scene.pixels if name != STILL]
    picks = [(name, t, *uv) for name in names for t, uv in scene.pixels[name].items()]
    lines = []
    for a, b in LENGTHS:
        length = np.linalg.norm(scene.world[a] - scene.world[b])
        use = "adjust" if (a, b) in adjust else "check"
        lines.append((f"{a}-{b}", a, b, length, 0.03, use))
    header = "image,latitude_deg,longitude_deg,height_m,yaw_deg,pitch_deg,roll_deg"
    write_table(folder / "poses.csv", header, [(name, *PLACE) for name in names])
    parameters = np.array(VIDEO_CAMERA)
    if still:
        parameters[2:4] += CROP
        camera = camera_file((4000, 2250), parameters, [15, 15, 15, 15, 2e-3, 2e-3, *[1e-3] * 3])
    else:
        camera = camera_file((3840, 2160), parameters, [10, 10, 10, 10, *[1e-3] * 5])
    return write_project(
        folder,
        camera,
        picks,
        lines,
        images=str(scene.folder / (STILL if still else "frames/*.jpg")),
        poses="exif" if still else "poses.csv",
        world={"origin": dict(NARRABEEN_ORIGIN)},
        ground=ground,
    )


def duck_project(scene: Published, folder: Path, left_out: str, ground: str) -> Path:
    """All targets but one are known; withheld are the distances to that one."""
    used = [name for name in scene.point if name != left_out]
    home = np.array([*scene.point["pier1"][:2], 0.0])
    place = {name: xyz - home for name, xyz in scene.point.items()}
    level = float(np.mean([place[name][2] for name in used]))
    (image,) = scene.pixels
    picks = [(image, name, *uv) for name, uv in scene.pixels[image].items()]
    if ground == "known heights":
        picks = [(*pick, place[str(pick[1])][2] - level) for pick in picks]
    lines = [
        (name, left_out, name, np.linalg.norm(place[left_out] - place[name]), 0.03, "check")
        for name in used
    ]
    control = [(name, *place[name], 0.03) for name in used]
    write_table(folder / "control.csv", "label,east_m,north_m,up_m,sigma_m", control)
    lens = scene.control["camera"]
    parameters = [*(lens[name] for name in ("fx", "fy", "cx", "cy")), *lens["dist"]]
    return write_project(
        folder,
        camera_file((3840, 2160), parameters, [5, 5, 10, 10, 2e-3, 2e-3, 5e-4, 5e-4, 5e-4]),
        picks,
        lines,
        images=str(scene.folder / "*.jpg"),
        control="control.csv",
        ground={
            "height_m": level,
            # the heights of the targets that are known scatter by so much
            "roughness_sigma_m": 0.0 if ground == "known heights" else 0.4,
        },
    )


def _board_lines(
    label: Sequence[str], corner: Sequence[str], known: str, count: int = 200
) -> list[tuple[str, str, str, float, float, str]]:
    """Known lengths between corners of the board, and others, at least three squares long."""
    if known == "six lengths of its rim":
        row, column = ("00", "05", "10"), ("00", "04", "08")
        ends = [
            (f"{row[0]}_{column[0]}", f"{row[0]}_{column[1]}"),
            (f"{row[0]}_{column[2]}", f"{row[1]}_{column[2]}"),
            (f"{row[2]}_{column[2]}", f"{row[2]}_{column[1]}"),
            (f"{row[2]}_{column[0]}", f"{row[1]}_{column[0]}"),
            ("01_01", "09_07"),
            ("09_01", "01_07"),
        ]
    elif known == "six lengths between its corners":
        ends = list(combinations(corner, 2))
    else:
        ends = []
    long = [
        (a, b) for a, b in combinations(label, 2) if _apart(a, b) > 0.179 and (a, b) not in ends
    ]
    chosen = np.random.default_rng(0).permutation(len(long))[:count]
    rows = [(f"known {a} {b}", a, b, _apart(a, b), 0.0005, "adjust") for a, b in ends]
    checks = [long[k] for k in chosen]
    return rows + [(f"{a} {b}", a, b, _apart(a, b), 0.0005, "check") for a, b in checks]


def _apart(a: str, b: str) -> float:
    """Between two corners `row_column` of 60 mm squares [m]."""
    (row, column), (other_row, other_column) = (map(int, name.split("_")) for name in (a, b))
    return 0.06 * float(np.hypot(row - other_row, column - other_column))


def board_project(scene: Published, folder: Path, photo: str, known: str) -> Path:
    """One photo of the board, some of it known, 200 other lengths withheld."""
    corner = ("00_00", "00_08", "10_08", "10_00")
    lens = scene.control["camera"]
    parameters = [*(lens[name] for name in ("fx", "fy", "cx", "cy")), *lens["dist"]]
    sigma = [*lens["fc_3sigma"], *lens["cc_3sigma"], *lens["kc_3sigma"]]
    content = {}
    if known == "four corners":
        content["control"] = "control.csv"
        rows = [(name, *scene.point[name], 0.0005) for name in corner]
        write_table(folder / "control.csv", "label,east_m,north_m,up_m,sigma_m", rows)
    return write_project(
        folder,
        camera_file((4000, 2250), parameters, np.array(sigma) / 3),
        [(photo, name, *uv) for name, uv in scene.pixels[photo].items()],
        _board_lines(sorted(scene.point), corner, known),
        images=str(scene.folder / photo),
        # bowed by 2 mm either way (published with the photos): 1.2 mm rms
        ground={"height_sigma_m": 0.002, "slope_sigma_deg": 0.1, "roughness_sigma_m": 0.0012},
        **content,
    )
