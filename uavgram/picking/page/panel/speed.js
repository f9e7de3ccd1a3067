// The speed of an object that moved between two photos: photos and times of its two places, and
// obstacles to it.

import { picksOf, store } from "../connection/store.js";

/** @typedef {{ image: number, name: string, time: number | null }} Seen */

const CLOCK = [11, 22]; // hours to hundredths of an ISO time

// Photos in which a label is picked, and their times [s]; null if unknown.
/** @param {string} label @returns {Seen[]} */
function seenIn(label) {
  return picksOf(label).map(({ image }) => {
    const { name, time_utc_s: time } = store.photos[image];
    return { image, name, time };
  });
}

/** @param {number | null} time */
const clockText = (time) => (time === null ? "time not known" : `${new Date(time * 1000).toISOString().slice(...CLOCK)} UTC`);

// A label with its photo and time, or the number of its photos.
/** @param {string} label */
export function placeText(label) {
  const seen = seenIn(label);
  if (seen.length !== 1) return seen.length ? `${label}: in ${seen.length} photos` : label;
  return `${label}: ${seen[0].name}, ${clockText(seen[0].time)}`;
}

const MOST_NAMES = 3;

/** @param {Seen[]} seen */
function names(seen) {
  const all = seen.map(({ name }) => name);
  return all.length > MOST_NAMES ? `${all.slice(0, MOST_NAMES).join(", ")} \u2026` : all.join(", ");
}

// Returns why one label cannot be a place of a moving object; empty if it can.
/** @param {string} label */
export function placeFault(label) {
  const seen = seenIn(label);
  if (!seen.length) return `${label} is picked in no photo. Pick it in one.`;
  if (seen.length > 1) {
    return `${label} is picked in ${seen.length} photos (${names(seen)}). What moves is at another place in each photo: `
      + `keep ${label} in one of them (Delete removes it from the photo that is shown), and give its place in another photo a label of its own.`;
  }
  return seen[0].time === null ? `The time of ${seen[0].name} is not known, so nothing tells how fast ${label} moved.` : "";
}

// Returns the seconds between the photos of a speed, or why there are none.
/** @param {string[]} points */
export function speedFacts([start, end]) {
  const why = placeFault(start) || placeFault(end);
  if (why) return { seconds: null, why };
  const [[from], [to]] = [seenIn(start), seenIn(end)];
  if (from.image === to.image) {
    return { seconds: null, why: `${start} and ${end} are both picked in ${from.name}. A speed needs two photos: pick where the same thing is in another one.` };
  }
  const seconds = Math.abs((to.time ?? 0) - (from.time ?? 0));
  return { seconds, why: seconds > 0 ? "" : `${from.name} and ${to.name} have the same time, so nothing tells how fast it moved.` };
}
