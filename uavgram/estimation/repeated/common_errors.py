"""Errors that all sightings or all readings of one photo share: of the camera, and of the tape.

Each is a number of sigma 1, one column of `PhotoDesign.camera_root` or the share by which the tape
reads too much. A camera's error moves every pixel; where a sighting keeps its own error, its place
moves against that.
"""

from __future__ import annotations

import numpy as np

from uavgram.geometry.camera.lens import distort, write_parameter_derivative
from uavgram.model.arrays import Floats
from uavgram.model.simulation.photo import PhotoDesign


def common_count(design: PhotoDesign) -> int:
    """How many there are."""
    return _of_camera(design) + (1 if design.tape_scale_sigma else 0)


def parameters_at(design: PhotoDesign, common: Floats) -> Floats:
    """The camera's parameters: (P,) where it is exact, else (P, B).

    Parameters
    ----------
    design
        What is common to B draws.
    common
        (K, B) their errors.
    """
    stated = design.calibration.parameters
    if design.camera_root is None:
        return stated
    return np.asarray(stated[:, None] + design.camera_root @ common[: _of_camera(design)])


def tape_scale(design: PhotoDesign, common: Floats) -> Floats:
    """What the tape reads of a metre, as `estimation/survey/terms/tapes.py` has it: (B,).

    Parameters
    ----------
    design, common
        As for `parameters_at`.
    """
    if not design.tape_scale_sigma:
        return np.ones(common.shape[1])
    return np.asarray(1.0 / (1.0 + design.tape_scale_sigma * common[-1]))


def sight_shifts(design: PhotoDesign, parameters: Floats, rotation: Floats, ray: Floats) -> Floats:
    """By how much the camera's errors move the pixels of places: (2, E, K, B) in sigmas.

    Parameters
    ----------
    design, parameters
        As for `parameters_at`.
    rotation, ray
        (3, 3, B), (3, E, B) from the camera to the places.
    """
    ends, size = ray.shape[1:]
    out = np.zeros((2, ends, common_count(design), size))
    if design.camera_root is None:
        return out
    right, down, ahead = (np.einsum("ib,ieb->eb", rotation[:, k], ray) for k in range(3))
    u, v = right / ahead, down / ahead
    lens = distort(design.calibration.model, parameters[4:], u, v)
    by_parameter = np.zeros((ends, size, 2, len(parameters)))
    write_parameter_derivative(by_parameter, design.calibration.model, parameters, lens, (u, v))
    moved = np.einsum("ebjp,pk->jekb", by_parameter, design.camera_root, optimize=True)
    out[:, :, : _of_camera(design)] = moved / design.pixel_sigma_px[:, None, None]
    return out


def by_common(
    design: PhotoDesign, by_error: Floats, shifts: Floats, length_m: Floats, scale: Floats
) -> Floats:
    """What the common errors do to the readings that are expected: (L, K, B).

    Parameters
    ----------
    design
        What is common to B draws.
    by_error
        (2, 2, L, B) what the errors of the two ends, u and v, do to these readings.
    shifts
        Of `sight_shifts`.
    length_m
        (L, B) between the ends.
    scale
        Of `tape_scale`.
    """
    out = np.zeros((len(length_m), shifts.shape[2], length_m.shape[1]))
    if design.camera_root is not None:
        for own, at in zip(by_error, design.line.T, strict=True):
            out -= np.einsum("jlb,jlkb->lkb", own, shifts[:, at])
    if design.tape_scale_sigma:
        out[:, -1] = -design.tape_scale_sigma * length_m * scale**2
    return out


def _of_camera(design: PhotoDesign) -> int:
    return 0 if design.camera_root is None else design.camera_root.shape[1]
