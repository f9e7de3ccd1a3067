// Tiles of all photos: loaded few at a time, the most wanted first, the longest unused dropped.

import { keyed } from "../connection/key.js";
import { store } from "../connection/store.js";
import { toneSign } from "./tone.js";

const LEAST_KEPT = 16; // a tile takes a megabyte
const SPARE = 1.25; // share of the drawn tiles; with fewer, tiles would be loaded again and again
const AT_ONCE = 6;
/** @type {Map<string, { picture: ImageBitmap, tone: string }>} */
const kept = new Map(); // by key, in the order of their last use
/** @type {Map<string, AbortController>} */
const under = new Map(); // by key
/** @type {Set<string>} */
const failed = new Set();
/** Reasons why photos cannot be shown, by photo. @type {Map<number, string>} */
const faults = new Map();
/** Wanted tiles of each pane: keys, the most wanted first; number of drawn tiles; photo. @type {Map<number, { keys: string[], drawn: number, photo: number }>} */
const panes = new Map();
const page = Math.random().toString(36).slice(2, 14);
/** @type {(photo: number) => void} */
let arrived = () => undefined;

/** @param {(photo: number) => void} callback */
export function onTile(callback) {
  arrived = callback;
}

/** @param {number} photo @param {number} level @param {number} column @param {number} row */
export function tileKey(photo, level, column, row) {
  return `${photo}/${level}/${column}/${row}`;
}

/** @param {string} key */
const photoOf = (key) => Number(key.split("/", 1)[0]);

/** @param {string} key */
export function tile(key) {
  const found = kept.get(key);
  if (found) {
    kept.delete(key);
    kept.set(key, found);
  }
  return found?.picture;
}

/** Whether a tile is loaded with the present brightness of its photo. @param {string} key */
export const isCurrent = (key) => kept.get(key)?.tone === toneSign(photoOf(key));

/** @param {number} pane @param {number} photo @param {string[]} keys @param {number} drawn */
export function want(pane, photo, keys, drawn) {
  panes.set(pane, { keys: keys.filter((key) => !isCurrent(key) && !failed.has(key)), drawn, photo });
  const all = new Set([...panes.values()].flatMap((one) => one.keys));
  for (const [key, control] of under) {
    if (!all.has(key)) control.abort();
  }
  trim();
  next();
}

/** Why a photo cannot be shown; empty if it can. @param {number} photo */
export const tileFault = (photo) => faults.get(photo) ?? "";

/** Loads the failed tiles of a photo again when they are wanted. @param {number} photo */
export function retry(photo) {
  faults.delete(photo);
  for (const key of failed) if (photoOf(key) === photo) failed.delete(key);
}

/** @param {number} pane */
export function forget(pane) {
  panes.delete(pane);
}

function mostKept() {
  return Math.max(LEAST_KEPT, SPARE * [...panes.values()].reduce((sum, { drawn }) => sum + drawn, 0));
}

// Drops tiles: those of a larger view are no longer needed in a smaller one.
function trim() {
  let spare = Math.ceil(kept.size - mostKept());
  for (const [oldest, { picture }] of kept) {
    if (spare <= 0) return;
    picture.close();
    kept.delete(oldest);
    spare -= 1;
  }
}

function next() {
  if (store.closing) return;
  const lists = [...panes.values()].map(({ keys }) => keys);
  for (let rank = 0; under.size < AT_ONCE; rank += 1) {
    const row = lists.filter((list) => rank < list.length).map((list) => list[rank]);
    if (!row.length) return;
    for (const key of row) {
      if (under.size < AT_ONCE && !under.has(key) && !isCurrent(key) && !failed.has(key)) void load(key);
    }
  }
}

/** @param {string} key */
async function load(key) {
  const control = new AbortController();
  under.set(key, control);
  try {
    const digest = store.photos[photoOf(key)]?.digest;
    // The server keeps only photos shown side by side decoded.
    const headers = { "x-shown": `${page} ${[...new Set([...panes.values()].map(({ photo }) => photo))].join()}` };
    const tone = toneSign(photoOf(key));
    const answer = await fetch(keyed(`/photo/${key}.jpg?${digest}&tone=${tone}`), { signal: control.signal, headers });
    if (!answer.ok) {
      /** @type {unknown} */
      const said = await answer.json().catch(() => ({}));
      faults.set(photoOf(key), /** @type {{ why?: string }} */ (said).why ?? "");
      throw new Error(`${answer.status}`);
    }
    const picture = await createImageBitmap(await answer.blob());
    kept.get(key)?.picture.close();
    kept.delete(key);
    kept.set(key, { picture, tone });
    trim();
  } catch {
    if (!control.signal.aborted) failed.add(key);
  } finally {
    under.delete(key);
    arrived(photoOf(key));
    next();
  }
}
