// Tiles of all photos: fetched few at a time, the most wanted first, the longest unused dropped.

import { store } from "./store.js";

const LEAST_KEPT = 48; // a tile takes a megabyte
const SPARE = 1.25; // of what is drawn: fewer than that would be fetched again and again
const AT_ONCE = 6;
const kept = new Map(); // key -> ImageBitmap, in the order of their last use
const under = new Map(); // key -> AbortController
const failed = new Set();
const wanted = new Map(); // owner -> keys, the most wanted first
const drawn = new Map(); // owner -> how many tiles it draws
const shown = new Map(); // owner -> the photo that it shows
const page = Math.random().toString(36).slice(2, 14);
let arrived = () => {};

export function onTile(callback) {
  arrived = callback;
}

export function tileKey(photo, level, column, row) {
  return `${photo}/${level}/${column}/${row}`;
}

const photoOf = (key) => Number(key.split("/", 1)[0]);

export function tile(key) {
  const found = kept.get(key);
  if (found) {
    kept.delete(key);
    kept.set(key, found);
  }
  return found;
}

export function want(owner, keys, count) {
  drawn.set(owner, count);
  if (keys.length) shown.set(owner, photoOf(keys[0]));
  wanted.set(owner, keys.filter((key) => !kept.has(key) && !failed.has(key)));
  const all = new Set([...wanted.values()].flat());
  for (const [key, control] of under) {
    if (!all.has(key)) control.abort();
  }
  next();
}

export function forget(owner) {
  wanted.delete(owner);
  drawn.delete(owner);
  shown.delete(owner);
}

function mostKept() {
  return Math.max(LEAST_KEPT, SPARE * [...drawn.values()].reduce((sum, count) => sum + count, 0));
}

function next() {
  const lists = [...wanted.values()];
  for (let rank = 0; under.size < AT_ONCE; rank += 1) {
    const row = lists.filter((list) => rank < list.length).map((list) => list[rank]);
    if (!row.length) return;
    for (const key of row) {
      if (under.size < AT_ONCE && !under.has(key) && !kept.has(key) && !failed.has(key)) load(key);
    }
  }
}

async function load(key) {
  const control = new AbortController();
  under.set(key, control);
  try {
    const photo = store.photos[photoOf(key)];
    // The server keeps decoded what is shown side by side, and little else.
    const headers = { "x-shown": `${page} ${[...new Set(shown.values())].join()}` };
    const answer = await fetch(`/photo/${key}.jpg?${photo.digest}`, { signal: control.signal, headers });
    if (!answer.ok) throw new Error(`${answer.status}`);
    const picture = await createImageBitmap(await answer.blob());
    kept.set(key, picture);
    while (kept.size > mostKept()) {
      const [oldest, bitmap] = kept.entries().next().value;
      bitmap.close();
      kept.delete(oldest);
    }
  } catch (fault) {
    if (fault.name !== "AbortError") failed.add(key);
  } finally {
    under.delete(key);
    arrived(photoOf(key));
    next();
  }
}
