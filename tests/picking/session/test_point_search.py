"""The search in other photos: the newest picks first, nothing proposed of what is gone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.estimation.measuring.predicted_pixels import TransferredPixels
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.imaging.matching.least_squares import (
    REASON_TEXTS,
    Matches,
    RefusalReason,
    SoughtPoints,
)
from uavgram.imaging.photos.cache import GreyPhotos
from uavgram.imaging.raster import Image
from uavgram.model.observations import MeasurementRequest, Picks
from uavgram.model.work import report_work
from uavgram.picking.document.commands import Place
from uavgram.picking.document.proposals import BY_HAND, Outcomes
from uavgram.picking.document.state import Line, Pick, State
from uavgram.picking.session import point_search as module
from uavgram.picking.session.point_search import OFF_GROUND, PickedTargets, PointSearch, SearchInput
from uavgram.picking.session.proposal_table import ProposalTable
from uavgram.picking.session.workers import WatchedWork, collect_observations
from uavgram.pipeline.match import search as search_module
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey
from uavgram.stages.match import (
    CONTRADICTED,
    RAISED_PX,
    REGION_SQUARED,
    Candidates,
    Found,
    Pair,
    Record,
)

LONGEST_WAIT_S = 20.0
TARGETS = ("2.jpg", "3.jpg")


def state(*labels: str, u: float = 10.0) -> State:
    return State(picks=tuple(Pick(image="1.jpg", label=one, u_px=u, v_px=5.0) for one in labels))


def adjusted(of: State, *frames: str) -> LiveAdjustment:
    """An adjustment of a state in which these photos have a pose."""
    survey = SimpleNamespace(survey=SimpleNamespace(frame_id=("1.jpg", *frames)))
    return cast(
        "LiveAdjustment", SimpleNamespace(adjustment=survey, observed=collect_observations(of))
    )


LAST = adjusted(State(), *TARGETS)


class Agreeing(Candidates):
    """Places of which some are contradicted."""

    wrong: ClassVar[Collection[Pair]] = ()

    def list_contradicted(self, found: Mapping[int, Found]) -> list[Pair]:
        return [self.pair[row] for row in found if self.pair[row] in self.wrong]


class World:
    """Stands in for the adjustment and the photos: every label should be seen in both targets.

    Attributes
    ----------
    radius_px
        Of the regions.
    refused
        Why nothing is found in a photo.
    posed
        Photos in which poses predict the labels.
    by_features
        Photos in which features predict the labels, far better; before, nothing is found there.
    contradicted
        What an adjustment with finds contradicts, and the finds that it had.
    looked
        Photo and label of what was looked at, in order.
    """

    def __init__(self) -> None:
        self.radius_px = 20.0
        self.refused: dict[str, RefusalReason] = {}
        self.looked: list[tuple[str, str]] = []
        self.places: Candidates | None = None
        self.posed: tuple[str, ...] = TARGETS
        self.by_features: tuple[str, ...] = ()
        self.contradicted: dict[Pair, str] = {}
        self.tried: list[set[Pair]] = []
        self.wrong: list[tuple[str, str]] = []
        self.sent: list[Any] = []  # for pages
        self.raised: tuple[str, ...] = ()
        self.off_ground: tuple[str, ...] = ()
        self.seen: list[set[Pair]] = []
        self.adjustment = cast("Adjustment", SimpleNamespace())
        self.go_on, self.begun = threading.Event(), threading.Event()
        self.go_on.set()

    def expected(
        self, _: LiveSurvey, __: LiveAdjustment, picks: Picks, labels: Collection[str] | None
    ) -> Candidates:
        self.places = self.predicted(picks, labels, self.posed)
        return self.places

    def predicted(
        self,
        picks: Picks,
        labels: Collection[str] | None,
        images: Collection[str],
        radius_px: float | None = None,
    ) -> Candidates:
        rows = [
            (i, image)
            for i, label in enumerate(picks.label)
            for image in TARGETS
            if picks.source[i] != "match"
            and (labels is None or label in labels)
            and image in images
        ]
        n, pick = len(rows), np.array([i for i, _ in rows], dtype=np.int64)
        sigma_px = (radius_px or self.radius_px) / np.sqrt(REGION_SQUARED)
        both = np.tile(np.eye(2), (n, 1, 1))
        nothing = (
            np.zeros((n, 2)),
            np.zeros((n, 2, 0)),
            np.zeros((n, 0), np.int64),
            np.zeros((n, 2, 6)),
        )
        image = tuple(image for _, image in rows)
        found = TransferredPixels(
            pick, image, np.full((n, 2), 50.0), sigma_px**2 * both, both, *nothing
        )
        pairs = tuple((image, picks.label[i]) for i, image in rows)
        Agreeing.wrong = self.wrong
        raised = np.array([label in self.raised for _, label in pairs], np.bool_)
        none = np.zeros(n, np.bool_)
        return Agreeing(found, pairs, pick, raised, none, self.adjustment)

    def predict(self, picks: Picks, is_wanted: Callable[[Pair], bool]) -> Iterator[Candidates]:
        wanted = [one for one in self.by_features if is_wanted((one, picks.label[0]))]
        if wanted:
            self.refused = {}
            yield self.predicted(picks, None, wanted, 5.0)

    def find_raised_labels(self, record: Record) -> set[str]:
        self.seen.append(set(record.found))
        return set(self.off_ground)

    inputs = SimpleNamespace(project=SimpleNamespace(picks_sigma_px=1.0))

    def flight(self) -> object:
        return None

    def adjust_with_finds(
        self, last: LiveAdjustment, found: dict[Pair, Found]
    ) -> tuple[LiveAdjustment, dict[Pair, str]]:
        self.tried.append(set(found))
        self.posed = TARGETS
        return last, self.contradicted

    def look(self, _: Image, photo: Image, sought: SoughtPoints) -> Matches:
        self.begun.set()
        self.go_on.wait(LONGEST_WAIT_S)
        target, count = f"{photo[0, 0]}.jpg", len(sought.source_px)
        self.looked += [(target, f"{u:.0f}") for u, _ in sought.source_px]
        why = np.full(count, self.refused.get(target, RefusalReason.NONE))
        pixel = np.where(why[:, None] > 0, np.nan, 50.5)
        return Matches(
            pixel_px=np.broadcast_to(pixel, (count, 2)),
            covariance_px2=np.tile(np.diag([0.03**2, 0.06**2]), (count, 1, 1)),
            sigma_px=np.where(why > 0, np.nan, 0.06),
            score=np.full(count, 0.9),
            refused=why,
        )


def decoded(name: str) -> Image:
    if name == "gone.jpg":
        raise InputError(name, "cannot be read")
    return np.full((4, 4), int(name[0]), np.uint8)


def in_turn(look: Callable[[Any], Any], groups: Sequence[Any]) -> Iterator[tuple[Any, Any]]:
    return zip(groups, map(look, groups), strict=True)


Told = list[tuple[Outcomes, set[str], int]]
Start = Callable[[World], tuple[PointSearch, Told]]


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    running: list[tuple[PointSearch, GreyPhotos]] = []

    def begin(world: World) -> tuple[PointSearch, Told]:
        monkeypatch.setattr(module, "predict_places", world.expected)
        monkeypatch.setattr(module, "FeaturePlaces", lambda _: world)
        monkeypatch.setattr(module, "collect_height_evidence", lambda *args: args[3])
        monkeypatch.setattr(module, "find_raised_labels", world.find_raised_labels)
        quietly = partial(search_module.search_places, progress=lambda items, *_: items)
        monkeypatch.setattr(module, "search_places", quietly)
        monkeypatch.setattr(search_module, "match_points", world.look)
        monkeypatch.setattr(
            search_module, "prefetch", lambda do, all_: zip(all_, map(do, all_), strict=True)
        )
        told: Told = []
        photos = GreyPhotos(dict.fromkeys(("1.jpg", *TARGETS), 16), decoded)
        survey = cast("LiveSurvey", world)
        proposed = ProposalTable(lambda all_, of, number: told.append((all_, set(of), number)))
        one = PointSearch(survey, photos, proposed, WatchedWork("search", world.sent.append))
        one.start()
        running.append((one, photos))
        return one, told

    yield begin
    for one, photos in running:
        one.stop()
        photos.stop()


def search(seeker: PointSearch, picked: State, last: LiveAdjustment | None = LAST) -> Outcomes:
    """Outcomes when the search with the picks' own adjustment is finished."""
    number = seeker.proposed.searched + 1
    seeker.submit(SearchInput(picked, last, is_adjusted=True, version=number))
    until(lambda: seeker.proposed.searched == number)
    return seeker.proposed.outcomes


def list_changed_labels(told: Told) -> list[set[str]]:
    return [labels for _, labels, _ in told if labels]


def list_reasons(seeker: PointSearch) -> list[str]:
    return [one.why for one in seeker.proposed.outcomes.values()]


def until(holds: Callable[[], bool]) -> None:
    latest = time.monotonic() + LONGEST_WAIT_S
    while not holds():
        assert time.monotonic() < latest
        time.sleep(0.002)


def test_a_point_that_is_probably_not_on_the_ground_is_asked_for_and_not_proposed(
    start: Start,
) -> None:
    world = World()
    world.off_ground = ("A",)
    seeker, _ = start(world)
    outcomes = search(seeker, state("A", "B"))
    found = {pair for pair, one in outcomes.items() if one.found is not None}

    assert found == {("2.jpg", "B"), ("3.jpg", "B")}


def test_withdrawn_matches_remain_evidence_and_come_back_with_it(start: Start) -> None:
    world = World()
    world.off_ground = ("A",)
    seeker, _ = start(world)
    search(seeker, state("A"))
    assert list_reasons(seeker) == [OFF_GROUND] * 2
    world.off_ground = ()
    outcomes = search(seeker, state("A", "B"))
    assert all(one.found is not None for one in outcomes.values())

    assert {pair for pair in world.seen[-1] if pair[1] == "A"} == {
        ("2.jpg", "A"),
        ("3.jpg", "A"),
    }


def test_what_is_found_is_proposed_and_what_is_not_is_asked_for_in_words(start: Start) -> None:
    world = World()
    world.refused = {"3.jpg": RefusalReason.NOT_UNIQUE}
    seeker, told = start(world)
    outcomes = search(seeker, state("A"))
    found, asked = outcomes["2.jpg", "A"], outcomes["3.jpg", "A"]
    assert found.found is not None
    assert (found.found.source, found.found.sigma_px, found.found.from_u_px) == ("match", 0.06, 10)
    assert (asked.found, asked.why) == (None, REASON_TEXTS[RefusalReason.NOT_UNIQUE])
    assert list_changed_labels(told) == [{"A"}] * 2
    assert told[-1] == (outcomes, set(), 0)


def test_what_stands_off_the_ground_is_known_less_well(start: Start) -> None:
    world = World()
    world.raised = ("A",)
    seeker, _ = start(world)
    found = search(seeker, state("A"))["2.jpg", "A"].found

    assert found is not None
    assert found.sigma_px == pytest.approx(np.hypot(0.06, RAISED_PX), abs=1e-4)


def test_it_is_kept_whether_all_that_surrounds_a_find_is_alike(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    likeness = iter([0.79, 0.81])
    monkeypatch.setattr(module, "compute_worst_quarter_correlation", lambda *_: next(likeness))
    seeker, _ = start(World())
    outcomes = search(seeker, state("A"))

    assert sorted(one.is_alike for one in outcomes.values()) == [False, True]


def test_what_others_in_the_photo_contradict_is_proposed_no_longer(start: Start) -> None:
    world = World()
    world.wrong = [("2.jpg", "B")]
    seeker, told = start(world)
    outcomes = search(seeker, state("A", "B"))
    assert list_changed_labels(told)[-1] == {"B"}
    assert outcomes["2.jpg", "B"].why == CONTRADICTED
    assert outcomes["2.jpg", "B"].found is None
    assert outcomes["3.jpg", "B"].found is not None


def seek_without_poses(
    world: World, seeker: PointSearch, picked: State, off_ground: Sequence[str]
) -> Outcomes:
    """Outcomes for some picks, by features alone and then by an adjustment with the finds."""
    world.posed, world.by_features, world.off_ground = (), TARGETS, tuple(off_ground)
    return search(seeker, picked, adjusted(picked))


@pytest.mark.parametrize("before", [("B",), ("A", "B")])
def test_proposals_do_not_depend_on_the_order_of_the_picks(
    start: Start, before: tuple[str, ...]
) -> None:
    length = Line(name="L1", start="A", end="B", length_m=5.0, sigma_m=0.01)
    picked, world = replace(state("A", "B"), lines=(length,)), World()
    at_once = seek_without_poses(world, start(world)[0], picked, ())
    world = World()
    seeker, _ = start(world)
    # An earlier adjustment, without the length, took its labels for points off the ground.
    seek_without_poses(world, seeker, state(*before), before)

    assert seek_without_poses(world, seeker, picked, ()) == at_once


def test_with_an_older_adjustment_only_new_picks_are_sought_and_none_withdrawn(
    start: Start,
) -> None:
    world = World()
    seeker, _ = start(world)
    search(seeker, state("A"))
    world.off_ground = ("A",)
    seeker.submit(SearchInput(state("A", "B"), LAST, is_adjusted=False))
    until(lambda: list_reasons(seeker) == [""] * 4)
    search(seeker, state("A", "B"))
    assert list_reasons(seeker).count(OFF_GROUND) == 2

    assert len(world.looked) == 2 + 2 + 4


def test_nothing_is_searched_again_for_the_same_picks_and_lengths(start: Start) -> None:
    world = World()
    seeker, _ = start(world)
    before = search(seeker, state("A"))
    looked = len(world.looked)
    distance = MeasurementRequest(name="D1", kind="distance", points=("A", "B"))

    assert search(seeker, replace(state("A"), requests=(distance,))) == before
    assert len(world.looked) == looked


def test_what_is_taken_back_is_searched_again(start: Start) -> None:
    world = World()
    seeker, _ = start(world)
    before = search(seeker, state("A"))
    search(seeker, state("A", u=12.0))

    assert search(seeker, state("A")) == before
    seeker.proposed.refuse([("2.jpg", "A")])
    seeker.proposed.reopen([("2.jpg", "A")])
    assert search(seeker, state("A")) == before


def test_a_refusal_taken_back_during_a_search_stays_taken_back(start: Start) -> None:
    world = World()
    seeker, _ = start(world)
    search(seeker, state("A"))
    pair = ("2.jpg", "A")
    seeker.proposed.refuse([pair])
    world.go_on.clear()
    world.begun.clear()
    seeker.submit(SearchInput(state("A", "B"), LAST, is_adjusted=True, version=7))
    world.begun.wait(LONGEST_WAIT_S)  # it began with the refusal
    seeker.proposed.reopen([pair])
    world.go_on.set()
    until(lambda: seeker.proposed.searched == 7)
    assert search(seeker, state("A", "B"))[pair].found is not None


def test_a_fault_of_the_search_ends_it(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    seeker, _ = start(World())
    monkeypatch.setattr(module, "search_places", lambda *_: 1 / 0)

    assert not search(seeker, state("A"))


def test_newer_picks_are_not_waited_for(start: Start) -> None:
    world = World()
    seeker, _ = start(world)
    world.go_on.clear()
    seeker.submit(SearchInput(state("A", "B"), LAST, is_adjusted=True))
    world.begun.wait(LONGEST_WAIT_S)
    seeker.submit(SearchInput(state("A", "B", "C", u=99.0), LAST, is_adjusted=True))
    world.go_on.set()
    until(lambda: len(seeker.proposed.outcomes) == 6)
    assert all(one.source == ("1.jpg", 99.0, 5.0) for one in seeker.proposed.outcomes.values())
    assert ("3.jpg", "10") not in world.looked  # the second photo was no longer looked at


def test_a_search_is_shown_by_its_stage_and_a_person_can_stop_it(start: Start) -> None:
    """What was found stays, and nothing is searched before the next change."""
    world = World()
    seeker, _ = start(world)
    world.go_on.clear()
    seeker.submit(SearchInput(state("A"), LAST, is_adjusted=True, version=4))
    world.begun.wait(LONGEST_WAIT_S)
    seeker.watched.stop()
    world.go_on.set()
    until(lambda: seeker.proposed.searched == 4)
    assert world.looked == [("2.jpg", "10")]  # the second photo was no longer looked at
    assert [*seeker.proposed.outcomes] == [("2.jpg", "A")]
    stages = [sent["stage"] for sent in world.sent]
    assert stages[0] == "look in other photos: 0 of 2 places"
    assert stages[-1] == ""
    search(seeker, state("A"))
    assert len(world.looked) == 1
    search(seeker, state("A", u=20.0))
    assert len(world.looked) == 3


def test_a_pick_that_moved_takes_its_proposals_along(start: Start) -> None:
    seeker, told = start(World())
    search(seeker, state("A"))
    assert not search(seeker, state("B"), None)
    assert list_changed_labels(told)[-1] == {"A"}


def test_what_is_refused_is_not_proposed_again(start: Start) -> None:
    world = World()
    seeker, _ = start(world)
    search(seeker, state("A"))
    seeker.proposed.refuse([("2.jpg", "A")])
    world.radius_px = 1.0
    outcomes = search(seeker, state("A", "B"))
    assert outcomes["2.jpg", "A"].why == BY_HAND
    assert outcomes["2.jpg", "A"].found is None
    photos = [photo for photo, _ in world.looked]
    assert photos.count("2.jpg") == 2  # for A before, and for B: it is not looked at again


def test_what_is_picked_there_is_not_sought(start: Start) -> None:
    world = World()
    seeker, _ = start(world)
    there = Pick(image="2.jpg", label="A", u_px=10.0, v_px=5.0, source="match")
    assert set(search(seeker, State(picks=(*state("A").picks, there)))) == {("3.jpg", "A")}


def test_a_photo_that_is_gone_is_said_and_ends_nothing(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "TARGETS", ("gone.jpg", "3.jpg"))
    seeker, _ = start(World())
    outcomes = search(seeker, state("A"))
    assert "cannot be read" in outcomes["gone.jpg", "A"].why
    assert outcomes["3.jpg", "A"].found is not None


def test_a_photo_without_a_pose_is_searched_where_features_predict_the_pick(start: Start) -> None:
    world, picked = World(), state("A")
    world.posed, world.by_features = ("2.jpg",), TARGETS
    seeker, _ = start(world)
    outcomes = search(seeker, picked, adjusted(picked, "2.jpg"))

    assert all(one.found is not None for one in outcomes.values())
    assert world.tried == [{("2.jpg", "A"), ("3.jpg", "A")}]
    assert len(world.looked) == 2  # features were not asked for the photo with a pose


def test_what_an_adjustment_with_the_finds_contradicts_is_not_proposed(start: Start) -> None:
    world, picked = World(), state("A", "B")
    world.posed, world.by_features = ("2.jpg",), TARGETS
    world.contradicted = {("3.jpg", "B"): CONTRADICTED}
    seeker, told = start(world)
    outcomes = search(seeker, picked, adjusted(picked, "2.jpg"))

    assert list_changed_labels(told)[-1] == {"B"}
    assert outcomes["3.jpg", "A"].found is not None
    assert outcomes["3.jpg", "B"].why == CONTRADICTED
    assert outcomes["3.jpg", "B"].found is None


def test_a_vague_pose_does_not_contradict_what_features_predicted_better(start: Start) -> None:
    world, picked = World(), state("A")
    world.radius_px, world.refused = 900.0, dict.fromkeys(TARGETS, RefusalReason.TOO_FAR)
    world.by_features, world.wrong = TARGETS, [("2.jpg", "A")]
    seeker, _ = start(world)
    outcomes = search(seeker, picked, adjusted(picked))

    assert world.tried
    assert outcomes["2.jpg", "A"].found is not None


def test_an_adjustment_with_finds_ends_when_the_search_does(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    world, picked = World(), state("A")
    world.posed, world.by_features = ("2.jpg",), TARGETS

    def adjust(*_: object) -> None:
        world.tried.append(set())
        for _k in range(2000):
            time.sleep(0.01)
            report_work()

    monkeypatch.setattr(world, "adjust_with_finds", adjust)
    seeker, _ = start(world)
    seeker.submit(SearchInput(picked, adjusted(picked, "2.jpg"), is_adjusted=True, version=1))
    until(lambda: bool(world.tried))
    begun = time.monotonic()
    seeker.stop()
    assert time.monotonic() - begun < 5.0


# A target that was clicked a little beside its centre is proposed elsewhere at its very centre.


FINER = 16
HERE, THERE = (60.21875, 55.46875), (70.96875, 64.71875)
CLICK = (61.21875, 54.46875)
"""Beside the centre by a pixel each way."""

TURN = np.array([[0.0, -1.2], [1.2, 0.0]])
"""From the first photo to the second: turned by 90 degrees, and larger."""

MATCH = Place(
    image="b.jpg",
    label="P1",
    u_px=THERE[0] + 1.2,
    v_px=THERE[1] + 1.2,
    sigma_px=0.05,
    source="match",
    score=0.9,
    from_image="a.jpg",
    from_u_px=CLICK[0],
    from_v_px=CLICK[1],
)


def disc(place: tuple[float, float]) -> Image:
    finer = np.full((120 * FINER, 130 * FINER), 70, np.uint8)
    u, v = (round((one + 0.5) * FINER - 0.5) for one in place)
    cv2.circle(finer, (u, v), 9 * FINER, 200, -1)
    small = cv2.resize(finer, (130, 120), interpolation=cv2.INTER_AREA)
    return cast("Image", cv2.GaussianBlur(small, (0, 0), 0.7))


@pytest.fixture
def targets() -> Iterator[PickedTargets]:
    pictures = {"a.jpg": disc(HERE), "b.jpg": disc(THERE), "bare.jpg": np.full_like(disc(HERE), 70)}
    photos = GreyPhotos(dict.fromkeys(pictures, 15_600), pictures.__getitem__)
    calibration = SimpleNamespace(parameters=np.array([400.0]))
    survey = SimpleNamespace(inputs=SimpleNamespace(calibration=calibration))
    yield PickedTargets(cast("LiveSurvey", survey), photos)
    photos.stop()


def test_the_target_itself_is_proposed_where_its_surroundings_were_found(
    targets: PickedTargets,
) -> None:
    found = targets.target_at(MATCH, TURN)

    assert found.source == "target"
    assert (found.u_px, found.v_px) == pytest.approx(THERE, abs=0.05)
    assert (found.from_image, found.from_u_px, found.from_v_px) == ("", None, None)
    assert found.sigma_px is not None
    assert 0.02 < found.sigma_px < 0.25


def test_a_match_stays_one_where_there_is_no_clear_target(targets: PickedTargets) -> None:
    hidden = replace(MATCH, image="bare.jpg")
    no_target = replace(MATCH, from_image="bare.jpg")
    beside = replace(MATCH, u_px=THERE[0] + 6.0)

    for one in (hidden, no_target, beside):
        assert targets.target_at(one, TURN) == one
