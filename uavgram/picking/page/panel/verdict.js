// The one verdict of the adjustment, above the numbers: its light, the likeliest reason in one plain sentence,
// and what would put it right. Statistics and all else fold away behind "why". Level and words are the server's.

import { adjusted, remarks } from "../connection/store.js";
import { light } from "../connection/trust.js";
import { byId, fillIfNew, node } from "../elements/dom.js";
import { list } from "../elements/table.js";
import { OFF_GROUND, offGround } from "./point.js";

/** @import { Tools } from "../actions/tools.js" */
/** @import { Mend, Remark } from "../connection/protocol.js" */

/** @param {HTMLElement} box @param {Tools} tools */
export function showVerdict(box, tools) {
  const { level, words } = light();
  const { first, why, unseen } = adjusted()?.verdict ?? unjudged();
  box.hidden = false;
  box.dataset.level = level;
  if (byId("light").textContent !== words) byId("light").textContent = words;
  const high = offGround();
  const isOld = level === "none";
  const plain = first.plain || first.text || unseen;
  /** @param {Remark} remark */
  const buttons = (remark) => actionsOf(remark, high, isOld, tools);
  fillIfNew(byId("first"), JSON.stringify([first, plain, high, isOld]), () => (plain ? [node("span", { title: first.text || plain }, plain), buttons(first) ?? ""] : []));
  const behind = first.plain && first.plain !== first.text && !why.some(({ text }) => text === first.text) ? [first, ...why] : why;
  byId("why").hidden = !behind.length;
  byId("why-title").textContent = `${first.text ? "Why" : "Warnings"} (${behind.length})`;
  fillIfNew(byId("reasons"), JSON.stringify([behind, high, isOld]), () => [list(behind, (remark) => (remark === first ? null : buttons(remark)))]);
}

// Before there are numbers: what was warned of.
/** @type {Remark} */
const NOTHING = { level: "warning", code: "", text: "" };
const unjudged = () => ({ first: NOTHING, why: remarks().filter(({ level }) => level !== "info"), unseen: "" });

// What would put it right, the likeliest first, and a way to see it. Of old numbers only that: what would put
// right what was marked before may put wrong what is marked now.
/** @param {Remark} remark @param {string[]} high @param {boolean} isOld @param {Tools} tools */
function actionsOf({ code, mends = [], show }, high, isOld, tools) {
  /** @type {HTMLElement[]} */
  const made = mends.map((mend, k) => node("button", { name: "mend", class: k ? "" : "main", disabled: isOld, onclick: () => putRight(mend, tools) }, mend.words));
  if (!mends.length && code === OFF_GROUND && high.length) made.push(freeButton(high, tools));
  if (show) made.push(node("button", { name: "show", onclick: () => tools.panes.look(show.image, show.label) }, "Show me"));
  return made.length ? node("span", { class: "mends" }, ...made) : null;
}

/** @param {Mend} mend @param {Tools} tools */
function putRight({ words, changes }, tools) {
  tools.send({ t: "all", changes });
  tools.notice.show(`Done: ${words}.`, true, { words: "Undo", act: () => tools.send({ t: "undo" }) });
}

/** @param {string[]} high @param {Tools} tools */
const freeButton = (high, tools) => node("button", { name: "free", title: "Takes it that they stand off the ground, at heights that their photos tell", onclick: () => tools.heights.free(high) },
  high.length === 1 ? `Free the height of ${high[0]}` : `Free these ${high.length} heights`);
