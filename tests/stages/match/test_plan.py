"""What is looked for next."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import TransferredPixels
from uavgram.stages.match import (
    CONTRADICTED,
    REGION_SQUARED,
    Candidates,
    Found,
    Missed,
    Pair,
    Record,
    choose_lines,
    choose_next_places,
    compute_radii,
)

A, B = ("a.jpg", "P"), ("b.jpg", "P")


def places(sigma_px: list[float], stretch: list[float]) -> TransferredPixels:
    n = len(sigma_px)
    return TransferredPixels(
        click=np.arange(n),
        frame_id=("",) * n,
        pixel_px=np.zeros((n, 2)),
        covariance_px2=np.array(sigma_px)[:, None, None] ** 2 * np.eye(2),
        affine=np.array(stretch)[:, None, None] * np.eye(2),
        rise=np.zeros((n, 2)),
        jacobian=np.zeros((n, 2, 0)),
        columns=np.zeros((n, 0), np.int64),
        own=np.zeros((n, 2, 6)),
    )


def chosen(
    sigma_px: list[float], stretch: list[float], pairs: list[Pair], record: Record | None = None
) -> list[int]:
    n = len(pairs)
    is_raised = np.array([label.startswith("roof") for _, label in pairs], dtype=np.bool_)
    candidates = Candidates(
        places(sigma_px, stretch), tuple(pairs), np.arange(n), is_raised, np.zeros(n, np.bool_)
    )
    rows: list[int] = choose_next_places(
        candidates, np.ones(n, np.bool_), record or Record()
    ).tolist()
    return rows


def test_of_several_picks_that_lead_to_a_place_the_most_alike_view_is_taken() -> None:
    assert chosen([2.0, 2.0, 2.0], [0.5, 1.1, 1.9], [A, A, A]) == [1]


def test_a_place_that_is_predicted_much_worse_waits_for_better_poses() -> None:
    pairs = [(f"{k}.jpg", "P") for k in range(6)]
    assert chosen([10, 11, 12, 13, 14, 90.0], [1.0] * 6, pairs) == [0, 1, 2, 3, 4]
    assert chosen([0.1, 3.0, 5.0], [1.0] * 3, pairs[:3]) == [0, 1, 2]  # fine enough, all of them


def test_a_place_in_vain_is_tried_again_from_another_pick_or_when_its_region_has_halved() -> None:
    wide = float(np.sqrt(REGION_SQUARED)) * 2.0
    assert compute_radii(4.0 * np.eye(2)[None])[0] == np.float64(wide)
    record = Record().add_results({A: Missed(0, wide, "several places look like it")})

    assert chosen([2.0], [1.0], [A], record) == []
    assert chosen([1.2], [1.0], [A], record) == []
    assert chosen([0.9], [1.0], [A], record) == [0]
    assert chosen([2.0, 2.0], [1.0, 3.0], [A, A], record) == [1]


def test_what_was_found_is_not_looked_for_until_it_is_contradicted() -> None:
    found = Record().add_results({A: Found(0, (1.0, 2.0), 0.05, 0.9, 20.0)})
    assert chosen([5.0, 5.0], [1.0, 1.0], [A, B], found) == [1]

    back = found.revoke_finds({A: CONTRADICTED})
    assert not back.found
    assert chosen([5.0], [1.0], [A], back) == []
    assert chosen([0.5], [1.0], [A], back) == [0]


def test_a_contradiction_outlasts_the_reasons_of_later_tries() -> None:
    record = Record().add_results({A: Found(0, (1.0, 2.0), 0.05, 0.9, 20.0)})
    record = record.revoke_finds({A: CONTRADICTED}).add_results(
        {A: Missed(0, 2.0, "nothing there")}
    )
    record = record.add_results({B: Missed(0, 2.0, "first"), A: Missed(0, 1.0, "last")})

    assert record.in_vain == {A: CONTRADICTED, B: "first"}


def test_what_stands_off_the_ground_waits_until_the_ground_is_done() -> None:
    roof = "a.jpg", "roof"
    assert chosen([2.0, 2.0], [1.0, 1.0], [A, roof]) == [0]

    done = Record().add_results({A: Found(0, (1.0, 2.0), 0.05, 0.9, 20.0)})
    assert chosen([2.0, 2.0], [1.0, 1.0], [A, roof], done) == [1]


def test_a_label_of_unknown_height_is_looked_for_along_the_line_of_one_pick_after_another() -> None:
    roofs = [(f"{name}.jpg", "roof") for name in "bcdbcd"]
    picks, alone = np.array([0, 0, 0, 1, 1, 1, 2]), np.arange(7) < 6
    alike = [1.5, 1.5, 1.5, 1.1, 1.1, 1.1, 1.0]
    candidates = Candidates(places([3.0] * 7, alike), (*roofs, A), picks, alone, alone)
    every, nothing = np.ones(7, np.bool_), Missed(1, 9.0, "nothing there looks like it")
    some = Record().add_results({roofs[0]: nothing})
    record = Record().add_results(dict.fromkeys(roofs[:3], nothing))

    assert choose_next_places(candidates, every, Record()).tolist() == [6]
    assert choose_lines(candidates, every, Record()).tolist() == [3, 4, 5]
    assert choose_lines(candidates, every, some).tolist() == [4, 5]
    assert choose_lines(candidates, every, record).tolist() == [0, 1, 2]
