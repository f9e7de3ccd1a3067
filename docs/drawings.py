"""Drawings of the conventions, made at each build; angles are turned by the package's own code."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
import numpy as np

mpl.rcParams.update({"svg.hashsalt": "uavgram", "font.size": 11, "svg.fonttype": "path"})

ROOT = Path(__file__).parents[1]
INK, RED, GREEN, BLUE = "#1b1b1b", "#b3261e", "#1a6b36", "#174ea6"


def draw(folder: Path) -> None:
    """Write all drawings as SVG."""
    for name, make in {
        "image": _image,
        "frames": _frames,
        "pitch": _pitch,
        "slope": _slope,
        "likelihood": _likelihood,
        "rooms": _rooms,
    }.items():
        figure = make()
        metadata = {"Date": None, "Creator": None}
        figure.savefig(folder / f"{name}.svg", bbox_inches="tight", metadata=metadata)
        plt.close(figure)


def _blank(width: float, height: float) -> tuple[Any, Any]:
    figure, axes = plt.subplots(figsize=(width, height))
    axes.set_aspect("equal")
    axes.axis("off")
    return figure, axes


def _arrow(axes: Any, start: Any, end: Any, text: str, colour: str = INK) -> None:  # noqa: ANN401
    axes.annotate(
        "", xy=end, xytext=start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.8}
    )
    start, end = np.asarray(start, float), np.asarray(end, float)
    beyond = end + 0.14 * (end - start) / np.linalg.norm(end - start)
    axes.text(*beyond, text, color=colour, ha="center", va="center")


def _image() -> Any:  # noqa: ANN401
    figure, axes = _blank(6, 3)
    for u in range(7):
        axes.plot([u - 0.5, u - 0.5], [-0.5, 3.5], color="#9a9a9a", lw=0.8)
    for v in range(5):
        axes.plot([-0.5, 5.5], [v - 0.5, v - 0.5], color="#9a9a9a", lw=0.8)
    axes.plot(0, 0, "o", color=RED)
    axes.text(0.15, 0.3, "(0, 0)", color=RED)
    axes.plot(3.4, 2.2, "x", color=BLUE, ms=9, mew=2)
    axes.text(3.55, 2.05, "u = 3.4, v = 2.2", color=BLUE)
    _arrow(axes, (-0.5, -0.9), (1.6, -0.9), "u", INK)
    _arrow(axes, (-0.9, -0.5), (-0.9, 1.6), "v", INK)
    axes.set(xlim=(-1.4, 5.8), ylim=(3.8, -1.4))
    return figure


def _frames() -> Any:  # noqa: ANN401
    figure, axes = _blank(8, 3.2)
    for x, title, arrows in (
        (0, "world", [((0.8, 0.25), "x east", RED), ((0.35, 0.75), "y north", GREEN)]),
        (3, "body (autopilot)", [((0.35, 0.75), "x nose", RED), ((0.8, 0.25), "y right", GREEN)]),
        (6, "camera", [((0.8, 0.25), "x right", RED), ((0.1, -0.95), "y down", GREEN)]),
    ):
        for end, text, colour in arrows:
            _arrow(axes, (x, 0), (x + end[0], end[1]), text, colour)
        axes.text(x + 0.3, -1.5, title, ha="center", weight="bold")
    _arrow(axes, (0, 0), (0, 1.0), "z up", BLUE)
    _arrow(axes, (3, 0), (3, -0.95), "z down", BLUE)
    _arrow(axes, (6, 0), (6.45, 0.7), "z optical axis", BLUE)
    axes.set(xlim=(-0.8, 7.8), ylim=(-1.8, 1.4))
    return figure


def _pitch() -> Any:  # noqa: ANN401
    from uavgram.geometry.motion.rotation import matrix_from_ypr  # noqa: PLC0415

    figure, axes = _blank(7, 3.2)
    axes.plot([-0.3, 6.4], [0, 0], color="#7a6a50", lw=2)
    for place, pitch_deg in ((0.5, -90.0), (2.2, -45.0), (4.4, 0.0)):
        axis = matrix_from_ypr(0.0, np.radians(pitch_deg), 0.0)[..., :, 0].ravel()
        end = np.array([place, 2.0]) + 1.3 * np.array([axis[0], -axis[2]])
        _arrow(axes, (place, 2.0), end, f"{pitch_deg:.0f}°", BLUE)
        axes.plot(place, 2.0, "s", color=INK, ms=8)
    axes.text(
        3.0, 2.6, "nose of the vehicle to the right; pitch_deg of the optical axis", ha="center"
    )
    axes.text(3.0, -0.35, "ground", ha="center", color="#7a6a50")
    return figure


def _slope() -> Any:  # noqa: ANN401
    figure, axes = _blank(7, 2.6)
    axes.plot([0, 6], [0, 0], "--", color="#808080")
    axes.plot([0, 6], [-0.45, 0.75], color="#7a6a50", lw=2)
    axes.plot(3, 0.15, "o", color=INK)
    axes.text(2.95, 0.35, "centroid of the scene", ha="right")
    axes.annotate("", xy=(3, 0.15), xytext=(3, 0), arrowprops={"arrowstyle": "<->", "color": BLUE})
    axes.text(3.1, -0.2, "ground.height_m", color=BLUE)
    axes.text(6.1, 0.75, "ground: slopes turn about the centroid", va="center")
    axes.text(6.1, 0, "z = 0: height of the origin", va="center", color="#606060")
    axes.plot([4.6, 4.6], [0.47, 0.95], color=RED)
    axes.plot(4.6, 0.95, "o", color=RED)
    axes.text(4.6, 1.1, "height_m of a pick", ha="center", color=RED)
    return figure


def _likelihood() -> Any:  # noqa: ANN401
    figure, axes = plt.subplots(figsize=(8, 3.6))
    axes.axis("off")
    observed = ("picked pixels", "known lengths", "control points", "known things")
    prior = ("flight log", "calibration", "mount", "ground", "tape")
    unknown = ("pose of each photo", "two coordinates\nof each ground point", "what photos share")
    for x, title, words, colour in (
        (0, "observed", observed, BLUE),
        (1, "unknown", unknown, RED),
        (2, "known beforehand", prior, GREEN),
    ):
        axes.text(x, 1.0, title, ha="center", weight="bold", color=colour)
        for row, word in enumerate(words):
            y = 0.85 - 0.8 * (row + 0.5) / len(words)
            box = {"boxstyle": "round", "fc": "white", "ec": colour}
            axes.text(x, y, word, ha="center", va="center", bbox=box)
    for start, end in ((0.35, 0.66), (1.65, 1.34)):
        axes.annotate(
            "",
            xy=(end, 0.45),
            xytext=(start, 0.45),
            arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.8},
        )
    axes.set(xlim=(-0.4, 2.4), ylim=(0, 1.1))
    return figure


PURPOSES = {
    "cli": "commands: arguments to one call, exit status",
    "picking": "the local page: click, see values, write results",
    "synthetic": "surveys of known truth: demo, plan, study",
    "pipeline": "readers, stages and writers in their order",
    "config": "YAML that people write, checked",
    "io": "all other files, both directions",
    "views": "report, drawings, recording",
    "stages": "the steps of a run",
    "imaging": "whatever looks at pixels",
    "estimation": "likelihood, solver, clocks, reliability, propagation",
    "geometry": "formulas on plain arrays, with derivatives",
    "model": "frozen data, checked when it is made",
}


def floors() -> list[list[str]]:
    """Return the rooms of the package, floor by floor from the top, as the contract has them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = project["tool"]["importlinter"]["contracts"][0]["layers"]
    rooms = [layer.replace("uavgram.", "").split(" | ") for layer in layers]
    return [floor for floor in rooms if (ROOT / "uavgram" / floor[0]).is_dir()]


def imports_between_rooms() -> dict[str, set[str]]:
    """Find which rooms each room imports, as its files say."""
    rooms = {room for floor in floors() for room in floor}
    found: dict[str, set[str]] = {}
    for room in rooms:
        files = (ROOT / "uavgram" / room).rglob("*.py")
        text = "\n".join(file.read_text(encoding="utf-8") for file in files)
        named = re.findall(r"^\s*(?:from|import) uavgram\.(\w+)", text, re.MULTILINE)
        found[room] = (set(named) & rooms) - {room}
    return found


def direct_arrows() -> set[tuple[str, str]]:
    """Find the imports between rooms to which no others lead as well."""
    imports = imports_between_rooms()

    def reached(room: str) -> set[str]:
        return {far for near in imports[room] for far in (near, *reached(near))}

    return {
        (room, other)
        for room, others in imports.items()
        for other in others
        if not any(other in reached(between) for between in others - {other})
    }


def _rooms() -> Any:  # noqa: ANN401
    figure, axes = plt.subplots(figsize=(10, 9.5))
    axes.axis("off")
    places = {}
    for row, floor in enumerate(floors()):
        width = 3.7 if len(floor) > 1 else 5.6
        for k, room in enumerate(floor):
            x, y = (k - (len(floor) - 1) / 2) * 3.9, -1.15 * row
            places[room] = x, y
            shape = {"boxstyle": "round,pad=0,rounding_size=0.12", "fc": "#eef3fb", "ec": BLUE}
            corner = x - width / 2, y - 0.35
            axes.add_patch(mpl.patches.FancyBboxPatch(corner, width, 0.7, **shape))
            axes.text(x, y + 0.12, room, ha="center", va="center", weight="bold", color=BLUE)
            axes.text(x, y - 0.2, PURPOSES[room], ha="center", va="center", fontsize=9)
    for start, end in sorted(direct_arrows()):
        (x0, y0), (x1, y1) = places[start], places[end]
        aside = 0.12 * (x1 - x0)  # arrows that meet in a room come side by side
        arrow = {"arrowstyle": "-|>", "color": INK, "lw": 1.3, "shrinkA": 1, "shrinkB": 1}
        ends = (x1 - aside, y1 + 0.36), (x0 + aside, y0 - 0.36)
        axes.annotate("", xy=ends[0], xytext=ends[1], arrowprops=arrow)
    axes.set(xlim=(-6, 6), ylim=(-1.15 * (len(floors()) - 1) - 0.6, 0.6))
    return figure
