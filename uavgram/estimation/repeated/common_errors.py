"""Errors that all sightings or all readings of one photo share: of camera, ground and tape.

Each is a number of sigma 1: a column of `PhotoDesign.camera_root` or of `ground_root`, or the
relative scale error of the tape. A camera's error moves every pixel; if a sighting keeps its own
error, its place moves in the opposite sense. An error of the ground's plane moves places along
their rays.
"""

from __future__ import annotations

import numpy as np

from uavgram.geometry.camera.lens import distort, write_parameter_derivative
from uavgram.model.arrays import Floats, Ints
from uavgram.model.simulation import PhotoDesign


def count_common_errors(design: PhotoDesign) -> int:
    """Return the number of common errors."""
    return (
        _columns(design.camera_root) + _columns(design.ground_root) + bool(design.tape_scale_sigma)
    )


def ground_slice(design: PhotoDesign) -> slice:
    """Return the slice of the errors of the ground; those of the camera come before it."""
    first = _columns(design.camera_root)
    return slice(first, first + _columns(design.ground_root))


def compute_ground(design: PhotoDesign, stated: Floats, common: Floats) -> Floats:
    """Compute the height of the ground at the origin and its slopes, (3, B).

    Parameters
    ----------
    design, common
        As for `compute_parameters`.
    stated
        (3, B) prior values of them.
    """
    if design.ground_root is None:
        return stated
    return np.asarray(stated + design.ground_root @ common[ground_slice(design)])


def compute_rise(design: PhotoDesign, change: Floats, place: Floats) -> Floats:
    """Compute the rise (E, B) of the ground under places by changed errors [m].

    Parameters
    ----------
    design
        Design common to B draws.
    change
        (K, B) of the errors, or (K, 1).
    place
        (2, E, B).
    """
    if design.ground_root is None:
        return np.zeros(place.shape[1:])
    height, east, north = design.ground_root @ change[ground_slice(design)]
    return np.asarray(height + east * place[0] + north * place[1])


def compute_parameters(design: PhotoDesign, common: Floats) -> Floats:
    """Return the camera's parameters: (P,) if it is exact, else (P, B).

    Parameters
    ----------
    design
        Design common to B draws.
    common
        (K, B) their errors.
    """
    stated = design.calibration.parameters
    if design.camera_root is None:
        return stated
    return np.asarray(stated[:, None] + design.camera_root @ common[: _columns(design.camera_root)])


def compute_tape_scale(design: PhotoDesign, common: Floats) -> Floats:
    """Return the (B,) reading of one metre, as in `estimation/survey/observations/lengths.py`.

    Parameters
    ----------
    design, common
        As for `compute_parameters`.
    """
    if not design.tape_scale_sigma:
        return np.ones(common.shape[1])
    return np.asarray(1.0 / (1.0 + design.tape_scale_sigma * common[-1]))


def compute_pixel_shifts(
    design: PhotoDesign, parameters: Floats, rotation: Floats, ray: Floats
) -> Floats:
    """Compute shifts (2, E, K, B) of the pixels of places by the camera's errors, in sigmas.

    Parameters
    ----------
    design, parameters
        As for `compute_parameters`.
    rotation, ray
        (3, 3, B), (3, E, B) from the camera to the places.
    """
    ends, size = ray.shape[1:]
    out = np.zeros((2, ends, count_common_errors(design), size))
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


def compute_common_effects(
    design: PhotoDesign,
    ends: Ints,
    sightings: tuple[Floats, Floats],
    readings: tuple[Floats, Floats],
    sights: tuple[Floats, Floats, Floats, Floats],
) -> Floats:
    """Compute (R, K, B) effects of the common errors on the expected readings.

    Parameters
    ----------
    design
        Design common to B draws.
    ends
        (2, R) the two ends of each reading; the lengths come first.
    sightings
        (2, 2, R, B) effects of the errors of the two ends, u and v, on these readings, and result
        of `compute_pixel_shifts`.
    readings
        (R, B) expected readings, and result of `compute_tape_scale`.
    sights
        (2, 3, R, B) gradients of the readings by their ends, and of the ends (3, E, B) rays, (E, B)
        their fall against the ground, (3, E, B) places.
    """
    (by_error, shifts), (expected, scale), (pull, ray, falling, world) = sightings, readings, sights
    out = np.zeros((len(expected), shifts.shape[2], expected.shape[1]))
    # A sighting keeps its own error: the camera's shift acts with the opposite sign.
    if design.camera_root is not None:
        for own, at in zip(by_error, ends, strict=True):
            out -= np.einsum("jlb,jlkb->lkb", own, shifts[:, at])
    if design.ground_root is not None:
        columns = ground_slice(design)
        unit = np.eye(out.shape[1])[columns, :, None]
        rise = np.stack([compute_rise(design, one, world) for one in unit])
        for own, at in zip(pull, ends, strict=True):
            # Raising the ground moves a place along its ray, by ray / falling for each metre.
            by_rise = np.einsum("krb,krb->rb", own, ray[:, at]) / falling[at]
            out[:, columns] += by_rise[:, None] * rise[:, at].swapaxes(0, 1)
    # reading = length / (1 + sigma k): its derivative by k is -sigma reading scale.
    if design.tape_scale_sigma:
        taped = len(design.line)
        out[:taped, -1] = -design.tape_scale_sigma * expected[:taped] * scale
    return out


def _columns(root: Floats | None) -> int:
    return 0 if root is None else root.shape[1]
