// Messages between page and server, as JSON: types only, for the checks in .ci/page. The server builds
// its part in protocol/encode_*.py and session/, and checks messages of the page in protocol/parse.py.

type Maybe = number | null; // null where Python has NaN

// Ellipse of one sigma: half-axes, and the direction of the major one from u towards v.
export interface Spread { major_px: Maybe; minor_px: Maybe; turn_deg: Maybe }

// A height over the ground that was stated, or is to be estimated from photos; else the point is on the ground.
export interface Height { height_m: Maybe; height_sigma_m?: Maybe; is_free?: boolean }
// Origin of a pick: a person by default; for a match also the pick that it was found from.
export type Source = "hand" | "match" | "target";
interface Made { source?: Source; score?: Maybe; from_image?: Maybe; from_u_px?: Maybe; from_v_px?: Maybe }
export interface Pick extends Height, Made { image: number; label: string; u_px: number; v_px: number; sigma_px: Maybe; area: string }
interface Reading { name: string; start: string; end: string; length_m: number; sigma_m: number; adjust: boolean }
type Along = "slope" | "horizontal";
export interface Line extends Reading { tape: string; along: Along }
export type Kind = "distance" | "polyline" | "area" | "angle" | "line_distance" | "skid_speed" | "coordinate" | "speed"
  | "height" | "horizontal_distance" | "vertical_distance" | "slope" | "plane_distance" | "volume" | "profile";
export interface Measurement { name: string; kind: Kind; points: string[]; parameters?: Record<string, number> }
export interface Note { level: "error" | "warning" | "info"; code: string; text: string; labels?: string[] }

// The project itself.

export interface Photo {
  name: string; digest: string; width_px: number; height_px: number; levels: number; matched: boolean; reason: string; time_utc_s: Maybe;
  file_time_s: Maybe; // by the camera's own clock
  seed: { east_m: Maybe; north_m: Maybe; up: string; sigma: string; turn_sigma_deg: Maybe } | null;
  event: { status: string; residual_s: Maybe; why: string } | null;
}
// Brightness curve of a photo: values that become black and white, and the lift of the middle.
export interface Tone { black: number; white: number; gamma: number }
export interface Tones { first: Tone; stretched: Tone } // default; with the automatic stretch
export interface Camera {
  name: string; model: string; width_px: number; height_px: number; parameters: string[][]; facts: string[]; source: string[]; file: string; messages: Note[];
}
export interface ClockOffset { text: string }
export interface Clock extends ClockOffset { sigma_s: Maybe; log: string; events: number; unused: string[] }
export interface Flight { track: [number, number, number][] } // UTC time [s], east and north [m]
export interface Predicted { image: number; label: string; pixel_px: [number, number]; spread: Spread }
// Proposed picks, and labels to be picked by hand with the reason.
// `from_image`: of the source pick, for a match only.
export interface Proposal { image: number; label: string; u_px: number; v_px: number; sigma_px: number; score: number; source: Source; from_image: Maybe; is_sure: boolean } // is_sure: needs no inspection
export interface Asked { image: number; label: string; why: string }
export interface Proposals { labels: string[]; found: Proposal[]; asked: Asked[]; left: number } // all results of these labels; left: places still to be searched
export interface Outputs { folder: string; files: { name: string; words: string }[]; recording: boolean; version: number | null; stamp: string }
// Results of a run, in the words of its report.
export interface Results {
  level: "green" | "amber" | "red" | null; headline: string; first: string; others: string[]; scale: string; counts: string; case: [string, string][]; made: string;
  measurements: { name: string; kind: string; points: string[]; value: string; others: string; interval: string; status: Trust["status"]; words: string }[];
}
export interface Folder { id: number; name: string; photos: number; width_px: number; height_px: number }
export type Calibration = { t: "calibration" } & (
  | { state: "running"; what: string; done: number; total: number }
  | { state: "failed"; why: string }
  | { state: "done"; verdict: string; reasons: string[]; counts: string; facts: [string, string][]; file: string; width_px: number; height_px: number });

// The adjustment.

export interface Fit { image: number; label: string; residual_px: Maybe[]; w: Maybe; status: string; spread: Spread | null }
// The verdict: likeliest reason (without text if all is well), further remarks. All of it comes from the server.
// `reasons`: their number; `unseen`: lengths in which a wrong reading would not show.
export interface Verdict { level: "green" | "amber" | "red" | null; words: string; first: Remark; why: Remark[]; reasons: number; unseen: string }
// Status of a row: a word unless it is ok, and the reason.
export interface Trust { status: "ok" | "not-checked" | "doubtful" | "contradicted"; words: string; why: string }
// `shows`: its minimal detectable error and the effect; or the observation in which no error would show.
// `text`: value and sigma, empty if it is not measured; `grade`: of a slope; `earth`: latitude or longitude; `others`: of other solutions.
export interface ValueWords { text: string; grade: string; earth: string }
export interface Measured extends Trust, ValueWords { others: string; shows: string }
export interface LengthWords { adjusted: string; text: string } // in a table, and beside the line
export interface HeightWords { height: string; sentence: string; tag: string } // in a table, alone, and beside the label
export interface LengthFit extends Trust, LengthWords { sigma: string; w: Maybe; shows: string }
// One plain sentence, and `text` in detail; buttons for remedies, likeliest first; place to inspect.
export interface Remark extends Note { plain: string; labels: string[]; frames: number[]; lengths: string[]; measurements: string[]; mends: Mend[]; show: { image: number; label: string } | null }
export interface Mend { words: string; changes: SingleChange[]; opens?: string } // sent as one step: { t: "all", changes }; or a length to be read again
export interface AdjustedPoint extends Trust, Partial<HeightWords> { sigma_m: Maybe[]; sigma: string; neighbours: string[] } // `height` over the ground, if the point is off it
export interface Adjusted {
  mode: "adjusted"; seconds: number; verdict: Verdict;
  points: Record<string, AdjustedPoint | undefined>;
  picks: Fit[]; predicted: Predicted[];
  lines: Record<string, LengthFit | undefined>;
  measurements: Record<string, Measured | undefined>;
  checks: { label: string; errors: string[]; quantities: string[] }[];
  control_lines: Record<string, { offset: string; w: Maybe; status: string; fits: boolean } | undefined>; // largest offset, to the left
  frames: Record<number, { status: string; sigma: string; moved: string; standing: Trust } | undefined>;
  clock: ClockOffset | null;
  advice: { start: string; end: string; text: string } | null;
  messages: Note[];
}
export interface Unadjusted { mode: "none"; why: string; messages: Note[] }
export interface Linearised {
  mode: "linearised";
  residuals_px: [number, string, Maybe, Maybe][]; // image, label, u, v
  lines: Record<string, LengthWords>; measurements: Record<string, ValueWords>; heights: Record<string, Partial<HeightWords>>;
}
export type Live = { t: "live"; for: number; expected?: Predicted[] } & (Adjusted | Unadjusted | Linearised);
export type FullLive = Exclude<Live, Linearised>;

// From the server.

export interface Units { length: "m" | "ft" | "ft-in"; speed: "km/h" | "mph" | "m/s" }
export interface Standing { version: number; undo: number; redo: number }
// Line planned to be marked and taped: labels of the ends; length and directions to the ends in words.
export interface PlannedLine { name: string; start: string; end: string; length: string; start_place: string; end_place: string }
// Coded plate: its name, side length and directions in words, labels of its corners.
export interface PlannedPlate { name: string; side: string; place: string; corners: string[] }
// `why`: why the program does not look for the plates, if it does not.
export interface Planned { lines: PlannedLine[]; plates: PlannedPlate[]; why: string }
export interface ControlLine { name: string; points: string[] } // of known position; labels picked on it
// The sample survey: file and text of its tape readings.
export interface Sample { file: string; text: string }
export interface InitialState extends Standing {
  t: "initial-state"; project: string; units: Units; tile_px: number; pick_sigma_px: number; reading_sigma_m: number; photos: Photo[]; camera: Camera; clock: Clock | null; flight: Flight | null;
  control: string[]; check: string[]; named: string[]; sample: Sample | null; control_lines: ControlLine[]; planned: Planned; expected: Predicted[]; recovered: boolean; messages: Note[];
  state: { picks: Pick[]; repeated: Pair[]; lines: Line[]; measurements: Measurement[] };
  live: FullLive | null; proposals: Proposals; outputs: Outputs; outside: string[]; aside: number | null; calibration: Calibration | null;
}
export interface Changed extends Standing {
  t: "changed"; diff: { picks?: { put: Pick[]; gone: Pair[] }; repeated?: Pair[]; lines?: Line[]; measurements?: Measurement[] };
}
export interface Refused { t: "refused"; why: string }
export type ServerMessage = { seq?: number | null } & (
  | InitialState | Changed | Live | Calibration | Refused | Answers[keyof Answers]
  | { t: "closed" } | { t: "saved"; version: number; fault: string } | { t: "outside"; files: string[] } | { t: "outputs"; outputs: Outputs } | { t: "proposals" } & Proposals);

// From the page: changes of the picked state, and questions.

export interface Place extends Made { t: "place"; image: number; label: string; u_px: number; v_px: number; sigma_px?: Maybe; step?: number; final?: boolean }
export interface SetLine extends Reading { t: "line"; was: string; tape?: string; along?: Along }
export interface SetMeasurement extends Measurement { t: "measure"; was: string }
export interface SetHeight extends Height { t: "height"; label: string; step?: number }
type Pair = [number, string]; // photo and label
// `keep`: the label whose picks stay in photos in which both are picked.
export interface Merge { t: "merge"; label: string; into: string; keep?: string }
export type Change = SingleChange | { t: "all"; changes: SingleChange[] } | { t: "accept"; pairs: Pair[] } | { t: "undo" } | { t: "redo" };
// A change that can be combined with others in one step; a swap without a photo concerns all photos.
export type SingleChange = Place | SetLine | SetMeasurement
  | { t: "repeat"; image: number; label: string; u_px: number; v_px: number } | { t: "unpick"; image: number; label: string } | { t: "forget"; label: string } | { t: "rename"; label: string; new: string }
  | Merge | { t: "split"; label: string; new: string; images: number[] } | { t: "swap"; image: number | null; label: string; other: string }
  | { t: "sigma"; image: number; label: string; sigma_px: Maybe } | SetHeight
  | { t: "remove-line"; name: string } | { t: "remove-measurement"; name: string };

export type Target = "any" | "target"; // the likeliest feature; only marks that people put down
export type Question =
  | { t: "snap"; image: number; u_px: number; v_px: number; target: Target; expected?: string } | { t: "ground"; image: number; u_px: number; v_px: number }
  | { t: "side"; name: string } | { t: "ties"; image: number } | { t: "refuse"; pairs: Pair[]; is_taken_back?: boolean } | { t: "export" } | { t: "reload" } | { t: "take-aside" } | { t: "discard-aside" } | { t: "folders" } | { t: "stop-calibration" } | { t: "use-camera" }
  | { t: "calibrate"; folder: number; board: string; model: string };
type Placed = [Maybe, Maybe]; // value and sigma [m]
export interface SidePoint { station: string; height: string; ground: string; label: string; station_m: Placed; offset_m: Placed; height_m: Placed; ground_m: Placed } // heights over the first point
interface Done { t: "done"; why?: string }
export interface Answers {
  snap: { t: "snapped"; why: string; places_px: [number, number][] } | { t: "snapped"; why?: undefined; u_px: number; v_px: number; sigma_px: number; what: "corner" | "target"; is_sure: boolean }; // otherwise it only looks like the target
  side: { t: "side"; points: SidePoint[] };
  ties: { t: "ties"; places_px: [number, number][] };
  ground: { t: "ground"; places: Record<number, [number, number, number] | undefined> }; // u, v [px] and scale
  export: { t: "exported"; why?: string; outputs?: Outputs };
  folders: { t: "folders"; why?: string; folders: Folder[] };
  refuse: Done; reload: Done; "stop-calibration": Done; "use-camera": Done; calibrate: Done; "discard-aside": Done; "take-aside": Done & { refused: number };
}
