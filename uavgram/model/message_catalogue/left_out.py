"""Messages on observations that were left out or removed, and on data that is not used."""

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

EXCLUDED = (
    Entry(
        "pick-left-out",
        WARNING,
        finding=(
            "A pick takes no part, for the reason in the message: all other observations "
            "contradict it, or it is in the sky, at the rim of the lens, in a photo without a "
            "position, or in one that shows another place."
        ),
        action="Check its place and its label.",
        effect=Effect.AMBER,
        order=Order.LEFT_OUT,
        one="The pick of {labels} in {frames} was left out.",
        several="Picks of {labels} in {frames} were left out.",
        accuses=True,
    ),
    Entry(
        "pick-removed",
        WARNING,
        finding=(
            "With `outliers: remove`, a pick that does not fit was removed, and the rest adjusted "
            "again."
        ),
        action="Check it, and correct or delete it.",
        effect=Effect.AMBER,
        order=Order.REMOVED,
        one="The pick of {labels} in {frames} does not fit and was taken out.",
        several="Picks of {labels} in {frames} do not fit and were taken out.",
        accuses=True,
    ),
    Entry(
        "match-left-out",
        WARNING,
        finding=(
            "A match that the program found for a pick does not fit the matches in the other "
            "photos: the object may have moved, or look like another one."
        ),
        consequence="The numbers do not use it.",
        action="Check the match. Pick the point there by hand, or delete the match.",
    ),
    Entry(
        "ties-left-out",
        NOTE,
        finding="Some tie points that the program found do not fit the others, and take no part.",
    ),
    Entry(
        "photo-damaged",
        WARNING,
        finding=(
            "A photo cannot be used: it is cut off, empty, no photo, or missing though the picks "
            "name it. The message states which."
        ),
        consequence=(
            "A new project leaves it out. The page opens an existing project without it, but "
            "measures nothing there, and the commands refuse the project."
        ),
        action=(
            "Copy it from the camera once more, or back to the other photos. To go on without it, "
            "press *Leave out* on the "
            "page, or write its name into `leave_out` of the project."
        ),
    ),
    Entry(
        "photo-left-out",
        WARNING_OR_NOTE,
        finding="The project leaves out a photo, by `leave_out`.",
        consequence=(
            "Its picks and tie points take no part, nor do matches found from its picks. They stay "
            "in their tables."
        ),
        action="To use it again, take its name out of `leave_out`.",
        order=Order.EXCLUDED,
    ),
    Entry(
        "left-out-unknown",
        WARNING,
        finding="A name in `leave_out` is that of no photo, and no pick is in such a photo.",
        action="Correct the name, or take it out.",
    ),
    Entry(
        "frame-left-out",
        WARNING,
        finding="A photo was left out with all of its picks, for the reason in the message.",
        action="Check its labels, or pick more points in it.",
        effect=Effect.AMBER,
        order=Order.LEFT_OUT,
        one="{frames} was left out, with all of its picks.",
        several="{frames} were left out, with all of their picks.",
        accuses=True,
    ),
    Entry(
        "line-left-out",
        WARNING,
        finding=(
            "A length was left out before the tests: with so large an error nothing else would fit."
        ),
        action="Check the reading, its unit and its ends.",
        effect=Effect.AMBER,
        order=Order.LEFT_OUT,
        one="{lengths} does not fit and was left out.",
        several="{lengths} do not fit and were left out.",
        accuses=True,
    ),
    Entry(
        "line-removed",
        WARNING,
        finding=(
            "With `outliers: remove`, a length that does not fit was removed, and the rest "
            "adjusted again."
        ),
        action="Check the reading, its ends and their picks.",
        effect=Effect.AMBER,
        order=Order.REMOVED,
        one="{lengths} does not fit and was taken out.",
        several="{lengths} do not fit and were taken out.",
        accuses=True,
    ),
    Entry(
        "known-left-out",
        WARNING,
        finding=(
            "A known value was left out before the tests, because nothing else would fit with it."
        ),
        action="Check its value and unit, and the labels of its points.",
        effect=Effect.AMBER,
        order=Order.LEFT_OUT,
        one="A known value of {labels} does not fit and was left out.",
    ),
    Entry(
        "known-removed",
        WARNING,
        finding="With `outliers: remove`, a known value that does not fit was removed.",
        action="Check its value, its points and their picks.",
        effect=Effect.AMBER,
        order=Order.REMOVED,
        one="A known value of {labels} does not fit and was removed.",
    ),
    Entry(
        "control-left-out",
        WARNING,
        finding="A control point was left out, because nothing else would fit with it.",
        action="Check its coordinates (two may be exchanged), its label and its picks.",
        effect=Effect.AMBER,
        order=Order.LEFT_OUT,
        one="The control point {labels} does not fit and was left out.",
        several="The control points {labels} do not fit and were left out.",
    ),
    Entry(
        "control-exchanged",
        WARNING,
        finding=(
            "Two control points seem to have each other's coordinates, or each other's labels in "
            "the photos: everything else fits once the coordinates are exchanged, and the results "
            "use them so."
        ),
        action=(
            "Look at the list of control points, and at which point is which in the photos; then "
            "correct the one that is wrong."
        ),
        effect=Effect.DOUBTFUL,
        order=Order.CAUSE_OF_ONE,
        one="{labels} seem to have each other's coordinates.",
    ),
    Entry(
        "height-left-out",
        WARNING,
        finding=(
            "The stated height of a point was left out, because two or more photos show another "
            "height."
        ),
        action="Measure the height again, and check whether the picks are on the right object.",
        effect=Effect.AMBER,
        order=Order.LEFT_OUT,
        one="The stated height of {labels} does not fit and was left out.",
        several="The stated heights of {labels} do not fit and were left out.",
    ),
    Entry(
        "too-many-blunders",
        ERROR,
        finding=(
            "The program stopped removing picks and lengths: many were removed, and others still "
            "do not fit."
        ),
        action="Look for a common cause: labels, the camera file, the ground, times.",
        effect=Effect.RED,
        one="Many picks and lengths do not fit: do not use these numbers.",
    ),
    Entry(
        "pick-duplicate",
        WARNING,
        finding=(
            "A row of the picks repeats another row to the last digit. It is a copy and counts "
            "once. Two rows of one label in one photo that differ count as two clicks, which check "
            "each other."
        ),
        action="Remove the copy, or click again.",
        order=Order.DUPLICATE,
    ),
    Entry(
        "line-duplicate",
        WARNING,
        finding="A length is in the table twice with the same reading. It counts once.",
        action="Remove the copy. If the line was taped twice, write one more digit.",
        order=Order.DUPLICATE,
        one="{lengths} is there twice, and counts once.",
        several="{lengths} are there twice, and count once.",
    ),
    Entry(
        "known-duplicate",
        WARNING,
        finding="A known value is given twice. It counts once.",
        action="Remove the copy.",
        order=Order.DUPLICATE,
    ),
    Entry(
        "photo-duplicate",
        WARNING,
        finding=(
            "A photo is there twice, as the same file. It counts once, for the clocks and in the "
            "adjustment. Picks in both copies are repeats of one observation; picks that were "
            "copied with the photo count once."
        ),
        action="Take the copy out of `images`.",
        order=Order.DUPLICATE,
    ),
    Entry(
        "copies-contradict",
        WARNING,
        finding=(
            "A photo is there twice, as the same file, and most labels are picked at other places "
            "in one copy than in the other: the picks of one of them are of another photo, such as "
            "one that was exchanged with it."
        ),
        consequence="No pick in either copy is used, as nothing shows which are right.",
        action="Look at both copies. Delete the wrong picks, or pick them in their own photo.",
        effect=Effect.AMBER,
        order=Order.DUPLICATE,
        one="{frames} are the same file with picks at different places: look at both.",
    ),
    Entry(
        "photo-saved-anew",
        WARNING,
        finding=(
            "Two files show one exposure: they have the same capture time and camera, or one has "
            "no time and a label at nearly the same pixel or a name that continues the other's. "
            "They count once."
        ),
        action="Take one of them out of `images`.",
    ),
)

UNUSED = (
    Entry(
        "label-unseen",
        WARNING,
        finding="A table names a point that is not picked in any photo.",
        action="Pick it, or correct its name. The message suggests a similar one.",
    ),
    Entry(
        "label-resembles",
        WARNING,
        finding=(
            "A label is picked once and looks like another label: `Pl` and `P1`, `O` and `0`, "
            "small and capital letters, Cyrillic and Latin letters. Or it is one letter off "
            "another, such as `P10` and `P1`, and at the place where that one is expected in the "
            "photo, and not picked."
        ),
        consequence="If both are one point, its two names do not tie the photos together.",
        action=(
            "If both are one point, give it one label. If they are two points, nothing has to be "
            "done."
        ),
    ),
    Entry(
        "line-unseen",
        WARNING,
        finding="A length is not used, because one of its ends has no usable pick.",
        action="Pick that point, or correct the label.",
        effect=Effect.AMBER,
        order=Order.EXCLUDED,
        one="{lengths} is not used: a point of it is not picked.",
        several="{lengths} are not used: points of them are not picked.",
    ),
    Entry(
        "known-unseen",
        WARNING,
        finding="A known value is not used, because one of its points has no usable pick.",
        action="Pick that point, or correct the label.",
        effect=Effect.AMBER,
        order=Order.EXCLUDED,
        one="Something known is not used: {labels} is not picked.",
    ),
    Entry(
        "known-idle",
        WARNING,
        finding=(
            "A known value is not used. Either all of its points are on the ground by their picks, "
            "and the value does not depend on the ground; or it is a line of known position "
            "(control_lines.csv) and nothing else places the survey on the map."
        ),
        action=(
            "If points are off the ground, write `free` in their `height_m` in picks.csv. For a "
            "line: pick three points on lines that are not all parallel, or give the flight log or "
            "two control points."
        ),
    ),
    Entry(
        "control-unseen",
        WARNING,
        finding="A control point is not used, because it has no usable pick.",
        action=(
            "Pick it, or correct its name. If no photo shows it, remove it from the control points."
        ),
        effect=Effect.AMBER,
        order=Order.EXCLUDED,
        one="The control point {labels} is not used: it is not picked.",
        several="The control points {labels} are not used: they are not picked.",
    ),
    Entry(
        "check-unseen",
        WARNING,
        finding="A check point checks nothing, because it has no usable pick.",
        action="Pick it, or correct its name.",
    ),
    Entry(
        "check-unjudged",
        WARNING,
        finding=(
            "Check points are not compared, because coordinates have no meaning without a log or "
            "control points."
        ),
        action="Name a log or control points in the project.",
    ),
    Entry(
        "points-unplaced",
        WARNING,
        finding=(
            "Points with latitude and longitude are not used, because nothing ties this survey to "
            "the earth."
        ),
        action="Give the log, `world.origin`, or control points on the earth.",
    ),
    Entry(
        "area-unpicked",
        WARNING,
        finding="The project names an area of the ground that contains no pick.",
        action="Write its name in the column `area` of picks.csv, or remove it from the project.",
    ),
    Entry(
        "measurement-null",
        WARNING,
        finding=(
            "A measurement has no value, for the reason in the message: usually a point without a "
            "usable pick."
        ),
        action="Pick that point, or correct the measurement.",
        effect=Effect.UNCHECKED,
        one="{measurements} cannot be measured.",
    ),
    Entry(
        "measurement-unknown",
        WARNING,
        finding="The 95 % interval of a distance, an area or an angle reaches zero.",
        consequence="Any size would fit as well, and the value has no meaning.",
        action=(
            "Check the stated errors of picks (`picks_sigma_px`) and lengths. If they are right, "
            "pick in more photos, or tape more lengths."
        ),
        effect=Effect.UNCHECKED,
        one="Nothing is known of {measurements}: any value would fit.",
        several="Nothing is known of {measurements}: any values would fit.",
    ),
    Entry(
        "match-stale",
        WARNING,
        finding=(
            "A match is not used, because the pick that it was found from was moved or deleted."
        ),
        action="Run `uavgram picks match` again, or delete the match.",
    ),
    Entry(
        "own-columns",
        NOTE,
        finding="A table has columns that the program does not read. It keeps their content.",
    ),
)
