"""Messages on observations that do not fit."""

from __future__ import annotations

from uavgram.model.catalogue.entry import NOTE, WARNING, Effect, Entry, Order

MISFITS = (
    Entry(
        "picks-contradict",
        WARNING,
        finding=(
            "The picks of one point in several photos contradict each other, and no observation "
            "shows which of them is wrong."
        ),
        consequence="The point is as uncertain as its picks differ.",
        action="Pick the point again in the photos that are named, or in one more photo.",
        effect=Effect.DOUBTFUL,
        order=Order.SUSPECT,
        one="The picks of {labels} in {frames} contradict each other.",
        several="The picks of {labels} contradict each other, in {frames}.",
        accuses=True,
    ),
    Entry(
        "pick-suspect",
        WARNING,
        finding="A pick does not fit the others.",
        consequence="It takes part in the result and distorts the measurements at that point.",
        action=(
            "Check its place and its label. If the message names other suspects, no test can "
            "separate them: check all of them."
        ),
        effect=Effect.DOUBTFUL,
        order=Order.SUSPECT,
        one="The pick of {labels} in {frames} does not fit.",
        several="Picks of {labels} in {frames} do not fit.",
        accuses=True,
    ),
    Entry(
        "line-suspect",
        WARNING,
        finding="A known length does not fit. The message gives the taped and the computed value.",
        consequence=(
            "A withheld length (`use: check`) changes nothing. Any other one distorts the result."
        ),
        action=(
            "Check the reading, the two points at its ends and their picks before you remove it: "
            "the tape may be right."
        ),
        effect=Effect.DOUBTFUL,
        order=Order.SUSPECT,
        one="{lengths} does not fit the rest.",
        several="{lengths} do not fit the rest.",
        accuses=True,
    ),
    Entry(
        "known-suspect",
        WARNING,
        finding="Another known value (an angle, a height, an area) does not fit.",
        action="Check its value, its points and their picks.",
        effect=Effect.DOUBTFUL,
        order=Order.SUSPECT,
        one="A known value of {labels} does not fit the rest.",
    ),
    Entry(
        "control-suspect",
        WARNING,
        finding="A control point does not fit.",
        action="Check its coordinates, its label and its picks. Often two points are swapped.",
        effect=Effect.DOUBTFUL,
        order=Order.SUSPECT,
        one="The control point {labels} does not fit the rest.",
        several="The control points {labels} do not fit the rest.",
    ),
    Entry(
        "check-suspect",
        WARNING,
        finding=(
            "A check point, which takes no part in the result, is computed at another place than "
            "it is known."
        ),
        action=(
            "Check its coordinates and its picks. If most check points are off by the same amount, "
            "check the height datum or the coordinate system."
        ),
        effect=Effect.DOUBTFUL,
        order=Order.CONTRADICTION,
        one="The check point {labels} is off.",
        several="The check points {labels} are off.",
    ),
    Entry(
        "telemetry-strained",
        WARNING,
        finding="A photo has another position or direction than the log gives.",
        action="Check its picks, its time and the gimbal.",
        effect=Effect.DOUBTFUL,
        order=Order.SUSPECT,
        one="{frames} is not where the flight log has it.",
        several="{frames} are not where the flight log has them.",
    ),
    Entry(
        "prior-strained",
        WARNING,
        finding=(
            "A value that the project assumes (the slope of the ground, the mount, the tape, a "
            "clock) does not fit the picks and lengths."
        ),
        action="Correct the value, or state a wider sigma for it.",
        effect=Effect.DOUBTFUL,
        order=Order.SUSPECT,
        one="The slope, mount, tape or clock in the project does not fit the picks and lengths.",
    ),
    Entry(
        "lengths-contradict",
        WARNING,
        finding=(
            "Without a log, the lengths contradict each other, and no single one explains it. The "
            "message names the worst first."
        ),
        action="Check its unit and the labels of its ends.",
        effect=Effect.RED,
        order=Order.CONTRADICTION,
        one="The lengths may contradict each other.",
        accuses=True,
    ),
    Entry(
        "odd-height",
        WARNING,
        finding=(
            "The computed height of the cameras is not one from which drones photograph the ground."
        ),
        action=(
            "Check the unit of the lengths (the message names units that would give an ordinary "
            "height), and the heights of log, ground and control points."
        ),
        effect=Effect.AMBER,
        order=Order.CONTRADICTION,
        one="The cameras are at a height from which no drone takes photos.",
    ),
    Entry(
        "unusual-height",
        NOTE,
        finding=(
            "Only the lengths determine how high the cameras were, and by them the height is below "
            "3 m or above 150 m."
        ),
        action="If that is right, nothing has to be done. Otherwise check the unit of the lengths.",
    ),
    Entry(
        "misfit",
        WARNING,
        finding=(
            "Picks, lengths and ground do not fit together, even without the readings that other "
            "messages name as suspect: no single reading explains it, or a cause that is named "
            "still takes part."
        ),
        consequence="Do not rely on the numbers. A large misfit makes the verdict red.",
        action=(
            "Check the readings in other messages, labels, the unit of the lengths, the camera "
            "file, and whether the ground is a plane."
        ),
        effect=Effect.AMBER,
        order=Order.MISFIT,
        one="Picks, lengths and ground do not fit together.",
    ),
    Entry(
        "group-misfit",
        WARNING,
        finding=(
            "One kind of observation (picks, lengths, the log) fits worse than its stated errors "
            "allow, even without the readings that other messages name as suspect."
        ),
        consequence="The uncertainties are too small.",
        action="Find the mistake in these observations, or state wider sigmas for them.",
        effect=Effect.AMBER,
        order=Order.GROUP,
        one="Some observations are less exact than stated.",
        part_of="misfit",
    ),
    Entry(
        "checks-misfit",
        WARNING,
        finding=(
            "The withheld checks are further off than the uncertainties allow, even without those "
            "that other messages name as suspect."
        ),
        consequence="The uncertainties cannot be trusted.",
        action=(
            "Check the points and lengths that are named. If none is named, all observations share "
            "an error: check units, datum and camera file."
        ),
        effect=Effect.AMBER,
        order=Order.GROUP,
        one="The withheld lengths and points are further off than they should be.",
    ),
    Entry(
        "many-suspects",
        WARNING,
        finding=(
            "Too much does not fit for a single wrong pick, length or known value. If more than "
            "two in five of a kind do not fit, the others may be the wrong ones."
        ),
        action=(
            "Look for a common cause: labels, units, the tape, the camera file, the ground, times."
        ),
        effect=Effect.RED,
        order=Order.GROUP,
        one="Too much does not fit: no test shows which observations are right.",
    ),
    Entry(
        "blunder-not-located",
        WARNING,
        finding=(
            "One of several observations is wrong, and no test shows which. The message names "
            "them, and those that were left out, if any."
        ),
        action="Check all that are named, or tape another line that decides between them.",
        effect=Effect.DOUBTFUL,
        order=Order.REMOVED,
        one="One of several readings does not fit.",
        accuses=True,
    ),
    Entry(
        "blunder-kept",
        WARNING,
        finding=(
            "An observation does not fit, but without it nothing could be computed. It was kept."
        ),
        action="Correct it, or add picks and lengths so that the result does not depend on it.",
        effect=Effect.DOUBTFUL,
        order=Order.REMOVED,
        one="A pick or length does not fit, and nothing can replace it.",
    ),
)
