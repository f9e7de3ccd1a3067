"""What a message says, in one plain sentence: who is wrong, without a number of a test."""

from __future__ import annotations

import re

from uavgram.model.message import SUBJECTS, Message
from uavgram.model.naming import listed, listed_photos

ONE_OR_MORE: dict[str, tuple[str, str]] = {
    # Causes that were found.
    "labels-swapped": (
        "{labels} seem swapped in {frames}.",
        "Labels seem swapped in {frames}: {labels}.",
    ),
    "labels-swapped-everywhere": (
        "{labels} seem swapped in all photos.",
        "Labels seem swapped in all photos: {labels}.",
    ),
    "label-elsewhere": (
        "One of {labels} is picked where the other belongs, in {frames}.",
        "Labels are picked where others belong, in {frames}: {labels}.",
    ),
    "line-wrong-unit": (
        "{lengths} seems to be in another unit than metres.",
        "{lengths} seem to be in another unit than metres.",
    ),
    "line-wrong-digit": ("{lengths} seems misread.", "{lengths} seem misread."),
    "line-other-ends": (
        "{lengths} seems to be between other points.",
        "{lengths} seem to be between other points.",
    ),
    "lines-exchanged": ("{lengths} seem to have each other's readings.",) * 2,
    "lengths-wrong-unit": ("All lengths seem to be in another unit than metres.",) * 2,
    "lengths-factor": ("The lengths seem to be all too long, or too short, by one factor.",) * 2,
    "lengths-offset": ("The lengths seem to be all off by the same amount.",) * 2,
    "lengths-offset-possible": ("The lengths may be all off by the same amount.",) * 2,
    "lengths-level-possible": ("The file of the lengths does not state how the tape was held.",)
    * 2,
    "lengths-level": ("All lengths seem to have been taped level, on ground that slopes.",) * 2,
    "photos-mirrored": ("All photos seem to have been mirrored when they were picked.",) * 2,
    "control-shifted": ("All control points are shifted by the same amount.",) * 2,
    "mount-turned": ("The camera looks another way than the project says.",) * 2,
    "gimbal-off": ("The camera looks another way than the log says.",) * 2,
    "heights-off": ("The heights of the log do not fit the height of the ground.",) * 2,
    "clock-off": ("The camera's clock is off by more than was said to be possible.",) * 2,
    "clock-jumps": ("The clock of the flight log jumps.",) * 2,
    "log-of-another-day": ("The flight log is of another day than the photos.",) * 2,
    "other-zoom": ("The photos were taken at another zoom than the camera file says.",) * 2,
    "camera-contradicted": ("The camera file does not belong to these photos.",) * 2,
    "other-camera": (
        "{frames} seems to be taken at another zoom or with another camera.",
        "{frames} seem to be taken at another zoom or with another camera.",
    ),
    "photo-mirrored": (
        "{frames} seems to have been mirrored when it was picked.",
        "{frames} seem to have been mirrored when they were picked.",
    ),
    "photo-turned": (
        "{frames} seems to have been turned when it was picked.",
        "{frames} seem to have been turned when they were picked.",
    ),
    "photo-elsewhere": (
        "{frames} shows another place, or its labels are in disorder.",
        "{frames} show other places, or their labels are in disorder.",
    ),
    "log-position-jump": ("The places in the flight log jump at {frames}.",) * 2,
    "log-attitude-jump": ("The directions in the flight log jump at {frames}.",) * 2,
    # Single things that do not fit.
    "pick-suspect": (
        "The pick of {labels} in {frames} does not fit.",
        "{count} picks do not fit: of {labels} in {frames}.",
    ),
    "picks-contradict": (
        "The picks of {labels} in {frames} contradict each other.",
        "The picks of {labels} contradict each other, in {frames}.",
    ),
    "line-suspect": ("{lengths} does not fit the rest.", "{lengths} do not fit the rest."),
    "known-suspect": ("What is known of {labels} does not fit the rest.",) * 2,
    "control-suspect": (
        "The control point {labels} does not fit the rest.",
        "The control points {labels} do not fit the rest.",
    ),
    "check-suspect": (
        "The check point {labels} is off.",
        "The check points {labels} are off.",
    ),
    "telemetry-strained": (
        "{frames} does not stand where the flight log has it.",
        "{frames} do not stand where the flight log has them.",
    ),
    "prior-strained": ("Something that was assumed does not fit what was observed.",) * 2,
    "point-off-ground": ("{labels} stands off the ground.", "{labels} stand off the ground."),
    # What was left out or taken out.
    "pick-left-out": (
        "The pick of {labels} in {frames} was left out.",
        "{count} picks were left out: of {labels} in {frames}.",
    ),
    "pick-removed": (
        "The pick of {labels} in {frames} does not fit and was taken out.",
        "{count} picks do not fit and were taken out: of {labels} in {frames}.",
    ),
    "frame-left-out": (
        "{frames} was left out, with all of its picks.",
        "{frames} were left out, with all of their picks.",
    ),
    "line-left-out": (
        "{lengths} does not fit and was left out.",
        "{lengths} do not fit and were left out.",
    ),
    "line-removed": (
        "{lengths} does not fit and was taken out.",
        "{lengths} do not fit and were taken out.",
    ),
    "known-left-out": ("What is known of {labels} does not fit and was left out.",) * 2,
    "known-removed": ("What is known of {labels} does not fit and was taken out.",) * 2,
    "control-left-out": (
        "The control point {labels} does not fit and was left out.",
        "The control points {labels} do not fit and were left out.",
    ),
    "height-left-out": (
        "The stated height of {labels} does not fit and was left out.",
        "The stated heights of {labels} do not fit and were left out.",
    ),
    "line-duplicate": (
        "{lengths} is there twice, and counts once.",
        "{lengths} are there twice, and count once.",
    ),
    # All together.
    "not-converged": ("The picks and lengths lead to no result: do not use these numbers.",) * 2,
    "many-suspects": ("So much does not fit that nothing shows what is right.",) * 2,
    "too-many-blunders": ("Many picks and lengths do not fit: do not use these numbers.",) * 2,
    "blunder-not-located": ("One of several picks or lengths does not fit.",) * 2,
    "blunder-kept": ("A pick or length does not fit, and nothing can replace it.",) * 2,
    "lengths-contradict": ("The lengths may contradict each other.",) * 2,
    "odd-height": ("The cameras stand at a height from which no drone takes photos.",) * 2,
    "misfit": ("Picks, lengths and ground do not fit together.",) * 2,
    "group-misfit": ("Some observations are less exact than stated.",) * 2,
    "checks-misfit": ("The withheld lengths and points are further off than they should be.",) * 2,
    "ground-not-plane": ("The ground is not flat.",) * 2,
    "picks-less-exact": ("The picks are less exact than stated.",) * 2,
    "lengths-less-exact": ("The taped lengths are less exact than stated.",) * 2,
    "identification-less-exact": ("Picks and lengths hardly mean the same points.",) * 2,
    # What nothing decides or checks.
    "nothing-checks": ("{measurements} is not checked.", "{measurements} are not checked."),
    "ambiguous-pose": ("The cameras may stand elsewhere: two solutions fit as well.",) * 2,
    "three-lengths": ("Nothing checks the three lengths.",) * 2,
    "three-known": ("Nothing checks the three things that are known.",) * 2,
    "line-unseen": (
        "{lengths} is not used: a point of it is not picked.",
        "{lengths} are not used: points of them are not picked.",
    ),
    "known-unseen": ("Something known is not used: {labels} is not picked.",) * 2,
    "measurement-unknown": (
        "Nothing is known of {measurements}: any value would fit.",
        "Nothing is known of {measurements}: any values would fit.",
    ),
    "measurement-null": (
        "{measurements} cannot be measured.",
        "{measurements} cannot be measured.",
    ),
}
"""By code of a message; the second of each where there are several of its kind."""

TWO = ("labels-swapped-everywhere", "labels-swapped", "label-elsewhere")
"""Codes of which one message speaks of two labels."""

_STATISTICS = re.compile(r": | \(|\. ")


def plain_sentence(message: Message) -> str:
    """What a message says, in one sentence.

    Where nothing better is known, as much of its text as stands before a colon or a bracket: the
    first sentence is plain, and numbers come last.
    """
    if message.plain:
        return message.plain
    names = {what: getattr(message, what) for what in SUBJECTS}
    forms = ONE_OR_MORE.get(message.code)
    if forms is None or not all(names[what] for what in SUBJECTS if f"{{{what}}}" in forms[0]):
        return f"{_STATISTICS.split(message.text, maxsplit=1)[0].removesuffix('.')}."
    form = forms[_is_several(message, forms[0])]
    told = {what: listed(each) if each else "" for what, each in names.items()}
    if message.frames:
        told["frames"] = listed_photos(message.frames)
    return form.format(count=len(message.labels), **told)


def _is_several(message: Message, form: str) -> bool:
    """Whether a message speaks of several of its kind."""
    if message.code in TWO:
        return len(message.labels) > 2 or (message.code != TWO[0] and len(message.frames) > 1)
    named = [len(getattr(message, what)) for what in SUBJECTS if f"{{{what}}}" in form]
    return max(named, default=1) > 1
