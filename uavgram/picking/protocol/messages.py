"""Messages of the server to the page, as JSON, and the requests of the start page.

The page's own messages are the commands of `document.commands`. The check of the page's JavaScript
makes its types from both (tests/support/page_types.py).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, Never, NotRequired, TypedDict

from uavgram.imaging.photos.preview import Tone
from uavgram.model.camera import LensModel
from uavgram.model.message import Level
from uavgram.model.naming import Units
from uavgram.model.observations import MeasurementKind, Source
from uavgram.model.options import Auto
from uavgram.model.result.reliability import MeasurementStatus, VerdictLevel
from uavgram.picking.document.commands import SingleChange, Work
from uavgram.picking.document.state import Line
from uavgram.pipeline.setup import FoundCamera, FoundPhotos

Words = Callable[[Units], str]
"""Text of a number in some units, made when it is sent (`encode_quantities.word_for_page`)."""

Text = str | Words
Pair = tuple[int, str]
"""Photo and label."""

Json = dict[str, Any]
LineFields = Annotated[Json, Line]
ChangeFields = Annotated[Json, SingleChange]
ToneFields = Annotated[Json, Tone]
UnitFields = Annotated[Json, Units]
"""Objects with the fields of a data class, a command in the form of the page's messages."""

Numbers = tuple[float | None, float | None]
"""Value and sigma [m]."""


class Sent(TypedDict):
    """Message of the server: `seq` of the page's message that it answers."""

    seq: NotRequired[int | None]


class Spread(TypedDict):
    """Ellipse of one sigma: half-axes, and the direction of the major one from u towards v."""

    major_px: float | None
    minor_px: float | None
    turn_deg: float | None


class Height(TypedDict):
    """Height over the ground: stated, or to be estimated from photos; else it is on the ground."""

    height_m: float | None
    height_sigma_m: NotRequired[float | None]
    is_free: NotRequired[bool]


class PhotoLabel(TypedDict):
    """Label in a photo."""

    image: int
    label: str


class Pixel(PhotoLabel):
    """Pixel of a label in a photo, and its sigma."""

    u_px: float
    v_px: float
    sigma_px: float | None


class Pick(Pixel, Height):
    """Pick; the fields from `source` on are left out for a person's pick."""

    area: str
    source: NotRequired[Source]
    score: NotRequired[float | None]
    from_image: NotRequired[int | None]
    from_u_px: NotRequired[float | None]
    from_v_px: NotRequired[float | None]


class Measurement(TypedDict):
    """Requested measurement."""

    name: str
    kind: MeasurementKind
    points: list[str]
    parameters: NotRequired[dict[str, float]]


class PickedState(TypedDict):
    """Everything that was picked."""

    picks: list[Pick]
    repeated: list[Pair]
    lines: list[LineFields]
    measurements: list[Measurement]


class PutPicks(TypedDict):
    """Picks that were placed or changed, and those that were removed."""

    put: list[Pick]
    gone: list[Pair]


class Difference(TypedDict, total=False):
    """Change of the picked state: the lists that changed."""

    picks: PutPicks
    repeated: list[Pair]
    lines: list[LineFields]
    measurements: list[Measurement]


class Note(TypedDict):
    """Message of the program."""

    level: Level
    code: str
    text: str
    labels: list[str]


class SeedPose(TypedDict):
    """Pose from telemetry: centre and sigmas."""

    east_m: float | None
    north_m: float | None
    up: Text
    sigma: Text
    turn_sigma_deg: float | None


class EventFit(TypedDict):
    """Camera event that a photo was paired with."""

    status: str
    residual_s: float | None
    why: str


class Photo(TypedDict):
    """Photo of the project; `file_time_s` by the camera's own clock."""

    name: str
    digest: str
    width_px: int
    height_px: int
    levels: int
    matched: bool
    reason: str
    file_time_s: float | None
    time_utc_s: float | None
    seed: SeedPose | None
    event: EventFit | None


class Tones(TypedDict):
    """Brightness curves of a photo: the default, and with the automatic stretch."""

    first: ToneFields
    stretched: ToneFields


class Camera(TypedDict):
    """Camera of the project, in words."""

    name: str
    model: LensModel
    width_px: int
    height_px: int
    parameters: list[list[str]]
    facts: list[str]
    source: list[str]
    file: str
    messages: list[Note]


class ClockOffset(TypedDict):
    """Camera clock minus UTC."""

    text: Text


class Clock(ClockOffset):
    """Camera clock before the adjustment, and the events of the log."""

    sigma_s: float | None
    log: str
    events: int
    unused: list[str]


class Flight(TypedDict):
    """Track: UTC time [s], east and north [m]."""

    track: list[tuple[float, float, float]]


class Predicted(PhotoLabel):
    """Expected place of a label in a photo in which it is not picked."""

    pixel_px: tuple[float, float]
    spread: Spread


class Proposal(Pixel):
    """Proposed pick; `from_image`: of the source pick of a match; `is_sure`: without inspection."""

    score: float | None
    source: Source
    from_image: int | None
    is_sure: bool


class Asked(PhotoLabel):
    """Label to be picked by hand in a photo, with the reason."""

    why: str


class Proposals(Sent):
    """All results of the search for these labels; `searched`: number of the last searched state."""

    labels: list[str]
    found: list[Proposal]
    asked: list[Asked]
    searched: int


class OutputFile(TypedDict):
    """File of the output folder."""

    name: str
    words: str


class Outputs(TypedDict):
    """Output folder; `version` of the picked state that its results were made from."""

    folder: str
    files: list[OutputFile]
    recording: bool
    stamp: str
    version: int | None


class ResultRow(TypedDict):
    """Measurement of a run, in words."""

    name: str
    kind: str
    points: list[str]
    value: str
    others: str
    interval: str
    status: MeasurementStatus
    words: str


class Results(TypedDict):
    """Results of a run, in the words of its report."""

    level: VerdictLevel | None
    headline: str
    first: str
    others: list[str]
    scale: str
    counts: str
    case: list[tuple[str, str]]
    made: str
    measurements: list[ResultRow]


class Folder(TypedDict):
    """Folder of photos for a calibration."""

    id: int
    name: str
    photos: int
    width_px: int
    height_px: int


class CalibrationRunning(Sent):
    """Progress of a calibration."""

    t: Literal["calibration"]
    state: Literal["running"]
    what: str
    done: int
    total: int


class CalibrationFailed(Sent):
    """Reason for no calibration."""

    t: Literal["calibration"]
    state: Literal["failed"]
    why: str


class CalibrationResult(Sent):
    """Findings of a calibration, in words."""

    verdict: str
    reasons: list[str]
    counts: str
    facts: list[tuple[str, str]]
    file: str
    width_px: int
    height_px: int


class CalibrationDone(CalibrationResult):
    """End of a calibration."""

    t: Literal["calibration"]
    state: Literal["done"]


Calibration = CalibrationRunning | CalibrationFailed | CalibrationDone


class Trust(TypedDict):
    """Status of a row: a word unless it is ok, and the reason."""

    status: MeasurementStatus
    words: str
    why: str


class Fit(PhotoLabel):
    """Fit of a pick."""

    residual_px: list[float | None]
    w: float | None
    status: str
    spread: Spread | None


class Way(TypedDict):
    """Place or action of the page, other than a change of picks: a length, a photo, the set-up."""

    to: Literal["length", "leave-out", "set-up", "recorded"]
    names: list[str]


class Mend(TypedDict):
    """Button of a remedy: changes sent as one step, or a way to go."""

    words: str
    changes: list[ChangeFields]
    way: NotRequired[Way]


class Remark(Note):
    """Reason or warning: one plain sentence, and `text` in detail; remedies, likeliest first."""

    plain: str
    frames: list[int]
    lengths: list[str]
    measurements: list[str]
    mends: list[Mend]
    show: list[PhotoLabel]


class Verdict(TypedDict):
    """Verdict: likeliest reason (without text if all is well), all reasons, further remarks.

    `reasons` is their number; `unseen` names lengths in which a wrong reading would not show;
    `height` is a sentence on the height of the cameras above the ground, empty if unknown.
    """

    level: VerdictLevel | None
    words: str
    first: Remark
    why: list[Remark]
    reasons: int
    unseen: str
    height: Text


class ValueWords(TypedDict):
    """Value and sigma, empty if not measured; grade of a slope; latitude or longitude."""

    text: Text
    grade: Text
    earth: str


class Measured(Trust, ValueWords):
    """Measurement; `others`: of other solutions; `shows`: observation that nothing checks."""

    value: float | None
    sigma: float | None
    unit: str
    others: Text
    shows: str


class LengthWords(TypedDict):
    """Adjusted length in a table, and beside the line."""

    adjusted: Text
    text: Text


class LengthTrust(Trust):
    """Status of a known length; `shows`: its minimal detectable error and the effect."""

    shows: str


class LengthFit(LengthTrust, LengthWords):
    """Known length after the adjustment."""

    adjusted_m: float | None
    sigma: Text
    w: float | None


class HeightWords(TypedDict):
    """Height of a point off the ground in a table, alone, beside the label; empty on the ground."""

    height: Text
    sentence: Text
    tag: Text


class AdjustedPoint(Trust, HeightWords):
    """Sigmas of a point in the survey (e n u), and to its neighbours in words."""

    sigma_m: list[float | None]
    sigma: Text
    neighbours: list[str]


class Check(TypedDict):
    """Point whose known coordinates only judge the result: errors in a table, and in words."""

    label: str
    errors: list[Text]
    quantities: list[Text]


class ControlLineFit(TypedDict):
    """Largest offset of the picks from a line of known position, to the left."""

    offset: Text
    w: float | None
    status: str
    fits: bool


class PhotoFit(TypedDict):
    """Adjusted photo: sigma of its centre, and the shift from the pose of the telemetry."""

    status: str
    sigma: Text
    moved: Text
    standing: Trust


class Advice(TypedDict):
    """Length to tape next."""

    start: str
    end: str
    text: Text


class Adjusted(TypedDict):
    """Full adjustment; `frames` by the photo's number.

    `stopped`: why it belongs to earlier picks, as a person stopped the one of the present picks.
    """

    mode: Literal["adjusted"]
    seconds: float
    verdict: Verdict
    points: dict[str, AdjustedPoint]
    picks: list[Fit]
    predicted: list[Predicted]
    lines: dict[str, LengthFit]
    measurements: dict[str, Measured]
    checks: list[Check]
    control_lines: dict[str, ControlLineFit]
    frames: dict[str, PhotoFit]
    clock: ClockOffset | None
    advice: Advice | None
    messages: list[Note]
    stopped: str


class Unadjusted(TypedDict):
    """Reason for no adjustment."""

    mode: Literal["none"]
    why: str
    messages: list[Note]


class Linearised(TypedDict):
    """First-order update: new values only; `residuals_px`: photo, label, u and v."""

    mode: Literal["linearised"]
    residuals_px: list[tuple[int, str, float | None, float | None]]
    lines: dict[str, LengthWords]
    measurements: dict[str, ValueWords]
    heights: dict[str, HeightWords]


Adjustment = Adjusted | Unadjusted | Linearised


class PlannedLine(TypedDict):
    """Line to be marked and taped: length and directions to its ends in words."""

    name: str
    start: str
    end: str
    length: str
    start_place: str
    end_place: str


class PlannedPlate(TypedDict):
    """Coded plate: its side and directions in words, labels of its corners."""

    name: str
    side: str
    place: str
    corners: list[str]


class Planned(TypedDict):
    """Plan of the flight; `why` the program does not look for the plates, if it does not."""

    lines: list[PlannedLine]
    plates: list[PlannedPlate]
    why: str


class ControlLine(TypedDict):
    """Line of known position, and the labels picked on it."""

    name: str
    points: list[str]


class Sample(TypedDict):
    """Tape readings of the sample survey."""

    file: str
    text: str


class Standing(Sent):
    """Number of the present state, and of steps that can be undone and redone."""

    version: int
    undo: int
    redo: int


LiveHead = TypedDict(
    "LiveHead",
    {
        "seq": NotRequired[int | None],
        "t": Literal["live"],
        "for": int,
        "expected": NotRequired[list[Predicted]],
    },
)
"""Number of the state that was adjusted, and the expected places of known points."""


class LiveAdjusted(LiveHead, Adjusted):
    """Full adjustment of a state."""


class LiveUnadjusted(LiveHead, Unadjusted):
    """Reason for no adjustment of a state."""


class LiveLinearised(LiveHead, Linearised):
    """First-order update for a state."""


FullLive = LiveAdjusted | LiveUnadjusted
Live = FullLive | LiveLinearised


class PickingState(Standing):
    """Everything about photos and picks that a page needs at its start."""

    t: Literal["initial-state"]
    project: str
    units: UnitFields
    tile_px: int
    pick_sigma_px: float
    reading_sigma_m: float
    photos: list[Photo]
    damaged: list[str]
    left_out: list[str]
    camera: Camera
    clock: Clock | None
    flight: Flight | None
    control: list[str]
    check: list[str]
    named: list[str]
    sample: Sample | None
    control_lines: list[ControlLine]
    planned: Planned
    expected: list[Predicted]
    recovered: bool
    messages: list[Note]
    state: PickedState
    live: FullLive | None
    proposals: Proposals


class InitialState(PickingState):
    """Everything that a page needs at its start."""

    outputs: Outputs
    outside: list[str]
    added: str
    aside: int | None
    calibration: Calibration | None
    stages: dict[Work, str]


class Changed(Standing):
    """Change of the picked state."""

    t: Literal["changed"]
    diff: Difference


class Refused(Sent):
    """Reason why a message of the page was refused."""

    t: Literal["refused"]
    why: str


class Closed(Sent):
    """End of the server, or of its project."""

    t: Literal["closed"]


class Saved(Sent):
    """State that was written to the tables, or the reason for none."""

    t: Literal["saved"]
    version: int
    fault: str


class Outside(Sent):
    """Files that another program changed, and sentences on those that are new beside the photos."""

    t: Literal["outside"]
    files: list[str]
    added: str


class NewOutputs(Sent):
    """New outputs."""

    t: Literal["outputs"]
    outputs: Outputs


class WorkStage(Sent):
    """Stage of long work; empty: it has ended."""

    t: Literal["work"]
    kind: Work
    stage: str


class NewProposals(Proposals):
    """New results of the search."""

    t: Literal["proposals"]


class Snapped(Sent):
    """Exact place of a target; without `is_sure` it only looks like the target."""

    t: Literal["snapped"]
    why: NotRequired[Never]
    u_px: float
    v_px: float
    sigma_px: float
    what: Literal["corner", "target"]
    is_sure: bool


class NotSnapped(Sent):
    """Reason for no exact place, and the candidates."""

    t: Literal["snapped"]
    why: str
    places_px: list[tuple[float, float]]


class SidePoint(TypedDict):
    """Point of a side view: texts, and value and sigma; heights over the first point."""

    label: str
    station: Text
    height: Text
    ground: Text
    station_m: Numbers
    offset_m: Numbers
    height_m: Numbers
    ground_m: Numbers


class Side(Sent):
    """Side view of a measurement."""

    t: Literal["side"]
    points: list[SidePoint]


class TiePlaces(Sent):
    """Tie points in a photo."""

    t: Literal["ties"]
    places_px: list[tuple[float, float]]


class Ground(Sent):
    """Same ground in other photos, by number: u and v [px], and scale."""

    t: Literal["ground"]
    places: dict[str, tuple[float, float, float]]


class Exported(Sent):
    """Outputs that were written, or the reason for none."""

    t: Literal["exported"]
    why: NotRequired[str]
    outputs: NotRequired[Outputs]


class PhotoFolders(Sent):
    """Folders of photos for a calibration."""

    t: Literal["folders"]
    why: NotRequired[str]
    folders: list[Folder]


class Done(Sent):
    """End of an action; `refused`: number of changes that do not fit any more."""

    t: Literal["done"]
    why: NotRequired[str]
    refused: NotRequired[int]


Answers = TypedDict(
    "Answers",
    {
        "snap": Snapped | NotSnapped,
        "side": Side,
        "ties": TiePlaces,
        "ground": Ground,
        "export": Exported,
        "folders": PhotoFolders,
        "refuse": Done,
        "reload": Done,
        "leave-out": Done,
        "use-recorded": Done,
        "calibrate": Done,
        "stop-work": Done,
        "use-camera": Done,
        "take-aside": Done,
        "discard-aside": Done,
    },
)
"""Answers to questions and actions by their kind."""

Answer = Snapped | NotSnapped | Side | TiePlaces | Ground
ActionAnswer = Exported | PhotoFolders | Done
ServerMessage = (
    InitialState
    | Changed
    | Live
    | Calibration
    | Refused
    | Closed
    | Saved
    | Outside
    | NewOutputs
    | WorkStage
    | NewProposals
    | Answer
    | ActionAnswer
)


Broadcast = Callable[[ServerMessage], None]


class Listed(TypedDict):
    """Folder in a list of the start page; `inside`: the folders around it, from the home."""

    number: int
    name: str
    inside: str
    photos: int
    is_flight: bool
    has_project: bool


class Beginning(TypedDict):
    """Start of the start page: a folder, those opened before, and the newest flights."""

    folder: int | None
    is_chosen: bool
    opens: bool
    recent: list[Listed]
    newest: list[Listed]


class Step(TypedDict):
    """Folder on the way to another one."""

    number: int
    name: str


class ListedFolders(TypedDict):
    """Folders in a folder, and the way to it."""

    number: int | None
    way: list[Step]
    photos: int
    are_inner: bool
    is_flight: bool
    has_project: bool
    folders: list[Listed]


class Setup(TypedDict):
    """Set-up of a project by a person."""

    pitch_deg: float | Auto
    yaw_deg: float | Auto
    roll_deg: float | Auto
    reading_sigma_m: float
    units: Literal["metric", "imperial", ""]
    case: dict[str, str]


class Found(TypedDict):
    """Content of a folder that a project can use."""

    number: int
    name: str
    path: str
    has_project: bool
    photos: list[FoundPhotos]
    cameras: list[FoundCamera]
    logs: list[str]
    poses: list[str]
    gcp_lists: list[str]
    tables: list[str]
    unusable: list[str]
    passed_over: str
    setup: Setup
    camera: str | None
    log: str | None
    has_gimbal: bool | None
    fault: str


class Wanted(TypedDict):
    """Request of the start page: a folder, its files to use, and the set-up."""

    folder: int
    images: list[str]
    log: str | None
    poses: str | None
    camera: str | None
    gcp_list: str | None
    gcp_sigma_m: float
    setup: Setup
