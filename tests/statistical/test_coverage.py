"""Are the uncertainties honest? Many random scenes against the truth, one error at a time too.

With every source on at once, a mistake in one hides behind the others; so each is switched on
alone as well, in scenes where nothing but its own prior or noise decides the result. The bounds
are those of chi-square and binomial at 1e-6 for the number of trials. Planted bugs show that the
bounds can be broken.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from uavgram.estimation import plane_pose, survey_problem
from uavgram.estimation.survey_problem import SurveyProblem
from uavgram.geometry import shapes
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

pytestmark = pytest.mark.statistical

TRIALS, FEWER = 400, 60
TAIL = 1e-6 / 2

FAN = ((0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (3, 4), (5, 0))
NET = tuple((a, b) for a in range(6) for b in range(a))
ROWS = {
    "one frame of a flight": {"frames": 1, "labels": 4, "lines": 0},
    "many frames of a flight": {"frames": 5, "labels": 8, "lines": 3},
    "lengths alone": {
        "frames": 1,
        "labels": 6,
        "telemetry": False,
        "gauge": "plane",
        "ends": FAN,
        "spread": 7.0,
    },
    "lengths of a net": {
        "frames": 1,
        "labels": 8,
        "telemetry": False,
        "gauge": "plane",
        "ends": NET,
        "measured": (6, 7),
    },
    "control": {"frames": 2, "labels": 8, "lines": 0, "telemetry": False, "control": 5},
    "rough ground": {"frames": 2, "labels": 6, "lines": 2, "roughness": 0.15},
}
MANY = ("many frames of a flight", "lengths alone", "control")
"""The rows of which all sources together are tried in as many scenes as it takes to see a third."""

TELEMETRY = ("telemetry", "boresight", "lever_arm", "position_bias", "heading_bias", "clock")
CASES = [
    *[("one frame of a flight", (s,)) for s in ("pixels", "calibration", "plane", *TELEMETRY)],
    ("one frame of a flight", None),
    *[("many frames of a flight", (s,)) for s in ("pixels", "telemetry")],
    ("many frames of a flight", None),
    *[("lengths alone", (s,)) for s in ("pixels", "lengths", "calibration")],
    ("lengths alone", None),
    *[("control", (s,)) for s in ("pixels", "control", "calibration")],
    ("control", None),
    ("lengths of a net", ("pixels",)),
    ("rough ground", ("roughness",)),
]


@pytest.fixture(autouse=True)
def _coarse_search(monkeypatch):
    """Seven lines and more need no fine search: time for more scenes."""
    monkeypatch.setattr(plane_pose, "TILT_STEP_DEG", 20.0)


def one_trial(scene, measured, change=None):
    """Squared error over variance of a distance, and of its two points together (4 numbers)."""
    survey = scene.survey if change is None else change(scene.survey)
    adjustment = refine(survey, SolveOptions())[0].adjustment
    label = np.array([adjustment.label_index(name) for name in (f"P{k}" for k in measured)])
    if (label < 0).any():
        return None
    world, covariance = adjustment.joint_points(label)
    truth = scene.world[list(measured)]
    value, gradient = shapes.distance(world)
    variance = gradient.ravel() @ covariance @ gradient.ravel()
    plan = [0, 1, 3, 4]
    error = (world - truth).ravel()[plan]
    together = error @ np.linalg.solve(covariance[np.ix_(plan, plan)], error)
    return (value - np.linalg.norm(truth[1] - truth[0])) ** 2 / variance, together


def violations(scene_factory, row, sources, change=None, trials=FEWER):
    """What is not as the covariances say, in words."""
    found = []
    options = dict(ROWS[row])
    measured = options.pop("measured", (1, 3))
    for seed in range(trials):
        scene = scene_factory(1000 + seed, sources=sources, **options)
        result = one_trial(scene, measured, change)
        if result is not None:
            found.append(result)
    found = np.array(found)
    n = len(found)
    assert n > 0.75 * trials  # the others did not see both points
    words = []
    for name, values, degrees in (("distance", found[:, 0], 1), ("points", found[:, 1], 4)):
        low, high = chi2.ppf([TAIL, 1 - TAIL], n * degrees) / n
        if not low <= values.mean() <= high:
            words.append(f"{name}: mean square {values.mean():.2f} not in {low:.2f}..{high:.2f}")
        inside = (values <= chi2.ppf(0.95, degrees)).sum()
        least, most = binom.ppf([TAIL, 1 - TAIL], n, 0.95)
        if not least <= inside <= most:
            words.append(f"{name}: {inside} of {n} within 95 %, not {least:.0f}..{most:.0f}")
    return words


@pytest.mark.parametrize(
    ("row", "sources"), CASES, ids=lambda v: v if isinstance(v, str) else "+".join(v or ("all",))
)
def test_errors_are_as_large_as_the_covariances_say(scene_factory, row, sources):
    trials = TRIALS if sources is None and row in MANY else FEWER
    assert violations(scene_factory, row, sources, trials=trials) == []


# Planted bugs: each must break the bounds.


def without_calibration_covariance(monkeypatch):
    root = survey_problem.covariance_root
    monkeypatch.setattr(survey_problem, "covariance_root", lambda c: 1e-6 * root(c))


def rotation_on_the_wrong_side(monkeypatch):
    right = SurveyProblem._pixels

    def wrong(self, state):
        block = right(self, state)
        if block is None:
            return None
        first = self.layout.point_size + 3
        jacobian = np.array(block.jacobian)
        back = np.swapaxes(state.rotation, 1, 2)[self.survey.pick_frame]
        jacobian[:, :, first : first + 3] = jacobian[:, :, first : first + 3] @ back
        return replace(block, jacobian=jacobian)

    monkeypatch.setattr(SurveyProblem, "_pixels", wrong)


def telemetry_sigma_for_variance(monkeypatch):
    start = SurveyProblem.__init__

    def wrong(self, *arguments):
        start(self, *arguments)
        covariance = self.survey.telemetry.covariance
        sigma = np.sqrt(np.einsum("nii->ni", covariance))
        self.telemetry_whitening = np.eye(6) / np.sqrt(sigma)[:, None, :]

    monkeypatch.setattr(SurveyProblem, "__init__", wrong)


def length_variance_for_sigma(monkeypatch):
    right = SurveyProblem._lengths

    def wrong(self, state):
        block = right(self, state)
        weight = 1 / self.survey.length_sigma_m[self.line_index]
        return replace(
            block,
            residual=block.residual * weight[:, None],
            jacobian=block.jacobian * weight[:, None, None],
        )

    monkeypatch.setattr(SurveyProblem, "_lengths", wrong)


def twice(name):
    def plant(monkeypatch):
        right = SurveyProblem.evaluate

        def wrong(self, state):
            blocks = right(self, state)
            return None if blocks is None else blocks | {"again": blocks[name]}

        monkeypatch.setattr(SurveyProblem, "evaluate", wrong)

    return plant


def ends_apart(survey):
    """Every line gets ends of its own, with copies of the picks: nothing is shared."""
    ends = np.stack([survey.line_start, survey.line_end], axis=1)
    labels, names = len(survey.label), list(survey.label)
    frame, label = list(survey.pick_frame), list(survey.pick_label)
    pixel = list(survey.pixel_px)
    new = np.empty_like(ends)
    for index, old in np.ndenumerate(ends):
        new[index] = len(names)
        names.append(f"{survey.label[old]} again {index}")
        for pick in np.flatnonzero(survey.pick_label == old):
            frame.append(survey.pick_frame[pick])
            label.append(new[index])
            pixel.append(survey.pixel_px[pick])
    assert len(names) == labels + ends.size
    return replace(
        survey,
        label=tuple(names),
        height_above_m=np.append(survey.height_above_m, np.zeros(ends.size)),
        pick_frame=np.array(frame),
        pick_label=np.array(label),
        pixel_px=np.array(pixel),
        pick_sigma_px=np.full(len(frame), survey.pick_sigma_px[0]),
        line_start=new[:, 0],
        line_end=new[:, 1],
    )


ONE = "one frame of a flight"
BUGS = {
    "calibration covariance dropped": (without_calibration_covariance, ONE, "calibration", 60),
    "rotation error on the wrong side": (
        rotation_on_the_wrong_side,
        "many frames of a flight",
        "telemetry",
        30,
    ),
    "telemetry sigma used for variance": (telemetry_sigma_for_variance, ONE, "telemetry", 30),
    "length variance used for sigma": (length_variance_for_sigma, "lengths alone", "lengths", 30),
    "boresight counted twice": (twice("boresight"), ONE, "boresight", 100),
    "telemetry counted twice": (twice("telemetry"), ONE, "telemetry", 80),
    "plane counted twice": (twice("plane"), ONE, "plane", 250),
}


@pytest.mark.parametrize(("plant", "row", "source", "trials"), BUGS.values(), ids=BUGS.keys())
def test_a_planted_bug_breaks_the_bounds(scene_factory, monkeypatch, plant, row, source, trials):
    plant(monkeypatch)
    assert violations(scene_factory, row, (source,), trials=trials)


def test_shared_ends_treated_as_two_points_break_the_bounds(scene_factory):
    assert violations(scene_factory, "lengths of a net", ("pixels",), ends_apart, trials=100)
