// The region in which a point is expected in a photo, and the points that a click in it may mean.
// Geometry only: independent of the page.

/** @import { Predicted, Spread } from "../connection/protocol.js" */

/**
 * Fit of a click to the expected place of a point.
 * @typedef {object} Nearness
 * @property {string} label
 * @property {boolean} inside whether it is in the region
 * @property {number} cost minus twice the logarithm of its likelihood, for each square pixel: the smaller the likelier
 * @property {[number, number]} away from the click to where the point is expected [px of the photo]
 */

const REGION = 13.8155; // chi-square of 2 degrees of freedom: 99.9 % of all clicks that mean the point are inside
const LEAST_PX = 8; // half the size of a region on the screen, at least
const CLEARLY = 2 * Math.log(100); // a point is meant if it is 100 times likelier than the next one

// Fit of a click to a region: the ellipse of the expected place, widened by the accuracy of clicks on the screen.
/** @param {Predicted} expected @param {number} u @param {number} v @param {number} scale CSS pixels for each of the photo @returns {Nearness} */
export function nearness({ label, pixel_px, spread }, u, v, scale) {
  const away = /** @type {[number, number]} */ ([pixel_px[0] - u, pixel_px[1] - v]);
  const [major, minor] = axes(spread, LEAST_PX / Math.sqrt(REGION) / scale);
  const turn = ((spread.turn_deg ?? 0) * Math.PI) / 180;
  const along = (away[0] * Math.cos(turn) + away[1] * Math.sin(turn)) / major;
  const across = (away[1] * Math.cos(turn) - away[0] * Math.sin(turn)) / minor;
  const off = along * along + across * across;
  return { label, inside: off <= REGION, cost: off + 2 * Math.log(2 * Math.PI * major * minor), away };
}

/** @param {Spread} spread @param {number} least @returns {number[]} NaN if nothing is known: no click is inside */
const axes = ({ major_px, minor_px }, least) => [major_px, minor_px].map((axis) => (axis === null ? NaN : Math.hypot(axis, least)));

// Points that a click may mean, likeliest first: a single one if that is clear, none outside all regions.
/** @param {Nearness[]} all */
export function meant(all) {
  const inside = all.filter((one) => one.inside).sort((a, b) => a.cost - b.cost);
  return inside.filter(({ cost }) => cost <= inside[0].cost + CLEARLY).map(({ label }) => label);
}

// Returns whether a point is clearly likelier at a click than anything else in the photo, all places of which
// are equally likely: a region of half the photo is no evidence.
/** @param {Nearness} one @param {{ width_px: number, height_px: number }} photo */
export const isTelling = ({ cost }, { width_px, height_px }) => cost + CLEARLY <= 2 * Math.log(width_px * height_px);

const ASIDE = ["to the right", "to the lower right", "below", "to the lower left", "to the left", "to the upper left", "above", "to the upper right"];

// Direction of the expected place, seen from the click.
/** @param {[number, number]} away */
export function aside([du, dv]) {
  const eighth = Math.round((4 * Math.atan2(dv, du)) / Math.PI + 8) % 8;
  const words = ASIDE[eighth];
  return `${Math.round(Math.hypot(du, dv))} px ${words}${words.startsWith("to") ? " of" : ""} here`;
}
