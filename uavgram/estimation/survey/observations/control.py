"""Control points: points with known coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import (
    ErrorSource,
    Kind,
    Member,
    Misfit,
    Observation,
    Subjects,
)
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats, Ints
from uavgram.model.naming import format_misfit
from uavgram.model.observations import KnownWorldPoints

CONTROL_POINTS = ErrorSource(
    "control points",
    "how well the control points are known",
    "More or better control points would help there.",
)


class Control(Observation):
    """Control points: points with known coordinates."""

    kind = Kind(
        "control",
        CONTROL_POINTS,
        "control points",
        role="reading",
        rank=4,
        axes=("east", "north", "up"),
        units=("m",) * 3,
        plural="control points",
        check="their labels and stated errors",
        misfit_code="control-suspect",
        advice="Look at their coordinates, their labels and their picks.",
        is_core=True,
        is_whole=True,
        is_joint=True,
    )

    def is_part(self) -> bool:
        """Return whether there are control points."""
        return bool(len(self.problem.survey.control_label))

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the coordinates of the points about the truth."""
        control = stated.control
        kept = [i for i, name in enumerate(control.label) if name in truth.row]
        label = tuple(control.label[i] for i in kept)
        place = truth.place_m[[truth.row[name] for name in label]].reshape(-1, 3)
        sigma = control.sigma_m[kept]
        world = place + sigma * truth.rng.standard_normal(sigma.shape)
        again = KnownWorldPoints(label=label, world_m=world, sigma_m=sigma)
        return replace(stated, control=again)

    @cached_property
    def _columns(self) -> Ints:
        label = self.problem.survey.control_label
        own = self.problem.layout.point_columns(label)
        return np.concatenate([own, self.problem.plane_columns(label)], axis=1)

    def rows(self, state: State) -> Block | None:
        """Compare the points with their known coordinates."""
        survey = self.problem.survey
        world, d_point, d_plane = self.problem.world_points(state, survey.control_label)
        weight = 1.0 / survey.control_sigma_m
        jacobian = np.concatenate([d_point, d_plane], axis=-1)
        residual = (world - survey.control_world_m) * weight
        return Block(residual, self._columns, jacobian * weight[:, :, None])

    def sigma(self, found: Minimum[State]) -> Floats:
        """Return the (C, 3) standard deviations of the coordinates [m]."""
        del found
        return self.problem.survey.control_sigma_m

    def heights(self, found: Minimum[State]) -> Iterator[tuple[Ints, Floats]]:
        """Yield the derivatives of the heights."""
        del found
        survey = self.problem.survey
        up = np.zeros((len(survey.control_label), 3))
        up[:, 2] = 1.0 / survey.control_sigma_m[:, 2]
        yield survey.control_label, up

    def label(self, row: int) -> str:
        """Return the label of a control point."""
        return str(self.problem.survey.label[self.problem.survey.control_label[row]])

    def title(self, member: Member) -> str:
        """Return ``control point 'P'``."""
        return f"control point {self.label(member.row)!r}"

    def axis(self, member: Member) -> str:
        """Return ``control 'P' east``."""
        return f"control {self.label(member.row)!r} {self.kind.axes[member.axis]}"

    def subjects(self, row: int) -> Subjects:
        """Return its label."""
        return {"labels": (self.label(row),)}

    def witness(self) -> Iterator[str]:
        """Yield the source of evidence for the scale."""
        yield "the control points"

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a control point that does not fit."""
        off = ", ".join(f"{r:+.3f}" for r in found.off)
        how = f"(found minus known {off} m, {format_misfit(found.w)})"
        label = self.label(found.member.row)
        return (
            f"The control point {label!r} does not fit: look at its coordinates, its label and its "
            f"picks {how}.",
            f"{label!r} {how}",
        )
