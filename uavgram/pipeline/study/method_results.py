"""What a method of finding a pose found of scenes whose truth is known, and its row in a table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.study.methods import MethodRow

FAILED = 0.05
"""Root mean square error of a scene's withheld distances, as a share of them, from which on a
method counts as failed."""
SIGMAS_95 = 1.959964


@dataclass(frozen=True, eq=False)
class Found:
    """What a method found of B scenes.

    Attributes
    ----------
    error_m
        (B, m) of the withheld distances; NaN where there is no pose.
    sigma_m
        (B, m) predicted; inf where nothing determines the pose; NaN of methods that predict none.
    true_m
        (B, m) the distances.
    cost
        (B,) sum of squares.
    ambiguous
        (B,) whether the method says that another pose fits as well.
    """

    error_m: Floats
    sigma_m: Floats
    true_m: Floats
    cost: Floats
    ambiguous: Bools

    @property
    def rms_m(self) -> Floats:
        """(B,) of each scene; inf where there is no pose."""
        return np.asarray(np.nan_to_num(np.sqrt(np.mean(self.error_m**2, axis=1)), nan=np.inf))

    @property
    def failed(self) -> Bools:
        """(B,) whether the distances are useless."""
        return self._are_useless(self.error_m)

    @property
    def told(self) -> Bools:
        """(B,) whether the method says so itself: by no pose, by another one, or by its sigmas."""
        said = self.ambiguous | ~np.isfinite(self.error_m).all(axis=1)
        if np.isnan(self.sigma_m).all():  # it has none
            return said
        return said | self._are_useless(self.sigma_m)

    def _are_useless(self, off_m: Floats) -> Bools:
        share = np.sqrt(np.mean((off_m / self.true_m) ** 2, axis=1))
        return ~np.asarray(share <= FAILED)


def row_of(setting: str, method: str, parts: list[Found]) -> MethodRow:
    """The row of one method.

    Parameters
    ----------
    setting, method
        Names.
    parts
        What it found, from the scenes with least features to those with most.
    """
    rms = np.concatenate([one.rms_m for one in parts])
    failed = np.concatenate([one.failed for one in parts])
    told = np.concatenate([one.told for one in parts])
    z = np.concatenate([(one.error_m / one.sigma_m).ravel() for one in parts])
    z = z[np.isfinite(z) & np.isfinite(np.concatenate([one.sigma_m.ravel() for one in parts]))]
    return MethodRow(
        setting=setting,
        method=method,
        scenes=len(rms),
        rms_m=float(np.median(rms)),
        ninth_m=float(np.quantile(rms, 0.9, method="inverted_cdf")),
        fewest_m=float(np.median(parts[0].rms_m)),
        most_m=float(np.median(parts[-1].rms_m)),
        failed=float(failed.mean()),
        ambiguous=float(np.concatenate([one.ambiguous for one in parts]).mean()),
        told=float(told.mean()),
        failed_silently=float((failed & ~told).mean()),
        coverage=float(np.mean(np.abs(z) <= SIGMAS_95)) if len(z) else float("nan"),
        z=float(np.sqrt(np.mean(z**2))) if len(z) else float("nan"),
    )
