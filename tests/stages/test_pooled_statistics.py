"""Pooled statistics: their ranges hold the truth as often as they say, however things correlate."""

import numpy as np
import pytest
from scipy.stats import binom

from uavgram.model.batch import Drift, Fit, ParameterUpdate, SurveyRow
from uavgram.stages.pooled_statistics import find_camera_drifts, pool_fits


def surveys(fits: list[Fit], camera: str = "c") -> list[SurveyRow]:
    return [
        SurveyRow(name=str(k), project=str(k), status="done", camera=camera, fits=(fit,))
        for k, fit in enumerate(fits)
    ]


@pytest.mark.parametrize("factor", [0.6, 1.0, 1.7])
def test_the_range_holds_the_true_factor(factor: float) -> None:
    random, draws, hits = np.random.default_rng(3), 400, 0
    for _ in range(draws):
        sizes = random.integers(1, 6, 8)
        squares = [factor**2 * float(np.sum(random.standard_normal(n) ** 2)) for n in sizes]
        fits = [
            Fit(kind="checks", squares=s, freedom=float(n))
            for s, n in zip(squares, sizes, strict=True)
        ]
        (one, of_camera) = pool_fits(surveys(fits))
        assert (of_camera.of, of_camera.ratio) == ("camera", one.ratio)
        hits += one.low < factor < one.high

    low, high = binom.interval(0.9999, draws, 0.95)
    assert low <= hits <= high


def test_many_surveys_tell_that_sigmas_are_too_small() -> None:
    rows = surveys([Fit(kind="checks", squares=4.0 * 10, freedom=10.0)] * 5)
    (one, _) = pool_fits(rows)

    assert one.ratio == pytest.approx(2.0)
    assert one.is_small
    assert not one.is_large
    assert (one.surveys, one.freedom) == (5, 50.0)


def adjusted(
    random: np.random.Generator, truth: np.ndarray, design: np.ndarray, day: int
) -> SurveyRow:
    """A linear survey of two correlated parameters, whose file says 0 with sigmas 1 and 2."""
    prior = np.diag([1.0, 0.25])
    posterior = np.linalg.inv(prior + design.T @ design)
    seen = design @ truth + random.standard_normal(len(design))
    value = posterior @ design.T @ seen
    sigma = np.sqrt(posterior.diagonal())
    return SurveyRow(
        name=str(day),
        project=str(day),
        status="done",
        camera="c",
        taken_utc=f"20{10 + day:02}-01-01T00:00:00+00:00",
        seen=tuple(
            ParameterUpdate(name=n, stated=0.0, stated_sigma=s, value=v, sigma=g)
            for n, s, v, g in zip("ab", (1.0, 2.0), value.tolist(), sigma.tolist(), strict=True)
        ),
    )


def drifts(random: np.random.Generator, per_year: float, draws: int) -> list[Drift]:
    found = []
    for _ in range(draws):
        truth = random.standard_normal(2) * [1.0, 2.0]
        rows = []
        for day in range(5):
            # both parameters do nearly the same: strongly correlated
            design = random.standard_normal((4, 1)) * [1.0, 0.8] + 0.3 * random.standard_normal(
                (4, 2)
            )
            rows.append(adjusted(random, truth + np.array([per_year * day, 0.0]), design, day))
        found += [one for one in find_camera_drifts(rows) if one.parameter == "a"]
    return found


def test_offsets_and_changes_are_no_larger_than_they_say_though_parameters_correlate() -> None:
    found = drifts(np.random.default_rng(5), 0.0, 400)
    offset = np.array([one.offset / one.offset_sigma for one in found])
    change = np.array([one.per_year / one.per_year_sigma for one in found])

    assert len(found) > 300
    assert np.sqrt(np.mean(offset**2)) < 1.1
    assert np.sqrt(np.mean(change**2)) < 1.1
    assert np.sqrt(np.mean(offset**2)) > 0.7  # and not much smaller either
    assert sum(one.is_off or one.drifts for one in found) <= 0.02 * len(found)


def test_a_camera_that_drifts_is_found() -> None:
    found = drifts(np.random.default_rng(6), 3.0, 40)
    change = np.array([one.per_year for one in found])

    assert np.mean([one.drifts for one in found]) > 0.8
    assert abs(np.mean(change) - 3.0) < 0.5


def test_another_file_is_another_calibration() -> None:
    def row(stated: float) -> SurveyRow:
        seen = ParameterUpdate(name="fx", stated=stated, stated_sigma=3.0, value=stated, sigma=1.0)
        return SurveyRow(name="x", project="x", status="done", camera="c", seen=(seen,))

    assert find_camera_drifts([row(2000.0), row(2010.0)]) == ()
    assert len(find_camera_drifts([row(2000.0), row(2000.0)])) == 1
