"""Errors that all sightings or all readings of one photo share: of camera, ground and tape.

Each is a number of sigma 1: a column of `PhotoDesign.camera_root` or of `ground_root`, or the share
by which the tape reads too much. A camera's error moves every pixel; where a sighting keeps its own
error, its place moves against that. An error of the ground's plane moves places along their rays.
"""

from __future__ import annotations

import numpy as np

from uavgram.geometry.camera.lens import distort, write_parameter_derivative
from uavgram.model.arrays import Floats
from uavgram.model.simulation import PhotoDesign


def common_count(design: PhotoDesign) -> int:
    """How many there are."""
    return (
        _columns(design.camera_root) + _columns(design.ground_root) + bool(design.tape_scale_sigma)
    )


def of_ground(design: PhotoDesign) -> slice:
    """Which of them are errors of the ground; those of the camera stand before it."""
    first = _columns(design.camera_root)
    return slice(first, first + _columns(design.ground_root))


def ground_at(design: PhotoDesign, stated: Floats, common: Floats) -> Floats:
    """Height of the ground at the origin and its slopes, (3, B).

    Parameters
    ----------
    design, common
        As for `parameters_at`.
    stated
        (3, B) what is known of them beforehand.
    """
    if design.ground_root is None:
        return stated
    return np.asarray(stated + design.ground_root @ common[of_ground(design)])


def raised(design: PhotoDesign, change: Floats, place: Floats) -> Floats:
    """By how much changed errors raise the ground under places: (E, B) [m].

    Parameters
    ----------
    design
        What is common to B draws.
    change
        (K, B) of the errors, or (K, 1).
    place
        (2, E, B).
    """
    if design.ground_root is None:
        return np.zeros(place.shape[1:])
    height, east, north = design.ground_root @ change[of_ground(design)]
    return np.asarray(height + east * place[0] + north * place[1])


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
    return np.asarray(stated[:, None] + design.camera_root @ common[: _columns(design.camera_root)])


def tape_scale(design: PhotoDesign, common: Floats) -> Floats:
    """What the tape reads of a metre, as `estimation/survey/observations/lengths.py` has it: (B,).

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
    out[:, :, : _columns(design.camera_root)] = moved / design.pixel_sigma_px[:, None, None]
    return out


def by_common(
    design: PhotoDesign,
    by_error: Floats,
    shifts: Floats,
    lengths: tuple[Floats, Floats],
    rises: tuple[Floats, Floats],
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
    lengths
        (L, B) between the ends [m], and of `tape_scale`.
    rises
        (2, L, B) what raising the ground under one end does to these readings, and (2, E, B) the
        places.
    """
    length_m, scale = lengths
    by_rise, place = rises
    out = np.zeros((len(length_m), shifts.shape[2], length_m.shape[1]))
    if design.camera_root is not None:
        for own, at in zip(by_error, design.line.T, strict=True):
            out -= np.einsum("jlb,jlkb->lkb", own, shifts[:, at])
    columns = of_ground(design)
    unit = np.eye(out.shape[1])[:, :, None]
    for k in range(columns.start, columns.stop):
        rise = raised(design, unit[:, k], place)
        for own, at in zip(by_rise, design.line.T, strict=True):
            out[:, k] += own * rise[at]
    if design.tape_scale_sigma:
        out[:, -1] = -design.tape_scale_sigma * length_m * scale**2
    return out


def _columns(root: Floats | None) -> int:
    return 0 if root is None else root.shape[1]
