"""Messages that the page may send: one frozen class per command, question and project action.

Commands change the picked state, questions change nothing, project actions concern the whole
project.

`protocol.parse` has already checked that numbers are finite and in range, that texts are short and
clean, and that photos exist. `history` checks whether a command fits the state (the label exists,
the name is free). Either refuses a message by a `RefusedError`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.errors import UavgramError
from uavgram.model.camera import LensModel
from uavgram.model.observations import Along, MeasurementKind
from uavgram.picking.document.state import PickedPixel

Target = Literal["any", "target"]
Work = Literal["adjustment", "calibration", "results", "search"]
"""Long work that is shown on the page and can be stopped."""


@dataclass(frozen=True, kw_only=True)
class Place(PickedPixel):
    """Pick a label in a photo, or move its existing pick; a sigma of None keeps the present one.

    A placed pick belongs to the one who places it: a match that a person moves becomes a person's
    pick.
    """


@dataclass(frozen=True, kw_only=True)
class Repeat:
    """Click a picked label in a photo again: an independent repetition beside the first click."""

    image: str
    label: str
    u_px: float
    v_px: float


@dataclass(frozen=True, kw_only=True)
class PlaceAll:
    """Pick several labels in one step; existing picks stay unchanged."""

    places: tuple[Place, ...]


@dataclass(frozen=True, kw_only=True)
class Accept:
    """Pick proposals of the program: photo and label of each."""

    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class Refuse:
    """Refuse proposals of the program, or decline to pick a label by hand: photo and label of each.

    `is_taken_back` withdraws an earlier refusal.
    """

    pairs: tuple[tuple[str, str], ...]
    is_taken_back: bool = False


@dataclass(frozen=True, kw_only=True)
class Unpick:
    """Remove the pick of a label in a photo, or only its last repetition."""

    image: str
    label: str
    is_repetition: bool = False


@dataclass(frozen=True, kw_only=True)
class Forget:
    """Remove a label everywhere: picks, lengths, measurements."""

    label: str


@dataclass(frozen=True, kw_only=True)
class Rename:
    """Rename a label in picks, lengths and measurements."""

    label: str
    new: str


@dataclass(frozen=True, kw_only=True)
class Merge:
    """Merge two labels into one point: all statements about `label` then apply to `into`.

    `keep` is the label whose picks stay in photos in which both are picked; empty where there is no
    such photo.
    """

    label: str
    into: str
    keep: str = ""


@dataclass(frozen=True, kw_only=True)
class Split:
    """Split off the picks of a label in some photos as another point with the label `new`."""

    label: str
    new: str
    images: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Swap:
    """Exchange the picks of two labels in one photo, or in all photos where `image` is empty."""

    image: str
    label: str
    other: str


@dataclass(frozen=True, kw_only=True)
class SetSigma:
    """Set the standard deviation of one pick; None: the project's default."""

    image: str
    label: str
    sigma_px: float | None


@dataclass(frozen=True, kw_only=True)
class SetHeight:
    """Set a label's height above the ground, or set it free; without either it is on the ground.

    A height with a sigma is an observation in the adjustment; a free height is estimated without
    one.
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
    """Make several changes in one step, in this order: all of them, or none if one does not fit."""

    changes: tuple[SingleChange, ...]


@dataclass(frozen=True)
class Undo:
    """Undo the last step."""


@dataclass(frozen=True)
class Redo:
    """Redo the step that was undone last."""


@dataclass(frozen=True, kw_only=True)
class Snap:
    """Find the exact centre of the corner or round target near a pixel.

    Where the photo is expected to show the label `expected`, the target inside the expected region
    is taken; the pixel decides between several.
    """

    image: str
    u_px: float
    v_px: float
    target: Target
    expected: str = ""


@dataclass(frozen=True, kw_only=True)
class SameGround:
    """Find the pixels of other photos that show the same ground as this pixel."""

    image: str
    u_px: float
    v_px: float


@dataclass(frozen=True, kw_only=True)
class SideView:
    """Return the positions of a measurement's points along it, and their heights."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Ties:
    """Return the tie points in a photo."""

    image: str


@dataclass(frozen=True)
class Export:
    """Save, run the project as `uavgram run` does, and write all its outputs."""


@dataclass(frozen=True)
class Reload:
    """Read the project again from its present files; undo and redo start afresh."""


@dataclass(frozen=True, kw_only=True)
class LeaveOut:
    """Leave photos out of the project by `leave_out`, or take them back, and read it again."""

    names: tuple[str, ...]
    is_taken_back: bool = False


@dataclass(frozen=True)
class UseRecorded:
    """Take the camera's direction as recorded, not as stated, and read the project again."""


@dataclass(frozen=True)
class TakeAside:
    """Apply the changes that an earlier session could not save."""


@dataclass(frozen=True)
class DiscardAside:
    """Stop offering the changes that an earlier session could not save."""


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
class StopWork:
    """Stop the adjustment, the calibration, or the writing of results."""

    work: Work


@dataclass(frozen=True)
class UseCamera:
    """Enter the newest camera file in the project file, and read the project again."""


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
    | LeaveOut
    | UseRecorded
    | TakeAside
    | DiscardAside
    | Folders
    | Calibrate
    | StopWork
    | UseCamera
)
Question = Snap | SameGround | SideView | Ties


class RefusedError(UavgramError):
    """Message whose content or request is impossible; the page shows the reason.

    Attributes
    ----------
    seq
        Sequence number of the message, if it could be read.
    field
        Name of the field of a form that has the fault; empty without any.
    """

    seq: int | None = None
    field: str = ""
