// Strokes and words in a photo.

import { shape } from "../elements/dom.js";

/** A line with its halo. @param {string} d @param {string} [wide] */
export const stroke = (d, wide = "halo wide") => [shape("path", { class: wide, d }), shape("path", { class: "thin", d })];

const LONGEST = 32; // letters of a label in a photo

/** @param {string} words @param {string} kind */
export function textShape(words, kind) {
  const made = shape("text", { x: 0, y: 0, class: kind });
  made.textContent = kind === "tag" && words.length > LONGEST ? `${words.slice(0, LONGEST - 1)}\u2026` : words;
  return made;
}

/** @param {string} words @param {number} x @param {number} y @param {string} anchor */
export function textAt(words, x, y, anchor) {
  const made = shape("text", { x: x.toFixed(1), y: y.toFixed(1), "text-anchor": anchor });
  made.textContent = words;
  return made;
}

/** A tooltip. @param {string} words */
export function titleShape(words) {
  const made = shape("title");
  made.textContent = words;
  return made;
}
