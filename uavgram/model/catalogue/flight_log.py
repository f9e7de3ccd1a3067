"""Messages on the flight log."""

from __future__ import annotations

from uavgram.model.catalogue.entry import NOTE, WARNING, WARNING_OR_NOTE, Effect, Entry, Order

FLIGHT_LOG = (
    Entry(
        "log-position-jump",
        WARNING,
        finding="The position in the log jumps: the receiver lost its satellites.",
        consequence=(
            "Photos after the jump have a lower weight. Their picks determine their positions."
        ),
        action="In these photos, pick points that they share with the others.",
        effect=Effect.AMBER,
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
        NOTE,
        finding=(
            "The project states angles of the camera in `mount`. They replace the gimbal angles in "
            "the log or in the photos' tags, and differ from them by up to the angle in the "
            "message."
        ),
        action="To use the gimbal's own angles, write `auto`.",
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
