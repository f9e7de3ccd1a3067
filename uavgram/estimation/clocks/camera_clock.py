"""The line between a camera's clock and an autopilot's, from pairs of photos and events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Bools, Floats

# Of a camera's clock against the autopilot's: quartz without temperature control stays within some
# 50 ppm, autopilots were measured 18 to 146 ppm off.
DRIFT_SIGMA = 1e-4
COARSE_S = 0.1  # clocks of a coarser step: the step outweighs what shutters scatter
LEAST_JITTER_S = 0.001
COARSE_JITTER_S = 0.02  # of shutters, where the readings are too coarse to tell
_SIGNIFICANT = 3.0  # sigmas of a drift worth telling


@dataclass(frozen=True)
class CameraClock:
    """``reading = event + offset_s + drift * (event - reference_s)``.

    Attributes
    ----------
    offset_s, drift
        Of the line; the offset holds at the reference, drift is dimensionless (1e-6 is 1 ppm).
    reference_s
        On the events' clock.
    offset_sigma_s, drift_sigma
        Standard deviations, uncorrelated by the choice of the reference.
    jitter_s
        Standard deviation of one pair about the line, without the readings' step.
    """

    offset_s: float
    drift: float
    reference_s: float
    offset_sigma_s: float = float("inf")
    drift_sigma: float = DRIFT_SIGMA
    jitter_s: float = 0.0

    def to_event(self, reading_s: Floats) -> Floats:
        """(F,) instants of readings on the events' clock."""
        since = (reading_s - self.offset_s - self.reference_s) / (1.0 + self.drift)
        return np.asarray(self.reference_s + since)

    @property
    def drifts(self) -> bool:
        """Whether the drift exceeds three of its sigmas."""
        return abs(self.drift) > _SIGNIFICANT * self.drift_sigma

    def sigma_at(self, event_s: Floats) -> Floats:
        """(F,) standard deviation of the line at these instants [s]."""
        return np.asarray(
            np.hypot(self.offset_sigma_s, self.drift_sigma * (event_s - self.reference_s))
        )


def rough_clock(event_s: Floats, reading_s: Floats, scatter_s: float) -> CameraClock:
    """Least squares through pairs (N,), N >= 1; the drift has a prior of zero.

    Parameters
    ----------
    scatter_s
        Of one pair, to weigh it against the prior.
    """
    count = len(event_s)
    reference = float(event_s.sum()) / count
    since = event_s - reference
    apart = reading_s - event_s
    offset = float(apart.sum()) / count
    prior = (scatter_s / DRIFT_SIGMA) ** 2
    drift = float(since @ (apart - offset) / (since @ since + prior))
    return CameraClock(offset, drift, reference)


def fit_camera_clock(event_s: Floats, reading_s: Floats, resolution_s: float) -> CameraClock:
    """Fit the line to pairs (N,) with its standard deviations.

    A fine clock's pairs scatter normally: least squares. A coarse clock's error is uniform over
    its step: every pair bounds the line, the middle between the extremes is the best offset, and
    what they leave open is its uncertainty. Readings that all fall on the same part of a step
    (exposures at whole seconds) leave the whole step open, however many they are.

    The drift has a prior of zero with `DRIFT_SIGMA`: a short flight leaves it there.

    Parameters
    ----------
    event_s, reading_s
        (N,) times of the events on their own clock, and the camera's readings; N >= 1.
    resolution_s
        Step of the readings.
    """
    if len(event_s) < 2:
        return CameraClock(
            offset_s=float(np.mean(reading_s - event_s)),
            drift=0.0,
            reference_s=float(np.mean(event_s)),
            offset_sigma_s=float(np.hypot(resolution_s, COARSE_JITTER_S)),
        )
    coarse = resolution_s > COARSE_S
    step_sigma = resolution_s / np.sqrt(12.0)
    reference = float(event_s.mean())
    since = event_s - reference
    apart = reading_s - event_s
    free = float(since @ apart / max(float(since @ since), 1e-9))
    residual = apart - apart.mean() - free * since
    scatter = max(float(np.std(residual)), step_sigma, LEAST_JITTER_S)
    open_s = max(resolution_s - float(np.ptp(residual)), 0.0) if coarse else 0.0
    span = max(float(np.ptp(event_s)), 1e-3)
    free_sigma = np.hypot(scatter / max(np.sqrt(since @ since), 1e-3), open_s / span)
    drift_sigma = 1.0 / np.hypot(1.0 / free_sigma, 1.0 / DRIFT_SIGMA)
    drift = float(free * (drift_sigma / free_sigma) ** 2)
    residual = reading_s - event_s - drift * since
    offset, offset_sigma = float(residual.mean()), scatter / np.sqrt(len(residual))
    jitter = float(np.std(residual))
    if coarse:
        offset, offset_sigma = _middle(residual, resolution_s)
        jitter = COARSE_JITTER_S
    return CameraClock(
        offset_s=offset,
        drift=drift,
        reference_s=reference,
        offset_sigma_s=float(offset_sigma),
        drift_sigma=float(drift_sigma),
        jitter_s=max(jitter, LEAST_JITTER_S),
    )


def _middle(residual_s: Floats, resolution_s: float) -> tuple[float, float]:
    """Offset and its sigma from readings with a uniform error.

    The midrange of n uniform errors of full width w has sigma w / sqrt(2 (n + 1) (n + 2))
    (Johnson, Kotz and Balakrishnan 1995, Continuous univariate distributions 2, chapter 26).
    Readings that do not fill the step leave the offset open over the rest of it; readings that
    exceed it by more than shutters scatter do not belong together, by as much as they exceed it.
    """
    # A pair of another event lies outside: the most readings that one step can hold count.
    ordered = np.sort(residual_s)
    held = np.searchsorted(ordered, ordered + resolution_s + 2 * COARSE_JITTER_S, side="right")
    first = int(np.argmax(held - np.arange(len(ordered))))
    n = int(held[first]) - first
    low, high = float(ordered[first]), float(ordered[held[first] - 1])
    filled = resolution_s / np.sqrt(2.0 * (n + 1) * (n + 2))
    rest = abs(resolution_s - (high - low)) / np.sqrt(12.0)
    return (low + high) / 2, float(np.sqrt(filled**2 + rest**2 + COARSE_JITTER_S**2 / 4))


def is_within(residual_s: Floats, tolerance_s: Floats | float) -> Bools:
    """(F,) whether a residual is explained by the step and the scatter."""
    return np.asarray(np.abs(residual_s) <= tolerance_s)
