// The one verdict of the adjustment, above the numbers: its light, and the likeliest reason. All reasons
// and warnings at length fold away behind "why". Level and words are the server's.

import { adjusted, remarks } from "../connection/store.js";
import { byId, fillIfNew, node } from "../elements/dom.js";
import { list } from "../elements/table.js";
import { OFF_GROUND, offGround } from "./point.js";

/** @import { Tools } from "../actions/tools.js" */
/** @import { Note, Remark } from "../connection/protocol.js" */

/** @param {HTMLElement} box @param {Tools} tools */
export function showVerdict(box, tools) {
  const { level, words, first, why } = adjusted()?.verdict ?? unjudged();
  box.hidden = !words && !why.length;
  box.dataset.level = level;
  if (byId("light").textContent !== words) byId("light").textContent = words;
  const high = offGround();
  /** @param {Remark} message */
  const button = ({ code }) => (code === OFF_GROUND && high.length ? freeButton(high, tools) : null);
  fillIfNew(byId("first"), JSON.stringify([first, high]), () => (first.text ? [node("span", { title: first.text }, first.text), button(first) ?? ""] : []));
  byId("why").hidden = !why.length;
  byId("why-title").textContent = first.text ? "Why" : `Warnings (${why.length})`;
  fillIfNew(byId("reasons"), JSON.stringify([why, high]), () => [list(why, button)]);
}

// Before there are numbers: what was warned of.
/** @param {Note} note @returns {Remark} */
const asRemark = ({ level, code, text, labels = [] }) => ({ level, code, text, plain: text, labels, frames: [], lengths: [], measurements: [], mends: [], show: null });
const NOTHING = asRemark({ level: "warning", code: "", text: "" });
const unjudged = () => ({ level: "none", words: "", first: NOTHING, why: remarks().filter(({ level }) => level !== "info").map(asRemark) });

/** @param {string[]} high @param {Tools} tools */
const freeButton = (high, tools) => node("button", { class: "below", name: "free", title: "Takes it that they stand off the ground, at heights that their photos tell", onclick: () => tools.heights.free(high) },
  high.length === 1 ? `Free the height of ${high[0]}` : `Free these ${high.length} heights`);
