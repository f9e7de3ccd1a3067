// Plan made before the flight: line ends to be marked, lengths to be entered, plates to be put down, and the
// plates found so far.

import { labels, picksOf, proposals, store } from "../connection/store.js";
import { fillIfNew, node } from "../elements/dom.js";

/** @import { Tools } from "../actions/tools.js" */
/** @import { PlannedLine, PlannedPlate } from "../connection/protocol.js" */
/** @typedef {{ plate: PlannedPlate, photos: number, proposed: boolean }} PlateRow `photos`: number in which a corner is picked */
/** @typedef {{ line: PlannedLine, taped: boolean, missing: string[] }} Row `missing`: labels of ends that are not marked yet */

const list = node("ol", {});
const title = node("summary", {});
const box = node("details", { class: "steps planned", open: true, "aria-label": "Planned lines" }, title, list);

/** @param {Tools} tools */
export function plannedPart(tools) {
  if (!store.planned.lines.length) return null;
  const rows = store.planned.lines.map((line) => ({ line, taped: isTaped(line), missing: [line.start, line.end].filter((end) => !labels().includes(end)) }));
  const done = rows.filter(({ taped }) => taped).length;
  fillIfNew(title, `${done} ${rows.length}`, () => [`Planned lines: ${done} of ${rows.length} entered`]);
  const next = rows.find(({ taped }) => !taped);
  fillIfNew(list, JSON.stringify(rows), () => rows.map((row) => lineItem(row, row === next, tools)));
  return box;
}

const plateList = node("ol", {});
const plateTitle = node("summary", {});
const why = node("p", { class: "dim" });
const plateBox = node("details", { class: "steps planned", open: true, "aria-label": "Planned plates" }, plateTitle, why, plateList);

// The program finds plates itself: only its proposals need a click.
export function plannedPlatesPart() {
  const { plates } = store.planned;
  if (!plates.length) return null;
  const offered = new Set(proposals().map(({ label }) => label));
  const rows = plates.map((plate) => ({
    plate, photos: new Set(plate.corners.flatMap((corner) => picksOf(corner).map(({ image }) => image))).size,
    proposed: plate.corners.some((corner) => offered.has(corner)),
  }));
  const found = rows.filter(({ photos }) => photos).length;
  fillIfNew(plateTitle, `${found} ${rows.length}`, () => [`Planned plates: ${found} of ${rows.length} found`]);
  if (why.textContent !== store.planned.why) why.textContent = store.planned.why;
  why.hidden = !store.planned.why;
  fillIfNew(plateList, JSON.stringify(rows), () => rows.map(plateItem));
  return plateBox;
}

/** @param {PlateRow} row */
function plateItem({ plate, photos, proposed }) {
  const words = node("b", {}, `${plate.name}: side ${plate.side}`);
  const where = node("span", { class: "dim" }, plate.place);
  if (photos) return node("li", { class: "done" }, node("span", { class: "unseen" }, "Done: "), words, node("span", { class: "dim" }, `in ${photos} photo${photos === 1 ? "" : "s"}`));
  return node("li", {}, words, where, ...(proposed ? [node("span", { class: "dim" }, "found: accept it below")] : []));
}

// The places of the ends are shown beneath the next line only.
/** @param {Row} row @param {boolean} isNext @param {Tools} tools */
function lineItem({ line, taped, missing }, isNext, tools) {
  const words = node("b", {}, `${line.name}: about ${line.length}, from ${line.start} to ${line.end}`);
  if (taped) return node("li", { class: "done" }, node("span", { class: "unseen" }, "Done: "), words);
  const where = missing.map((end) => node("span", { class: "dim" }, `${end}: ${end === line.start ? line.start_place : line.end_place}`));
  const buttons = missing.length ? missing.map((end) => markButton(end, tools))
    : [node("button", { type: "button", onclick: () => enter(line, tools) }, "Enter what the tape said")];
  return node("li", {}, words, ...(isNext ? where : []), node("span", { class: "row" }, ...buttons));
}

// Makes the next click place that label.
/** @param {string} label @param {Tools} tools */
const markButton = (label, tools) => node("button", {
  type: "button", onclick: () => {
    tools.setTool("pick");
    tools.name(label);
    tools.state.typed = true; // as if typed: this label, and no other
  },
}, `Mark ${label}`);

/** @param {PlannedLine} line @param {Tools} tools */
function enter({ name, start, end }, tools) {
  const free = tools.namesOf("line").includes(name) ? "" : name;
  tools.ask({ t: "line", start, end, name: free, sigma_m: tools.state.lastSigmaM ?? store.readingSigmaM });
}

/** @param {PlannedLine} line */
const isTaped = ({ start, end }) => store.lines.some((one) => (one.start === start && one.end === end) || (one.start === end && one.end === start));
