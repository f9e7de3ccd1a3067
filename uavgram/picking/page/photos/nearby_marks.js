// The marks at a place on the screen, or so near that a click there may mean them.

import { picksIn, proposals } from "../connection/store.js";

/** @import { PageState } from "../actions/page_state.js" */
/** @import { View } from "./view.js" */

/**
 * A mark, and its distance on the screen.
 * @typedef {{ image: number, label: string, u_px: number, v_px: number }} Place
 * @typedef {{ label: string, at: [number, number], away: number, hollow: boolean }} Near hollow: found by the program, no pick yet
 */

export const SAME_PX = 3; // clicks so close are on the same place
export const ON_PX = 7; // a click so close means the mark, if no other is as close
export const NEAR_PX = 16; // a click so close, within the ring round the mark, may mean the mark, or another

/** The marks near a place of the photo, the nearest first, none where they are hidden; `coming`: picks that are not confirmed yet.
 * @param {{ image: number, view: View, state: PageState }} pane @param {number} u @param {number} v @param {Place[]} coming @returns {Near[]} */
export function marksNear({ image, view, state }, u, v, coming = []) {
  if (state.hidesMarks) return [];
  /** @param {Place[]} places @param {boolean} hollow */
  const near = (places, hollow) => places.filter((one) => one.image === image).map(({ label, u_px, v_px }) => (
    { label, at: /** @type {[number, number]} */ ([u_px, v_px]), away: Math.hypot(u_px - u, v_px - v) * view.scale, hollow }));
  const all = [...near([...picksIn(image), ...coming], false), ...near(state.shown.predicted ? proposals() : [], true)];
  return all.filter(({ away }) => away <= NEAR_PX).sort((a, b) => a.away - b.away);
}

/** The mark at a place; none if there are several. @param {Near[]} near @param {number} reach */
export function markOn(near, reach = ON_PX) {
  const on = near.filter(({ away }) => away <= reach);
  return on.length === 1 ? on[0] : null;
}
