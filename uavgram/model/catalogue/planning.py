"""Messages on the planning of a flight."""

from __future__ import annotations

from uavgram.model.catalogue.entry import WARNING, Entry

PLANNING = (
    Entry(
        "plan-not-reached",
        WARNING,
        finding=(
            "A measurement will not be as exact as requested (`sigma_m`), with any of the flights "
            "and numbers of lines that were tried."
        ),
        action=(
            "Allow more or longer lines, more photos, lower heights or other patterns; pick more "
            "exactly; or accept the larger ± in the message."
        ),
    ),
    Entry(
        "plan-nowhere",
        WARNING,
        finding=(
            "The area is given in metres, without a place on earth and a direction of its first "
            "axis."
        ),
        consequence=(
            "The plan is right, but its maps and the north of its drawing are those of the demo, "
            "and no mission file is written."
        ),
        action=(
            "Write `site:` with `latitude_deg`, `longitude_deg`, `scene_east_m: 0`, "
            "`scene_north_m: 0` and `road_azimuth_deg` (of the first axis, clockwise from north), "
            "or draw the area on a map and give it as a GeoJSON or KML file."
        ),
    ),
    Entry(
        "plan-unchecked",
        WARNING,
        finding=(
            "If the tape were misread by 30 cm at one of these lines, no test would show it: the "
            "other lines check it too little."
        ),
        consequence=(
            "All measurements would be wrong with it. The table gives the largest unnoticed "
            "mistake of each line."
        ),
        action="Read the tape twice, tape one more line, or take more photos.",
    ),
    Entry(
        "plan-needs-line",
        WARNING,
        finding=(
            "If one of these lines is lost (a car parks on it, its mark is blown away), the rest "
            "determines the photos too poorly for useful measurements. The same holds for plates."
        ),
        action="Tape one more, or write `robust: true` in the plan.",
    ),
    Entry(
        "plan-few-lines",
        WARNING,
        finding=(
            "The plan has one or two lines and a single photo, so that only the log determines the "
            "tilt of the camera."
        ),
        consequence=(
            "In simulated surveys the errors were up to 1.3 times the stated ± (up to twice for a "
            "single value). With three lines the ± was right."
        ),
        action="Tape three lines or more, or take more photos.",
    ),
    Entry(
        "plan-lines-useless",
        WARNING,
        finding=(
            "The log alone gives nearly the same accuracy as the log with these lines: they are "
            "too short, or the log is very good. The same holds for plates that are too small."
        ),
        action="Use a longer tape, or leave the lines out.",
    ),
)
