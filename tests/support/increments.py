"""Increment between two states of a survey: the inverse of `apply_increment`."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.unknowns import Layout, State
from uavgram.geometry.motion.rotation import log_so3
from uavgram.model.arrays import Floats


def compute_increment(layout: Layout, start: State, end: State) -> Floats:
    """Compute the (..., size) increment by which `apply_increment` leads from one state to another.

    Parameters
    ----------
    layout
        Order of the unknowns in the vector.
    start, end
        Two states of the same unknowns, or as many of each with the same leading axes.
    """
    turn = log_so3(np.swapaxes(start.rotation, -1, -2) @ end.rotation)
    parts = (
        end.point - start.point,
        end.picked - start.picked,
        end.tie - start.tie,
        np.concatenate([end.center - start.center, turn, end.turning - start.turning], axis=-1),
        end.intrinsic - start.intrinsic,
        (end.plane - start.plane)[..., end.plane.shape[-1] - layout.plane :],
        end.relief - start.relief,
        end.telemetry - start.telemetry,
        end.tape - start.tape,
        end.readout - start.readout,
    )
    many = end.plane.shape[:-1]
    return np.concatenate([part.reshape(*many, -1) for part in parts], axis=-1)
