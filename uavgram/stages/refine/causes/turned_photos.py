"""Hypotheses on photos with all picks wrong: mirrored, rotated, or with labels in disorder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.resection import (
    AGREEMENT_SIGMAS,
    MIN_PICKS,
    sight_adjusted_points,
)
from uavgram.estimation.reliability.hypotheses import HypothesisTest
from uavgram.estimation.survey.adjustment import LeftOutCause
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.message import Message, MessagePlural, propose_photo_removal
from uavgram.model.naming import join_photo_names
from uavgram.model.survey import Cause, Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import (
    GROSS_ERROR_LOG_ODDS,
    Diagnosis,
    Hypothesis,
    find_usable_picks,
)
from uavgram.stages.refine.causes.label_assignment import assign_labels
from uavgram.stages.refine.causes.other_poses import compute_decreases
from uavgram.stages.refine.causes.stray_picks import labels_of
from uavgram.stages.refine.reduced_starts import EITHER

MAX_PHOTOS = 12
"""Largest number of left-out photos that are examined."""


class _Turn(NamedTuple):
    """Transform from shown to original pixels: exchange axes first, then reverse directions."""

    axes: bool
    columns: bool
    rows: bool


MIRRORED = {
    "mirrored": _Turn(axes=False, columns=True, rows=False),
    "mirrored and upside down": _Turn(axes=False, columns=False, rows=True),
}
TURNED = {
    "turned by 180 degrees": _Turn(axes=False, columns=True, rows=True),
    "turned by 90 degrees to the right": _Turn(axes=True, columns=False, rows=True),
    "turned by 90 degrees to the left": _Turn(axes=True, columns=True, rows=False),
}
"""Ways in which the photo was shown when it was picked."""
EITHER_MIRRORED = {"mirrored": MIRRORED["mirrored"]}
"""The one way that matters without a log, which would show how the photo was turned besides."""

STRAINED_SIGMAS, MAX_STRAINED = 10.0, 3
"""Residual of a pose against the log, in its sigmas, above which a photo may be rotated; and
largest number of photos that are examined for it."""

TURNED_LOG_ODDS = float(np.log(20.0))
"""Logarithm of the odds against a rotated photo, without other evidence."""

MAX_HEADING_RAD = np.radians(45.0)
"""Angle between a pose and that of the log [rad], above which it is another one."""


def find_misplaced_photos(diagnosis: Diagnosis) -> Ints:
    """Return photos of the survey whose picks were all left out as contradicting the rest."""
    reasons = diagnosis.refined.pick_reason.items()
    picks = [k for k, why in reasons if why.cause is LeftOutCause.MISPLACED_FRAME]
    return np.unique(diagnosis.survey.pick_frame[picks])[:MAX_PHOTOS]


def find_photos_against_log(diagnosis: Diagnosis) -> dict[int, float]:
    """Return photos far from their pose in the log, and their squared residuals."""
    adjustment = diagnosis.adjustment
    block, telemetry = adjustment.minimum.blocks.get("telemetry"), adjustment.survey.telemetry
    if block is None or telemetry is None:
        return {}
    # In the stated sigmas, also where those of a wrong pose were enlarged.
    names = [adjustment.survey.frame_id[k] for k in telemetry.frame_index]
    stated = np.array([diagnosis.refined.pose_widened.get(name, 1.0) for name in names])
    away = stated * np.abs(block.residual).max(axis=1)
    worst = np.argsort(-away, kind="stable")[:MAX_STRAINED]
    index = {name: k for k, name in enumerate(diagnosis.survey.frame_id)}
    return {
        index[names[k]]: float(away[k]) ** 2 for k in worst.tolist() if away[k] > STRAINED_SIGMAS
    }


def propose_photos_in_order(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that left-out photos are right, after the correction of another mistake."""
    for frame in find_misplaced_photos(diagnosis).tolist():
        yield Hypothesis(
            message=None,
            mend=SurveyCorrection(),
            back=frozenset(picks_of(diagnosis, frame).tolist()),
            price=TURNED_LOG_ODDS,
            settles=frozenset([diagnosis.survey.frame_id[frame]]),
        )


def propose_turned_photos(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that photos were mirrored or rotated when picked."""
    survey = diagnosis.survey
    if len(find_picks_of_only_photo(diagnosis)):
        return  # its own points are no evidence
    strained = find_photos_against_log(diagnosis)
    promise = dict.fromkeys(find_misplaced_photos(diagnosis).tolist(), 0.0) | strained
    for frame, gain in promise.items():
        name, only = survey.frame_id[frame], _find_only_other(diagnosis, frame)
        for how, turn in (MIRRORED | TURNED if only is None else EITHER_MIRRORED).items():
            mend = _put_back(survey, picks_of(diagnosis, frame), turn)
            if not _shows_the_ground(diagnosis, frame, mend.pixel_of_pick):
                continue
            yield Hypothesis(
                message=partial(_turned_message, (name,), how)
                if only is None
                else partial(_either_mirrored_message, (survey.frame_id[only], name)),
                mend=mend,
                equal=() if only is None else (_put_back(survey, picks_of(diagnosis, only), turn),),
                is_clear=only is None,
                promise=gain,
                price=float(np.log(len(MIRRORED) + len(TURNED))),
                settles=frozenset([name]),
            )
            used = _find_equal_photo(diagnosis, frame) if only is None else None
            if used is not None:
                yield _propose_other_turned(diagnosis, frame, used, how)


def _propose_other_turned(diagnosis: Diagnosis, frame: int, used: int, how: str) -> Hypothesis:
    """Propose that a photo in use was mirrored or rotated, in place of one that was left out."""
    survey, turns = diagnosis.survey, MIRRORED | TURNED
    return Hypothesis(
        message=partial(_turned_message, (survey.frame_id[used],), how),
        mend=_put_back(survey, picks_of(diagnosis, used), turns[how]),
        back=frozenset(picks_of(diagnosis, frame).tolist()),
        is_of_all=True,
        price=float(np.log(len(turns))),
        settles=frozenset([survey.frame_id[frame], survey.frame_id[used]]),
    )


def _find_equal_photo(diagnosis: Diagnosis, frame: int) -> int | None:
    """Return the photo in use, where it and a left-out one contradict each other alike."""
    reasons = diagnosis.refined.pick_reason
    is_either = any(reasons.get(k) == EITHER for k in picks_of(diagnosis, frame).tolist())
    if not is_either:
        return None
    return diagnosis.survey.frame_id.index(diagnosis.adjustment.survey.frame_id[0])


def _find_only_other(diagnosis: Diagnosis, frame: int) -> int | None:
    """Return the only other photo, where nothing shows which of the two was mirrored.

    Without a log and known places the survey may as well be its own mirror image, and two photos
    that contradict each other have no third to decide.
    """
    used = diagnosis.adjustment.survey.frame_id
    if diagnosis.survey.gauge != "plane" or len(used) != 1 or diagnosis.survey.seeds is not None:
        return None
    other = diagnosis.survey.frame_id.index(used[0])
    return None if other == frame else other


def _put_back(survey: Survey, picks: Ints, turn: _Turn) -> SurveyCorrection:
    """Correct picks of a photo to their pixels in the original one."""
    pixel = _rotate_back(survey.pixel_px[picks], turn, survey.calibration)
    places = zip(picks.tolist(), pixel.tolist(), strict=True)
    return SurveyCorrection(pixel_of_pick={pick: (u, v) for pick, (u, v) in places})


def propose_photos_turned_together(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that all participating photos were rotated, and the left-out ones were not."""
    survey = diagnosis.survey
    left_out = find_misplaced_photos(diagnosis)
    if not len(left_out) or survey.telemetry is None:
        return
    names = diagnosis.adjustment.survey.frame_id
    if len(names) > 2 * len(left_out):
        return  # it would be odd if so many were turned
    frames = [survey.frame_id.index(name) for name in names]
    back = frozenset(np.concatenate([picks_of(diagnosis, k) for k in left_out]).tolist())
    for how, turn in (TURNED | MIRRORED).items():
        places: dict[int, tuple[float, float]] = {}
        for frame in frames:
            places |= _put_back(survey, picks_of(diagnosis, frame), turn).pixel_of_pick
        yield Hypothesis(
            message=partial(_turned_message, names, how),
            mend=SurveyCorrection(pixel_of_pick=places),
            back=back,
            is_of_all=True,
            price=float(np.log(len(MIRRORED) + len(TURNED))) + len(frames) * TURNED_LOG_ODDS,
            settles=frozenset([*names, *(survey.frame_id[k] for k in left_out)]),
        )


def propose_only_photo(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that the only photo was mirrored or rotated when it was picked.

    It places its own points, so that only the log and control points show how it was shown.
    """
    turns = MIRRORED | TURNED
    survey, picks = diagnosis.survey, find_picks_of_only_photo(diagnosis)
    if not len(picks) or (survey.telemetry is None and not len(survey.control_label)):
        return
    mends = [_put_back(survey, picks, turn) for turn in turns.values()]
    decrease = compute_decreases(diagnosis, picks, mends)
    name = survey.frame_id[survey.pick_frame[picks[0]]]
    for how, mend, promise in zip(turns, mends, decrease.tolist(), strict=True):
        yield Hypothesis(
            message=partial(_turned_message, (name,), how),
            mend=mend,
            is_of_all=True,
            promise=promise,
            price=float(np.log(len(turns))) + TURNED_LOG_ODDS,
            settles=frozenset([name, *survey.line_name]),
        )


def propose_labels_moved_on(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that each point of the only photo has the label of the next or previous one."""
    survey, picks = diagnosis.survey, find_picks_of_only_photo(diagnosis)
    # Labels in the order of their first clicks.
    label, first = np.unique(survey.pick_label[picks], return_index=True)
    order = label[np.argsort(first)]
    if len(order) < MIN_PICKS:
        return
    moved: list[dict[int, int]] = []
    for step in (-1, 1):
        other = dict(zip(order.tolist(), np.roll(order, step).tolist(), strict=True))
        moved.append({pick: other[survey.pick_label[pick]] for pick in picks.tolist()})
    mends = [SurveyCorrection(label_of_pick=right) for right in moved]
    decrease = compute_decreases(diagnosis, picks, mends)
    for mend, promise in zip(mends, decrease.tolist(), strict=True):
        yield Hypothesis(
            message=partial(_disorder_message, diagnosis, mend.label_of_pick),
            mend=mend,
            is_of_all=True,
            promise=promise,
            price=float(np.log(len(mends))) + TURNED_LOG_ODDS,
            settles=frozenset([survey.frame_id[survey.pick_frame[picks[0]]], *survey.line_name]),
        )


def find_picks_of_only_photo(diagnosis: Diagnosis) -> Ints:
    """Find the usable picks (n,) of a single photo; none of several photos."""
    picks = np.flatnonzero(find_usable_picks(diagnosis.taking))
    is_single = len(np.unique(diagnosis.survey.pick_frame[picks])) == 1
    return picks if is_single else picks[:0]


def propose_photos_in_disorder(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose other labels for the picks of photos."""
    survey = diagnosis.survey
    for frame in find_misplaced_photos(diagnosis).tolist():
        picks = picks_of(diagnosis, frame)
        label = _complete(diagnosis, picks, assign_labels(diagnosis, frame, picks))
        known = np.flatnonzero(label >= 0)
        changed = known[label[known] != survey.pick_label[picks[known]]]
        # Where most picks fit under no label, other labels are not the remedy.
        if len(known) <= MIN_PICKS + 1 or 2 * len(known) <= len(picks) or not len(changed):
            continue
        mend = SurveyCorrection(
            label_of_pick={int(picks[k]): int(label[k]) for k in known},
            without_picks=frozenset(picks[label < 0].tolist()),
        )
        wrong = len(picks) - len(known)
        yield Hypothesis(
            message=partial(
                _disorder_message, diagnosis, {int(picks[k]): int(label[k]) for k in changed}
            ),
            mend=mend,
            price=2.0 * GROSS_ERROR_LOG_ODDS * wrong
            + len(changed) * float(np.log(len(survey.label))),
            settles=frozenset([survey.frame_id[frame]]),
        )


def _complete(diagnosis: Diagnosis, picks: Ints, label: Ints) -> Ints:
    """Give the last pick without a label the last unused label (n,).

    Only where no other photo shows the point of that label: then no place contradicts it.
    """
    survey = diagnosis.survey
    without, left = np.flatnonzero(label < 0), np.setdiff1d(survey.pick_label[picks], label)
    names = [survey.label[k] for k in left]
    if len(without) != 1 or len(left) != 1 or diagnosis.adjustment.label_rows(names)[0] >= 0:
        return label
    completed = label.copy()
    completed[without] = left
    return completed


def propose_photos_elsewhere(diagnosis: Diagnosis, causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Report left-out photos without another cause: they show another place.

    Parameters
    ----------
    diagnosis
        The survey as it was adjusted.
    causes
        Causes that were found.
    """
    survey, found = diagnosis.survey, []
    settled = {name for cause in causes for name in cause.settles}
    for frame in find_misplaced_photos(diagnosis).tolist():
        name = survey.frame_id[frame]
        if name in settled:
            continue
        picks = picks_of(diagnosis, frame)
        reasons = {diagnosis.refined.pick_reason.get(pick) for pick in picks.tolist()}
        is_either = EITHER in reasons
        mend = SurveyCorrection(without_picks=frozenset(picks.tolist()))
        found.append(
            Cause(
                message=_either_message(diagnosis, name) if is_either else _elsewhere_message(name),
                mend=None if is_either else mend,
                gain=4.0 * GROSS_ERROR_LOG_ODDS * len(picks),
                settles=frozenset([name]),
            )
        )
    return tuple(found)


def _rotate_back(shown_px: Floats, turn: _Turn, camera: Calibration) -> Floats:
    """Transform pixels (n, 2) of the photo as shown to those of the original photo."""
    pixel = shown_px[:, ::-1].copy() if turn.axes else shown_px.copy()
    if turn.columns:
        pixel[:, 0] = camera.width_px - 1.0 - pixel[:, 0]
    if turn.rows:
        pixel[:, 1] = camera.height_px - 1.0 - pixel[:, 1]
    return pixel


def picks_of(diagnosis: Diagnosis, frame: int) -> Ints:
    """Return picks of a photo of the survey that take part, or were left out with it."""
    there = diagnosis.spoilt
    there[diagnosis.refined.pick_index] = True
    return np.flatnonzero((diagnosis.survey.pick_frame == frame) & there)


def _shows_the_ground(
    diagnosis: Diagnosis, frame: int, pixel_of_pick: Mapping[int, tuple[float, float]]
) -> bool:
    """Return whether pixels of a photo fit their labels, from above, and near the log's pose.

    Parameters
    ----------
    diagnosis, frame
        The survey under diagnosis; the photo.
    pixel_of_pick
        Assumed pixels of its picks.
    """
    picks = np.array([*pixel_of_pick], dtype=np.int64)
    pixel = np.array([*pixel_of_pick.values()], dtype=np.float64).reshape(-1, 2)
    survey = diagnosis.survey
    sights = sight_adjusted_points(diagnosis.adjustment, survey, labels_of(diagnosis), picks, pixel)
    if len(sights.world_m) <= MIN_PICKS:
        return False
    pose = sights.resect()
    # Residuals of the resection, by their median.
    off = np.nan_to_num(np.linalg.norm(sights.offsets(pose), axis=1), nan=np.inf)
    if not np.median(off) < AGREEMENT_SIGMAS:
        return False
    if survey.seeds is None:
        return True
    # Rotation angle against the log: cos(angle) = (trace - 1) / 2.
    turn = survey.seeds.world_from_camera[frame].T @ pose[1]
    return bool(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)) < MAX_HEADING_RAD)


def _turned_message(frames: Sequence[str], how: str, _: HypothesisTest | None) -> Message:
    """Report photos that were shown mirrored or rotated."""
    named = join_photo_names(frames)
    one = len(frames) == 1
    what, they = (
        (f"The photo {frames[0]!r} seems", "it was")
        if one
        else (f"The photos {named} seem", "they were")
    )
    file = "file, as the camera wrote it" if one else "files, as the camera wrote them"
    return Message(
        "warning",
        "photo-mirrored" if how in MIRRORED else "photo-turned",
        f"{what} to have been {how} when {they} picked: pick {'it' if one else 'them'} again in "
        f"the original {file}. {'Its' if one else 'Their'} picks fit once they are put back.",
        frames=tuple(frames),
        several=MessagePlural(
            "{count} photos seem to have been mirrored or turned when they were picked",
            f"{frames[0]!r} {how}",
            ending="Pick them again in the original files, as the camera wrote them.",
        )
        if one
        else None,
    )


def _either_mirrored_message(frames: tuple[str, str], _: HypothesisTest | None) -> Message:
    """Report that one of two photos was mirrored, where nothing shows which.

    Parameters
    ----------
    frames
        Names of the photo that is used, and of the other one.
    _
        Result of the linear test, not used.
    """
    used, other = map(repr, frames)
    return Message(
        "warning",
        "photo-mirrored",
        f"Of the photos {used} and {other} one was mirrored when it was picked, and nothing shows "
        "which: writing has to read from left to right. Pick the mirrored one again in the "
        f"original file, as the camera wrote it. Only the picks of {used} are used: distances and "
        "areas are right in any case.",
        frames=frames,
        plain=f"Of the photos {join_photo_names(frames)} one was mirrored; nothing shows which.",
    )


def _disorder_message(
    diagnosis: Diagnosis, right: Mapping[int, int], _: HypothesisTest | None
) -> Message:
    survey = diagnosis.survey
    frame = survey.frame_id[survey.pick_frame[next(iter(right))]]
    names = {survey.label[survey.pick_label[k]]: survey.label[v] for k, v in right.items()}
    each = ", ".join(f"{old!r} should be {new!r}" for old, new in names.items())
    return Message(
        "warning",
        "labels-swapped",
        f"The labels in {frame!r} seem to be in disorder: look at them, and change them in this "
        f"photo. By their places {each}.",
        frames=(frame,),
        labels=tuple(names),
        several=MessagePlural(
            "Labels seem to be swapped in {count} photos or groups of picks",
            f"{', '.join(map(repr, names))} in {frame!r}",
            ending="Each pick is at the place of another of them: look, and change the labels "
            "there.",
        ),
    )


def _either_message(diagnosis: Diagnosis, frame: str) -> Message:
    """Report a photo and the one that is used, which contradict each other, but fit alone."""
    used = diagnosis.adjustment.survey.frame_id
    frames = (*used, frame)
    return Message(
        "warning",
        "photo-elsewhere",
        f"One of the photos {' and '.join(map(repr, frames))} shows another place, was mirrored or "
        "turned, or has its labels in disorder, and nothing shows which: look at both. Only the "
        f"picks of {join_photo_names(used)} are used.",
        frames=frames,
        plain="The two photos contradict each other: one of them shows another place.",
        instead=tuple(map(propose_photo_removal, frames)),
    )


def _elsewhere_message(frame: str) -> Message:
    return Message(
        "warning",
        "photo-elsewhere",
        f"The photo {frame!r} shows another place, or its labels are in disorder: its "
        "picks do not fit the rest. Look at it, also for labels that are swapped and for a photo "
        "that was mirrored or turned; pick it again, or take it out.",
        frames=(frame,),
        several=MessagePlural(
            "{count} photos show another place, or their labels are in disorder",
            repr(frame),
            ending="Look at them, and pick them again or take them out.",
        ),
        instead=(propose_photo_removal(frame),),
    )
