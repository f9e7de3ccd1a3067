"""The recording's pages of text."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey

from uavgram.model.result.reliability import (
    Effects,
    Evidence,
    PriorResults,
    RemovalRecord,
    WeakestLinks,
)
from uavgram.model.result.result import AreaPlane, Result
from uavgram.views.recording.curves import frame_curves, pose_curves
from uavgram.views.recording.pages import (
    checks_page,
    frame_sheets,
    lengths_page,
    measured_page,
    messages_page,
    messages_title,
    points_page,
    summary,
)
from uavgram.views.recording.photo import project_picks
from uavgram.views.recording.scene import measure_scene
from uavgram.views.survey.verdict import verdict_words
from uavgram.views.tables import MAX_ROWS, make_table, markdown, plain


@pytest.fixture(scope="module")
def result() -> Result:
    return survey.build()


def effects(count: int) -> Effects:
    return Effects(
        on=("skid left",) * count, change=np.full(count, 0.042), sigmas=np.full(count, 2.0)
    )


@pytest.fixture(scope="module")
def judged(result: Result) -> Result:
    """With external reliability, a removal and two areas of ground."""
    rows = result.measurements
    evidence = Evidence(
        lines=effects(len(result.lines.name)),
        picks=effects(len(result.picks.label)),
        priors=PriorResults(
            kind=("telemetry", "mount"),
            name=("height", "boresight"),
            frame_id=("DSC_0003.jpg", ""),
            unit=("m", "deg"),
            residual=np.array([0.4, -5.1]),
            w=np.array([0.5, -5.5]),
            redundancy=np.array([0.4, 0.5]),
            bias=np.array([3.2, 1.1]),
            effects=effects(2),
        ),
        weakest=WeakestLinks(
            what=("height of DSC_0003.jpg",) * len(rows.name),
            bias=np.full(len(rows.name), 3.2),
            unit=("m",) * len(rows.name),
            change=np.full(len(rows.name), 0.042),
            unchecked=(("known length 'R5 gate'",),) + ((),) * (len(rows.name) - 1),
        ),
    )
    removal = RemovalRecord(
        what="pick of 'P13' in DSC_0000.jpg", w=8.1, group=(), rivals=(),
        variance_factor_before=2.1, variance_factor_after=1.0,
        change=(0.01,) * len(rows.name),
    )  # fmt: skip
    plane = result.plane
    area = AreaPlane(
        name="ramp", height_m=replace(plane.height_m, value=np.array([1.25])),
        slope_deg=plane.slope_deg, pivot_m=np.zeros(2),
    )  # fmt: skip
    return replace(result, evidence=evidence, removals=(removal,), areas=(area,))


def test_measurements_have_their_weakest_links_and_what_nothing_checks(judged: Result) -> None:
    page = measured_page(judged)

    assert "| road width | 6.310 ± 0.012 m ? | **doubtful** |" in page
    assert "| to the tree | **not computed** | **not computed** |" in page
    assert "an undetected error of 3.2 m in the height of DSC\\_0003.jpg would move it" in page
    (row,) = (line for line in page.splitlines() if line.startswith("| skid left | an undetected"))
    assert row.endswith("| known length 'R5 gate' |")


def test_lengths_come_the_worst_fit_first_with_what_an_unseen_error_would_do(
    judged: Result,
) -> None:
    rows = [line for line in lengths_page(judged).splitlines() if line.startswith("| R")]

    assert [row.split("|")[1].strip() for row in rows[:2]] == ["R3 hedge", "R4 wall"]
    assert "**SUSPECT**" in rows[0]
    assert rows[0].endswith("| +0.042 m in 'skid left' |")
    assert "not seen" in rows[-1]


def test_checks_tell_three_sigma_the_fit_priors_removals_ground_and_camera(judged: Result) -> None:
    page = checks_page(judged)

    assert "| **+0.017 ± 0.016** | +1.1 | inside |" in page
    assert "| all |  | 41 | 1.62 | \\< 0.001 |" in page
    assert "1. The pick of 'P13' in DSC\\_0000.jpg" in page
    # the worst prior first, and loud
    assert page.index("| boresight | – | -5.1 | **-5.5** |") < page.index(
        "| height | DSC\\_0003.jpg | +0.4 | +0.5 |"
    )
    assert "| ramp | 1.250 ± 0.050 |" in page
    assert "| fx | 1311.3 ± 2.0 | 1310.0 ± 1.0 |" in page


def test_a_check_outside_three_sigma_is_loud(result: Result) -> None:
    checks = replace(result.line_checks, z=np.array([3.4]))

    assert "**OUTSIDE**" in checks_page(replace(result, line_checks=checks))


def test_without_withheld_numbers_the_page_says_that_nothing_checks() -> None:
    empty = survey.build(lines=(), measures=(), point_count=0)

    assert "no independent observation confirms the result" in checks_page(empty)
    assert measured_page(empty).endswith("No measurements were requested.")
    assert lengths_page(empty).endswith("None were given.")
    assert points_page(empty).endswith("No point was picked.")


def test_messages_come_the_worst_first_and_their_tab_counts_them(result: Result) -> None:
    page = messages_page(result)

    assert page.index("**error**") < page.index("**warning**") < page.index("**info**")
    assert "did you mean 'three'?" in page
    assert all(f"`{message.code}`" in page for message in result.messages)
    assert messages_title(result) == "Messages: 1 error, 1 warning"
    assert messages_title(survey.build(clean=True)) == "Messages"
    assert messages_page(replace(result, messages=())).endswith("None.")


def test_the_summary_is_short_however_much_was_measured() -> None:
    names: tuple[survey.Measure, ...] = tuple(
        (f"D{i}", "distance", ("P00", "P05"), "m") for i in range(300)
    )
    result = survey.build(measures=names)
    page = summary(result, verdict_words(result), measure_scene(result))

    assert "292 more are on the page *Measured*" in page
    assert len(page) < 4000


def test_a_sheet_says_how_far_a_frame_was_corrected(result: Result) -> None:
    picks = project_picks(result)
    poses = pose_curves(result)
    sheet = list(frame_sheets(result, picks, frame_curves(result, picks), poses))[7]
    moved = np.linalg.norm(
        result.frames.refined.center_world_m[7] - result.frames.seed.center_world_m[7]
    )

    assert f"moved by {moved:.2f} m, tilted by {poses.tilt_deg[7]:.2f}°" in sheet
    assert sheet.startswith("# DSC\\_0007.jpg: refined")


def test_what_people_wrote_cannot_become_markdown() -> None:
    assert plain("a|b *c* <b>\n[d](e)") == r"a\|b \*c\* \<b\> \[d\](e)"


def test_a_table_says_what_it_leaves_out() -> None:
    shown = markdown(make_table("a | b", [("1", "2")] * (MAX_ROWS + 5)))

    assert shown.count("| 1 | 2 |") == MAX_ROWS
    assert shown.endswith("5 more rows are in the report and in results.json.")
