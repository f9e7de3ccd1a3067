// The lines that were planned before the flight: which ends are to be marked, which lengths to be entered.

import { labels, store } from "../connection/store.js";
import { fillIfNew, node } from "../elements/dom.js";

/** @import { Tools } from "../actions/tools.js" */
/** @import { PlannedLine } from "../connection/protocol.js" */
/** @typedef {{ line: PlannedLine, taped: boolean, missing: string[] }} Row `missing`: labels of ends that are not marked yet */

const list = node("ol", {});
const title = node("summary", {});
const box = node("details", { class: "steps planned", open: true, "aria-label": "Planned lines" }, title, list);

/** @param {Tools} tools */
export function plannedPart(tools) {
  if (!store.planned.length) return null;
  const rows = store.planned.map((line) => ({ line, taped: isTaped(line), missing: [line.start, line.end].filter((end) => !labels().includes(end)) }));
  const done = rows.filter(({ taped }) => taped).length;
  fillIfNew(title, `${done} ${rows.length}`, () => [`Planned lines: ${done} of ${rows.length} entered`]);
  const next = rows.find(({ taped }) => !taped);
  fillIfNew(list, JSON.stringify(rows), () => rows.map((row) => lineItem(row, row === next, tools)));
  return box;
}

// Where its ends are stands beneath the one that is next.
/** @param {Row} row @param {boolean} isNext @param {Tools} tools */
function lineItem({ line, taped, missing }, isNext, tools) {
  const words = node("b", {}, `${line.name}: about ${line.length}, from ${line.start} to ${line.end}`);
  if (taped) return node("li", { class: "done" }, node("span", { class: "unseen" }, "Done: "), words);
  const where = missing.map((end) => node("span", { class: "dim" }, `${end}: ${end === line.start ? line.start_place : line.end_place}`));
  const buttons = missing.length ? missing.map((end) => markButton(end, tools))
    : [node("button", { type: "button", onclick: () => enter(line, tools) }, "Enter what the tape said")];
  return node("li", {}, words, ...(isNext ? where : []), node("span", { class: "row" }, ...buttons));
}

// The next click places that label.
/** @param {string} label @param {Tools} tools */
const markButton = (label, tools) => node("button", {
  type: "button", onclick: () => {
    tools.setTool("pick");
    tools.name(label);
    tools.state.typed = true; // as if it were: this label, and no other
  },
}, `Mark ${label}`);

/** @param {PlannedLine} line @param {Tools} tools */
function enter({ name, start, end }, tools) {
  const free = tools.namesOf("line").includes(name) ? "" : name;
  tools.ask({ t: "line", start, end, name: free, sigma_m: tools.state.lastSigmaM });
}

/** @param {PlannedLine} line */
const isTaped = ({ start, end }) => store.lines.some((one) => (one.start === start && one.end === end) || (one.start === end && one.end === start));
