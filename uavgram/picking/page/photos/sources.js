// Origin of a pick: its shape and description.

import { picksOf, store } from "../connection/store.js";

/** @import { Pick, Source } from "../connection/protocol.js" */

const SAME_PLACE_PX = 0.01; // as on the server: a match belongs to a pick no further from its source place

// The mark of each source: distinguished by shape, not only by colour.
export const SHAPES = {
  hand: "M-9 0H-3M3 0H9M0 -9V-3M0 3V9",
  match: "M-9 -9L-2.5 -2.5M2.5 2.5L9 9M-9 9L-2.5 2.5M2.5 -2.5L9 -9",
  target: "M-9 -4V-9H-4M4 -9H9V-4M9 4V9H4M-4 9H-9V4M-2.5 0H2.5M0 -2.5V2.5",
};

/** @param {Pick} pick @returns {Source} */
export const sourceOf = ({ source }) => source ?? "hand";

// One line for a tooltip.
/** @param {Pick} pick */
export function madeBy(pick) {
  const { source, sigma_px, score, from_image } = pick;
  const sigma = `\u00b1 ${sigma_px ?? store.pickSigmaPx} px`;
  const how = score === null || score === undefined ? "" : `, score ${score.toFixed(2)}`;
  if (source === "target") return `target found by the program, ${sigma}${how}`;
  if (source === "match") return `match found by the program from the pick in ${photo(from_image)}, ${sigma} of the matching${how}`;
  return `picked by hand, ${sigma}`;
}

/** @param {number | null | undefined} image */
const photo = (image) => (image === null || image === undefined ? "another photo" : store.photos[image].name);

// Returns a pick as moved by a person.
/** @param {Pick} pick @returns {Pick} */
export function byHand(pick) {
  if (!pick.source) return pick;
  const moved = { ...pick, sigma_px: null };
  delete moved.source;
  delete moved.score;
  delete moved.from_image;
  delete moved.from_u_px;
  delete moved.from_v_px;
  return moved;
}

// Matches that were found from a pick: they are removed with it.
/** @param {Pick} pick */
export const matchesOf = ({ image, label, u_px, v_px }) => picksOf(label).filter((one) =>
  one.from_image === image && Math.hypot(Number(one.from_u_px) - u_px, Number(one.from_v_px) - v_px) <= SAME_PLACE_PX);

// Notice about their removal; empty if there are none.
/** @param {Pick} pick */
export function goneWith(pick) {
  const count = matchesOf(pick).length;
  if (!count) return "";
  return `${count === 1 ? "The match that was" : `The ${count} matches that were`} found from ${pick.label} went with it: Undo brings all back.`;
}

// Notice about what goes with a point that is removed everywhere; empty if nothing rests on it.
/** @param {string} label */
export function goneWithPoint(label) {
  const lengths = store.lines.filter(({ start, end }) => start === label || end === label).map(({ name }) => name);
  const values = store.measurements.filter(({ points }) => points.includes(label)).map(({ name }) => name);
  const names = [...lengths, ...values];
  return names.length ? `${names.join(", ")} went with ${label}: Undo (Ctrl+Z) brings all back.` : "";
}
