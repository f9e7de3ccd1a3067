// Results of the last run: verdict, measurements and plan, and all its files.

import { keyed } from "../connection/key.js";
import { store } from "../connection/store.js";
import { ageOfNumbers } from "../connection/trust.js";
import { find } from "../door/server.js";
import { node } from "../elements/dom.js";
import { cell, fill, keep, list, table, tableRow } from "../elements/table.js";

/** @import { Outputs, Results } from "../connection/protocol.js" */
/** @import { Attribute } from "../elements/dom.js" */

/** @type {{ stamp: string, results: Results | null }} */
let read = { stamp: "", results: null };

const OLDER = "These results are older than your marks. Write them again (button below).";
const NO_CONNECTION = "No connection to the program: this page cannot open the files below. They are in the folder that is named there.";
const SIGNS = { green: "\u25CF", amber: "\u25B2", red: "\u25A0", none: "\u25CB" };

/** @param {Element} section @param {() => void} again called when the results were read */
export function showResults(section, again) {
  const { outputs } = store;
  if (!outputs) return;
  if (read.stamp !== outputs.stamp) void bring(outputs.stamp, again);
  if (!outputs.files.length && !outputs.recording) {
    fill(section, () => [keep("results", "none", () => node("div", { class: "no-results" }, node("h2", {}, "Nothing is written yet"),
      node("p", {}, "Mark points, enter what was taped, and measure what you want to know. Then write the results: the report, a table, drawings for CAD and maps, and a recording to look at in 3-D."),
      node("p", { class: "dim" }, "The button below writes them into the project's folder.")))]);
    return;
  }
  const note = ageOfNumbers() === "lost" ? NO_CONNECTION : outputs.version === store.version ? "" : OLDER;
  const { results } = read;
  fill(section, () => [keep("results", [outputs, results, note], () => node("div", { class: "results" },
    note ? node("p", { class: "older", role: "status" }, note) : null,
    results ? headline(results) : null,
    node("div", { class: "beside" },
      node("div", {}, results ? measurements(results) : null),
      node("div", {}, results ? plan(outputs) : null, files(outputs))),
    results ? more(results) : null))]);
}

/** @param {string} stamp @param {() => void} again */
async function bring(stamp, again) {
  read = { stamp, results: null };
  if (!stamp) return;
  try {
    const results = /** @type {Results} */ (await find("/results.json"));
    if (read.stamp !== stamp) return; // superseded by newer ones
    read = { stamp, results };
  } catch {
    return; // files of an older version: their links remain
  }
  again();
}

/** @param {Results} results */
const headline = ({ level, headline: words, first, counts, case: about, made }) => node("div", { class: "headline", "data-level": level ?? "none" },
  node("p", { class: "sentence" }, node("span", { class: "sign", "aria-hidden": "true" }, SIGNS[level ?? "none"]), words),
  first ? node("p", { class: "first" }, first) : null,
  node("p", { class: "dim" }, [...about.map(([word, text]) => `${word}: ${text}`), counts, `Written ${made.slice(0, 16).replace("T", " ")} UTC`].join(" \u00b7 ")));

/** @param {Results} results */
function measurements({ measurements: rows }) {
  const kinds = new Set(rows.map(({ kind }) => kind));
  if (!rows.length) return node("p", {}, "Nothing was measured: use Distance, Area or another tool, and write the results again.");
  return table("Results", [kinds.size === 1 ? [...kinds][0] : "measurement", "value", "true in 19 of 20 cases within", "status"], rows.map((one) => tableRow({}, cell({}, node("b", {}, one.name), " ", node("span", { class: "dim" }, kinds.size > 1 ? `${one.kind} ` : "", one.points.join(" \u2013 "))),
    cell({ class: one.status === "contradicted" ? "is-contradicted" : "" }, node("b", {}, one.value), one.others ? node("div", { class: "dim" }, one.others) : null), one.interval, cell({ class: `status ${one.status}` }, one.words))));
}

/** @param {Outputs} outputs */
const plan = ({ stamp }) => node("a", { class: "plan", href: keyed("/output/report.html"), ...inNewTab, title: "Open the report" },
  node("img", { src: keyed(`/plan.svg?of=${stamp}`), alt: "Plan of points, lengths and measurements, to scale; it is in the report too", onerror: ({ target }) => { if (target instanceof HTMLElement) target.hidden = true; } }));

/** @param {string} href @param {string} words @param {Record<string, Attribute>} attributes */
const link = (href, words, attributes = {}) => node("a", { href: keyed(href), ...attributes }, words);
const inNewTab = { target: "_blank", rel: "noopener" };

/** @param {Outputs} outputs */
function files({ files: all, recording, folder }) {
  const [shown, saved] = [all.filter(({ name }) => name.endsWith(".html")), all.filter(({ name }) => !name.endsWith(".html"))];
  return node("nav", { "aria-label": "Outputs", class: "files" },
    node("div", { class: "main-files" }, ...shown.map(({ name, words }, k) => link(`/output/${name}`, words, { ...inNewTab, class: k ? "" : "as-button" })),
      recording ? link("/recording", "Recording in the Rerun viewer", inNewTab) : null),
    shown.length ? node("p", { class: "dim" }, "To print a report, or to keep it as a PDF, open it and press Ctrl+P.") : null,
    saved.length ? node("ul", { "aria-label": "Files to save" }, ...saved.map(({ name, words }) => node("li", {}, link(`/output/${name}`, words, { download: name })))) : null,
    all.length ? node("p", { class: "dim" }, "All in ", node("code", {}, folder)) : null);
}

/** @param {Results} results */
const more = ({ others, scale }) => node("div", { class: "why-so" }, scale ? node("p", {}, scale) : null,
  others.length ? node("details", { open: others.length < 4 }, node("summary", {}, `What else is to be known (${others.length})`), list(others.map((text) => ({ level: /** @type {const} */ ("warning"), text })))) : null);
