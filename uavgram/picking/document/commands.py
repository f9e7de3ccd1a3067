"""What the page may ask for: one frozen class for each command, question and project action.

Commands change what is picked, questions change nothing, project
actions are about the whole project.

Numbers are finite and in range, texts are short and clean, photos exist: `protocol.parse` saw to
that. Whether a command fits the state (a label that is there, a free name) is for `history`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.camera.calibration import LensModel
from uavgram.model.survey.observations import Along, MeasurementKind, Source

Target = Literal["any", "target"]


@dataclass(frozen=True, kw_only=True)
class Place:
    """Pick a label in a photo, or move the pick that is there; a sigma of None keeps its own.

    Whoever places it made it: a match that a person moves is a person's pick. `source` and what
    follows are of what the program found, as in `Picks`.
    """

    image: str
    label: str
    u_px: float
    v_px: float
    sigma_px: float | None = None
    source: Source = "hand"
    score: float | None = None
    from_image: str = ""
    from_u_px: float | None = None
    from_v_px: float | None = None


@dataclass(frozen=True, kw_only=True)
class Repeat:
    """Click a picked label in a photo again: an independent repetition beside the first click."""

    image: str
    label: str
    u_px: float
    v_px: float


@dataclass(frozen=True, kw_only=True)
class PlaceAll:
    """Pick several in one step; what is picked already stays as it is."""

    places: tuple[Place, ...]


@dataclass(frozen=True, kw_only=True)
class Accept:
    """Pick what the program found: photo and label of each."""

    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class Refuse:
    """Do not take what the program found, or do not ask for it: photo and label of each.

    `is_taken_back` where that was said and is not meant any more.
    """

    pairs: tuple[tuple[str, str], ...]
    is_taken_back: bool = False


@dataclass(frozen=True, kw_only=True)
class Unpick:
    """Remove the pick of a label in a photo."""

    image: str
    label: str


@dataclass(frozen=True, kw_only=True)
class Forget:
    """Remove a label everywhere: picks, lengths, measurements."""

    label: str


@dataclass(frozen=True, kw_only=True)
class Rename:
    """Call a label otherwise, wherever it stands."""

    label: str
    new: str


@dataclass(frozen=True, kw_only=True)
class Merge:
    """Take two labels for one point: all that is said of `label` is said of `into` from now on.

    `keep` is the one of the two whose picks stay in photos in which both are picked; empty where
    there is no such photo.
    """

    label: str
    into: str
    keep: str = ""


@dataclass(frozen=True, kw_only=True)
class Split:
    """Take the picks of a label in some photos for another point, which is called `new`."""

    label: str
    new: str
    images: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Swap:
    """Exchange two labels where they are picked: in one photo, or, where it is empty, in all."""

    image: str
    label: str
    other: str


@dataclass(frozen=True, kw_only=True)
class SetSigma:
    """State the standard deviation of one pick; None: the project's own."""

    image: str
    label: str
    sigma_px: float | None


@dataclass(frozen=True, kw_only=True)
class SetHeight:
    """State a label's height above the ground, or that it is to be found; else it is on it.

    A height may have a sigma, and then takes part with it; of a free one nothing is stated.
    """

    label: str
    height_m: float | None
    height_sigma_m: float | None = None
    is_free: bool = False


@dataclass(frozen=True, kw_only=True)
class SetLine:
    """Add a known length, or change the one called `was`; a tape of None keeps its own."""

    was: str
    name: str
    start: str
    end: str
    length_m: float
    sigma_m: float
    adjust: bool
    tape: str | None = None
    along: Along | None = None


@dataclass(frozen=True, kw_only=True)
class RemoveLine:
    """Remove a known length."""

    name: str


@dataclass(frozen=True, kw_only=True)
class SetMeasurement:
    """Add a measurement, or change the one called `was`."""

    was: str
    name: str
    kind: MeasurementKind
    points: tuple[str, ...]
    parameters: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, kw_only=True)
class RemoveMeasurement:
    """Remove a measurement."""

    name: str


@dataclass(frozen=True, kw_only=True)
class All:
    """Several changes in one step, in this order: all of them, or, where one does not fit, none."""

    changes: tuple[SingleChange, ...]


@dataclass(frozen=True)
class Undo:
    """Take the last step back."""


@dataclass(frozen=True)
class Redo:
    """Do again what was taken back last."""


@dataclass(frozen=True, kw_only=True)
class Snap:
    """Find the exact place of the corner or the round target near a pixel.

    Where the photo is expected to show the label `expected`, that is the one inside the region in
    which it is expected; the pixel tells several apart.
    """

    image: str
    u_px: float
    v_px: float
    target: Target
    expected: str = ""


@dataclass(frozen=True, kw_only=True)
class SameGround:
    """Find the pixels of other photos that show the ground that this pixel shows."""

    image: str
    u_px: float
    v_px: float


@dataclass(frozen=True, kw_only=True)
class SideView:
    """Where the points of a measurement lie along it, and how high."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Ties:
    """Where a photo shows tie points."""

    image: str


@dataclass(frozen=True)
class Export:
    """Save, run the project as `uavgram run` does, and write all its outputs."""


@dataclass(frozen=True)
class Reload:
    """Read the project again from its files, as they are now; the steps begin anew."""


@dataclass(frozen=True)
class TakeAside:
    """Take over what an earlier session could not save."""


@dataclass(frozen=True)
class DiscardAside:
    """Offer it no more."""


@dataclass(frozen=True)
class Folders:
    """List the folders near the project that hold photos."""


@dataclass(frozen=True, kw_only=True)
class Calibrate:
    """Calibrate a camera from the photos of a listed folder; `board` as on the command line."""

    folder: int
    board: str
    model: LensModel


@dataclass(frozen=True)
class StopCalibration:
    """End the calibration that is running."""


@dataclass(frozen=True)
class UseCamera:
    """Name the camera file that was made last in the project, and read the project again."""


SingleChange = (
    Place
    | Repeat
    | PlaceAll
    | Unpick
    | Forget
    | Rename
    | Merge
    | Split
    | Swap
    | SetSigma
    | SetHeight
    | SetLine
    | RemoveLine
    | SetMeasurement
    | RemoveMeasurement
)
Change = SingleChange | All
Command = Change | Undo | Redo
ProjectAction = (
    Refuse
    | Export
    | Reload
    | TakeAside
    | DiscardAside
    | Folders
    | Calibrate
    | StopCalibration
    | UseCamera
)
Question = Snap | SameGround | SideView | Ties
