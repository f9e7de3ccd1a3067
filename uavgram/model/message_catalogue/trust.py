"""Messages on the trustworthiness of a result, and on the ground."""

from __future__ import annotations

from uavgram.model.message_catalogue.entry import (
    ERROR,
    NOTE,
    WARNING,
    WARNING_OR_NOTE,
    Effect,
    Entry,
    Order,
)

TRUST = (
    Entry(
        "not-converged",
        ERROR,
        finding="The computation found no stable result, and no test can find the fault.",
        action=(
            "Look at the other messages first, then for a swapped label or a wrong length. If the "
            "camera was assumed, calibrate it."
        ),
        effect=Effect.RED,
        one="The picks and lengths lead to no result: do not use these numbers.",
    ),
    Entry(
        "nothing-checks",
        WARNING,
        finding=(
            "A single wrong reading could change this measurement by more than 10 times its "
            "uncertainty (one sigma), and no test would show it."
        ),
        consequence=(
            "A wrong tape reading, a wrong click, a wrong stated height or a wrong position of the "
            "log goes into the result unnoticed."
        ),
        action=(
            "Follow the message. A click is checked by a click of the same point in "
            'another photo, by a second click in the same photo ("Click again" on the picking '
            "page, or a second row in picks.csv), by a coded target, or by a length, another known "
            "value, a control point or a withheld check at that point. A match is no check: it "
            "repeats the click that it was found from. A stated height is checked by another "
            "photo, a position of the log by lengths or other photos. A direction of the camera "
            "that is only assumed is checked by several photos or lengths; better state it in "
            "`mount`."
        ),
        effect=Effect.UNCHECKED,
        order=Order.UNCHECKED,
        one="{measurements} is not checked.",
        several="{measurements} are not checked.",
    ),
    Entry(
        "three-lengths",
        WARNING,
        finding="There are only three lengths.",
        consequence="Nothing checks them, and several solutions may fit them.",
        action="Tape a fourth that closes no triangle.",
        effect=Effect.UNCHECKED,
        order=Order.AMBIGUITY,
        one="Nothing checks the three lengths.",
    ),
    Entry(
        "three-known",
        WARNING,
        finding="There are only three known values.",
        consequence="Nothing checks them, and several solutions may fit them.",
        action="Give a fourth: a length, a right angle, two parallel lines.",
        effect=Effect.UNCHECKED,
        order=Order.AMBIGUITY,
        one="Nothing checks the three things that are known.",
    ),
    Entry(
        "ambiguous-pose",
        WARNING_OR_NOTE,
        finding="The camera may have been at one of several positions that fit about equally well.",
        consequence=(
            'The measurements differ between them. The report shows the other values after "or".'
        ),
        action="Tape another line, or give the flight log, so that only one fits.",
        effect=Effect.UNCHECKED,
        order=Order.AMBIGUITY,
        one="The cameras may be elsewhere: two solutions fit equally well.",
    ),
    Entry(
        "weak-lengths",
        WARNING_OR_NOTE,
        finding="The lengths are placed so that distances elsewhere have large uncertainties.",
        action="Tape the line that the message proposes. The message gives the improvement.",
    ),
    Entry(
        "scale-basis",
        NOTE,
        finding="States which observations determine the scale.",
        consequence=(
            "If these are your lengths alone, a tape that is wrong by 1 % makes all results wrong "
            "by 1 %, and no test shows it."
        ),
        is_detail=True,
    ),
    Entry(
        "gauge-plane",
        NOTE,
        finding="Without a log or control points, north and the place on the earth are unknown.",
        consequence=(
            "Coordinates count from the first photo. Lengths, areas and angles do not depend on "
            "that."
        ),
    ),
    Entry(
        "level-on-slope",
        WARNING,
        finding=(
            "Lengths were measured level, but the slope of the ground is unknown, so the program "
            "takes them along the ground."
        ),
        consequence="On a slope of 5 degrees they are 0.4 % too short for that.",
        action="State the length along the ground.",
    ),
    Entry(
        "picks-less-exact",
        WARNING,
        finding="Picks scatter more than stated.",
        consequence="All uncertainties were widened accordingly.",
        action="Check whether each label is at the same place in all photos.",
        order=Order.NOISE,
        one="The picks are less exact than stated.",
    ),
    Entry(
        "lengths-rounded",
        NOTE,
        finding="All taped lengths are multiples of 5 or 10 cm, so they were rounded to that.",
        consequence="Their uncertainty contains the rounding: ± 0.03 m for whole decimetres.",
        action="Read the tape to the centimetre where the results need it.",
    ),
    Entry(
        "lengths-less-exact",
        WARNING,
        finding="Taped lengths scatter more than stated.",
        consequence="All uncertainties were widened accordingly.",
        action="State in `sigma_m` how exactly the tape was read: to whole decimetres is ± 0.03 m.",
        order=Order.NOISE,
        one="The taped lengths are less exact than stated.",
    ),
    Entry(
        "identification-less-exact",
        WARNING,
        finding=(
            "The picked places and the taped or known places differ by far more than "
            "`picks_identification_sigma_m`."
        ),
        consequence=(
            "All uncertainties were widened accordingly. Several wrong lengths would have the same "
            "effect."
        ),
        action=(
            "Check whether tape and picks use the same place of each mark, and whether each length "
            "was read correctly."
        ),
        effect=Effect.AMBER,
        order=Order.NOISE,
        one="Picks and lengths hardly mean the same points.",
    ),
    Entry(
        "found-less-exact",
        NOTE,
        finding=(
            "Matches or tie points, which the program found in other photos, scatter more than it "
            "stated."
        ),
        consequence="All uncertainties were widened accordingly.",
        action="Check those that are furthest off: an object may have moved.",
    ),
    Entry(
        "picks-more-exact",
        NOTE,
        finding="Picks scatter less than stated.",
        consequence="All uncertainties were narrowed accordingly.",
    ),
    Entry(
        "only-program-picks",
        NOTE,
        finding=(
            "The program itself found all points of these measurements, such as the corners of "
            "coded plates. No person picked them."
        ),
        consequence="The values do not change.",
        action="Look at the points in the photos before you use the values.",
    ),
    Entry(
        "sigmas-too-wide",
        NOTE,
        finding="Everything fits far better than stated.",
        consequence="The uncertainties are larger than necessary.",
        action=(
            "State smaller errors of picks (`picks_sigma_px`), lengths, ground and log, if they "
            "are true."
        ),
    ),
    Entry(
        "first-order-doubtful",
        WARNING,
        finding=(
            "The survey is weak, so the ± of a measurement is approximate. The message gives a "
            "more realistic ±, and the likely error of the value."
        ),
        action="Tape more lengths, or run again with `--monte-carlo` for the exact interval.",
        order=Order.APPROXIMATION,
    ),
    Entry(
        "first-order-off",
        WARNING,
        finding="Sampling gives another interval than the ordinary computation.",
        action="Use the sampled 95 % interval in the message.",
        order=Order.APPROXIMATION,
    ),
    Entry(
        "monte-carlo-failed",
        WARNING,
        finding="Some of the sampled repetitions found no solution and were left out.",
        consequence="Sampled intervals may be too narrow.",
        action="Add lengths or picks.",
        order=Order.APPROXIMATION,
    ),
    Entry(
        "monte-carlo-null",
        WARNING,
        finding=(
            "A measurement has no value in some of the sampled repetitions, which its interval "
            "leaves out."
        ),
        consequence="The interval may be too narrow.",
        action="Add lengths, or picks near it.",
        order=Order.APPROXIMATION,
    ),
)

GROUND = (
    Entry(
        "heights-unseen",
        WARNING,
        finding=(
            "Several points are off the ground although no height was stated for them. Other "
            "points were picked in one photo only, or in photos from nearly the same place, "
            "which do not show their heights."
        ),
        consequence=(
            "Their heights count as uncertain, by as much as the others are off. Measurements at "
            "them are less exact."
        ),
        action="Pick them in a photo from further aside, or state their heights.",
    ),
    Entry(
        "point-off-ground",
        WARNING,
        finding="A point that was expected on the ground is above or below it.",
        consequence="It was adjusted with the height in the message, and distorts nothing else.",
        action=(
            "To confirm it, write `free` or the height in the `height_m` of its picks. If the "
            "point is in two photos only, check its picks too."
        ),
        effect=Effect.AMBER,
        order=Order.LEFT_OUT,
        one="{labels} is off the ground.",
        several="{labels} are off the ground.",
    ),
    Entry(
        "ground-not-plane",
        WARNING,
        finding=(
            "The ground is not flat: points are off the plane by about the amount in the message."
        ),
        consequence="The uncertainties contain it.",
        action=(
            "For smaller uncertainties, pick the points in more photos, or give other ground an "
            "area of its own."
        ),
        order=Order.NOISE,
        one="The ground is not flat.",
    ),
    Entry(
        "ground-slopes",
        NOTE,
        finding="The ground slopes by the amount in the message, as the survey shows.",
        consequence="The result takes it into account.",
    ),
)
