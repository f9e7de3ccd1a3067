"""The worlds of the study of trust: their mathematics by other programs, their surveys by a run."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from pyproj import Transformer
from scipy.spatial.transform import Rotation
from trust_conditions import BASES, CONDITIONS, STRIP, World, draw
from trust_faults import (
    FAULTS,
    accepts,
    accused_rightly,
    draw_small,
    is_accusation,
    swapped_everywhere,
)
from trust_oracle import oracle_sigmas
from trust_world import (
    HOME,
    UNDULATION_M,
    Pose,
    Survey,
    body_turn,
    draw_lens,
    geodetic_from_enu,
    mount_turn,
    project,
    turn_of,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

from study_trust import drawn, judged, rms, zs


def test_projections_are_those_of_opencv() -> None:
    rng = np.random.default_rng(1)
    lens = draw_lens(rng).true
    pose = Pose(center=np.array([3.0, -2.0, 30.0]), rotation=turn_of(np.array([3.0, 0.2, -0.3])))
    world = np.column_stack([rng.uniform(-12, 12, (40, 2)), rng.uniform(-1, 1, 40)])
    matrix = np.array([[lens[0], 0, lens[2]], [0, lens[1], lens[3]], [0, 0, 1.0]])
    turn = pose.rotation.T
    expected, _ = cv2.projectPoints(
        world, cv2.Rodrigues(turn)[0], -turn @ pose.center, matrix, lens[4:]
    )
    pixels, depth = project(lens, pose, world)
    assert (depth > 20).all()
    assert np.abs(pixels - expected[:, 0]).max() < 1e-8


def test_turns_are_those_of_scipy() -> None:
    roll, pitch, yaw = 0.1, -0.2, 2.0
    ned = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    enu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ ned
    assert np.allclose(body_turn(roll, pitch, yaw), enu)
    vector = np.array([0.3, -0.1, 0.7])
    assert np.allclose(turn_of(vector), Rotation.from_rotvec(vector).as_matrix())


def test_a_camera_that_looks_down_has_the_nose_at_the_top_of_the_picture() -> None:
    axes = mount_turn(-np.pi / 2)  # columns: right, down, forward of the picture, in body axes
    assert np.allclose(axes, np.column_stack([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]))


def test_places_are_those_of_pyproj() -> None:
    world = np.random.default_rng(2).uniform(-300, 300, (20, 3))
    transformer = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={HOME[0]} +lon_0={HOME[1]} +h_0={HOME[2] + UNDULATION_M}"
    )
    east, north, up = world.T
    longitude, latitude, height = transformer.transform(east, north, up, direction="INVERSE")
    found = geodetic_from_enu(world)
    assert np.allclose(found[:, 0], latitude, atol=1e-11)
    assert np.allclose(found[:, 1], longitude, atol=1e-11)
    assert np.allclose(found[:, 2], height - UNDULATION_M, atol=1e-5)


@pytest.mark.parametrize("world", ["exact", "strip_no_log", "nadir_log"])
def test_a_run_agrees_with_the_truth_of_an_ordinary_survey(world: str) -> None:
    row = judged(drawn(world, "", 5), {"world": world, "fault": "", "seed": 5})
    assert len(row["values"]) > 8
    assert 0.2 < rms(zs(row)) < 2.5


def test_the_oracle_is_less_sure_where_observations_are_worse() -> None:
    survey = drawn("strip_log", "", 5)
    world = CONDITIONS["strip_log"]
    sigmas = np.array(oracle_sigmas(survey, world))
    assert (sigmas > 0).all()
    other = {"pick_px": 10 * world.pick_px, "identified_m": 0.05, "own_m": 0.05}
    worse = oracle_sigmas(survey, type(world)(**(vars(world) | other)))
    assert (np.array(worse) > 3 * sigmas).all()


def test_the_same_seed_gives_the_same_survey() -> None:
    one, two = (drawn("strip", "swapped_once", 3) for _ in range(2))
    assert [(p.label, *p.at) for p in one.picks] == [(p.label, *p.at) for p in two.picks]
    assert one.wrong == two.wrong
    other = drawn("strip", "swapped_once", 4)
    assert one.lines[0].length != other.lines[0].length


def test_who_is_accused() -> None:
    wrong = {"lengths": {"L2"}}
    reason = {"cause": "line-suspect", "labels": ["R1"], "frames": []}
    assert is_accusation("line-suspect")
    assert not is_accusation("nothing-checks")
    assert accused_rightly(reason | {"lengths": ["L2"]}, wrong)
    assert not accused_rightly(reason | {"lengths": ["L1"]}, wrong)
    assert not accused_rightly(reason | {"lengths": ["L1"]}, {})
    assert not accused_rightly(reason | {"lengths": ["L1"]}, {"labels": {"R1"}})


def test_causes_by_their_codes() -> None:
    assert accepts("length_in_feet", "line-wrong-unit")
    assert not accepts("length_in_feet", "lengths-factor")
    assert len(FAULTS) >= 16


@pytest.mark.parametrize(
    ("base", "fault", "seed", "cause"),
    [
        ("strip_no_log", "photo_elsewhere", 21000, "photo-elsewhere"),
        ("strip_no_log", "photo_mirrored", 21000, "photo-mirrored"),
        ("single", "all_in_feet", 12001, "lengths-wrong-unit"),
        ("strip", "swapped_all", 12000, "labels-swapped-everywhere"),
        ("strip_no_log", "all_hook_10cm", 12000, "lengths-offset-possible"),
        ("strip", "level_tapes", 12009, "lengths-level-possible"),
    ],
)
def test_a_fault_is_the_first_cause_and_no_value_beside_it_is_wrong_and_in_order(
    base: str, fault: str, seed: int, cause: str
) -> None:
    row = judged(drawn(base, fault, seed), {"world": base, "fault": fault, "seed": seed})
    assert row["reasons"][0]["cause"] == cause
    assert row["level"] != "green"
    assert max(map(abs, zs(row, "ok")), default=0.0) < 3.5


@pytest.mark.parametrize(
    ("seed", "fault", "cause"),
    [
        (1006, "photo_mirrored", "photo-mirrored"),  # two photos of one track
        (1105, "photo_half_size", "photo-elsewhere"),  # the other photo adapts to the scale
        (1115, "length_percent", "line-left-out"),  # a wrong pose of the log explains it, too
        (1192, "swapped_once", "labels-swapped-everywhere"),  # converges late
    ],
)
def test_a_fault_in_a_survey_of_few_photos_is_named_and_nothing_right_is_accused(
    seed: int, fault: str, cause: str
) -> None:
    planted, survey = draw_small(seed)
    assert planted == fault
    row = judged(survey, {"world": "small", "fault": fault, "seed": seed})
    first = row["reasons"][0]
    assert first["cause"] == cause
    assert accused_rightly(first, survey.wrong)
    assert max(map(abs, zs(row)), default=0.0) < 5.0


@pytest.mark.parametrize("seed", range(3))
def test_lengths_in_feet_in_one_photo_come_before_heights_that_would_fit_by_chance(
    seed: int,
) -> None:
    rng = np.random.default_rng([42, seed])
    survey = draw(World(log="gps", lengths=(6, 6), tilt_deg=(38, 46)), rng)
    FAULTS["all_in_feet"].plant(survey, rng)
    row = judged(survey, {"world": "one", "fault": "all_in_feet", "seed": seed})
    assert row["reasons"][0]["cause"] == "lengths-wrong-unit"
    assert max(map(abs, zs(row))) < 3.5


def test_a_photo_that_too_few_points_place_is_not_accused() -> None:
    planted, survey = draw_small(1143)
    assert not planted
    row = judged(survey, {"world": "small", "fault": "", "seed": 1143})
    assert "photo-elsewhere" not in {one["cause"] for one in row["reasons"]}


def test_a_click_that_explains_as_much_is_named_beside_the_length_that_was_left_out() -> None:
    """Of two errors that explain the same, neither is chosen."""
    survey = drawn("single", "pick_60_400px", 12003)
    row = judged(survey, {"world": "single", "fault": "pick_60_400px", "seed": 12003})
    (label,) = survey.wrong["labels"]
    first = row["reasons"][0]
    assert first["cause"] == "blunder-not-located"
    assert "the click on" in first["text"]
    assert repr(label) in first["text"].split("the click on")[1]
    assert label in first["labels"]
    assert len(first["lengths"]) == 1


def test_one_wrong_click_is_found_though_two_lengths_and_the_log_could_be_wrong_instead() -> None:
    """In one photo it turns the camera, and other clicks and lengths no longer fit."""
    survey = drawn("single", "pick_60_400px", 82001)
    row = judged(survey, {"world": "single", "fault": "pick_60_400px", "seed": 82001})
    assert "R3" in survey.wrong["labels"]
    first = row["reasons"][0]
    assert (first["cause"], first["labels"]) == ("pick-left-out", ["R3"])
    assert not any("length" in one["cause"] or one["lengths"] for one in row["reasons"][2:])


@pytest.mark.parametrize("seed", [82001, 97001])
def test_labels_swapped_in_the_only_photo_are_left_out_and_spoil_no_other_value(seed: int) -> None:
    survey = drawn("single", "swapped_once", seed)
    row = judged(survey, {"world": "single", "fault": "swapped_once", "seed": seed})
    first = row["reasons"][0]
    assert first["cause"] == "labels-swapped-everywhere"
    assert set(first["labels"]) == survey.wrong["labels"]
    assert row["level"] == "amber"
    assert max(map(abs, zs(row))) < 3.5


def test_several_wrong_clicks_are_found_without_any_length() -> None:
    survey = drawn("rtk_only", "", 7)
    wrong = survey.picks[:: len(survey.picks) // 5][:5]
    for pick in wrong:
        pick.at = pick.at + np.sign([2000.0, 1500.0] - pick.at) * [180.0, 140.0]
    row = judged(survey, {"world": "rtk_only", "fault": "", "seed": 7})
    assert not survey.lines
    assert row["reasons"][0]["cause"] == "pick-left-out"
    assert set(row["reasons"][0]["labels"]) == {pick.label for pick in wrong}


def test_one_wrong_withheld_length_is_amber_and_named() -> None:
    """It bends nothing; the other withheld lengths fit."""
    survey = drawn("strip_log", "", 5)
    for line in survey.lines[:3]:
        line.extra["use"] = "check"
    survey.lines[0].length *= 1.1
    row = judged(survey, {"world": "strip_log", "fault": "", "seed": 5})
    assert row["level"] == "amber"
    assert row["reasons"][0]["lengths"] == [survey.lines[0].name]
    assert max(map(abs, zs(row))) < 3.5


def test_one_wrong_length_among_exact_ones_is_not_taken_for_noise() -> None:
    survey = drawn("strip_log", "", 5)
    survey.lines[0].length += 0.15
    row = judged(survey, {"world": "strip_log", "fault": "", "seed": 5})
    assert row["reasons"][0]["lengths"] == [survey.lines[0].name]
    assert max(map(abs, zs(row))) < 3.5


def test_a_long_curved_valley_is_no_reason_for_red() -> None:
    """One photo from above under a log: 60 iterations were too few, and it was red."""
    row = judged(drawn("nadir_log", "", 71014), {"world": "nadir_log", "fault": "", "seed": 71014})
    assert row["level"] == "amber"
    assert max(map(abs, zs(row))) < 3.5


def test_a_log_of_a_flight_in_gusts_leads_to_a_result() -> None:
    """Its attitude changes between any two samples, so that the clock is no linear unknown."""
    rng = np.random.default_rng(0)
    survey = draw(STRIP, rng)
    assert survey.log is not None
    keep = np.exp(-0.1 / 5.0)  # samples each 0.1 s, correlated over 5 s
    gusts = np.zeros_like(survey.log.rpy)
    for k, push in enumerate(rng.standard_normal(gusts.shape)):
        gusts[k] = push if not k else keep * gusts[k - 1] + np.sqrt(1 - keep**2) * push
    survey.log.rpy = survey.log.rpy + np.radians(3.0) * gusts
    survey.options["time"]["offset_sigma_s"] = 0.3
    row = judged(survey, {"world": "strip_log", "fault": "", "seed": 0})
    assert "error:not-converged" not in row["messages"]
    assert row["level"] == "green"
    assert max(map(abs, zs(row))) < 3.5


def test_one_of_eight_lengths_that_bends_a_single_photo_is_left_out() -> None:
    """All first values contain it, and at the first minimum every other length is off, too."""
    rng = np.random.default_rng(9)
    survey = draw(replace(BASES["single_no_log"], lengths=(8, 8), taped=(8, 8)), rng)
    wrong = survey.lines[int(rng.integers(len(survey.lines)))]
    wrong.length += 1.0
    survey.wrong = {"lengths": {wrong.name}}
    row = judged(survey, {"world": "single_no_log", "fault": "length", "seed": 9})
    assert row["reasons"][0]["lengths"] == [wrong.name]
    assert max(map(abs, zs(row))) < 3.5


@pytest.mark.parametrize("log", ["gps", None])
def test_of_two_photos_one_of_another_place_spoils_nothing(log: str | None) -> None:
    rng = np.random.default_rng(3)
    survey = draw(replace(STRIP, photos=2, share=1.0, lengths=(6, 7), log=log), rng)
    FAULTS["photo_elsewhere"].plant(survey, rng)
    row = judged(survey, {"world": "strip", "fault": "photo_elsewhere", "seed": 3})
    first = row["reasons"][0]
    assert first["cause"] in ("photo-elsewhere", "frame-left-out")
    assert set(first["frames"]) >= set(survey.wrong["frames"])
    assert max(map(abs, zs(row))) < 3.5


def plant_wrong_click_at_a_length(survey: Survey, rng: np.random.Generator) -> None:
    """Move one click on an end of a length by 15 to 400 px."""
    taped = {end for line in survey.lines for end in line.ends}
    picks = [pick for pick in survey.picks if pick.label in taped]
    pick = picks[int(rng.integers(len(picks)))]
    turn, far = rng.uniform(0, 6.28), np.exp(rng.uniform(np.log(15), np.log(400)))
    most = [survey.lens.width - 2, survey.lens.height - 2]
    pick.at = np.clip(pick.at + far * np.array([np.cos(turn), np.sin(turn)]), 1, most)


@pytest.mark.parametrize(("log", "seed"), [("gps", 0), (None, 5)])
def test_picks_in_a_small_copy_of_one_of_two_photos_are_named_and_spoil_nothing(
    log: str | None, seed: int
) -> None:
    """They distort the points of both photos, so that lengths had been left out instead."""
    rng = np.random.default_rng(seed)
    survey = draw(replace(STRIP, photos=2, share=1.0, lengths=(6, 8), log=log), rng)
    FAULTS["photo_half_size"].plant(survey, rng)
    row = judged(survey, {"world": "strip", "fault": "photo_half_size", "seed": seed})
    first = row["reasons"][0]
    assert (first["cause"], set(first["frames"])) == (
        "photo-picked-in-copy",
        survey.wrong["frames"],
    )
    assert max(map(abs, zs(row))) < 3.5


@pytest.mark.parametrize("seed", [2, 4])
def test_exchanged_control_points_of_a_single_photo_are_named_and_spoil_nothing(seed: int) -> None:
    """With them the photo has no pose, or a false one: it begins from control that agrees."""
    world = World(log=None, clicks=2, control=6, lengths=(2, 2), taped=(8, 8), marks=(5, 5))
    rng = np.random.default_rng(seed)
    survey = draw(world, rng)
    FAULTS["control_exchanged"].plant(survey, rng)
    row = judged(survey, {"world": "strip", "fault": "control_exchanged", "seed": seed})
    first = row["reasons"][0]
    assert (first["cause"], set(first["labels"])) == ("control-exchanged", survey.wrong["labels"])
    assert 0.0 < max(map(abs, zs(row))) < 3.5


@pytest.mark.parametrize("seed", [2, 4])
def test_swapped_labels_of_control_points_are_named_beside_exchanged_coordinates(seed: int) -> None:
    """In a single photo both look the same where nothing else is measured from the points."""
    world = World(log=None, clicks=2, control=6, lengths=(2, 2), taped=(8, 8), marks=(5, 5))
    rng = np.random.default_rng(seed)
    survey = draw(world, rng)
    ends = {end for line in survey.lines for end in line.ends}
    one, other, *_ = sorted(survey.control.keys() - ends)
    for pick in survey.picks:
        pick.label = {one: other, other: one}.get(pick.label, pick.label)
    survey.blame(labels=[one, other])
    row = judged(survey, {"world": "strip", "fault": "swapped", "seed": seed})
    first = row["reasons"][0]
    assert (first["cause"], set(first["labels"])) == ("control-exchanged", {one, other})
    assert "are swapped in the photo, and nothing shows which" in first["text"]
    # The swap is in the sigmas of what it may spoil.
    wrong = {v["name"]: v["status"] for v in row["values"] if abs(zs({"values": [v]})[0]) > 3.5}
    assert wrong == {}
    assert "doubtful" in {v["status"] for v in row["values"]}


@pytest.mark.parametrize("seed", [5, 8])
def test_most_points_off_the_ground_without_a_stated_height_spoil_nothing(seed: int) -> None:
    """Photos from nearly one place hardly show heights; a scene of no size would fit any (8)."""
    world = World(
        photos=4,
        path="strip",
        tilt_deg=(0, 3),
        height_m=(58, 62),
        size_m=(60, 30),
        taped=(8, 8),
        marks=(40, 40),
        lengths=(6, 6),
        raised=28,
    )
    survey = draw(world, np.random.default_rng(seed))
    for pick in survey.picks:
        pick.extra.pop("height_m", None)
    row = judged(survey, {"world": "strip", "fault": "blank heights", "seed": seed})
    assert row["level"] == "amber"
    assert len(zs(row, kind="distance")) > 3
    assert max(map(abs, zs(row, kind="distance"))) < 3.5


@pytest.mark.parametrize(
    ("lengths", "tilt", "seed"),
    [
        (3, (20, 35), [1294290298, 109]),
        (4, (0, 10), [2460935118, 104]),
        (3, (55, 62), [2922785948, 106]),
    ],
)
def test_of_two_clicks_on_the_end_of_a_length_no_wrong_one_is_taken_for_right(
    lengths: int, tilt: tuple[float, float], seed: list[int]
) -> None:
    """With few lengths the photo has another pose with each click, and both may fit."""
    rng = np.random.default_rng(seed)
    world = replace(
        BASES["single_no_log"],
        clicks=2,
        lengths=(lengths, lengths),
        taped=(lengths + 1, lengths + 2),
        tilt_deg=tilt,
    )
    survey = draw(world, rng)
    plant_wrong_click_at_a_length(survey, rng)
    row = judged(survey, {"world": "single_no_log", "fault": "click", "seed": 0})
    assert max(map(abs, zs(row))) < 5.0


@pytest.mark.parametrize("seed", [1001])
def test_two_exchanged_control_points_are_named_without_a_log(seed: int) -> None:
    """Of four points the exchanged ones agree with each other in a movement of their own."""
    rng = np.random.default_rng(seed)
    survey = draw(replace(STRIP, control=4, log=None), rng)
    FAULTS["control_exchanged"].plant(survey, rng)
    row = judged(survey, {"world": "strip", "fault": "control_exchanged", "seed": seed})
    first = row["reasons"][0]
    assert (first["cause"], set(first["labels"])) == ("control-exchanged", survey.wrong["labels"])
    assert max(map(abs, zs(row))) < 3.5


@pytest.mark.parametrize("seed", [1, 2])
def test_where_two_of_three_control_points_are_exchanged_the_third_is_not_accused(
    seed: int,
) -> None:
    """The two agree with each other in a scene that is turned by 180 degrees."""
    rng = np.random.default_rng(seed)
    survey = draw(replace(STRIP, control=3, log=None), rng)
    FAULTS["control_exchanged"].plant(survey, rng)
    row = judged(survey, {"world": "strip", "fault": "control_exchanged", "seed": seed})
    first = row["reasons"][0]
    assert (first["cause"], set(first["labels"])) == ("control-exchanged", survey.wrong["labels"])
    assert max(map(abs, zs(row))) < 3.5


@pytest.mark.parametrize("world", ["single", "single_no_log"])
def test_wrong_picks_of_a_single_photo_accuse_no_length(world: str) -> None:
    """They turn the photo, so that many lengths seem less exact, and no misfit is a gross error."""
    case = {"world": world, "fault": "swapped_once", "seed": 97001}
    survey = drawn(world, "swapped_once", 97001)

    first = judged(survey, case)["reasons"][0]
    assert first["cause"] == "labels-swapped-everywhere"
    assert set(first["labels"]) == survey.wrong["labels"]


@pytest.mark.parametrize(
    ("lengths", "log", "seed"),
    [(4, None, 5), (4, None, 8), (5, None, 1), (5, None, 3), (5, None, 10), (4, "gps", 4)],
)
def test_labels_swapped_at_few_lengths_of_a_photo_spoil_nothing(
    lengths: int, log: str | None, seed: int
) -> None:
    """Where a wrong length would explain as much, the sigma contains the exchange of labels."""
    rng = np.random.default_rng([lengths, seed])
    world = World(log=log, lengths=(lengths, lengths), taped=(6, 6), tilt_deg=(5, 40), clicks=2)
    survey = draw(world, rng)
    swapped_everywhere(survey, rng)
    row = judged(survey, {"world": "few", "fault": "swapped_all", "seed": seed})
    named = {label for one in row["reasons"] for label in one["labels"]}
    assert named >= survey.wrong["labels"]
    assert row["level"] == "amber"
    assert max(map(abs, zs(row))) < 3.5


@pytest.mark.parametrize("log", ["gps", None])
def test_a_wrong_stated_height_in_one_photo_is_not_in_order(log: str | None) -> None:
    """Clicks that are repeated, and lengths elsewhere, do not show it."""
    rng = np.random.default_rng(1)
    world = World(log=log, lengths=(6, 6), taped=(6, 6), marks=(4, 4), clicks=2)
    survey = draw(world, rng)
    for pick in survey.picks:
        if pick.label == "P2":
            pick.extra |= {"height_m": 0.9, "height_sigma_m": 0.02}
    row = judged(survey, {"world": "single", "fault": "height_wrong", "seed": 1})
    assert max(map(abs, zs(row))) > 5.0
    assert max(map(abs, zs(row, "ok"))) < 3.5
    assert row["level"] == "amber"
    assert any(
        one["cause"] == "nothing-checks" and one["labels"] == ["P2"] for one in row["reasons"]
    )


def test_a_photo_with_the_log_as_its_only_scale_is_not_in_order() -> None:
    """A height of the log that is 4 m off would not be noticed."""
    survey = draw(World(lengths=(0, 0), clicks=2), np.random.default_rng(0))
    assert survey.log is not None
    survey.log.position[:, 2] += 4.0
    row = judged(survey, {"world": "single", "fault": "log", "seed": 0})
    assert zs(row)
    assert not zs(row, "ok")
    assert row["reasons"][0]["cause"] == "nothing-checks"
    assert "(up)" in row["reasons"][0]["text"]
    assert row["level"] == "amber"


@pytest.mark.parametrize("log", ["gps", None])
def test_labels_swapped_in_one_of_two_photos_may_be_swapped_in_the_other(log: str | None) -> None:
    rng = np.random.default_rng(4)
    world = replace(STRIP, photos=2, path="facing", share=1.0, lengths=(5, 5), log=log)
    survey = draw(world, rng)
    for pick in survey.picks:
        if pick.photo == 1 and pick.label in ("P1", "P2"):
            pick.label = {"P1": "P2", "P2": "P1"}[pick.label]
    row = judged(survey, {"world": "strip", "fault": "swapped_once", "seed": 4})
    first = row["reasons"][0]
    assert first["cause"] == "labels-swapped"
    assert set(first["labels"]) == {"P1", "P2"}
    assert all(survey.photo(k) in first["text"] for k in (0, 1))
    assert max(map(abs, zs(row))) < 3.5


@pytest.mark.parametrize(
    ("photos", "log", "seed"), [(1, "gps", 2), (1, None, 24), (1, "gps", 32), (2, None, 6)]
)
def test_exchanged_readings_of_few_lengths_are_named_and_spoil_nothing(
    photos: int, log: str | None, seed: int
) -> None:
    rng = np.random.default_rng([31, seed])
    path = "facing" if photos == 2 else "single"
    world = World(photos=photos, path=path, log=log, lengths=(5, 5), taped=(6, 6), tilt_deg=(5, 35))
    survey = draw(world, rng)
    one, two = sorted(survey.lines, key=lambda line: line.length)[1:4:2]
    one.length, two.length = two.length, one.length
    row = judged(survey, {"world": "few", "fault": "lines_exchanged", "seed": seed})
    assert set(row["reasons"][0]["lengths"]) & {one.name, two.name}
    assert row["level"] == "amber"
    assert max(map(abs, zs(row))) < 3.5
