"""Messages on photos, their times and positions, and on the flight log."""

from __future__ import annotations

from uavgram.model.message_catalogue.entry import (
    NOTE,
    WARNING,
    WARNING_OR_NOTE,
    Effect,
    Entry,
    Order,
)

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
        effect=Effect.DISPLACED,
        one="{frames} has no place in the flight log: check the times.",
        several="{frames} have no place in the flight log: check the times.",
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
        consequence=(
            "They were not used: these photos are assumed to look as `mount` states or, where it "
            "does not, as steeply down as the other photos."
        ),
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


FLIGHT_LOG = (
    Entry(
        "log-position-jump",
        WARNING,
        finding="The position in the log jumps: the receiver lost its satellites.",
        consequence=(
            "Photos after the jump have a lower weight. Their picks determine their positions."
        ),
        action="In these photos, pick points that they share with the others.",
        effect=Effect.DISPLACED,
        order=Order.LOG_FAULT,
        one="The places in the flight log jump at {frames}.",
    ),
    Entry(
        "log-attitude-jump",
        WARNING,
        finding="The heading or tilt in the log jumps.",
        consequence=(
            "Photos after the jump have a lower weight. Their picks determine their directions."
        ),
        action="In these photos, pick points that they share with the others.",
        effect=Effect.AMBER,
        order=Order.LOG_FAULT,
        one="The directions in the flight log jump at {frames}.",
    ),
    Entry(
        "log-position-frozen",
        WARNING,
        finding="The position in the log does not change while the drone flies on.",
        consequence="Photos of that time have a lower weight.",
        action="In these photos, pick points that they share with the others.",
        effect=Effect.AMBER,
        order=Order.LOG_FAULT,
    ),
    Entry(
        "log-attitude-frozen",
        WARNING,
        finding="The log repeats one attitude.",
        consequence="Photos of that time have a lower weight.",
        action="In these photos, pick points that they share with the others.",
        effect=Effect.AMBER,
        order=Order.LOG_FAULT,
    ),
    Entry(
        "log-position-gap",
        WARNING,
        finding="The log has no position for a while in which photos were taken.",
        consequence="Photos of that time have a lower weight.",
        action="In these photos, pick points that they share with the others.",
        order=Order.LOG_GAP,
    ),
    Entry(
        "log-attitude-gap",
        WARNING,
        finding="The log has no attitude for a while in which photos were taken.",
        consequence="Photos of that time have a lower weight.",
        action="In these photos, pick points that they share with the others.",
        order=Order.LOG_GAP,
    ),
    Entry(
        "log-gimbal-gap",
        WARNING,
        finding="The log has no gimbal direction for a while in which photos were taken.",
        consequence="Photos of that time have a lower weight.",
        action="In these photos, pick points that they share with the others.",
        order=Order.LOG_GAP,
    ),
    Entry(
        "log-receiver-apart",
        WARNING,
        finding="The position in the log differs from that of the GPS receiver itself.",
        consequence="Photos of that time have a lower weight.",
        action=(
            "In these photos, pick points that they share with the others, and give known points."
        ),
        order=Order.LOG_GAP,
    ),
    Entry(
        "estimator-reset",
        NOTE,
        finding=(
            "The autopilot recorded a correction of its own estimate, but positions and attitudes "
            "show no jump there."
        ),
        consequence="Nothing was changed.",
    ),
    Entry(
        "log-note",
        WARNING,
        finding=(
            "Something in the log is unusual, as the message states: a damaged part, a missing "
            "end, or camera triggers that the camera did not confirm."
        ),
        consequence="The program read everything that is readable.",
        action="If a part or the end is missing, copy the log from the vehicle again.",
    ),
    Entry(
        "clock-missing",
        WARNING,
        finding="The clock of the log has no relation to the time of day.",
        consequence="Photos cannot be found in the log.",
        action=(
            "Use a log with a GPS fix, the .tlog of the ground station, or a table of positions "
            "(`poses`)."
        ),
    ),
    Entry(
        "clock-receive",
        WARNING_OR_NOTE,
        finding=(
            "The log's own time cannot be used. The program uses the time of the ground station."
        ),
        consequence="Times may be off by the delay of the radio link.",
        action="Check with `uavgram check` whether the photos match the flight.",
    ),
    Entry(
        "clock-station-off",
        NOTE,
        finding=(
            "The clock of the ground station differs from that of the autopilot. The program uses "
            "the autopilot's."
        ),
    ),
    Entry(
        "clock-jumps",
        WARNING,
        finding=(
            "Some readings of the log's clock differ from the others, usually because of late leap "
            "seconds. They were left out."
        ),
        action="Check with `uavgram check` whether the photos match the flight.",
        effect=Effect.AMBER,
        one="The clock of the flight log jumps.",
    ),
    Entry(
        "position-missing",
        WARNING,
        finding="The log contains no positions.",
        consequence="It cannot place photos.",
        action="Use another log, `poses`, or known lengths.",
    ),
    Entry(
        "position-gap",
        WARNING,
        finding="The positions in the log have gaps.",
        consequence="Photos taken in a gap have no position.",
        action="Run `uavgram check`, which names photos without a position.",
    ),
    Entry(
        "attitude-missing",
        WARNING,
        finding="The log contains no attitudes.",
        consequence=(
            "Photos have positions from the log. Only tie points or picks show their directions."
        ),
        action="Find tie points (`uavgram picks ties`), or use another log.",
    ),
    Entry(
        "height-jump",
        WARNING,
        finding="The height in the log jumps.",
        action="Do not rely on photos taken near the jump.",
    ),
    Entry(
        "event-outside",
        WARNING,
        finding="The camera was triggered before the log's first position or after its last one.",
        consequence="Those photos have no position.",
        action="Run `uavgram check`, which names photos without a position.",
    ),
    Entry(
        "home-missing",
        WARNING,
        finding="The log does not state where home is. The program uses its first position.",
        action="For another origin, set `world.origin`.",
    ),
    Entry(
        "home-late",
        NOTE,
        finding=(
            "The log states where home is only after the first photo. The program uses that "
            "statement."
        ),
    ),
    Entry(
        "home-moves",
        NOTE,
        finding=(
            "Home changes within the log. The program uses the home at the time of the first photo."
        ),
    ),
    Entry(
        "mount-stated",
        WARNING_OR_NOTE,
        finding=(
            "The project states angles of the camera in `mount`. They replace the gimbal angles in "
            "the log or in the photos' tags, and differ from them by up to the angle in the "
            "message. It is a warning where both can hardly be right."
        ),
        action=(
            "Check how the camera hung. To use the gimbal's own angles, choose *As recorded* on "
            "the page, or write `auto`."
        ),
        effect=Effect.AMBER,
        order=Order.CAUSE_OF_ALL,
        one="The camera's direction, as chosen, contradicts the recorded angles.",
    ),
    Entry(
        "gimbal-unused",
        WARNING,
        finding=(
            "The log's gimbal angles have other times than its attitudes. The program uses the "
            "direction in `mount`."
        ),
        action="Check whether `mount` is right.",
    ),
    Entry(
        "gimbal-held",
        WARNING,
        finding=(
            "The log's gimbal angles do not cover the whole flight. The program extends the first "
            "and the last one."
        ),
        action="Check whether the gimbal moved during that time.",
    ),
    Entry(
        "pose-source",
        NOTE,
        finding="States which records of the log give positions, attitudes, directions and sigmas.",
    ),
)
