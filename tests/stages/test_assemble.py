"""Names become indices, and nothing is lost on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.errors import GeometryError
from uavgram.estimation.survey.observed import Observations
from uavgram.estimation.survey.selection import select_picks
from uavgram.model.camera import Calibration
from uavgram.model.frames import Frames, Telemetry
from uavgram.model.observations import KnownLines, KnownWorldPoints, Picks
from uavgram.model.options import AreaOptions, GroundOptions, SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.assemble import Assembled, assemble, free_control_heights
from uavgram.stages.refine import refine

NAN = np.nan


def picks(rows: tuple[Row, ...], area: tuple[str, ...] = ()) -> Picks:
    """Rows (image, label, u, v, sigma, height), and their areas."""
    image, label, u, v, sigma, height = zip(*rows, strict=True)
    return Picks(
        image=image,
        label=label,
        pixel_px=np.column_stack([u, v]),
        sigma_px=np.array(sigma),
        height_m=np.array(height),
        area=area,
    )


Row = tuple[str, str, float, float, float, float]
ROWS: tuple[Row, ...] = (
    ("f1", "A", 1, 2, NAN, NAN),
    ("f0", "B", 3, 4, 2.5, 0.7),
    ("f9", "A", 5, 6, NAN, NAN),
    ("f0", "A", 7, 8, NAN, NAN),
    ("f1", "B", 9, 10, NAN, NAN),
    ("f9", "C", 11, 12, NAN, NAN),
)
LINES = KnownLines(
    name=("ab", "withheld", "unseen", "ba"),
    start=("A", "A", "A", "B"),
    end=("B", "B", "Z", "A"),
    length_m=np.array([1.0, 2.0, 3.0, 4.0]),
    sigma_m=np.full(4, 0.01),
    adjust=np.array([True, False, True, True]),
)


def control(*labels: str) -> KnownWorldPoints:
    n = len(labels)
    return KnownWorldPoints(label=labels, world_m=np.ones((n, 3)), sigma_m=np.full((n, 3), 0.1))


NO_CONTROL = control()
GROUND = GroundOptions()


@pytest.fixture
def flight(scene_factory: Callable[..., Scene]) -> Telemetry:
    survey = scene_factory(0, frames=3).survey  # frames f0, f1, f2; the flight does not know f9
    assert survey.seeds is not None
    assert survey.telemetry is not None
    assert survey.track is not None
    return Telemetry(poses=survey.seeds, prior=survey.telemetry, track=survey.track)


@pytest.fixture
def calibration(scene_factory: Callable[..., Scene]) -> Calibration:
    return scene_factory(0).survey.calibration


def put_together(
    calibration: Calibration,
    telemetry: Telemetry | None,
    known: KnownWorldPoints = NO_CONTROL,
    rows: tuple[Row, ...] = ROWS,
    area: tuple[str, ...] = (),
    ground: GroundOptions = GROUND,
) -> Assembled:
    observed = Observations(
        calibration=calibration,
        lines=LINES,
        control=known,
        telemetry=telemetry,
        picks=picks(rows, area),
        ground=ground,
        picks_sigma_px=1.5,
    )
    return assemble(observed)


def test_picks_of_a_frame_without_an_instant_are_left_out_and_say_where_the_rest_went(
    calibration: Calibration, flight: Telemetry
) -> None:
    assembled = put_together(calibration, flight)
    survey = assembled.survey
    assert survey.frame_id == ("f0", "f1")
    assert survey.label == ("A", "B")  # C was only seen by f9
    assert assembled.pick_index.tolist() == [0, 1, -1, 2, 3, -1]
    for row, index in zip(ROWS, assembled.pick_index, strict=True):
        if index >= 0:
            assert survey.frame_id[survey.pick_frame[index]] == row[0]
            assert survey.label[survey.pick_label[index]] == row[1]
            assert tuple(survey.pixel_px[index]) == row[2:4]
    assert survey.pick_sigma_px.tolist() == [1.5, 2.5, 1.5, 1.5]


def test_a_height_stated_at_one_pick_holds_for_the_label_everywhere(
    calibration: Calibration, flight: Telemetry
) -> None:
    assert put_together(calibration, flight).survey.height_above_m.tolist() == [0.0, 0.7]


def test_withheld_and_unseen_lengths_do_not_enter(
    calibration: Calibration, flight: Telemetry
) -> None:
    assembled = put_together(calibration, flight)
    assert assembled.line_index.tolist() == [0, -1, -1, 1]
    assert assembled.survey.length_m.tolist() == [1.0, 4.0]
    assert assembled.survey.line_start.tolist() == [0, 1]
    assert assembled.survey.line_end.tolist() == [1, 0]


def test_the_prior_of_a_frame_follows_it_to_its_new_place(
    calibration: Calibration, flight: Telemetry
) -> None:
    rows = (*ROWS[2:3], ("f2", "A", 1, 1, NAN, NAN), ("f1", "B", 1, 1, NAN, NAN))
    survey = put_together(calibration, flight, rows=rows).survey
    assert survey.frame_id == ("f1", "f2")
    assert survey.telemetry is not None
    assert survey.seeds is not None
    assert survey.telemetry.frame_index.tolist() == [0, 1]
    np.testing.assert_array_equal(survey.telemetry.time_s, flight.prior.time_s[1:])
    np.testing.assert_array_equal(survey.seeds.center_world_m, flight.poses.center_world_m[1:])


@pytest.mark.parametrize(
    ("known", "gauge", "used"), [((), "plane", 0), (("A",), "plane", 0), (("A", "B"), "world", 2)]
)
def test_without_log_two_picked_control_points_make_a_world(
    calibration: Calibration, known: tuple[str, ...], gauge: str, used: int
) -> None:
    survey = put_together(calibration, None, control(*known, "never picked")).survey
    assert survey.gauge == gauge
    assert len(survey.control_label) == used
    assert survey.frame_id == ("f1", "f0", "f9")  # all frames with picks


def test_with_a_log_one_control_point_is_used(calibration: Calibration, flight: Telemetry) -> None:
    survey = put_together(calibration, flight, control("B")).survey
    assert survey.gauge == "world"
    assert survey.control_label.tolist() == [1]


def test_no_usable_frame_is_an_error(calibration: Calibration, flight: Telemetry) -> None:
    with pytest.raises(GeometryError, match="no usable frame remains"):
        put_together(calibration, flight, rows=ROWS[2:3])


def test_slope_sigma_is_turned_to_radians(calibration: Calibration, flight: Telemetry) -> None:
    ground = put_together(calibration, flight).survey.ground
    assert ground.slope_sigma_rad == pytest.approx(np.deg2rad(3.0))
    assert ground.height_sigma_m == 0.3


def put_in_areas(
    calibration: Calibration, flight: Telemetry, area: tuple[str, ...], ground: GroundOptions
) -> Assembled:
    return put_together(calibration, flight, area=area, ground=ground)


def test_an_area_stated_at_one_pick_holds_for_the_label_and_has_a_plane_of_its_own(
    calibration: Calibration, flight: Telemetry
) -> None:
    stated = AreaOptions(height_m=0.4, slope_sigma_deg=2.0)
    ground = GroundOptions(height_sigma_m=0.2, roughness_sigma_m=0.01, areas={"verge": stated})
    survey = put_in_areas(calibration, flight, ("", "", "", "verge", "", ""), ground).survey
    assert survey.area.tolist() == [1, 0]  # A, B
    road, verge = survey.grounds
    assert (road.name, road.height_m, road.height_sigma_m) == ("default", 0.0, 0.2)
    assert (verge.name, verge.height_m, verge.height_sigma_m) == ("verge", 0.4, 0.2)
    assert verge.slope_sigma_rad == pytest.approx(np.deg2rad(2.0))
    assert road.slope_sigma_rad == pytest.approx(np.deg2rad(3.0))
    assert verge.roughness_sigma_m == 0.01


def test_where_every_label_names_its_area_the_first_one_picked_comes_first(
    calibration: Calibration, flight: Telemetry
) -> None:
    area = ("verge", "road", "verge", "", "", "")
    survey = put_in_areas(calibration, flight, area, GroundOptions()).survey
    assert [ground.name for ground in survey.grounds] == ["verge", "road"]


def test_an_area_that_nobody_picked_is_told(calibration: Calibration, flight: Telemetry) -> None:
    ground = GroundOptions(areas={"vergue": AreaOptions(), "verge": AreaOptions()})
    (message,) = put_in_areas(calibration, flight, ("verge", *[""] * 5), ground).messages
    assert message.code == "area-unpicked"
    assert "'vergue'" in message.text
    assert "did you mean 'verge'" in message.text


def test_frames_keep_the_times_of_their_photos(calibration: Calibration) -> None:
    names = tuple(dict.fromkeys(row[0] for row in ROWS))
    unknown = ("a photo that nobody picked in",)
    frames = Frames(
        frame_id=(*unknown, *names[::-1]),
        time_utc_s=1.7e9 + np.arange(len(names) + 1.0),
        sigma_time_s=np.full(len(names) + 1, 0.01),
        matched=np.zeros(len(names) + 1, np.bool_),
        reason=("no flight log",) * (len(names) + 1),
        clock_offset_s=0.0,
        clock_offset_sigma_s=0.0,
    )
    observed = Observations(
        calibration=calibration,
        lines=LINES,
        picks=picks(ROWS, ()),
        ground=GROUND,
        picks_sigma_px=1.5,
        exposures=frames,
    )
    survey = assemble(observed).survey
    taken = dict(zip(survey.frame_id, survey.time_s - 1.7e9, strict=True))
    assert taken == {name: len(names) - k for k, name in enumerate(names)}
    one = survey.frame_id[-1]
    kept = select_picks(survey, survey.pick_frame == survey.frame_id.index(one)).survey
    assert kept.time_s.tolist() == [1.7e9 + taken[one]]
    assert kept.time_sigma_s.tolist() == [0.01]
    assert np.isnan(assemble(replace(observed, exposures=None)).survey.time_s).all()


# Control points use their own heights, and are not pressed onto the ground's plane.


OFF_M = {0: 0.9, 1: 0.1, 2: 1.4, 3: 0.6, 4: -0.4, 5: 0.3}


def on_a_facade() -> Scene:
    """One photo, with a log, of control points at heights that nobody stated."""
    scene = make_scene(6, frames=1, labels=6, lines=0, control=6, heights=OFF_M, roughness=0.02)
    return replace(scene, survey=replace(scene.survey, height_above_m=np.zeros(6)))


def worst_m(survey: Survey, scene: Scene) -> float:
    adjustment = refine(survey, SolveOptions())[0].adjustment
    world, _ = adjustment.points()
    there = [int(label[1:]) for label in adjustment.survey.label]
    return float(np.linalg.norm(world - scene.world[there], axis=1).max())


def test_control_points_off_the_plane_keep_their_own_heights() -> None:
    scene = on_a_facade()
    survey = free_control_heights(scene.survey)

    assert survey.is_free.all()
    assert worst_m(survey, scene) < 0.1


@pytest.mark.parametrize("slope", [0.0, 0.015])
def test_control_points_on_a_plane_say_where_it_is(slope: float) -> None:
    scene = make_scene(6, control=5, roughness=0.02)
    world = (
        scene.survey.control_world_m
        + np.outer(scene.survey.control_world_m[:, 0], [0, 0, 1]) * slope
    )
    survey = replace(scene.survey, control_world_m=world)

    assert not free_control_heights(survey).is_free.any()


def test_a_height_above_the_ground_that_is_stated_holds() -> None:
    scene = on_a_facade()
    above = np.array([0.9, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = free_control_heights(replace(scene.survey, height_above_m=above)).is_free

    np.testing.assert_array_equal(found, above == 0.0)


def test_without_a_log_they_place_photos_all_the_same() -> None:
    """Three points, one of them on a kerbstone, and lengths between other points."""
    ends = ((3, 5), (4, 7), (6, 9), (3, 8), (5, 9), (7, 8))
    heights = {1: 0.9}
    scene = make_scene(
        6, frames=2, labels=10, ends=ends, control=3, telemetry=False, heights=heights
    )
    survey = free_control_heights(replace(scene.survey, height_above_m=np.zeros(10)))

    assert survey.is_free[:3].all()
    assert worst_m(survey, scene) < 0.5  # heights of 5 cm over short bases tilt the plane
