// The help: keys, marks and terms of the page.

import { node, shape } from "../elements/dom.js";
import { MISFIT, SIGMA } from "../elements/numbers.js";
import { DIAMOND, HOLLOW, KNOWN, OCTAGON } from "../photos/marks.js";
import { SHAPES } from "../photos/sources.js";
import { KEYS } from "./keys.js";

const ROUND = "M-9 0A9 6 0 1 0 9 0A9 6 0 1 0 -9 0Z";
const STROKE = "M-16 0H16";

// Class and path of each mark, and its meaning.
/** @type {[string, string, string][]} */
const MARKS = [
  ["placed", SHAPES.hand, "a point that you placed; the ellipse is where it lies, 95\u00a0%"],
  ["placed found", SHAPES.match, "the same point in another photo, found by the program. Rest the pointer there: from which pick, how exactly. Move it, and it is yours"],
  ["placed found", SHAPES.target, "a coded plate or target, found by the program"],
  ["proposed", HOLLOW, "found by the program; the full stop accepts it, a click there is a pick of your own, but on a target takes its measured centre"],
  ["predicted", ROUND, "where a point should be that is placed in other photos, 95\u00a0%"],
  ["suspect", DIAMOND, "suspect: it does not fit the rest. Look whether it is the right place, or the right length"],
  ["trust doubtful", DIAMOND, "dashed, round a point or as a line: doubtful. It rests on something that does not fit"],
  ["trust contradicted", OCTAGON, "round a point; as a line dotted: contradicted. Do not use it"],
  ["pulled", STROKE, "misfit (residual): from the point to where all else says it is, drawn larger, as beneath the photo is said"],
  ["length", STROKE, "a taped length; dashed: only to check"],
  ["measured", STROKE, "a measurement"],
  ["placed", KNOWN.control, "a point with known coordinates that takes part; square: one that is only to check"],
];

/** @type {[string, string][]} */
const WORDS = [
  ["(\u00b1)", SIGMA],
  ["misfit", MISFIT],
  ["\u25cb not checked", "nothing would show an error in it. Rest the pointer there: what an error would do"],
  ["? doubtful, \u2260 contradicted", "grey or struck: something that it rests on does not fit, or contradicts it: do not use it before that is cleared up"],
  ["grey italics", "not of what is marked now: being computed anew, first estimates, or without connection"],
];

/** @param {HTMLDialogElement} dialog @param {() => void} showSteps */
export function buildHelp(dialog, showSteps) {
  dialog.append(node("h2", { id: "help-title", class: "unseen" }, "Help"),
    node("div", { class: "row" },
      node("button", { onclick: () => dialog.close() }, "Close (Esc)"),
      node("button", { onclick: () => { dialog.close(); showSteps(); } }, "Show the first steps")),
    node("p", {}, "To try things out: ", node("code", {}, "uavgram pick --sample"), " in a terminal makes a small survey to play with. For another browser, or a lost page, run the command that started this one once more."),
    node("div", { class: "keys" }, ...KEYS.map(([title, rows]) => part(title, rows.map(({ keys, what }) => [keys, what]))),
      part("What is drawn", MARKS.map(([kind, path, what]) => /** @type {[Node, string]} */ ([swatch(kind, path), what]))), part("What is written", WORDS)));
}

/** @param {string} title @param {[string | Node, string][]} rows */
const part = (title, rows) => node("div", {}, node("h2", {}, title), node("dl", {}, ...rows.flatMap(([key, what]) => [node("dt", {}, key), node("dd", {}, what)])));

/** @param {string} kind @param {string} path */
function swatch(kind, path) {
  return shape("svg", { class: "swatch", viewBox: "-26 -14.5 52 29", width: 52, height: 29, "aria-hidden": "true" },
    shape("g", { class: kind }, shape("path", { class: "halo wide", d: path }), shape("path", { class: "thin", d: path })));
}
