"""Messages on observations that do not fit, and on causes that explain them."""

from __future__ import annotations

from uavgram.model.message_catalogue.entry import NOTE, WARNING, Effect, Entry, Order

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
        action="Check its picks, its time, and how the camera hung (mount or gimbal).",
        effect=Effect.DISPLACED,
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
        effect=Effect.ALL_DOUBTFUL,
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


FOUND_CAUSES = (
    Entry(
        "labels-swapped",
        WARNING,
        finding="In one photo, two points have each other's names.",
        consequence="Everything measured at these points is distorted.",
        action="Swap the two labels in that photo.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{labels} seem swapped in {frames}.",
        several="Labels seem swapped in {frames}: {labels}.",
        labels_of_one=2,
    ),
    Entry(
        "labels-swapped-everywhere",
        WARNING,
        finding=(
            "Two points have each other's names in all photos, so that lengths and known points "
            "refer to the wrong one."
        ),
        action="Swap the names in picks.csv, or in the table that names them.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ALL,
        one="{labels} seem swapped in all photos.",
        several="Labels seem swapped in all photos: {labels}.",
        labels_of_one=2,
    ),
    Entry(
        "label-elsewhere",
        WARNING,
        finding="In one photo, a point is picked at the place of another point.",
        action="Check the pick. Give it the right label, or move it.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="One of {labels} is picked where the other belongs, in {frames}.",
        several="Labels are picked where others belong, in {frames}: {labels}.",
        labels_of_one=2,
    ),
    Entry(
        "line-wrong-unit",
        WARNING,
        finding="One length fits if its reading was taken in another unit, such as feet.",
        action="Check your notes, and write the length in metres.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{lengths} seems to be in another unit than metres.",
        several="{lengths} seem to be in another unit than metres.",
    ),
    Entry(
        "line-wrong-digit",
        WARNING,
        finding="One length fits if one digit is replaced, or two digits are exchanged.",
        action=(
            "Check your notes or the tape. If they confirm the reading in the table, check the "
            "picks at the ends of the length."
        ),
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{lengths} seems misread.",
        several="{lengths} seem misread.",
    ),
    Entry(
        "line-other-ends",
        WARNING,
        finding="One length fits between another pair of points than the stated one.",
        action="Check which two points were taped, and correct the ends of the length.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{lengths} seems to be between other points.",
        several="{lengths} seem to be between other points.",
    ),
    Entry(
        "lines-exchanged",
        WARNING,
        finding="Two lengths fit if their readings are exchanged.",
        action="Check your notes, and exchange the readings.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{lengths} seem to have each other's readings.",
    ),
    Entry(
        "lengths-factor",
        WARNING,
        finding=(
            "All lengths are too long or too short by one factor, as the log, the heights or known "
            "points show."
        ),
        consequence="All results have the same relative error.",
        action=(
            "Compare the tape with another one. If the tape is right, check the log, heights or "
            "known points that contradict it."
        ),
        effect=Effect.RED,
        order=Order.CAUSE_OF_ALL,
        one="The lengths seem to be all too long, or too short, by one factor.",
    ),
    Entry(
        "lengths-offset",
        WARNING,
        finding=(
            "All lengths are too long or too short by the same amount, such as a hook or a broken "
            "end of the tape."
        ),
        action=(
            "Check where the zero of the tape is. If the tape is right, check whether the points "
            "were picked at one side of each mark, or beside it."
        ),
        effect=Effect.RED,
        order=Order.CAUSE_OF_ALL,
        one="The lengths seem to be all off by the same amount.",
    ),
    Entry(
        "lengths-wrong-unit",
        WARNING,
        finding="All lengths fit if they were taken in another unit.",
        consequence="All results are wrong by the ratio of the two units.",
        action="Write the lengths in metres.",
        effect=Effect.RED,
        order=Order.CAUSE_OF_ALL,
        one="All lengths seem to be in another unit than metres.",
    ),
    Entry(
        "lengths-level",
        WARNING,
        finding=(
            "All lengths fit as horizontal distances, and do not fit along the slope of the ground."
        ),
        action=(
            "Find out how the tape was held. If it was level, write `horizontal` in the column "
            "`along` of the lengths."
        ),
        effect=Effect.RED,
        order=Order.CAUSE_OF_ALL,
        one="All lengths seem to have been taped level, on ground that slopes.",
    ),
    Entry(
        "lengths-offset-possible",
        WARNING,
        finding=(
            "Everything fits better if all lengths, or those of one tape, are too long or too "
            "short by the same amount. A single wrong length would also explain it."
        ),
        consequence="All values are doubtful.",
        action=(
            "Check where the tape begins (its hook, or a zero that is not at its end), or measure "
            "one of the lines again with another tape."
        ),
        effect=Effect.DOUBTFUL,
        order=Order.POSSIBLE_CAUSE,
        one="The lengths may be all off by the same amount.",
    ),
    Entry(
        "lengths-level-possible",
        WARNING,
        finding=(
            "The ground slopes, the table of the lengths does not state how the tape was held, and "
            "everything fits better if it was held level. This is likely, but not certain."
        ),
        consequence="All values are doubtful.",
        action="Write `slope` or `horizontal` in the column `along` of lines.csv.",
        effect=Effect.DOUBTFUL,
        order=Order.POSSIBLE_CAUSE,
        one="The file of the lengths does not state how the tape was held.",
    ),
    Entry(
        "control-shifted",
        WARNING,
        finding=(
            "All control points are shifted by the same amount against the flight log. They agree "
            "with each other, but not with the log."
        ),
        consequence=(
            "Distances follow the control points and are right. Coordinates are as wrong as the "
            "control points."
        ),
        action="Check their coordinate system, datum and heights.",
        effect=Effect.RED,
        is_of_log=True,
        order=Order.CAUSE_OF_ALL,
        one="All control points are shifted by the same amount.",
    ),
    Entry(
        "photos-mirrored",
        WARNING,
        finding="The flight log fits only if left and right are exchanged in all photos.",
        consequence="Coordinates and directions are mirrored.",
        action="Pick the points again in the files as the camera wrote them.",
        effect=Effect.RED,
        is_of_log=True,
        order=Order.CAUSE_OF_ALL,
        one="All photos seem to have been mirrored when they were picked.",
    ),
    Entry(
        "mirrored-undecided",
        NOTE,
        finding=(
            "The flight log would also fit photos that were all mirrored when they were picked, as "
            "happens over a straight flight."
        ),
        consequence=(
            "Distances and areas are right in both cases. Coordinates are right only if the photos "
            "are not mirrored, and are marked."
        ),
        action="Look at one photo on the picking page: writing in it must read from left to right.",
        effect=Effect.UNCHECKED,
        one="Nothing shows whether the photos were mirrored: look whether writing reads correctly.",
    ),
    Entry(
        "mount-turned",
        WARNING,
        finding=(
            "The camera seems to be mounted in another direction than the project states. With the "
            "turn given in the message, the picks of points in several photos agree."
        ),
        consequence="Positions are wrong, often by a large amount.",
        action="Correct `mount` in the project.",
        effect=Effect.RED,
        is_of_log=True,
        part_of="gimbal-off",
        order=Order.CAUSE_OF_ALL,
        one="The camera's direction does not agree with `mount` in the project.",
    ),
    Entry(
        "gimbal-off",
        WARNING,
        finding=(
            "In all photos alike, the camera looked in another direction than the gimbal or "
            "`mount` states. Or all headings of the log are off by one angle, as its positions "
            "show."
        ),
        consequence=(
            "If the result takes it into account, coordinates and directions follow from the "
            "positions alone."
        ),
        action=(
            "Correct `mount`, or check whether the gimbal angles belong to this camera. Check how "
            "the log counts headings (from north, clockwise), and the compass."
        ),
        effect=Effect.AMBER,
        order=Order.CAUSE_OF_ALL,
        one="The camera's direction does not agree with the log, the photos or the project.",
    ),
    Entry(
        "heights-off",
        WARNING,
        finding=(
            "All heights of the log, or of the photos without a log, are too large or too small by "
            "one amount for the height of the ground. Lengths and picks show how high the cameras "
            "were."
        ),
        consequence="Distances do not depend on it.",
        action=(
            "Check whether log and ground refer to the same height datum (a geoid differs from the "
            "ellipsoid by up to 100 m). Check `world.origin` and `ground.height_m`."
        ),
        effect=Effect.AMBER,
        order=Order.CAUSE_OF_ALL,
        one="The heights of the flight do not fit the height of the ground.",
    ),
    Entry(
        "other-zoom",
        WARNING,
        finding="The photos were taken at another zoom or focus than the camera file describes.",
        consequence="The result uses the focal length that was found.",
        action="Calibrate the camera at the zoom and focus of these photos.",
        effect=Effect.AMBER,
        order=Order.CAUSE_OF_ALL,
        one="The photos were taken at another zoom than the camera file describes.",
    ),
    Entry(
        "other-camera",
        WARNING,
        finding="One photo fits only if it was taken with another camera, or at another zoom.",
        action=(
            "Check where the photo comes from. Leave it out, or measure it in a project of its own."
        ),
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{frames} seems to be taken at another zoom or with another camera.",
        several="{frames} seem to be taken at another zoom or with another camera.",
    ),
    Entry(
        "photo-picked-in-copy",
        WARNING,
        finding="A photo fits only if its points were picked in a smaller copy of it.",
        action="Pick it again in the original photo.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{frames} seems to have been picked in a smaller copy.",
        several="{frames} seem to have been picked in smaller copies.",
    ),
    Entry(
        "photo-mirrored",
        WARNING,
        finding="A photo fits only if left and right are exchanged.",
        action="Use the file as the camera wrote it.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{frames} seems to have been mirrored when it was picked.",
        several="{frames} seem to have been mirrored when they were picked.",
    ),
    Entry(
        "photo-turned",
        WARNING,
        finding="A photo fits only if it is turned, or was picked in a turned copy.",
        action="Use the file as the camera wrote it, and pick it again.",
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{frames} seems to have been turned when it was picked.",
        several="{frames} seem to have been turned when they were picked.",
    ),
    Entry(
        "photo-elsewhere",
        WARNING,
        finding="A photo shows another place than its picks claim: they fit nothing else.",
        action="Check whether the photo belongs to this survey, and check its labels.",
        effect=Effect.DISPLACED,
        order=Order.CAUSE_OF_ONE,
        one="{frames} shows another place, or its labels are in disorder.",
        several="{frames} show other places, or their labels are in disorder.",
    ),
    Entry(
        "clock-off",
        WARNING,
        finding=(
            "The photos fit if their times are shifted by one amount, such as an error of the "
            "camera's clock or a time zone."
        ),
        action="State the shift in `time.offset_s`.",
        effect=Effect.AMBER,
        order=Order.CAUSE_OF_ALL,
        one="The camera's clock is off by more than the project allows.",
    ),
)
