"""Prior knowledge of the camera: calibration, readout time, turns during the readout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import (
    ErrorSource,
    Kind,
    Member,
    Misfit,
    Observation,
    get_unit,
)
from uavgram.estimation.survey.observations.priors import Prior, make_independent_prior
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats
from uavgram.model.camera import describe_part, parameter_names

LENS = ErrorSource(
    "lens",
    "how well the camera is calibrated",
    "A better calibration would help there.",
)
ROLLING_SHUTTER = ErrorSource(
    "rolling shutter",
    "how well the readout time of the camera is known (it reads a photo row by row)",
    "Flying slower, or `readout_ms` in camera.yaml, would help there.",
)


UNKNOWN_CAMERA_CHECK = (
    "the reading, the unit and the ends of each length first, then whether the photos were zoomed "
    "or cropped; a calibrated camera decides"
)
"""Advice where the photos fit no ordinary camera: a wrong length is the likelier reason."""


class Calibration(Observation):
    """Interior orientation, in independent combinations of its parameters."""

    kind = Kind(
        "calibration",
        LENS,
        "lens calibration",
        plural="values of the camera",
        check="its focus, zoom and resolution, and its stated errors",
        is_core=True,
    )

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the parameters that the calibration states."""
        root = truth.problem.intrinsic_basis
        off = root @ truth.rng.standard_normal(root.shape[1])
        camera = replace(stated.calibration, parameters=truth.intrinsics + off)
        return replace(stated, calibration=camera)

    def rows(self, state: State) -> Block | None:
        """Compare the combinations with the calibration."""
        layout = self.problem.layout
        sigma = np.ones(layout.intrinsics)
        return make_independent_prior(state.intrinsic, sigma, layout.first_intrinsic)

    def arrange_for_tests(self, block: Block) -> Block:
        """Arrange the combinations as one observation of correlated parameters."""
        n = len(block.residual)
        return Block(block.residual.reshape(1, n), block.columns.reshape(1, n), np.eye(n)[None])

    def whitening(self) -> Floats | None:
        """Return (1, I, P); the row of an exactly known parameter is zero, as it cannot err."""
        inverse = np.linalg.pinv(self.problem.intrinsic_basis)
        return np.asarray(inverse, dtype=np.float64)[None]

    def title(self, member: Member) -> str:
        """Return ``focal length of the camera`` and the like."""
        return f"{describe_part(self.axis(member))} of the camera"

    def axis(self, member: Member) -> str:
        """Return ``fx`` and the like."""
        camera = self.problem.survey.calibration
        return parameter_names(camera.model, len(camera.parameters))[member.axis]

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a misfit; that of a guess of the program is no wrong value of the project."""
        text, what = super().misfit(found)
        if self.problem.survey.calibration.is_unknown:
            text = (
                f"Picks and lengths fit only another camera than an ordinary drone's: {what}. "
                f"{self.advice()}"
            )
        return text, what

    def advice(self) -> str:
        """Return the advice on misfits, as a sentence."""
        if self.problem.survey.calibration.is_unknown:
            return f"Look at {UNKNOWN_CAMERA_CHECK}."
        return super().advice()

    def check(self) -> str:
        """Return what to look at where the camera does not fit."""
        if self.problem.survey.calibration.is_unknown:
            return UNKNOWN_CAMERA_CHECK
        return super().check()

    def suspect(self, member: Member) -> str:
        """Return the whole camera: its parameters are correlated, and are checked together."""
        del member
        return "camera"

    def unit(self, member: Member) -> tuple[str, float]:
        """Return pixels, or no unit."""
        return get_unit("px" if self.axis(member) in ("fx", "fy", "cx", "cy") else "1")


class Readout(Prior):
    """Time in which the camera reads a photo, row after row."""

    kind = Kind(
        "readout",
        ROLLING_SHUTTER,
        "readout time of the camera",
        axes=("readout time",),
        units=("s",),
    )

    def is_part(self) -> bool:
        """Return whether rows are read one after the other."""
        return self.problem.survey.rolling is not None

    def rows(self, state: State) -> Block | None:
        """Compare the time with its known value."""
        assert self.problem.survey.rolling is not None  # noqa: S101  (see `of`)
        known = self.problem.survey.rolling.readout
        off = state.readout - known.value_s
        return make_independent_prior(
            off, np.array([known.sigma_s]), self.problem.layout.first_readout
        )


class Turning(Observation):
    """Turns of the camera during the readout, beyond those of the log."""

    kind = Kind(
        "turning",
        ROLLING_SHUTTER,
        "turn of the camera while a photo was read",
        role="construction",
    )

    def is_part(self) -> bool:
        """Return whether these turns are unknowns."""
        return bool(self.problem.layout.turning)

    def rows(self, state: State) -> Block | None:
        """Compare the turns with those of the log."""
        layout, rolling = self.problem.layout, self.problem.survey.rolling
        assert rolling is not None  # noqa: S101  (else it is no unknown)
        columns = layout.turning_columns(np.arange(layout.frames))
        readout = rolling.readout
        sigma = rolling.rate_sigma_rad_s * float(np.hypot(readout.value_s, readout.sigma_s))
        weight = np.broadcast_to(np.eye(3) / sigma, (len(columns), 3, 3))
        return Block(state.turning / sigma, columns, weight)
