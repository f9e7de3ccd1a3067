"""A click that others contradict spoils no search; a label is not sought where none shows which."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from textured_ground import LABELS, NAMES, write_textured

from uavgram.pipeline.match.run import match_picks

WRONG_PX = (25.0, -20.0)


def match_with_wrong_click(
    folder: Path, wrong: str, *, clicks: int = 1
) -> tuple[tuple[str, ...], dict[str, float]]:
    """Click all labels in two photos, one of them wrong in the second; match them in the third.

    Parameters
    ----------
    folder
        For the project.
    wrong
        The label clicked wrong.
    clicks
        Number of its right clicks in the first photo.

    Returns
    -------
    labels that were not sought, and errors of the others in the third photo [px].
    """
    project = write_textured(folder)
    rows = ["image,label,u_px,v_px"]
    for name in NAMES[:2]:
        for label in LABELS:
            is_wrong = label == wrong and name == NAMES[1]
            for k in range(clicks if label == wrong and not is_wrong else 1):
                u, v = project.pixel_px[name, label] + np.multiply(WRONG_PX, is_wrong) + 0.1 * k
                rows.append(f"{name},{label},{u:.3f},{v:.3f}")
    project.picks.write_text("\n".join(rows) + "\n")
    done = match_picks(project.path, dry_run=True)
    off = {
        label: float(np.linalg.norm(one.pixel_px - project.pixel_px[NAMES[2], label]))
        for (_, label), one in done.record.found.items()
    }
    return done.not_sought, off


@pytest.mark.parametrize("wrong", ["P4", "P6"])
def test_where_none_of_two_clicks_is_known_to_be_right_the_label_is_not_sought(
    tmp_path: Path, wrong: str
) -> None:
    not_sought, off = match_with_wrong_click(tmp_path, wrong)

    assert not_sought == (wrong,)
    assert set(off) == set(LABELS) - {wrong}
    assert max(off.values()) < 0.5


def test_two_clicks_that_agree_outvote_a_third_even_in_one_photo(tmp_path: Path) -> None:
    not_sought, off = match_with_wrong_click(tmp_path, "P4", clicks=2)

    assert not_sought == ()
    assert set(off) == set(LABELS)
    assert max(off.values()) < 0.5


def test_a_known_length_shows_which_of_two_clicks_is_wrong(tmp_path: Path) -> None:
    not_sought, off = match_with_wrong_click(tmp_path, "P2")

    assert not_sought == ()
    assert set(off) == set(LABELS)
    assert max(off.values()) < 0.5
