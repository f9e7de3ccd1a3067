"""Measured values against pencil and paper, and their covariance against sampling."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import TypedDict, Unpack, cast

import numpy as np
import pytest
from scenes import Scene

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.selection import select_picks
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Frames
from uavgram.model.message import Message
from uavgram.model.observations import MeasurementKind, MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.result.tables import MeasurementResults
from uavgram.stages.measure import add_alternatives, measure
from uavgram.stages.refine import refine

LABELS = ("A", "B", "C", "D", "E")
WORLD = np.array([[0.0, 0, 0], [3, 4, 0], [3, 0, 0], [0, 4, 0], [6, 8, 12]])


class Points:
    """Points with a joint covariance: all that measuring needs of an adjustment."""

    def __init__(
        self,
        world: Floats = WORLD,
        covariance: Floats | None = None,
        pick_frame: tuple[int, ...] = (0, 1, 0, 0, 1),
    ) -> None:
        self.world = world
        size = 3 * len(world)
        self.covariance = 1e-4 * np.eye(size) if covariance is None else covariance
        self.survey = SimpleNamespace(
            label=LABELS,
            row_of_label={label: k for k, label in enumerate(LABELS)},
            frame_id=("f0", "f1"),
            pick_frame=np.array(pick_frame),
            pick_label=np.arange(len(pick_frame)),
            area=np.zeros(len(LABELS), dtype=int),
            grounds=(SimpleNamespace(roughness_sigma_m=0.02),),
            height_above_m=np.zeros(len(LABELS)),
            height_sigma_m=np.zeros(len(LABELS)),
            is_free=np.array(LABELS) == "E",
        )
        self.problem = SimpleNamespace(layout=SimpleNamespace(size=size))
        self.minimum = SimpleNamespace(
            factor=SimpleNamespace(solve=lambda right: self.covariance @ right)
        )

    def points_with_jacobian(self, label: Ints) -> tuple[Floats, Floats, Ints]:
        """The unknowns are the points' coordinates."""
        columns = 3 * np.asarray(label)[:, None] + np.arange(3)
        return self.world[label], np.tile(np.eye(3), (len(label), 1, 1)), columns

    def ground_with_jacobian(self, label: Ints) -> tuple[Floats, Floats, Ints]:
        """The smooth ground is z = 0, known exactly."""
        world, jacobian, columns = self.points_with_jacobian(label)
        return world * [1, 1, 0], jacobian * [[1], [1], [0]], columns


class Changes(TypedDict, total=False):
    """What is not as usual with the frames."""

    frame_id: tuple[str, ...]
    time_utc_s: Floats
    sigma_time_s: Floats
    clock_offset_sigma_s: float


def frames(**changes: Unpack[Changes]) -> Frames:
    usual = Frames(
        frame_id=("f0", "f1"),
        time_utc_s=np.array([100.0, 102.5]),
        sigma_time_s=np.array([0.03, 0.04]),
        matched=np.ones(2, dtype=bool),
        reason=("", ""),
        clock_offset_s=0.0,
        clock_offset_sigma_s=1.0,
    )
    return replace(usual, **changes)


def ask(
    kind: MeasurementKind, points: Sequence[str], name: str = "it", **parameters: float
) -> MeasurementRequest:
    return MeasurementRequest(
        name=name, kind=kind, points=tuple(points), parameters=tuple(parameters.items())
    )


def measured(
    points: Points, requests: tuple[MeasurementRequest, ...], when: Frames
) -> tuple[MeasurementResults, tuple[Message, ...]]:
    return measure(cast("Adjustment", points), requests, when)  # all of one that measuring needs


def one(
    request: MeasurementRequest, adjustment: Points | None = None, when: Frames | None = None
) -> tuple[MeasurementResults, tuple[Message, ...]]:
    return measured(adjustment or Points(), (request,), when or frames())


# By hand, with 1 cm on each coordinate of each point.
BY_HAND = {
    "distance 3-4-5": (ask("distance", "AB"), 5.0, 0.01 * np.sqrt(2), "m"),
    "distance in space": (ask("distance", "BE"), np.sqrt(9 + 16 + 144), 0.01 * np.sqrt(2), "m"),
    # At the corner the two unit vectors leave at right angles: sqrt(2); the ends 1 each.
    "polyline": (ask("polyline", "ACB"), 7.0, 0.01 * np.sqrt(1 + 2 + 1), "m"),
    # Rectangle 3 x 4: each corner moves the area by half a diagonal: 2.5 m, four corners.
    "area": (ask("area", "ACBD"), 12.0, 0.01 * 2.5 * 2, "m2"),
    # At C between A (3 m) and B (4 m): 1/3, 1/4 and, at C, the hypotenuse of both.
    "angle": (
        ask("angle", "ACB"),
        90.0,
        np.degrees(0.01 * np.sqrt(2 * (1 / 9 + 1 / 16))),
        "deg",
    ),
    # C from the line A-B: 12/5; foot at 9/5 of 5 from A: shares 16/25 and 9/25.
    "line_distance": (
        ask("line_distance", "CAB"),
        2.4,
        0.01 * np.sqrt(1 + 0.64**2 + 0.36**2),
        "m",
    ),
    # E is 12 m over its foot, on ground that is rough by 2 cm.
    "height": (ask("height", "E"), 12.0, np.hypot(0.01, 0.02), "m"),
    "height of another": (ask("height", "AE"), 12.0, 0.01 * np.sqrt(2), "m"),
    "vertical_distance": (ask("vertical_distance", "EA"), -12.0, 0.01 * np.sqrt(2), "m"),
    "horizontal_distance": (ask("horizontal_distance", "EB"), 5.0, 0.01 * np.sqrt(2), "m"),
    # 12 up on 5 along, 13 m apart: 1 cm across turns it by 1 / 1300 at each end.
    "slope": (
        ask("slope", "BE"),
        np.degrees(np.arctan2(12, 5)),
        np.degrees(0.01 * np.sqrt(2) / 13),
        "deg",
    ),
    # The foot (6, 8) of E: shares -3, 2 and 2 of A, C and D, that turn against the clock.
    "plane_distance": (
        ask("plane_distance", "EACD"),
        12.0,
        0.01 * np.sqrt(1 + 9 + 4 + 4),
        "m",
    ),
    # 12 m2 seen from above, E 12 m high, A and C on the ground: 4 m on average. A corner that moves
    # sideways takes half of the side opposite to it with it, under 4 m; E up a third of the 12 m2.
    "volume": (
        ask("volume", "ACE"),
        12.0 * 4.0,
        np.hypot(0.01 * np.sqrt(2**2 * (3**2 + 8**2 + 10**2 + 3**2) + 4**2), 0.02 * 4.0),
        "m3",
    ),
    "profile": (ask("profile", "ACB"), 5.0, 0.01 * np.sqrt(2), "m"),
}


@pytest.mark.parametrize(("request_", "value", "sigma", "unit"), BY_HAND.values(), ids=BY_HAND)
def test_value_sigma_and_unit_by_hand(
    request_: MeasurementRequest, value: float, sigma: float, unit: str
) -> None:
    results, messages = one(request_)
    assert messages == ()
    assert results.value[0] == pytest.approx(value)
    assert results.sigma[0] == pytest.approx(sigma)
    assert results.unit == (unit,)
    assert results.interval_95[0] == pytest.approx(
        [value - 1.959964 * sigma, value + 1.959964 * sigma]
    )


def test_the_area_of_a_wall_is_not_that_of_its_plan() -> None:
    wall = np.array([[0.0, 0, 0], [3, 1, 0], [3, 1, 2], [0, 0, 2], [9, 9, 9]])
    results, messages = one(ask("area", "ABCD"), Points(world=wall))
    assert messages == ()
    assert results.value[0] == pytest.approx(2 * np.sqrt(10))
    _, messages = one(ask("area", "ACBD"), Points(world=wall))
    assert "crosses itself" in messages[0].text


def test_a_coordinate_gives_its_east_and_its_north() -> None:
    covariance = np.diag(np.arange(1.0, 16.0) ** 2)
    covariance[3, 4] = covariance[4, 3] = 10.0
    results, _ = one(ask("coordinate", "B", name="pole"), Points(covariance=covariance))
    assert results.name == ("pole east", "pole north")
    np.testing.assert_allclose(results.value, [3, 4])
    np.testing.assert_allclose(results.sigma, [4, 5])
    assert results.correlation[0, 1] == pytest.approx(10 / 20)


def test_skid_speed_with_an_uncertain_friction() -> None:
    results, _ = one(ask("skid_speed", "AB", mu=0.7, mu_sigma=0.05))
    speed = np.sqrt(2 * 0.7 * 9.80665 * 5)
    assert results.value[0] == pytest.approx(speed)  # 8.285 m/s
    by_length, by_mu = 0.5 * 0.01 * np.sqrt(2) / 5, 0.5 * 0.05 / 0.7
    assert results.sigma[0] == pytest.approx(speed * np.hypot(by_length, by_mu))
    assert results.unit == ("m/s",)


def test_skid_speed_along_a_curved_mark_takes_its_whole_length() -> None:
    results, _ = one(ask("skid_speed", "ACB", mu=0.7, mu_sigma=0.0))
    assert results.value[0] == pytest.approx(np.sqrt(2 * 0.7 * 9.80665 * 7))


def test_speed_with_timing_errors_of_both_frames() -> None:
    results, _ = one(ask("speed", "AB"))
    assert results.value[0] == pytest.approx(2.0)
    expected = 2.0 * np.hypot(0.01 * np.sqrt(2) / 5, 0.05 / 2.5)  # hypot(0.03, 0.04) = 0.05 s
    assert results.sigma[0] == pytest.approx(expected)
    assert results.unit == ("m/s",)


def test_speed_is_positive_whichever_frame_came_first() -> None:
    assert one(ask("speed", "BA"))[0].value[0] == pytest.approx(2.0)


NO_TIME = frames(time_utc_s=np.array([np.nan, 102.5]), sigma_time_s=np.array([np.nan, 0.04]))


@pytest.mark.parametrize(
    ("request_", "adjustment", "when", "why"),
    [
        (ask("distance", ("A", "Bb")), None, None, "did you mean 'B'"),
        (ask("distance", ("A", "zzz")), None, None, "'zzz' has no usable pick"),
        (ask("speed", "AC"), None, None, "no time, or the same"),
        (ask("speed", "AB"), Points(pick_frame=(0, 1, 0, 0, 1)), NO_TIME, "no time, or the same"),
        (ask("area", "ABCD"), None, None, "crosses itself"),  # lobes of equal size cancel
        (ask("area", "ABD"), Points(world=WORLD * [1, 0, 0]), None, "lie in line"),
        (ask("distance", "AB"), Points(world=0 * WORLD), None, "coincide"),
        (ask("skid_speed", "AB", mu=0.7, mu_sigma=0.1), Points(world=0 * WORLD), None, "coincide"),
        (ask("speed", "AB"), Points(world=0 * WORLD), None, "coincide"),
    ],
)
def test_what_cannot_be_measured_is_null_with_a_message(
    request_: MeasurementRequest, adjustment: Points | None, when: Frames | None, why: str
) -> None:
    results, messages = one(request_, adjustment, when)
    assert np.isnan(results.value[0])
    assert np.isnan(results.sigma[0])
    assert np.isnan(results.interval_95).all()
    assert [m.code for m in messages] == ["measurement-null"]
    assert why in messages[0].text
    assert "'it'" in messages[0].text


def test_speed_of_a_label_in_two_frames_is_refused() -> None:
    adjustment = Points()
    adjustment.survey.pick_frame = np.array([0, 1, 0, 0, 1, 1])
    adjustment.survey.pick_label = np.array([0, 1, 2, 3, 4, 0])
    results, messages = one(ask("speed", "AB"), adjustment)
    assert np.isnan(results.value[0])
    assert "picked in 2 frames" in messages[0].text


def test_one_missing_label_does_not_spoil_the_others() -> None:
    requests = (
        ask("distance", "AB", "good"),
        ask("coordinate", ("no",), "bad"),
        ask("area", "ACBD"),
    )
    results, messages = measured(Points(), requests, frames())
    assert results.name == ("good", "bad east", "bad north", "it")
    np.testing.assert_array_equal(np.isnan(results.value), [False, True, True, False])
    assert np.isnan(results.correlation[1]).all()
    assert results.correlation[0, 0] == pytest.approx(1)
    assert np.isfinite(results.correlation[0, 3])
    assert len(messages) == 1


def test_nothing_asked_gives_nothing() -> None:
    results, messages = measured(Points(), (), frames())
    assert results.value.shape == (0,)
    assert results.correlation.shape == (0, 0)
    assert messages == ()


def test_nothing_but_unseen_labels_gives_nulls() -> None:
    results, _ = one(ask("distance", ("x", "y")))
    assert np.isnan(results.value).all()


def test_covariances_of_all_kinds_equal_those_of_sampled_points(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(3, labels=6).survey
    adjustment = refine(survey, SolveOptions())[0].adjustment
    requests = (
        ask("distance", ("P0", "P1"), "d"),
        ask("polyline", ("P0", "P1", "P2", "P0"), "p"),
        ask("area", ("P0", "P1", "P2"), "a"),
        ask("angle", ("P3", "P4", "P5"), "w"),
        ask("line_distance", ("P0", "P4", "P5"), "l"),
        ask("coordinate", ("P2",), "c"),
        ask("skid_speed", ("P3", "P1"), "s", mu=0.7, mu_sigma=0.0),
    )
    when = frames(frame_id=("f0", "f1"))
    results, _ = measure(adjustment, requests, when)
    world, covariance = adjustment.joint_points(np.arange(6))
    rng = np.random.default_rng(0)
    # A tenth of the true spread: what is compared is the first order.
    samples = rng.multivariate_normal(np.zeros(18), 0.01 * covariance, 4000)
    values = np.array([by_hand(world + s.reshape(6, 3)) for s in samples])
    np.testing.assert_allclose(by_hand(world), results.value, rtol=1e-10)
    sampled = np.cov(values.T) / 0.01
    expected = results.correlation * np.outer(results.sigma, results.sigma)
    unit = np.outer(results.sigma, results.sigma)
    # Standard deviation of a sampled covariance: at most sqrt(2 / n) of the product of sigmas.
    np.testing.assert_allclose(sampled / unit, expected / unit, atol=5.5 * np.sqrt(2 / 4000))


def by_hand(p: Floats) -> Floats:
    """The requests of the test above, by other formulas than the package's."""
    n = np.linalg.norm
    legs = p[3] - p[4], p[5] - p[4]
    angle = np.degrees(np.arccos(legs[0] @ legs[1] / n(legs[0]) / n(legs[1])))
    base = p[5] - p[4]
    return np.array(
        [
            n(p[1] - p[0]),
            n(p[1] - p[0]) + n(p[2] - p[1]) + n(p[0] - p[2]),
            n(np.cross(p[1] - p[0], p[2] - p[0])) / 2,
            angle,
            n(np.cross(p[0] - p[4], base)) / n(base),
            p[2, 0],
            p[2, 1],
            np.sqrt(2 * 0.7 * 9.80665 * n(p[1] - p[3])),
        ]
    )


def test_two_distances_with_a_common_end_are_correlated_as_by_hand() -> None:
    # A-B and A-C: the share of A is the cosine between them, 3/5, of half of each variance.
    results, _ = measured(Points(), (ask("distance", "AB"), ask("distance", "AC", "2")), frames())
    assert results.correlation[0, 1] == pytest.approx(0.5 * 0.6)


def test_a_speed_of_two_frames_does_not_depend_on_the_clock_offset() -> None:
    late = frames(time_utc_s=np.array([107.0, 109.5]), clock_offset_sigma_s=30.0)
    assert one(ask("speed", "AB"), None, late)[0].sigma[0] == one(ask("speed", "AB"))[0].sigma[0]


def test_measuring_replaces_nothing_in_its_input() -> None:
    adjustment = Points()
    before = replace(ask("distance", "AB"))
    one(before, adjustment)
    np.testing.assert_array_equal(adjustment.world, WORLD)


def test_two_speeds_over_one_exposure_share_its_timing_error(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(2, frames=3, labels=9).survey
    once = {k: int(np.flatnonzero(survey.pick_label == k)[0]) for k in range(3)}
    # Each label in one frame of its own: 0 in the first, 1 in the second, 2 in the third.
    keep = [
        i
        for i in range(len(survey.pick_frame))
        if survey.pick_label[i] > 2 or survey.pick_frame[i] == survey.pick_label[i]
    ]
    assert len(once) == 3
    survey = select_picks(survey, np.isin(np.arange(len(survey.pick_frame)), keep)).survey
    adjustment = refine(survey, SolveOptions())[0].adjustment
    frames = Frames(
        frame_id=survey.frame_id,
        time_utc_s=np.array([0.0, 2.0, 4.0]),
        sigma_time_s=np.array([0.0, 0.3, 0.0]),
        matched=np.ones(3, dtype=bool),
        reason=("",) * 3,
        clock_offset_s=0.0,
        clock_offset_sigma_s=1.0,
    )
    requests = (
        MeasurementRequest(name="before", kind="speed", points=("P0", "P1")),
        MeasurementRequest(name="after", kind="speed", points=("P1", "P2")),
    )
    found, _ = measure(adjustment, requests, frames)

    # A second exposure that was later makes the first speed smaller and the second larger.
    assert found.correlation[0, 1] < -0.95


# Which measured values other solutions would change.


def make_measurements(values: list[float], sigmas: list[float]) -> MeasurementResults:
    value, sigma = np.array(values), np.array(sigmas)
    count = len(value)
    return MeasurementResults(
        name=tuple(f"M{i}" for i in range(count)),
        kind=("distance",) * count,
        points=(("A", "B"),) * count,
        value=value,
        sigma=sigma,
        unit=("m",) * count,
        interval_95=value[:, None] + 1.96 * sigma[:, None] * [-1, 1],
        correlation=np.eye(count),
    )


def test_a_value_within_its_interval_in_every_solution_is_the_only_one() -> None:
    rows = add_alternatives(
        make_measurements([20.0, 30.0], [0.1, 0.1]), [(20.19, 30.0), (19.81, 30.21)], [0.3, 0.3]
    )

    assert rows.alternative_values == ((), (30.21,))
    assert rows.is_ambiguous.tolist() == [False, True]


def test_other_values_are_in_order_and_those_of_one_value_stand_once() -> None:
    others = [(31.2,), (44.9,), (12.0,), (44.95,), (31.35,)]
    rows = add_alternatives(make_measurements([20.0], [0.1]), others, [0.1] * 5)

    assert rows.alternative_values == ((12.0, 31.2, 31.35, 44.9),)


def test_what_has_no_value_here_or_there_is_not_marked() -> None:
    rows = add_alternatives(
        make_measurements([np.nan, 20.0], [np.nan, 0.1]), [(5.0, np.nan)], [0.5]
    )

    assert rows.alternative_values == ((), ())


def test_one_solution_leaves_all_as_it_was() -> None:
    rows = add_alternatives(make_measurements([20.0, 30.0], [0.1, 0.1]), (), ())

    assert rows.alternative_values == ((), ())
    assert not rows.is_ambiguous.any()


def test_sigma_and_interval_include_other_explanations_by_their_odds() -> None:
    before = make_measurements([20.0, 30.0], [0.1, 0.2])
    # One explanation is as likely as the result, the other next to impossible.
    rows = add_alternatives(before, [(12.0, 32.0), (44.0, 30.0)], [0.5, 0.001])
    # Mixture of both normal distributions, drawn at random; second moments about the result.
    rng = np.random.default_rng(5)
    chosen = np.where(rng.random(200_000)[:, None] < 0.5, [20.0, 30.0], [12.0, 32.0])
    drawn = chosen + [0.1, 0.2] * rng.standard_normal((200_000, 2)) - [20.0, 30.0]

    covariance = drawn.T @ drawn / len(drawn)
    assert rows.sigma == pytest.approx(np.sqrt(np.diag(covariance)), rel=0.01)
    assert rows.correlation[0, 1] == pytest.approx(
        covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]), abs=0.01
    )
    assert rows.interval_95[0] == pytest.approx([12.0 - 0.196, 20.196])
    assert rows.alternative_values == ((12.0, 44.0), (32.0,))


def test_a_table_has_the_other_values_of_each_of_its_rows() -> None:
    with pytest.raises(ValueError, match=r"alternative_values: expected shape \(3,\), got \(1,\)"):
        replace(make_measurements([20.0, 30.0, 40.0], [0.1] * 3), alternative_values=((1.0,),))
