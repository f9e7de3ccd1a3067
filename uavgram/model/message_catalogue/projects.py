"""Messages on new projects, tie points, products, imports, targets and planned flights."""

from __future__ import annotations

from uavgram.model.message_catalogue.entry import NOTE, WARNING, Entry

NEW_PROJECT = (
    Entry(
        "nothing-picked",
        WARNING,
        finding="No point is picked yet.",
        consequence="Nothing can be computed.",
        action="Pick points with `uavgram pick`.",
    ),
    Entry(
        "nothing-to-measure",
        NOTE,
        finding="The project asks for no measurement yet.",
        action="Add measurements on the picking page, or in `measure`.",
    ),
    Entry(
        "no-scale",
        WARNING,
        finding="No log, pose or length determines the scale.",
        action="Tape at least four lengths on the ground.",
    ),
    Entry(
        "no-known-length",
        NOTE,
        finding="No length is known, so the log alone determines the scale.",
        action="Tape a few lengths: they make the results far better.",
    ),
    Entry(
        "gcp-list-found",
        NOTE,
        finding=(
            "The folder contains a gcp_list.txt of another program. The project uses it: "
            "`picks.csv` and `control.csv` have a header only."
        ),
        action="Run the command in the message, which fills them.",
    ),
    Entry(
        "files-passed-over",
        NOTE,
        finding=(
            "The folder contains files that the project does not use. The message lists their "
            "kinds and numbers."
        ),
        action=(
            "For videos, subtitles, HEIC and raw photos and pointers of Git LFS, the message "
            "states how to convert them."
        ),
    ),
    Entry(
        "log-unusable",
        WARNING,
        finding=(
            "A file in the folder has the name of a flight log, but it is empty, damaged, or of "
            "another program. The message states which."
        ),
        consequence=(
            "The new project does not use it. Without another log, the photos are placed by their "
            "own positions, if they have some, or else by taped lengths alone."
        ),
        action="Copy the log from the vehicle once more, and write its name in `log`.",
    ),
    Entry(
        "table-unusable",
        WARNING,
        finding="A table or list in the folder cannot be read, for the reason in the message.",
        consequence="The new project does not use it.",
        action="Save it as CSV UTF-8, and write its name in the project.",
    ),
    Entry(
        "camera-passed-over",
        WARNING,
        finding=(
            "A camera file in the folder is not used: it has another image size, or cannot be read."
        ),
        action="Name another file with `--camera`.",
    ),
    Entry(
        "poses-found",
        NOTE,
        finding="The photos state where they were taken. The new project uses it.",
    ),
    Entry(
        "poses-unusable",
        WARNING,
        finding=(
            "The photos state where they were taken, but this cannot be used, for the reason in "
            "the message."
        ),
        action="Correct that, or tape lengths.",
    ),
    Entry(
        "not-posed",
        WARNING,
        finding="The photos cannot be placed yet, for the reason in the message.",
        action="Correct that, or tape lengths.",
    ),
    Entry(
        "ground-assumed",
        WARNING,
        finding=(
            "The height of the photos above the ground is unknown. The program assumes an ordinary "
            "one."
        ),
        action=(
            "Write the height of the ground in `world.origin`, and its sigma in "
            "`ground.height_sigma_m`."
        ),
    ),
    Entry(
        "pick-recovered",
        WARNING,
        finding=(
            "An earlier session ended without saving. Its confirmed changes were recovered and "
            "saved."
        ),
        action="To go back to the tables as they were before, use Undo.",
    ),
    Entry(
        "pick-not-recovered",
        WARNING,
        finding="An earlier session ended without saving, and its changes do not fit the tables.",
        consequence="They are kept in the file that the message names.",
        action="Open the project with `uavgram pick` and take or discard them, or compare that "
        "file with the tables and repeat the missing changes.",
    ),
)

TIES = (
    Entry(
        "ties-found",
        NOTE,
        finding=(
            "States how many tie points were found, in how many photos. They tie the photos to "
            "each other without a click. The adjustment leaves out those that do not fit."
        ),
    ),
    Entry(
        "ties-none",
        WARNING,
        finding="The program found no two photos that show the same ground.",
        consequence="The numbers are as without tie points.",
        action=(
            "Check whether the photos are of one place, overlap and are sharp, and whether the "
            "camera file belongs to them."
        ),
    ),
    Entry(
        "ties-unused",
        NOTE,
        finding="Tie points were written to a table that the project does not name yet.",
        action="Write `ties: ties.csv` in the project.",
    ),
    Entry(
        "ties-apart",
        NOTE,
        finding="The photos form groups that no tie point connects.",
        consequence="Only the log, and points picked in both groups, connect them.",
    ),
    Entry(
        "photo-untied",
        NOTE,
        finding=(
            "The program found nothing in a photo that another photo shows. It may be blurred, "
            "show another place, or only water or leaves."
        ),
        consequence="Tie points do not help to place it.",
    ),
)

PRODUCTS = (
    Entry(
        "recording-thinned",
        NOTE,
        finding=(
            "The survey has more than 5,000 photos. The recording contains an even selection of "
            "them, because with all of them it would be too large to open."
        ),
        consequence=(
            "All frames, picks and points are in it, and all photos were used for the picture of "
            "the ground."
        ),
        action="To look at a photo that is missing, pick in it, or run a part of the survey.",
    ),
    Entry(
        "geotag-without-pose",
        WARNING,
        finding="Photos without a pose were left out.",
        action="Run `uavgram check` for the reason.",
    ),
    Entry(
        "geotag-seeds",
        WARNING,
        finding="Photos without picks were not adjusted.",
        consequence="Their positions are those of the log, with its errors.",
        action="Pick points in them.",
    ),
    Entry(
        "rectified-on-one-plane",
        WARNING,
        finding="The top view shows everything on one plane.",
        consequence=(
            "Objects above it, and other areas of ground, appear displaced. Distances there are "
            "wrong."
        ),
        action="Measure such distances with picks in the photos.",
    ),
    Entry(
        "rectified-brightened",
        NOTE,
        finding=(
            "The photos are dark or have little contrast. `rectified.png` is brightened for "
            "viewing. `rectified.tif` keeps the brightness of the photos."
        ),
        action="To see more in `rectified.tif`, stretch its contrast in your program.",
    ),
)

IMPORTS = (
    Entry(
        "gcp-without-labels",
        NOTE,
        finding="Picks without a name were named by their coordinates: gcp-1, gcp-2 and so on.",
    ),
    Entry(
        "gcp-numbers-unused",
        WARNING,
        finding="A gcp_list.txt has numbers behind labels, separated by blanks.",
        consequence="They are not used: `A 1` is the point `A`.",
        action=(
            "If they belong to the labels, separate all cells by tabs. If they are sigmas, import "
            "with `--sigma-columns`."
        ),
    ),
    Entry(
        "gcp-two-heights",
        WARNING,
        finding="A gcp_list.txt has one place at two heights, under two labels or none.",
        consequence="Its picks belong to two points, and nothing ties them together.",
        action="If it is one point, correct its height and give it one label.",
    ),
    Entry(
        "gcp-photos-absent",
        WARNING,
        finding="A gcp_list.txt names photos that are not in its folder, beside some that are.",
        consequence="The picks in the missing photos are left out.",
        action="Copy the photos beside the file, and import it once more into another picks.csv.",
    ),
    Entry(
        "gcp-zero-heights",
        WARNING,
        finding="Points have the height 0, which programs write for an unknown height.",
        consequence="These heights get a wide sigma, so that they have no effect.",
        action=(
            "If they are true, state `--control-sigma-up-m`. Otherwise write the heights in the "
            "table."
        ),
    ),
    Entry(
        "shapes-left-out",
        NOTE,
        finding="Shapes other than points were not imported.",
    ),
    Entry(
        "photo-not-beside",
        WARNING,
        finding=(
            "The photo is not beside its LabelMe file, so the program cannot check whether it was "
            "turned when it was picked."
        ),
        action="Put the photo there, and import again.",
    ),
)

TARGETS = (
    Entry(
        "no-target",
        WARNING,
        finding="No photo shows a plate of the family that the project names.",
        action=(
            "Compare the name with the print on the plates. To be found for certain, the black "
            "square must be at least 16 pixels wide in a photo."
        ),
    ),
    Entry(
        "target-left-out",
        WARNING,
        finding=(
            "A plate was recognised in a photo, but its corners are not used there: a shadow, dirt "
            "or a wheel covers a part of it, it is too small or too faint, or its number occurs "
            "twice."
        ),
        consequence="Other photos of the same plate are not affected.",
        action="Look at the plate in that photo.",
    ),
    Entry(
        "target-by-hand",
        NOTE,
        finding=(
            "You picked corners of plates by hand. Your picks stay, and the program adds none "
            "beside them."
        ),
    ),
    Entry(
        "target-not-sought",
        WARNING,
        finding=(
            "You picked chequers, crosses or discs, but the relation between the photos is not "
            "known yet, so the program does not know where to search for them."
        ),
        action="Add the data that the message names as missing, and run the search again.",
    ),
    Entry(
        "target-not-found",
        NOTE,
        finding=(
            "A chequer, cross or disc was searched for in the photos that are named and is not "
            "picked there, for the reason in brackets."
        ),
        action="Pick it there by hand where you see it.",
    ),
)


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
