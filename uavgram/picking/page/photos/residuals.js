// Drawing of residuals: adjusted minus picked place, enlarged to be visible.

import { fitOf, store } from "../connection/store.js";

/** @import { Fit } from "../connection/protocol.js" */

const SCALES = [20, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01]; // screen pixels per photo pixel
const LONGEST_PX = 90;

// The residual of a pick, if there is one.
/** @param {Fit | undefined} fit @returns {[number, number] | null} */
export function residualOf(fit) {
  const [u, v] = fit?.residual_px ?? [null, null];
  return u === null || v === null ? null : [u, v];
}

// The largest scale that keeps the photo's residuals readable; it is shown beside the zoom.
/** @param {number} image */
export function residualScale(image) {
  let longest = 1e-9;
  for (const { image: its, label } of store.picks.values()) {
    const [u, v] = (its === image && fitOf(image, label)?.residual_px) || [null, null];
    if (u !== null && v !== null) longest = Math.max(longest, Math.hypot(u, v));
  }
  return SCALES.find((scale) => scale * longest <= LONGEST_PX) ?? 0.01;
}
