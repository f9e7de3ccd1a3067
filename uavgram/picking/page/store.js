// What the server said: the picked state, and what the adjustment makes of it.

export const store = {
  photos: [],
  picks: new Map(), // "image|label" -> pick
  lines: [],
  measurements: [],
  undo: 0,
  redo: 0,
  version: 0,
  live: null, // the last full adjustment, with first-order values laid over it
  liveFor: -1,
  mode: "waiting",
  connected: false,
  gone: false, // not connected for so long that it is to be said
  fault: "",
};

export const pickKey = (image, label) => `${image}|${label}`;

// `ahead`: picks that were moved since what the server answers to here. Returns whether there is
// something new to draw: what a drag does is drawn before the server confirms it.
export function receive(message, ahead) {
  if (message.t === "hello") hello(message);
  else if (message.t === "changed") return changed(message, ahead);
  else if (message.t === "live") live(message);
  else if (message.t === "saved") store.fault = message.fault;
  else if (message.t === "outside") store.outside = message.files;
  else if (message.t === "outputs") store.outputs = message.outputs;
  else if (message.t === "calibration") store.calibration = message;
  return true;
}

function hello(message) {
  Object.assign(store, {
    project: message.project,
    photos: message.photos,
    tilePx: message.tile,
    sigma: message.sigma,
    camera: message.camera,
    control: message.control,
    check: message.check,
    opening: message.messages,
    recovered: message.recovered,
    clock: message.clock,
    expected: message.expected,
    outputs: message.outputs,
    outside: message.outside,
    aside: message.aside,
    calibration: message.calibration,
    fault: "",
    picks: new Map(message.state.picks.map((pick) => [pickKey(pick.image, pick.label), pick])),
    lines: message.state.lines,
    measurements: message.state.measurements,
    live: null,
    liveFor: -1,
    mode: "waiting",
  });
  standing(message);
  if (message.live) live(message.live);
}

function standing({ version, undo, redo }) {
  Object.assign(store, { version, undo, redo });
}

function changed(message, ahead) {
  const { picks, lines, measurements } = message.diff;
  for (const [image, label] of picks?.gone ?? []) store.picks.delete(pickKey(image, label));
  const put = (picks?.put ?? []).filter((pick) => !ahead.has(pickKey(pick.image, pick.label)) && !isThere(pick));
  for (const pick of put) store.picks.set(pickKey(pick.image, pick.label), pick);
  if (lines) store.lines = lines;
  if (measurements) store.measurements = measurements;
  standing(message);
  return Boolean(put.length || picks?.gone.length || lines || measurements);
}

function isThere(pick) {
  const there = pickAt(pick.image, pick.label);
  return there && Object.entries(pick).every(([name, value]) => there[name] === value);
}

function live(message) {
  store.liveFor = message.for;
  store.mode = message.mode;
  if (message.mode === "linearised") {
    layOver(message);
    return;
  }
  store.live = message;
  store.expected = message.expected ?? store.expected;
  if (message.mode === "adjusted") {
    message.pickAt = new Map(message.picks.map((pick) => [pickKey(pick.image, pick.label), pick]));
  }
}

// A first-order answer has values alone: sigmas and tests stay those of the last adjustment.
function layOver(message) {
  const base = store.live;
  if (!base || base.mode !== "adjusted") return;
  for (const [image, label, u, v] of message.picks) {
    const there = base.pickAt.get(pickKey(image, label));
    if (there) there.residual = [u, v];
  }
  for (const [name, value] of Object.entries(message.lines)) {
    if (base.lines[name]) base.lines[name].adjusted = value;
  }
  for (const [name, value] of Object.entries(message.measurements)) {
    const there = base.measurements[name];
    if (!there) continue;
    if (there.interval[0] !== null && value !== null && there.value !== null) {
      there.interval = there.interval.map((bound) => bound + value - there.value);
    }
    there.value = value;
  }
  for (const [label, world] of Object.entries(message.points)) {
    if (base.points[label]) base.points[label].world = world;
  }
  base.earth = message.earth;
}

export const adjusted = () => (store.live?.mode === "adjusted" ? store.live : null);
export const stale = () => store.liveFor < store.version;
export const pickAt = (image, label) => store.picks.get(pickKey(image, label));
export const fitOf = (image, label) => adjusted()?.pickAt.get(pickKey(image, label));

export const picksOf = (label) => [...store.picks.values()].filter((pick) => pick.label === label);

export function labels() {
  return [...new Set([...store.picks.values()].map((pick) => pick.label))];
}

export function picksIn(image) {
  return [...store.picks.values()].filter((pick) => pick.image === image);
}

// Labels that are picked in other photos, and points with known coordinates that are in none yet.
export function predictedIn(image) {
  const here = (one) => one.image === image && !pickAt(image, one.label);
  const predicted = (adjusted()?.predicted ?? []).filter(here);
  const expected = (store.expected ?? []).filter((one) => here(one) && !isPicked(one.label));
  return expected.length ? [...predicted, ...expected] : predicted;
}

const isPicked = (label) => picksOf(label).length > 0;

// Where a label is in a photo: its pick, else its predicted place.
export function placeOf(image, label) {
  const pick = pickAt(image, label);
  if (pick) return { u: pick.u, v: pick.v, picked: true };
  const found = predictedIn(image).find((one) => one.label === label);
  return found ? { u: found.at[0], v: found.at[1], picked: false } : null;
}

export function freeName(prefix, taken) {
  for (let k = 1; ; k += 1) {
    if (!taken.has(`${prefix}${k}`)) return `${prefix}${k}`;
  }
}

export const isSuspect = (status) => status === "suspect" || status === "removed";

export function worstIn(image) {
  let worst = null;
  for (const pick of adjusted()?.picks ?? []) {
    if (pick.image === image && pick.w !== null && Math.abs(pick.w) > Math.abs(worst?.w ?? 0)) worst = pick;
  }
  return worst;
}
