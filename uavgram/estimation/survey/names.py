"""Observations and priors in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.suspicion import Member, Suspicion
from uavgram.model.camera.calibration import parameter_names
from uavgram.model.naming import listed
from uavgram.model.survey.known import KnownThing

FACTORS = {"deg": float(np.rad2deg(1.0)), "ppm": 1e6, "%": 100.0}
"""How many of a unit there are in the unit inside; else 1."""

PLANE_OF = "plane of "
"""Opening of the group of an area's plane, where there are several areas."""

POSE_AXES = ("east", "north", "up", "image x axis", "image y axis", "optical axis")
CONTROL_AXES = ("east", "north", "up")
PRIOR_WORDS = {
    "boresight": ("boresight x", "boresight y", "boresight z"),
    "lever_arm": ("lever arm forward", "lever arm right", "lever arm down"),
    "position_bias": ("position bias east", "position bias north", "position bias up"),
    "heading_bias": ("heading bias",),
    "clock": ("clock offset",),
    "clock_drift": ("clock drift",),
    "readout": ("readout time",),
    "plane": ("ground height", "ground slope east", "ground slope north"),
}
PRIOR_UNITS = {
    "boresight": ("deg",) * 3,
    "lever_arm": ("m",) * 3,
    "position_bias": ("m",) * 3,
    "heading_bias": ("deg",),
    "clock": ("s",),
    "clock_drift": ("ppm",),
    "readout": ("s",),
    "plane": ("m", "deg", "deg"),
    "roughness": ("m",),
    "heights": ("m",),
    "control": ("m",) * 3,
    "telemetry": ("m",) * 3 + ("deg",) * 3,
    "lengths": ("m",),
    "tape": ("%",),
    "pixels": ("px",) * 2,
}
COUNTS = ("none", "one", "both", "all three", "all four", "all five", "all six")


KNOWN_WORDS = {
    "line_distance": "distance from a line",
    "collinear": "straight line",
    "parallel": "pair of parallel lines",
    "coplanar": "plane",
    "level": "level line",
    "equal_lengths": "set of equal lengths",
    "polyline": "length along points",
    "on_line": "place of the line",
}
"""Of kinds of known things whose own name says less."""

STEADY_CHANGE = "something that changes steadily over the flight"

MOST_RIVALS = 4
"""Other possible blunders that are named."""


class Subjects(TypedDict, total=False):
    """Names of what a message speaks of, by the fields of a message."""

    frames: tuple[str, ...]
    labels: tuple[str, ...]
    lengths: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Names:
    """Names of the observations of an adjusted survey.

    Attributes
    ----------
    adjustment
        The adjusted survey.
    """

    adjustment: Adjustment

    def observation(self, member: Member) -> str:
        """``pick of 'P' in 'img1.jpg'`` and the like, without an article."""
        survey, row = self.adjustment.survey, member.row
        if member.kind == "pixels":
            frame, label = self.pick(row)
            return f"pick of {label!r} in {frame!r}"
        if member.kind == "lengths":
            return f"length {self.length(row)}"
        if member.kind == "known":
            return f"known {self.known(row)}"
        if member.kind == "telemetry":
            return f"log's pose of {self.frame(row)!r} ({POSE_AXES[member.axis]})"
        if member.kind == "control":
            return f"control point {survey.label[survey.control_label[row]]!r}"
        return self.prior(member)

    def cause(self, member: Member) -> str:
        """What may be wrong where an observation does not fit, without an article.

        A drift of the clock is the one unknown that grows steadily over a flight: it takes up
        whatever does, most often something else, so no clock is blamed.
        """
        return STEADY_CHANGE if member.kind == "clock_drift" else self.observation(member)

    def length(self, row: int) -> str:
        """``'L2' ('R3' to 'R4')``: a known length of the adjustment."""
        survey, line = self.adjustment.survey, self.adjustment.problem.line_index[row]
        start, end = survey.label[survey.line_start[line]], survey.label[survey.line_end[line]]
        return named_ends(survey.line_name[line] if survey.line_name else "", start, end)

    def known(self, row: int) -> str:
        """``right angle 'corner' ('A', 'B', 'C')``: the known thing of a row of its group."""
        thing = self.known_thing(row)
        survey = self.adjustment.survey
        return named_thing(thing.kind, thing.name, [survey.label[k] for k in thing.label])

    def known_thing(self, row: int) -> KnownThing:
        """The known thing of a row of its group."""
        problem = self.adjustment.problem
        return problem.known[int(problem.known_thing[row])]

    def prior(self, member: Member) -> str:
        """``boresight x``, ``fx``, and the like."""
        survey, row = self.adjustment.survey, member.row
        if member.kind == "calibration":
            camera = survey.calibration
            return parameter_names(camera.model, len(camera.parameters))[member.axis]
        if member.kind == "control":
            label = survey.label[survey.control_label[row]]
            return f"control {label!r} {CONTROL_AXES[member.axis]}"
        if member.kind == "telemetry":
            return POSE_AXES[member.axis]
        own = {
            "tape": lambda: f"scale of {self.tape(row)}",
            "roughness": lambda: f"departure of {self.label(member)!r} from the plane",
            "heights": lambda: f"height of {self.label(member)!r}",
        }
        if member.kind in own:
            return own[member.kind]()
        if member.kind.startswith(PLANE_OF):
            return f"{PRIOR_WORDS['plane'][row]} of {member.kind.removeprefix(PLANE_OF)!r}"
        return PRIOR_WORDS[member.kind][row]

    def label(self, member: Member) -> str:
        """Of the point whose height a row is about."""
        third = self.adjustment.problem.third
        rows = third.rough if member.kind == "roughness" else third.stated
        return str(self.adjustment.survey.label[int(rows[member.row])])

    def tape(self, row: int) -> str:
        """``the tape``, or ``the tape 'red'``."""
        name = self.adjustment.problem.tapes[row]
        return f"the tape {name!r}" if name else "the tape"

    def pick(self, row: int) -> tuple[str, str]:
        """Frame and label of a pick of the adjustment."""
        survey = self.adjustment.survey
        frame, label = survey.pick_frame[row], survey.pick_label[row]
        return survey.frame_id[frame], survey.label[label]

    def frame(self, row: int) -> str:
        """Name of the frame of a row of the telemetry."""
        telemetry = self.adjustment.survey.telemetry
        assert telemetry is not None  # noqa: S101  (there is a row of it)
        return str(self.adjustment.survey.frame_id[telemetry.frame_index[row]])

    def unit(self, member: Member) -> tuple[str, float]:
        """Unit in which an error is stated, and how many of it there are in the unit inside."""
        if member.kind == "calibration":
            name = self.prior(member)
            return ("px" if name in ("fx", "fy", "cx", "cy") else "1"), 1.0
        if member.kind == "known":
            return self.known_thing(member.row).unit, 1.0
        kind = "plane" if member.kind.startswith(PLANE_OF) else member.kind
        unit = PRIOR_UNITS[kind][member.row if kind in PRIOR_WORDS else member.axis]
        return unit, FACTORS.get(unit, 1.0)

    def group(self, suspicion: Suspicion) -> str:
        """All that could be wrong: ``length 'a' or the picks of 'P' and 'Q' in 'img1.jpg'``."""
        members = (suspicion.accused, *suspicion.group)
        parts = [self.cause(m) for m in members if m.kind != "pixels"]
        by_frame: dict[str, list[str]] = {}
        survey = self.adjustment.survey
        for m in (m for m in members if m.kind == "pixels"):
            frame = survey.frame_id[survey.pick_frame[m.row]]
            by_frame.setdefault(frame, []).append(repr(survey.label[survey.pick_label[m.row]]))
        for frame, labels in by_frame.items():
            picks = "pick" if len(labels) == 1 else "picks"
            parts.append(f"{picks} of {listed(labels, None)} in {frame!r}")
        return " or the ".join(parts)

    def look(self, suspicion: Suspicion) -> str:
        """``no test can part them: look at all three``; empty where there is nothing to part."""
        count = 1 + len(suspicion.group)
        if count == 1:
            return ""
        words = COUNTS[count] if count < len(COUNTS) else f"all {count}"
        return f"no test can part them: look at {words}"

    def rivals(self, suspicion: Suspicion) -> str:
        """What else it could be, as a sentence; empty where it is located."""
        if not suspicion.rivals:
            return ""
        named = [self.cause(m) for m in suspicion.rivals[:MOST_RIVALS]]
        more = len(suspicion.rivals) - len(named)
        others = f" or one of {more} others" if more else ""
        return (
            f"There is too little redundancy to be sure: it could also be the "
            f"{' or the '.join(named)}{others}."
        )

    def subjects(self, *members: Member) -> Subjects:
        """Which frames, labels and lengths observations are of, as a message carries them."""
        each = [self._subjects(member) for member in members]
        together: Subjects = {
            "frames": tuple(dict.fromkeys(f for one in each for f in one.get("frames", ()))),
            "labels": tuple(dict.fromkeys(a for one in each for a in one.get("labels", ()))),
            "lengths": tuple(dict.fromkeys(i for one in each for i in one.get("lengths", ()))),
        }
        return together

    def _subjects(self, member: Member) -> Subjects:
        survey, row = self.adjustment.survey, member.row
        if member.kind == "pixels":
            frame, label = self.pick(row)
            return {"frames": (frame,), "labels": (label,)}
        if member.kind == "lengths":
            line = self.adjustment.problem.line_index[row]
            ends = survey.line_start[line], survey.line_end[line]
            name = survey.line_name[line : line + 1]
            return {"lengths": tuple(name), "labels": tuple(survey.label[k] for k in ends)}
        if member.kind == "known":
            thing = self.known_thing(row)
            return {"labels": tuple(survey.label[k] for k in thing.label)}
        if member.kind == "telemetry":
            return {"frames": (self.frame(row),)}
        if member.kind == "control":
            return {"labels": (survey.label[survey.control_label[row]],)}
        is_height = member.kind in ("roughness", "heights")
        return {"labels": (self.label(member),)} if is_height else {}


def named_ends(name: str, start: str, end: str) -> str:
    """``'L2' ('R3' to 'R4')``: a length; by its ends alone where it has no name.

    Parameters
    ----------
    name
        Of the length; may be empty.
    start, end
        Labels of its ends.
    """
    return f"{name!r} ({start!r} to {end!r})" if name else f"{start!r} to {end!r}"


def named_thing(kind: str, name: str, points: Sequence[str]) -> str:
    """``right angle 'corner' ('A', 'B', 'C')``: a known thing.

    Parameters
    ----------
    kind, name
        What it is, and what it is called.
    points
        Labels of its points.
    """
    return (
        f"{KNOWN_WORDS.get(kind, kind.replace('_', ' '))} {name!r} ({', '.join(map(repr, points))})"
    )
