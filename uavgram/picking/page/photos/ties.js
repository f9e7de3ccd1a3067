// Tie points: unnamed points that the program found in several photos, as small dots.

import { put, shape } from "../elements/dom.js";

/** @import { Link } from "../connection/socket.js" */
/** @import { Part } from "./marks.js" */

/** @type {Map<number, [number, number][]>} */
const known = new Map(); // by photo, if already loaded

/** @param {number} image */
export const tiesIn = (image) => known.get(image) ?? [];

export const forgetTies = () => known.clear();

/** Loads the tie points of photos that are not loaded yet. @param {Link} link @param {number[]} images */
export async function bringTies(link, images) {
  for (const image of images.filter((one) => !known.has(one))) {
    const { places_px } = await link.ask({ t: "ties", image });
    known.set(image, places_px);
  }
}

// All dots are one path, redrawn with the view: thousands of separate shapes would be slow.
/** @param {number} image @returns {Part} */
export function tiesPart(image) {
  const places = tiesIn(image);
  return {
    key: "ties",
    sign: `${image} ${places.length}`,
    make: () => shape("g", { class: "ties", role: "img", "data-count": places.length, "aria-label": `${places.length} tie points` }, shape("path", {})),
    move: ({ firstElementChild: path }, view) => {
      const dots = places.map(([u, v]) => view.toScreen(u, v)).filter(([x, y]) => x >= 0 && y >= 0 && x <= view.width && y <= view.height);
      if (path) put(path, "d", dots.map(([x, y]) => `M${x.toFixed(1)} ${y.toFixed(1)}h0`).join(""));
    },
  };
}
