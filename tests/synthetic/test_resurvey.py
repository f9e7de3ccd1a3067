"""Everything that a real survey observed is drawn anew about what was adjusted of it."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from uavgram.geometry.camera.projection import back_project, project
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownThings, Picks, Source
from uavgram.model.survey import TiePicks
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.synthetic.resurvey import ProjectWorld, make_project_world
from uavgram.synthetic.scenario import RepeatedSurvey, Scenario
from uavgram.synthetic.survey import make_inputs, simulate

TIE_PX, MATCH_PX, HEIGHT_M, KNOWN_M = 0.3, 0.05, 0.05, 0.02
AZIMUTH_DEG = 0.3
RAISED = "P1"


def survey() -> tuple[Inputs, int]:
    """The demo with a point at a stated height, ties, matches and a known distance."""
    rng = np.random.default_rng(8)
    points = tuple(
        replace(one, height_m=0.4 if one.label == RAISED else 0.0) for one in Scenario().points
    )
    stated = replace(Scenario().stated, noise="stated")
    drawn = simulate(replace(Scenario(), points=points, stated=stated))
    truth, inputs = drawn.truth, make_inputs(drawn)
    lens, size = truth.intrinsics, (drawn.calibration.width_px, drawn.calibration.height_px)

    def seen(frame: int, place: Floats) -> Floats:
        in_camera = (place - truth.center_world_m[frame]) @ truth.world_from_camera[frame]
        return project("brown", lens, in_camera)

    middle = truth.point_world_m.mean(axis=0)
    spread = middle + rng.uniform(-8.0, 8.0, (40, 3)) * [1.0, 1.0, 0.1]
    rows = []
    for frame in range(len(truth.frame_id)):
        pixel = seen(frame, spread)
        inside = np.all((pixel > 50) & (pixel < np.array(size) - 50), axis=1)
        rows += [(frame, k, *pixel[k]) for k in np.flatnonzero(inside)]
    ties = TiePicks(
        image=tuple(truth.frame_id[int(row[0])] for row in rows),
        tie=tuple(f"t{row[1]}" for row in rows),
        pixel_px=np.array([row[2:] for row in rows]) + TIE_PX * rng.standard_normal((len(rows), 2)),
        sigma_px=np.full(len(rows), TIE_PX),
    )
    picks, origin = inputs.picks, 0
    frame = truth.frame_id.index(picks.image[origin])
    ray = truth.world_from_camera[frame] @ back_project("brown", lens, picks.pixel_px[origin])
    label = truth.label.index(picks.label[origin])
    center = truth.center_world_m[frame]
    along = (truth.point_world_m[label, 2] - center[2]) / ray[2]
    others = [k for k in range(len(truth.frame_id)) if k != frame][:4]
    found = np.array([seen(k, center + along * ray) for k in others])
    count = len(others)
    height = np.where(np.array(picks.label) == RAISED, 0.4, picks.height_m)
    sigma = np.where(np.array(picks.label) == RAISED, HEIGHT_M, picks.height_sigma_m)
    hand: list[Source] = ["hand"] * len(picks.image)
    match: list[Source] = ["match"] * count
    picks = Picks(
        image=(*picks.image, *(truth.frame_id[k] for k in others)),
        label=(*picks.label, *(picks.label[origin],) * count),
        pixel_px=np.concatenate(
            [picks.pixel_px, found + MATCH_PX * rng.standard_normal((count, 2))]
        ),
        sigma_px=np.concatenate([picks.sigma_px, np.full(count, MATCH_PX)]),
        height_m=np.concatenate([height, np.full(count, np.nan)]),
        height_sigma_m=np.concatenate([sigma, np.full(count, np.nan)]),
        source=(*hand, *match),
        from_image=(*("",) * len(picks.image), *(picks.image[origin],) * count),
        from_px=np.concatenate(
            [np.full((len(picks.image), 2), np.nan), np.tile(picks.pixel_px[origin], (count, 1))]
        ),
    )
    ends = ("P6", "P15")
    a, b = (truth.point_world_m[truth.label.index(end)] for end in ends)
    azimuth = np.degrees(np.arctan2(*(b - a)[:2])) % 360.0
    known = KnownThings(
        name=("known", "wall"),
        kind=("distance", "azimuth"),
        points=(ends, ends),
        value=np.array([np.linalg.norm(b - a) + KNOWN_M, azimuth]),
        sigma=np.array([KNOWN_M, AZIMUTH_DEG]),
        adjust=np.array([True, True]),
        parameters=((), ()),
    )
    return replace(inputs, picks=picks, ties=ties, known=known), count


@pytest.fixture(scope="module")
def world() -> ProjectWorld:
    inputs, matches = survey()
    made = make_project_world(RepeatedSurvey(name="again"), inputs, None)
    assert len(made.survey.matches.row) == matches + 1  # and the pick that they were found from
    assert len(made.survey.ties.row) > 0.9 * len(inputs.ties.tie)
    return made


def test_without_errors_the_truth_comes_out_again(world: ProjectWorld) -> None:
    """Of everything: whatever was drawn about another place than the truth's would bend it."""
    exact = world.exact()
    found = compute(exact.inputs, posed=exact.posed, curved=False)
    table, survey = found.result.measurements, found.refined.adjustment.survey
    assert len(survey.matches.row) == len(world.survey.matches.row)
    assert len(survey.ties.row) == len(world.survey.ties.row)
    assert len(survey.known) == 2
    row = [table.name.index(name) for name in exact.name]
    off = (table.value[row] - exact.true) / table.sigma[row]
    assert np.abs(off).max() < 1e-2


def test_other_processes_draw_the_same(world: ProjectWorld) -> None:
    there = pickle.loads(pickle.dumps(world))  # noqa: S301  (our own)
    here, again = world.draw(2).inputs, there.draw(2).inputs
    assert np.array_equal(here.picks.pixel_px, again.picks.pixel_px)
    assert np.array_equal(here.lines.length_m, again.lines.length_m)


def test_each_observation_has_the_error_that_is_stated_of_it(world: ProjectWorld) -> None:
    exact, draws = world.exact().inputs, [world.draw(k).inputs for k in range(60)]
    ties = np.array([one.ties.pixel_px - exact.ties.pixel_px for one in draws])
    assert ties.std() == pytest.approx(TIE_PX, rel=0.02)
    known = np.array([one.known.value - exact.known.value for one in draws])
    squares = np.sum((known / [KNOWN_M, AZIMUTH_DEG]) ** 2, axis=0)
    assert np.all((chi2.ppf(0.001, 60) < squares) & (squares < chi2.ppf(0.999, 60)))
    raised = exact.picks.label.index(RAISED)
    heights = np.array([one.picks.height_m[raised] - exact.picks.height_m[raised] for one in draws])
    assert heights.std() == pytest.approx(HEIGHT_M, rel=0.4)
    # All picks of a label state the same height.
    same = np.array(draws[0].picks.label) == RAISED
    assert len(set(draws[0].picks.height_m[same & np.isfinite(draws[0].picks.height_m)])) == 1


def test_a_match_repeats_the_error_of_its_pick(world: ProjectWorld) -> None:
    exact, draws = world.exact().inputs.picks, [world.draw(k).inputs.picks for k in range(40)]
    match = int(np.flatnonzero(exact.of_source("match"))[0])
    origin = next(
        i
        for i in range(len(exact.image))
        if (exact.image[i], exact.label[i]) == (exact.from_image[match], exact.label[match])
    )
    pick = np.array([one.pixel_px[origin] - exact.pixel_px[origin] for one in draws])
    found = np.array([one.pixel_px[match] - exact.pixel_px[match] for one in draws])
    assert pick.std() == pytest.approx(0.7, rel=0.3)
    # On the ground they are one place; a photo shows it turned and a little larger or smaller.
    left = found - pick @ np.linalg.lstsq(pick, found, rcond=None)[0]
    assert left.std() < 2 * MATCH_PX
    assert 0.7 < found.std() / pick.std() < 1.4
    assert all(
        one.from_px[match] == pytest.approx(one.pixel_px[origin], abs=1e-12) for one in draws
    )


def test_hand_picks_are_beside_what_is_meant_alike_in_all_photos(world: ProjectWorld) -> None:
    inputs = world.inputs
    far = replace(inputs, project=replace(inputs.project, picks_identification_sigma_m=0.5))
    apart = [replace(world, inputs=given).draw(3).inputs.picks for given in (far, inputs)]
    moved = apart[0].pixel_px - apart[1].pixel_px
    label, source = np.array(apart[0].label), np.array(apart[0].source)
    own = moved[(label == "P6") & (source == "hand")]

    assert len(own) > 3
    size = np.linalg.norm(own, axis=1)
    assert size.min() > 1.0  # px; photos differ in height and heading, and by no draw of their own
    assert size.max() < 1.3 * size.min()
