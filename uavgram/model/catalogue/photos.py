"""Messages on photos, their times and the positions from which they were taken."""

from __future__ import annotations

from uavgram.model.catalogue.entry import NOTE, WARNING, WARNING_OR_NOTE, Effect, Entry

TIMES = (
    Entry(
        "log-of-another-day",
        WARNING,
        finding=(
            "By the camera's clock, the photos were taken on another day than the log. They fit "
            "the log all the same: by chance, or because the camera's clock was never set."
        ),
        action=(
            "Name the log of that flight. If it is the right log, `time.offset_s` states the error "
            "of the clock."
        ),
        effect=Effect.AMBER,
        one="The flight log is of another day than the photos.",
    ),
    Entry(
        "frame-unmatched",
        WARNING,
        finding="A photo has no place in the log, for the reason in the message.",
        consequence="It takes no part.",
        action="Check whether the photo belongs to this flight, and check `time.offset_s`.",
    ),
    Entry(
        "photo-without-event",
        WARNING,
        finding="Photos have no camera trigger of their own in the log.",
        consequence="The times in the files were used, where there are any.",
        action="Check whether photos or log belong to another flight.",
    ),
    Entry(
        "photo-event-uncertain",
        WARNING,
        finding="Photos may belong to another camera trigger than the nearest one.",
        consequence="The times in the files were used.",
        action="Run `uavgram check`: it shows each photo with its trigger.",
    ),
    Entry(
        "event-without-photo",
        NOTE,
        finding="The log has camera triggers without a photo, such as photos that were deleted.",
    ),
    Entry(
        "time-coarse",
        WARNING,
        finding=(
            "The times of the photos are coarse and fit the camera triggers of the log in several "
            "ways."
        ),
        consequence="The times were used without a correction.",
        action="Name all photos of the flight, or state `time.offset_s`.",
    ),
    Entry(
        "time-aligned",
        NOTE,
        finding=(
            "States the error of the camera's clock, found from the photos' times and the camera "
            "triggers of the log."
        ),
    ),
    Entry(
        "time-by-ties",
        NOTE,
        finding=(
            "The log has no camera triggers. The program set the camera's clock by the positions "
            "at which tie points place the photos."
        ),
        action="If you know a better value, state `time.offset_s`.",
    ),
    Entry(
        "time-by-order",
        NOTE,
        finding=(
            "Photos and camera triggers of the log are equally many, and were paired in their "
            "order."
        ),
    ),
    Entry(
        "times-from-names",
        WARNING,
        finding="The program read the times of the photos from their file names.",
        action="Check one of them, and correct `time` in the project if it is wrong.",
    ),
    Entry(
        "clock-assumed",
        WARNING,
        finding="The program assumes that the camera's clock shows UTC.",
        action="Compare a photo with the flight, and correct `time.offset_s`.",
    ),
    Entry(
        "photo-without-time",
        WARNING,
        finding="Some photos state no time. Another program may have saved them.",
        consequence="They cannot be found in the log.",
        action="Use the camera's own files.",
    ),
    Entry(
        "photo-times-ignored",
        WARNING,
        finding="Most photos state no time, so no time was used.",
        action="To use the times all the same, set `time.source`.",
    ),
    Entry(
        "photo-zone-unknown",
        NOTE,
        finding="The times of the photos have no time zone and were read as UTC.",
        action="State the time zone in `time.offset_s`.",
    ),
    Entry(
        "photo-edited",
        WARNING,
        finding="Another program saved the photos.",
        consequence="If it turned or cropped them, nothing fits.",
        action="Use the camera's own files.",
    ),
    Entry(
        "photo-name-formula",
        WARNING,
        finding="Photo names begin like a formula of a spreadsheet.",
        action="Do not open tables with these names in a spreadsheet, or rename the photos.",
    ),
)

POSES = (
    Entry(
        "poses-available",
        NOTE,
        finding="The photos state where they were taken. These positions were not used.",
        action="To use them, write `poses: exif` in the project.",
    ),
    Entry(
        "pose-sources",
        NOTE,
        finding="States which file gives positions and attitudes.",
    ),
    Entry(
        "no-pose-tags",
        WARNING,
        finding="No photo states where it was taken, so `exif` in `poses` has no effect.",
        action="Remove it, or name a table.",
    ),
    Entry(
        "pose-datum-differs",
        WARNING,
        finding=(
            "Photos were left out, because their heights have another datum than those of the "
            "others."
        ),
        action="Give their positions in a CSV file with heights of the same datum.",
    ),
    Entry(
        "pose-without-photo",
        NOTE,
        finding="A table of poses names photos that are not among `images`. They were not used.",
    ),
    Entry(
        "height-datum-assumed",
        NOTE,
        finding=(
            "A table does not state the datum of its heights. The message names the one that was "
            "assumed."
        ),
        consequence="A wrong datum shifts all heights by tens of metres.",
        action="Set `world.heights`.",
    ),
    Entry(
        "position-bias-wide",
        NOTE,
        finding="The positions of the photos are better than the project assumes.",
        action=(
            "If the base station has a known position, set `telemetry.position_bias_sigma_m` as "
            "the message proposes."
        ),
    ),
    Entry(
        "attitude-from-course",
        WARNING,
        finding=(
            "The directions of the photos are unknown. They were taken from the heading of the "
            "drone in the photos' tags."
        ),
        consequence="Their sigmas are wide.",
        action=(
            "If you know better, state `mount` in the project, or give `yaw_deg`, `pitch_deg` and "
            "`roll_deg` in a CSV file."
        ),
    ),
    Entry(
        "attitude-unknown",
        WARNING,
        finding=(
            "The directions of the photos are unknown. The course of the flight does not show them "
            "either, as drones fly backwards and sideways too. Only points in several photos, or "
            "known points, can show them."
        ),
        action="Pick such points, or give `yaw_deg`, `pitch_deg` and `roll_deg` in a CSV file.",
    ),
    Entry(
        "course-contradicted",
        NOTE,
        finding="By their picks, photos look in another direction than the nose of the drone.",
        consequence="Their headings follow from the picks.",
    ),
    Entry(
        "attitude-by-ties",
        NOTE,
        finding=(
            "Photos without directions do not look as `mount` states. Tie points between them show "
            "their tilt, which was used."
        ),
        action="If you know the tilt, set `mount.pitch_deg`.",
    ),
    Entry(
        "gimbal-not-filled",
        WARNING,
        finding=(
            "Photos state gimbal angles of exactly 0, 0 and 0, as drones do that do not measure "
            "them: all photos, or some, while the others were taken elsewhere and do not look to "
            "the horizon."
        ),
        consequence="They were not used: the camera is assumed to look as `mount` states.",
        action="State the direction in `mount`, or give the angles in a CSV file.",
    ),
    Entry(
        "gimbal-zero",
        NOTE,
        finding=(
            "Some photos state gimbal angles of exactly 0, 0 and 0: they look to the horizon in "
            "the north, or the drone did not fill in the angles."
        ),
        consequence="The angles are used.",
        action="If these photos look elsewhere, give their angles in a CSV file.",
    ),
    Entry(
        "odd-altitude",
        WARNING_OR_NOTE,
        finding=(
            "Photos state an altitude or a height above take-off of 0, or one with the wrong sign: "
            "far below the sea while the other photos are as far above it, or all of them far "
            "below it; the same about the place of take-off."
        ),
        consequence=(
            "That height was not used. Where the photo has two altitudes, in EXIF and in the tags "
            "of its maker, and one of them can be right, this one was used. Otherwise only the "
            "horizontal position was."
        ),
        action="Give the true heights in a CSV file, also if the survey really is below the sea.",
    ),
    Entry(
        "gimbal-roll-180",
        NOTE,
        finding=(
            "Photos that look down state a gimbal roll near 180 degrees. The program reads it as "
            "roll 0 with the yaw turned by 180 degrees."
        ),
    ),
    Entry(
        "gimbal-upside-down",
        WARNING,
        finding=(
            "The tags of the photos state that the camera was upside down. The program uses that."
        ),
        action="Check whether it is true.",
    ),
    Entry(
        "geo-without-angles",
        NOTE,
        finding="All angles of a geo.txt are zero, which means unknown.",
    ),
    Entry(
        "mrk-no-position",
        WARNING,
        finding="Rows of a .MRK have no position. Their photos have no position from it.",
        action="Write `[flight.MRK, exif]` for `poses`.",
    ),
    Entry(
        "mrk-not-fixed",
        WARNING,
        finding="Positions of a .MRK are no fixed RTK solution.",
        consequence="They are less exact. The program uses the sigmas in the file.",
        action=(
            "Nothing has to be done. Taped lengths or control points make the result more exact."
        ),
    ),
    Entry(
        "lever-arm-unused",
        NOTE,
        finding=(
            "`mount.lever_arm_m` was not applied, because `poses` gives positions of the camera "
            "itself."
        ),
    ),
    Entry(
        "origin-first-photo",
        NOTE,
        finding="The origin of the world is below the first photo, at the height of take-off.",
        action="If the ground has another height, set `ground.height_m` or `world.origin`.",
    ),
    Entry(
        "origin-control",
        NOTE,
        finding=(
            "Without a log, the first control point is the origin of the world; without control "
            "points, the start of the first line of known position."
        ),
    ),
    Entry(
        "origin-far",
        WARNING,
        finding="`world.origin` is so far from the flight that the curvature of the earth matters.",
        action="Choose an origin near the flight.",
    ),
)
