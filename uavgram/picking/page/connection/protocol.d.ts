// Messages between page and server, as JSON: written by `python tests/support/page_types.py`.

export type SingleChange = Place | Repeat | Unpick | Forget | Rename | Merge | Split | Swap | SetSigma | SetHeight | SetLine | RemoveLine | SetMeasurement | RemoveMeasurement;
export type Calibration = CalibrationRunning | CalibrationFailed | CalibrationDone;
export type Adjustment = Adjusted | Unadjusted | Linearised;
export type FullLive = LiveAdjusted | LiveUnadjusted;
export type Live = LiveAdjusted | LiveUnadjusted | LiveLinearised;
export type Answer = Snapped | NotSnapped | Side | TiePlaces | Ground;
export type ActionAnswer = Exported | PhotoFolders | Done;
export type ServerMessage = InitialState | Changed | LiveAdjusted | LiveUnadjusted | LiveLinearised | CalibrationRunning | CalibrationFailed | CalibrationDone | Refused | Closed | Saved | Outside | NewOutputs | WorkStage | NewProposals | Snapped | NotSnapped | Side | TiePlaces | Ground | Exported | PhotoFolders | Done;
export type Change = Place | Repeat | Unpick | Forget | Rename | Merge | Split | Swap | SetSigma | SetHeight | SetLine | RemoveLine | SetMeasurement | RemoveMeasurement | All | Undo | Redo | Accept;
export type Question = Snap | SameGround | SideView | Ties | Refuse | Export | Reload | LeaveOut | TakeAside | DiscardAside | Folders | Calibrate | StopWork | UseCamera;
export type Kind = "distance" | "polyline" | "area" | "angle" | "line_distance" | "coordinate" | "skid_speed" | "speed" | "height" | "horizontal_distance" | "vertical_distance" | "slope" | "plane_distance" | "volume" | "profile";
export type Source = "hand" | "match" | "target";
export type Target = "any" | "target";
export type Work = "adjustment" | "calibration" | "results" | "search";
// Message of the server: `seq` of the page's message that it answers.
export interface Sent { seq?: number | null }
// Ellipse of one sigma: half-axes, and the direction of the major one from u towards v.
export interface Spread { major_px: number | null; minor_px: number | null; turn_deg: number | null }
// Height over the ground: stated, or to be estimated from photos; else it is on the ground.
export interface Height { height_m: number | null; height_sigma_m?: number | null; is_free?: boolean }
// Pick; the fields from `source` on are left out for a person's pick.
export interface Pick { height_m: number | null; height_sigma_m?: number | null; is_free?: boolean; image: number; label: string; u_px: number; v_px: number; sigma_px: number | null; area: string; source?: Source; score?: number | null; from_image?: number | null; from_u_px?: number | null; from_v_px?: number | null }
// Requested measurement.
export interface Measurement { name: string; kind: Kind; points: string[]; parameters?: Record<string, number> }
// Everything that was picked.
export interface PickedState { picks: Pick[]; repeated: [number, string][]; lines: Line[]; measurements: Measurement[] }
// Picks that were placed or changed, and those that were removed.
export interface PutPicks { put: Pick[]; gone: [number, string][] }
// Change of the picked state: the lists that changed.
export interface Difference { picks?: PutPicks; repeated?: [number, string][]; lines?: Line[]; measurements?: Measurement[] }
// Message of the program.
export interface Note { level: "info" | "warning" | "error"; code: string; text: string; labels: string[] }
// Pose from telemetry: centre and sigmas.
export interface SeedPose { east_m: number | null; north_m: number | null; up: string; sigma: string; turn_sigma_deg: number | null }
// Camera event that a photo was paired with.
export interface EventFit { status: string; residual_s: number | null; why: string }
// Photo of the project; `file_time_s` by the camera's own clock.
export interface Photo { name: string; digest: string; width_px: number; height_px: number; levels: number; matched: boolean; reason: string; file_time_s: number | null; time_utc_s: number | null; seed: SeedPose | null; event: EventFit | null }
// Brightness curves of a photo: the default, and with the automatic stretch.
export interface Tones { first: Tone; stretched: Tone }
// Camera of the project, in words.
export interface Camera { name: string; model: "brown" | "fisheye"; width_px: number; height_px: number; parameters: string[][]; facts: string[]; source: string[]; file: string; messages: Note[] }
// Camera clock minus UTC.
export interface ClockOffset { text: string }
// Camera clock before the adjustment, and the events of the log.
export interface Clock { text: string; sigma_s: number | null; log: string; events: number; unused: string[] }
// Track: UTC time [s], east and north [m].
export interface Flight { track: [number, number, number][] }
// Expected place of a label in a photo in which it is not picked.
export interface Predicted { image: number; label: string; pixel_px: [number, number]; spread: Spread }
// Proposed pick; `from_image`: of the source pick of a match; `is_sure`: without inspection.
export interface Proposal { image: number; label: string; u_px: number; v_px: number; sigma_px: number | null; score: number | null; source: Source; from_image: number | null; is_sure: boolean }
// Label to be picked by hand in a photo, with the reason.
export interface Asked { image: number; label: string; why: string }
// All results of the search for these labels; `searched`: number of the last searched state.
export interface Proposals { seq?: number | null; labels: string[]; found: Proposal[]; asked: Asked[]; searched: number }
// File of the output folder.
export interface OutputFile { name: string; words: string }
// Output folder; `version` of the picked state that its results were made from.
export interface Outputs { folder: string; files: OutputFile[]; recording: boolean; stamp: string; version: number | null }
// Measurement of a run, in words.
export interface ResultRow { name: string; kind: string; points: string[]; value: string; others: string; interval: string; status: "ok" | "not-checked" | "doubtful" | "contradicted"; words: string }
// Results of a run, in the words of its report.
export interface Results { level: "green" | "amber" | "red" | null; headline: string; first: string; others: string[]; scale: string; counts: string; case: [string, string][]; made: string; measurements: ResultRow[] }
// Folder of photos for a calibration.
export interface Folder { id: number; name: string; photos: number; width_px: number; height_px: number }
// Progress of a calibration.
export interface CalibrationRunning { seq?: number | null; t: "calibration"; state: "running"; what: string; done: number; total: number }
// Reason for no calibration.
export interface CalibrationFailed { seq?: number | null; t: "calibration"; state: "failed"; why: string }
// Findings of a calibration, in words.
export interface CalibrationResult { seq?: number | null; verdict: string; reasons: string[]; counts: string; facts: [string, string][]; file: string; width_px: number; height_px: number }
// End of a calibration.
export interface CalibrationDone { seq?: number | null; verdict: string; reasons: string[]; counts: string; facts: [string, string][]; file: string; width_px: number; height_px: number; t: "calibration"; state: "done" }
// Status of a row: a word unless it is ok, and the reason.
export interface Trust { status: "ok" | "not-checked" | "doubtful" | "contradicted"; words: string; why: string }
// Fit of a pick.
export interface Fit { image: number; label: string; residual_px: (number | null)[]; w: number | null; status: string; spread: Spread | null }
// Place to look at.
export interface PhotoLabel { image: number; label: string }
// Place or action of the page, other than a change of picks: a length, a photo, the set-up.
export interface Way { to: "length" | "leave-out" | "set-up"; names: string[] }
// Button of a remedy: changes sent as one step, or a way to go.
export interface Mend { words: string; changes: SingleChange[]; way?: Way }
// Reason or warning: one plain sentence, and `text` in detail; remedies, likeliest first.
export interface Remark { level: "info" | "warning" | "error"; code: string; text: string; labels: string[]; plain: string; frames: number[]; lengths: string[]; measurements: string[]; mends: Mend[]; show: PhotoLabel[] }
// Verdict: likeliest reason (without text if all is well), all reasons, further remarks.
export interface Verdict { level: "green" | "amber" | "red" | null; words: string; first: Remark; why: Remark[]; reasons: number; unseen: string }
// Value and sigma, empty if not measured; grade of a slope; latitude or longitude.
export interface ValueWords { text: string; grade: string; earth: string }
// Measurement; `others`: of other solutions; `shows`: observation that nothing checks.
export interface Measured { status: "ok" | "not-checked" | "doubtful" | "contradicted"; words: string; why: string; text: string; grade: string; earth: string; value: number | null; sigma: number | null; unit: string; others: string; shows: string }
// Adjusted length in a table, and beside the line.
export interface LengthWords { adjusted: string; text: string }
// Status of a known length; `shows`: its minimal detectable error and the effect.
export interface LengthTrust { status: "ok" | "not-checked" | "doubtful" | "contradicted"; words: string; why: string; shows: string }
// Known length after the adjustment.
export interface LengthFit { status: "ok" | "not-checked" | "doubtful" | "contradicted"; words: string; why: string; shows: string; adjusted: string; text: string; adjusted_m: number | null; sigma: string; w: number | null }
// Height of a point off the ground in a table, alone, beside the label; empty on the ground.
export interface HeightWords { height: string; sentence: string; tag: string }
// Sigmas of a point in the survey (e n u), and to its neighbours in words.
export interface AdjustedPoint { status: "ok" | "not-checked" | "doubtful" | "contradicted"; words: string; why: string; height: string; sentence: string; tag: string; sigma_m: (number | null)[]; sigma: string; neighbours: string[] }
// Point whose known coordinates only judge the result: errors in a table, and in words.
export interface Check { label: string; errors: string[]; quantities: string[] }
// Largest offset of the picks from a line of known position, to the left.
export interface ControlLineFit { offset: string; w: number | null; status: string; fits: boolean }
// Adjusted photo: sigma of its centre, and the shift from the pose of the telemetry.
export interface PhotoFit { status: string; sigma: string; moved: string; standing: Trust }
// Length to tape next.
export interface Advice { start: string; end: string; text: string }
// Full adjustment; `frames` by the photo's number.
export interface Adjusted { mode: "adjusted"; seconds: number; verdict: Verdict; points: Record<string, AdjustedPoint | undefined>; picks: Fit[]; predicted: Predicted[]; lines: Record<string, LengthFit | undefined>; measurements: Record<string, Measured | undefined>; checks: Check[]; control_lines: Record<string, ControlLineFit | undefined>; frames: Record<string, PhotoFit | undefined>; clock: ClockOffset | null; advice: Advice | null; messages: Note[]; stopped: string }
// Reason for no adjustment.
export interface Unadjusted { mode: "none"; why: string; messages: Note[] }
// First-order update: new values only; `residuals_px`: photo, label, u and v.
export interface Linearised { mode: "linearised"; residuals_px: ([number, string, number | null, number | null])[]; lines: Record<string, LengthWords | undefined>; measurements: Record<string, ValueWords | undefined>; heights: Record<string, HeightWords | undefined> }
// Line to be marked and taped: length and directions to its ends in words.
export interface PlannedLine { name: string; start: string; end: string; length: string; start_place: string; end_place: string }
// Coded plate: its side and directions in words, labels of its corners.
export interface PlannedPlate { name: string; side: string; place: string; corners: string[] }
// Plan of the flight; `why` the program does not look for the plates, if it does not.
export interface Planned { lines: PlannedLine[]; plates: PlannedPlate[]; why: string }
// Line of known position, and the labels picked on it.
export interface ControlLine { name: string; points: string[] }
// Tape readings of the sample survey.
export interface Sample { file: string; text: string }
// Number of the present state, and of steps that can be undone and redone.
export interface Standing { seq?: number | null; version: number; undo: number; redo: number }
export interface LiveHead { seq?: number | null; t: "live"; for: number; expected?: Predicted[] }
// Full adjustment of a state.
export interface LiveAdjusted { seq?: number | null; t: "live"; for: number; expected?: Predicted[]; mode: "adjusted"; seconds: number; verdict: Verdict; points: Record<string, AdjustedPoint | undefined>; picks: Fit[]; predicted: Predicted[]; lines: Record<string, LengthFit | undefined>; measurements: Record<string, Measured | undefined>; checks: Check[]; control_lines: Record<string, ControlLineFit | undefined>; frames: Record<string, PhotoFit | undefined>; clock: ClockOffset | null; advice: Advice | null; messages: Note[]; stopped: string }
// Reason for no adjustment of a state.
export interface LiveUnadjusted { seq?: number | null; t: "live"; for: number; expected?: Predicted[]; mode: "none"; why: string; messages: Note[] }
// First-order update for a state.
export interface LiveLinearised { seq?: number | null; t: "live"; for: number; expected?: Predicted[]; mode: "linearised"; residuals_px: ([number, string, number | null, number | null])[]; lines: Record<string, LengthWords | undefined>; measurements: Record<string, ValueWords | undefined>; heights: Record<string, HeightWords | undefined> }
// Everything about photos and picks that a page needs at its start.
export interface PickingState { seq?: number | null; version: number; undo: number; redo: number; t: "initial-state"; project: string; units: Units; tile_px: number; pick_sigma_px: number; reading_sigma_m: number; photos: Photo[]; damaged: string[]; left_out: string[]; camera: Camera; clock: Clock | null; flight: Flight | null; control: string[]; check: string[]; named: string[]; sample: Sample | null; control_lines: ControlLine[]; planned: Planned; expected: Predicted[]; recovered: boolean; messages: Note[]; state: PickedState; live: LiveAdjusted | LiveUnadjusted | null; proposals: Proposals }
// Everything that a page needs at its start.
export interface InitialState { seq?: number | null; version: number; undo: number; redo: number; t: "initial-state"; project: string; units: Units; tile_px: number; pick_sigma_px: number; reading_sigma_m: number; photos: Photo[]; damaged: string[]; left_out: string[]; camera: Camera; clock: Clock | null; flight: Flight | null; control: string[]; check: string[]; named: string[]; sample: Sample | null; control_lines: ControlLine[]; planned: Planned; expected: Predicted[]; recovered: boolean; messages: Note[]; state: PickedState; live: LiveAdjusted | LiveUnadjusted | null; proposals: Proposals; outputs: Outputs; outside: string[]; aside: number | null; calibration: CalibrationRunning | CalibrationFailed | CalibrationDone | null; stages: Record<string, string> }
// Change of the picked state.
export interface Changed { seq?: number | null; version: number; undo: number; redo: number; t: "changed"; diff: Difference }
// Reason why a message of the page was refused.
export interface Refused { seq?: number | null; t: "refused"; why: string }
// End of the server, or of its project.
export interface Closed { seq?: number | null; t: "closed" }
// State that was written to the tables, or the reason for none.
export interface Saved { seq?: number | null; t: "saved"; version: number; fault: string }
// Files that another program changed.
export interface Outside { seq?: number | null; t: "outside"; files: string[] }
// New outputs.
export interface NewOutputs { seq?: number | null; t: "outputs"; outputs: Outputs }
// Stage of long work; empty: it has ended.
export interface WorkStage { seq?: number | null; t: "work"; kind: Work; stage: string }
// New results of the search.
export interface NewProposals { seq?: number | null; labels: string[]; found: Proposal[]; asked: Asked[]; searched: number; t: "proposals" }
// Exact place of a target; without `is_sure` it only looks like the target.
export interface Snapped { seq?: number | null; t: "snapped"; why?: undefined; u_px: number; v_px: number; sigma_px: number; what: "corner" | "target"; is_sure: boolean }
// Reason for no exact place, and the candidates.
export interface NotSnapped { seq?: number | null; t: "snapped"; why: string; places_px: [number, number][] }
// Point of a side view: texts, and value and sigma; heights over the first point.
export interface SidePoint { label: string; station: string; height: string; ground: string; station_m: [number | null, number | null]; offset_m: [number | null, number | null]; height_m: [number | null, number | null]; ground_m: [number | null, number | null] }
// Side view of a measurement.
export interface Side { seq?: number | null; t: "side"; points: SidePoint[] }
// Tie points in a photo.
export interface TiePlaces { seq?: number | null; t: "ties"; places_px: [number, number][] }
// Same ground in other photos, by number: u and v [px], and scale.
export interface Ground { seq?: number | null; t: "ground"; places: Record<string, [number, number, number] | undefined> }
// Outputs that were written, or the reason for none.
export interface Exported { seq?: number | null; t: "exported"; why?: string; outputs?: Outputs }
// Folders of photos for a calibration.
export interface PhotoFolders { seq?: number | null; t: "folders"; why?: string; folders: Folder[] }
// End of an action; `refused`: number of changes that do not fit any more.
export interface Done { seq?: number | null; t: "done"; why?: string; refused?: number }
export interface Answers { snap: Snapped | NotSnapped; side: Side; ties: TiePlaces; ground: Ground; export: Exported; folders: PhotoFolders; refuse: Done; reload: Done; "leave-out": Done; calibrate: Done; "stop-work": Done; "use-camera": Done; "take-aside": Done; "discard-aside": Done }
// Folder in a list of the start page; `inside`: the folders around it, from the home.
export interface Listed { number: number; name: string; inside: string; photos: number; is_flight: boolean; has_project: boolean }
// Start of the start page: a folder, those opened before, and the newest flights.
export interface Beginning { folder: number | null; is_chosen: boolean; opens: boolean; recent: Listed[]; newest: Listed[] }
// Folder on the way to another one.
export interface Step { number: number; name: string }
// Folders in a folder, and the way to it.
export interface ListedFolders { number: number | null; way: Step[]; photos: number; are_inner: boolean; is_flight: boolean; has_project: boolean; folders: Listed[] }
// Set-up of a project by a person.
export interface Setup { pitch_deg: number | "auto"; yaw_deg: number | "auto"; roll_deg: number | "auto"; reading_sigma_m: number; units: "metric" | "imperial" | ""; case: Record<string, string> }
// Content of a folder that a project can use.
export interface Found { number: number; name: string; path: string; has_project: boolean; photos: FoundPhotos[]; cameras: FoundCamera[]; logs: string[]; poses: string[]; gcp_lists: string[]; tables: string[]; unusable: string[]; passed_over: string; setup: Setup; camera: string | null; log: string | null; has_gimbal: boolean | null; fault: string }
// Request of the start page: a folder, its files to use, and the set-up.
export interface Wanted { folder: number; images: string[]; log: string | null; poses: string | null; camera: string | null; gcp_list: string | null; gcp_sigma_m: number; setup: Setup }
// Units of all displayed values: page, terminal, report, drawing and recording.
export interface Units { length: "m" | "ft" | "ft-in"; speed: "km/h" | "mph" | "m/s" }
// Known length; `adjust` is False for a withheld length that only serves as a check.
export interface Line { name: string; start: string; end: string; length_m: number; sigma_m: number; adjust: boolean; tape: string; along: "slope" | "horizontal" }
// Monotone curve from the photo's values to the screen's.
export interface Tone { black: number; white: number; gamma: number }
// Photos of one folder and size.
export interface FoundPhotos { pattern: string; count: number; width_px: number; height_px: number; example: string; camera: string; looks_deg: number | null; has_position: boolean; kind: number }
// Camera file, for photos of one size.
export interface FoundCamera { name: string; width_px: number; height_px: number }
// Pick a label in a photo, or move its existing pick; a sigma of None keeps the present one.
export interface Place { t: "place"; step?: number; final?: boolean; image: number; label: string; u_px: number; v_px: number; sigma_px?: number | null; source?: Source; score?: number | null; from_image?: number | null; from_u_px?: number | null; from_v_px?: number | null }
// Click a picked label in a photo again: an independent repetition beside the first click.
export interface Repeat { t: "repeat"; step?: number; final?: boolean; image: number; label: string; u_px: number; v_px: number }
// Pick proposals of the program: photo and label of each.
export interface Accept { t: "accept"; step?: number; final?: boolean; pairs: [number, string][] }
// Refuse proposals of the program, or decline to pick a label by hand: photo and label of each.
export interface Refuse { t: "refuse"; step?: number; final?: boolean; pairs: [number, string][]; is_taken_back?: boolean }
// Remove the pick of a label in a photo.
export interface Unpick { t: "unpick"; step?: number; final?: boolean; image: number; label: string }
// Remove a label everywhere: picks, lengths, measurements.
export interface Forget { t: "forget"; step?: number; final?: boolean; label: string }
// Rename a label in picks, lengths and measurements.
export interface Rename { t: "rename"; step?: number; final?: boolean; label: string; new: string }
// Merge two labels into one point: all statements about `label` then apply to `into`.
export interface Merge { t: "merge"; step?: number; final?: boolean; label: string; into: string; keep?: string }
// Split off the picks of a label in some photos as another point with the label `new`.
export interface Split { t: "split"; step?: number; final?: boolean; label: string; new: string; images: number[] }
// Exchange the picks of two labels in one photo, or in all photos where `image` is empty.
export interface Swap { t: "swap"; step?: number; final?: boolean; image: number | null; label: string; other: string }
// Make several changes in one step, in this order: all of them, or none if one does not fit.
export interface All { t: "all"; step?: number; final?: boolean; changes: SingleChange[] }
// Set the standard deviation of one pick; None: the project's default.
export interface SetSigma { t: "sigma"; step?: number; final?: boolean; image: number; label: string; sigma_px: number | null }
// Set a label's height above the ground, or set it free; without either it is on the ground.
export interface SetHeight { t: "height"; step?: number; final?: boolean; label: string; height_m: number | null; height_sigma_m?: number | null; is_free?: boolean }
// Add a known length, or change the one called `was`; a tape of None keeps its own.
export interface SetLine { t: "line"; step?: number; final?: boolean; was: string; name: string; start: string; end: string; length_m: number; sigma_m: number; adjust: boolean; tape?: string | null; along?: "slope" | "horizontal" | null }
// Remove a known length.
export interface RemoveLine { t: "remove-line"; step?: number; final?: boolean; name: string }
// Add a measurement, or change the one called `was`.
export interface SetMeasurement { t: "measure"; step?: number; final?: boolean; was: string; name: string; kind: Kind; points: string[]; parameters?: Record<string, number> }
// Remove a measurement.
export interface RemoveMeasurement { t: "remove-measurement"; step?: number; final?: boolean; name: string }
// Undo the last step.
export interface Undo { t: "undo"; step?: number; final?: boolean }
// Redo the step that was undone last.
export interface Redo { t: "redo"; step?: number; final?: boolean }
// Save, run the project as `uavgram run` does, and write all its outputs.
export interface Export { t: "export"; step?: number; final?: boolean }
// Read the project again from its present files; undo and redo start afresh.
export interface Reload { t: "reload"; step?: number; final?: boolean }
// Leave photos out of the project by `leave_out`, or take them back, and read it again.
export interface LeaveOut { t: "leave-out"; step?: number; final?: boolean; names: string[]; is_taken_back?: boolean }
// Apply the changes that an earlier session could not save.
export interface TakeAside { t: "take-aside"; step?: number; final?: boolean }
// Stop offering the changes that an earlier session could not save.
export interface DiscardAside { t: "discard-aside"; step?: number; final?: boolean }
// List the folders near the project that hold photos.
export interface Folders { t: "folders"; step?: number; final?: boolean }
// Calibrate a camera from the photos of a listed folder; `board` as on the command line.
export interface Calibrate { t: "calibrate"; step?: number; final?: boolean; folder: number; board: string; model: "brown" | "fisheye" }
// Stop the adjustment, the calibration, or the writing of results.
export interface StopWork { t: "stop-work"; step?: number; final?: boolean; work: Work }
// Enter the newest camera file in the project file, and read the project again.
export interface UseCamera { t: "use-camera"; step?: number; final?: boolean }
// Find the exact centre of the corner or round target near a pixel.
export interface Snap { t: "snap"; step?: number; final?: boolean; image: number; u_px: number; v_px: number; target: Target; expected?: string }
// Find the pixels of other photos that show the same ground as this pixel.
export interface SameGround { t: "ground"; step?: number; final?: boolean; image: number; u_px: number; v_px: number }
// Return the positions of a measurement's points along it, and their heights.
export interface SideView { t: "side"; step?: number; final?: boolean; name: string }
// Return the tie points in a photo.
export interface Ties { t: "ties"; step?: number; final?: boolean; image: number }