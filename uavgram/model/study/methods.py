"""A method of finding the pose of one photo, judged on many scenes: a row of the comparison."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class MethodRow:
    """One method in one setting.

    Attributes
    ----------
    setting, method
        Names.
    scenes
        How many.
    rms_m, ninth_m
        Median and 90th percentile of the scenes' root mean square errors.
    fewest_m, most_m
        Medians over the scenes with least and with most features.
    failed
        Share of scenes in which the distances are useless.
    ambiguous, told, failed_silently
        Shares of scenes in which the method says that another pose fits as well; in which it says
        so, or predicts errors beyond 5 %; and that failed without a word.
    coverage, z
        Share of the errors within 1.96 predicted sigmas, and their root mean square in sigmas.
    """

    setting: str
    method: str
    scenes: int
    rms_m: float
    ninth_m: float
    fewest_m: float
    most_m: float
    failed: float
    ambiguous: float
    told: float
    failed_silently: float
    coverage: float
    z: float
