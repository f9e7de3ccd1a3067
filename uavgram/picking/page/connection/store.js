// Data from the server: the picked state and its adjustment.

import { useUnits } from "../elements/units.js";

/** @import { Adjusted, Asked, Calibration, Camera, Changed, Clock, ControlLine, Fit, Flight, FullLive, Height, InitialState, Linearised, Line, Live, Measurement, Outputs, Photo, Pick, Planned, Predicted, Proposal, Proposals, Remark, Sample, ServerMessage, Standing, Work } from "./protocol.js" */

/**
 * @typedef {object} Store
 * @property {boolean} begun whether the server has sent its first message
 * @property {string} project
 * @property {Photo[]} photos
 * @property {string[]} damaged names of photos that cannot be used, so that nothing is measured
 * @property {string[]} leftOut names of photos that the project leaves out
 * @property {number} tilePx
 * @property {number} pickSigmaPx
 * @property {number} readingSigmaM of a taped length, from the project file
 * @property {Camera | null} camera
 * @property {string[]} control
 * @property {string[]} check
 * @property {string[]} named labels of points in the project's other tables, or in the photos of the sample
 * @property {Sample | null} sample
 * @property {ControlLine[]} controlLines
 * @property {Remark[]} opening
 * @property {boolean} recovered
 * @property {Clock | null} clock
 * @property {Flight | null} flight
 * @property {Predicted[]} expected
 * @property {Planned} planned
 * @property {Outputs | null} outputs
 * @property {string[]} outside
 * @property {string} added sentences on files that are new beside the photos
 * @property {number | null} aside number of changes that an earlier session could not save
 * @property {Calibration | null} calibration
 * @property {Partial<Record<Work, string>>} stages of long work that goes on
 * @property {Map<string, Pick>} picks "image|label" -> pick
 * @property {string[]} repeated "image|label" of repeated clicks
 * @property {Line[]} lines
 * @property {Measurement[]} measurements
 * @property {Map<string, Proposal>} found "image|label" -> the proposal there
 * @property {Map<string, Asked>} asked "image|label" -> why the label is to be picked by hand there
 * @property {number} searched version for which the search in other photos is finished
 * @property {number} undo
 * @property {number} redo
 * @property {number} version
 * @property {FullLive | null} live the last full adjustment, updated with first-order values
 * @property {Map<string, Fit>} fits "image|label" -> fit of the pick there
 * @property {number} liveFor
 * @property {Live["mode"] | "waiting"} mode
 * @property {boolean} connected
 * @property {boolean} waits whether the numbers have been older than the picks for so long that this is shown
 * @property {boolean} closing this page closes the project, whose photos it requests no more
 * @property {boolean} gone not connected for so long that this is shown
 * @property {boolean} silent connected, but a change has been unanswered for so long that this is shown
 * @property {string} fault
 */

/** @type {Store} */
export const store = {
  begun: false,
  project: "",
  photos: [],
  damaged: [],
  leftOut: [],
  tilePx: 0,
  pickSigmaPx: 1,
  readingSigmaM: 0.01,
  camera: null,
  control: [],
  check: [],
  named: [],
  sample: null,
  controlLines: [],
  opening: [],
  recovered: false,
  clock: null,
  flight: null,
  expected: [],
  planned: { lines: [], plates: [], why: "" },
  outputs: null,
  outside: [],
  added: "",
  aside: null,
  calibration: null,
  stages: {},
  picks: new Map(),
  repeated: [],
  lines: [],
  measurements: [],
  found: new Map(),
  asked: new Map(),
  searched: -1,
  undo: 0,
  redo: 0,
  version: 0,
  live: null,
  fits: new Map(),
  liveFor: -1,
  mode: "waiting",
  connected: false,
  waits: false,
  closing: false,
  gone: false,
  silent: false,
  fault: "",
};

/** @param {number} image @param {string} label */
export const pickKey = (image, label) => `${image}|${label}`;

/** @template {{ image: number, label: string }} T @param {T[]} all @returns {Map<string, T>} */
const byKey = (all) => new Map(all.map((one) => [pickKey(one.image, one.label), one]));

// `moved`: picks moved here since the state that the server answers to. Returns whether there is
// something new to draw: drags are drawn before the server confirms them.
/** @param {ServerMessage} message @param {Set<string>} moved */
export function receive(message, moved) {
  if (message.t === "initial-state") begin(message);
  else if (message.t === "changed") return changed(message, moved);
  else if (message.t === "live") live(message);
  else if (message.t === "saved") store.fault = message.fault;
  else if (message.t === "outside") Object.assign(store, { outside: message.files, added: message.added });
  else if (message.t === "outputs") store.outputs = message.outputs;
  else if (message.t === "proposals") proposed(message);
  else if (message.t === "calibration") store.calibration = message;
  else if (message.t === "work") store.stages[message.kind] = message.stage;
  return true;
}

/** @param {InitialState} message */
function begin({ project, units, photos, damaged, camera, control, check, named, sample, recovered, clock, flight, expected, planned, outputs, outside, added, aside, calibration, stages, ...message }) {
  const { picks, repeated, lines, measurements } = message.state;
  useUnits(units);
  Object.assign(store, {
    begun: true, project, photos, damaged, camera, control, check, named, sample, recovered, clock, flight, expected, planned, outputs, outside, added, aside, calibration, stages, lines, measurements,
    leftOut: message.left_out,
    tilePx: message.tile_px,
    pickSigmaPx: message.pick_sigma_px,
    readingSigmaM: message.reading_sigma_m,
    controlLines: message.control_lines,
    opening: message.messages,
    picks: byKey(picks),
    repeated: repeated.map((pair) => pickKey(...pair)),
    found: byKey(message.proposals.found),
    asked: byKey(message.proposals.asked),
    searched: message.proposals.searched,
    live: null,
    liveFor: -1,
    mode: "waiting",
    fault: "",
  });
  standing(message);
  if (message.live) live(message.live);
}

/** @param {Standing} message */
function standing({ version, undo, redo }) {
  Object.assign(store, { version, undo, redo });
}

/** @param {Changed} message @param {Set<string>} moved */
function changed(message, moved) {
  const { picks, repeated, lines, measurements } = message.diff;
  for (const [image, label] of picks?.gone ?? []) store.picks.delete(pickKey(image, label));
  const put = (picks?.put ?? []).filter((pick) => !moved.has(pickKey(pick.image, pick.label)) && !isThere(pick));
  for (const pick of put) store.picks.set(pickKey(pick.image, pick.label), pick);
  if (repeated) store.repeated = repeated.map((pair) => pickKey(...pair));
  if (lines) store.lines = lines;
  if (measurements) store.measurements = measurements;
  standing(message);
  return put.length > 0 || Boolean(picks?.gone.length) || Object.keys(message.diff).some((what) => what !== "picks");
}

/** @param {Pick} pick */
const isThere = (pick) => JSON.stringify(pick) === JSON.stringify(pickAt(pick.image, pick.label));

/** @param {Live} message */
function live(message) {
  store.liveFor = message.for;
  store.mode = message.mode;
  if (message.mode === "linearised") {
    layOver(message);
    return;
  }
  store.live = message;
  store.expected = message.expected ?? store.expected;
  store.fits = byKey(message.mode === "adjusted" ? message.picks : []);
}

// Applies a first-order answer, which has values only: sigmas and tests stay those of the last adjustment.
/** @param {Linearised} message */
function layOver({ residuals_px, lines, measurements, heights }) {
  const base = adjusted();
  if (!base) return;
  for (const [image, label, u, v] of residuals_px) {
    const there = store.fits.get(pickKey(image, label));
    if (there) there.residual_px = [u, v];
  }
  for (const [name, words] of Object.entries(lines)) Object.assign(base.lines[name] ?? {}, words);
  for (const [name, words] of Object.entries(measurements)) Object.assign(base.measurements[name] ?? {}, words);
  for (const [label, words] of Object.entries(heights)) Object.assign(base.points[label] ?? {}, words);
}

// Replaces all search results of some labels.
/** @param {Proposals} message */
function proposed({ labels: of, found, asked, searched }) {
  for (const all of [store.found, store.asked]) for (const [key, { label }] of all) if (of.includes(label)) all.delete(key);
  for (const [key, one] of byKey(found)) store.found.set(key, one);
  for (const [key, one] of byKey(asked)) store.asked.set(key, one);
  store.searched = searched;
}

// Lists the proposals or requests of labels that are not picked meanwhile.
/** @template {{ image: number, label: string }} T @param {Map<string, T>} all */
const open = (all) => [...all].flatMap(([key, one]) => (store.picks.has(key) ? [] : [one]));
export const proposals = () => open(store.found);
export const askedFor = () => open(store.asked);
/** @param {number} image @param {string} label */
export const proposalAt = (image, label) => (pickAt(image, label) ? undefined : store.found.get(pickKey(image, label)));

/** @returns {Adjusted | null} */
export const adjusted = () => (store.live?.mode === "adjusted" ? store.live : null);
export const stale = () => store.liveFor < store.version;
export const isSearching = () => store.searched < store.version;
export const remarks = () => store.live?.messages ?? store.opening;
/** @param {number} image @param {string} label */
export const pickAt = (image, label) => store.picks.get(pickKey(image, label));
/** @param {number} image @param {string} label */
export const fitOf = (image, label) => store.fits.get(pickKey(image, label));

/** @param {string} label */
export const picksOf = (label) => [...store.picks.values()].filter((pick) => pick.label === label);

// Returns the stated height of a label: a statement at one of its picks holds for all.
/** @param {string} label @returns {Height} */
export function heightOf(label) {
  const all = picksOf(label);
  return all.find(({ is_free, height_m }) => is_free || height_m !== null) ?? all[0] ?? { height_m: null };
}

// Returns the adjusted height of a point that is off the ground.
/** @param {string} label */
export function standsAt(label) {
  const point = adjusted()?.points[label];
  return point?.height ? point : null;
}

export function labels() {
  return [...new Set([...store.picks.values()].map((pick) => pick.label))];
}

// All names of points, picked or not.
export const namedLabels = () => [...new Set([
  ...labels(), ...store.control, ...store.check, ...store.named,
  ...[...store.lines, ...store.planned.lines].flatMap(({ start, end }) => [start, end]), ...store.measurements.flatMap(({ points }) => points), ...store.planned.plates.flatMap(({ corners }) => corners),
])];

/** Counts the picks of each label. */
export function countsOfPicks() {
  /** @type {Map<string, number>} */
  const count = new Map();
  for (const { label } of store.picks.values()) count.set(label, (count.get(label) ?? 0) + 1);
  return count;
}

/** @param {number} image */
export function picksIn(image) {
  return [...store.picks.values()].filter((pick) => pick.image === image);
}

// The photo with the most picks: the last one worked on, as a rule.
export function mostPicked() {
  const counts = store.photos.map((_, image) => picksIn(image).length);
  return Math.max(counts.indexOf(Math.max(...counts)), 0);
}

// Lists labels picked in other photos, and points with known coordinates or planned places that are in none yet.
/** @param {number} image */
export function predictedIn(image) {
  /** @param {Predicted} one */
  const here = (one) => one.image === image && !pickAt(image, one.label);
  const predicted = (adjusted()?.predicted ?? []).filter(here);
  const expected = store.expected.filter((one) => here(one) && !isPicked(one.label));
  return expected.length ? [...predicted, ...expected] : predicted;
}

/** @param {string} label */
const isPicked = (label) => picksOf(label).length > 0 || (plannedPlate(label)?.corners ?? []).some((corner) => picksOf(corner).length > 0);

/** @param {string} label */
const plannedPlate = (label) => store.planned.plates.find(({ name }) => name === label);

// Returns the place of a label in a photo: its pick, else its predicted place.
/** @param {number} image @param {string} label */
export function placeOf(image, label) {
  const pick = pickAt(image, label);
  if (pick) return { u: pick.u_px, v: pick.v_px, picked: true };
  const proposal = proposalAt(image, label);
  if (proposal) return { u: proposal.u_px, v: proposal.v_px, picked: false };
  const found = predictedIn(image).find((one) => one.label === label);
  return found ? { u: found.pixel_px[0], v: found.pixel_px[1], picked: false } : null;
}

/** @param {string} prefix @param {Set<string>} taken */
export function freeName(prefix, taken) {
  const names = new Set([...taken].map((name) => name.toLowerCase())); // p7 and P7 look alike
  for (let k = 1; ; k += 1) {
    if (!names.has(`${prefix}${k}`.toLowerCase())) return `${prefix}${k}`;
  }
}

/** @param {string | undefined} status */
export const isSuspect = (status) => status === "suspect" || status === "removed";

// Largest standardised residual of each photo's picks.
export function worstOfPhotos() {
  /** @type {Map<number, { w: number, status: string }>} */
  const worst = new Map();
  for (const { image, w, status } of adjusted()?.picks ?? []) {
    if (w !== null && Math.abs(w) > (worst.get(image)?.w ?? 0)) worst.set(image, { w: Math.abs(w), status });
  }
  return worst;
}
