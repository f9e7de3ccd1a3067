// The foot of the measurements tab: one click runs the project and writes all outputs.

import { acceptable } from "../actions/proposals.js";
import { adjusted, isSearching, store } from "../connection/store.js";
import { ageOfNumbers, light } from "../connection/trust.js";
import { fillIfNew, node } from "../elements/dom.js";
import { keep } from "../elements/table.js";

/** @import { Proposals } from "../actions/proposals.js" */
/** @import { ProjectActions } from "../actions/project_actions.js" */
/** @import { Outputs, Work } from "../connection/protocol.js" */
/** @typedef {Exclude<Work, "calibration">} Shown */

/** @param {Element} foot @param {boolean} isAsked whether this page asked for the results @param {() => void} exportAll @param {(work: Work) => void} stop @param {Proposals} found */
export function showOutputs(foot, isAsked, exportAll, stop, found) {
  const { outputs, stages, version } = store;
  if (!outputs) return;
  const exporting = isAsked || Boolean(stages.results);
  const work = exporting ? "results" : WORKS.find((one) => stages[one]) ?? null; // that is shown
  const old = outputs.files.length > 0 && outputs.version !== version;
  const { level } = light();
  const words = writeWords(level);
  const lost = ageOfNumbers() === "lost";
  const { all, words: acceptWords } = acceptable();
  const acceptAndWrite = () => { if (found.accept(all)) exportAll(); };
  const searching = isSearching();
  const made = keep("outputs", [outputs, old, work, level, words, lost, all, searching], () => node("div", {},
    node("div", { class: "row" },
      exporting ? null : node("button", { name: "export", class: level === "red" ? "unfit" : "main", "data-level": level, disabled: lost, title: "Save, compute everything once more, and write report, tables, drawings and recording (W)", onclick: exportAll },
        words),
      ...(work ? [node("span", { class: "stage", role: "status" }), node("button", { name: "stop-work", title: STOPS[work], onclick: () => stop(work) }, "Stop")] : []),
      all.length && !exporting && !lost ? node("button", { name: "accept-export", disabled: searching, title: "Look at their pictures in the list first", onclick: acceptAndWrite }, `${acceptWords}, and write`) : null,
      node("span", { class: "dim", role: "status" }, exporting || lost ? "" : searching && !work && store.photos.length > 1 ? "still looking in other photos" : age(outputs, old)))));
  if (foot.firstChild !== made) foot.replaceChildren(made);
  showStage(work);
}

/** Work in the background, the first of which is shown. @type {Exclude<Shown, "results">[]} */
const WORKS = ["adjustment", "search"];
/** @type {Record<Shown, string>} */
const STOPS = { results: "Earlier results stay as they are", adjustment: "Marks and lengths stay as they are", search: "What was found so far stays; your next change starts the search again" };
let begun = 0; // time at which the shown work began
/** @type {Shown | null} */
let shown = null;
let ticking = 0; // timer

// Shows the stage of long work, as the program names it, and how long it has taken.
/** @param {Shown | null} work */
function showStage(work) {
  if (work !== shown) begun = performance.now();
  shown = work;
  clearTimeout(ticking);
  const stage = document.querySelector("#outputs .stage");
  if (!work || !stage) return;
  const words = store.stages[work] || "save";
  stage.textContent = `${words.slice(0, 1).toUpperCase()}${words.slice(1)}\u2026 ${Math.round((performance.now() - begun) / 1000)} s`;
  ticking = setTimeout(() => showStage(work), 1000);
}

// The button for writing results shows how far they can be trusted.
/** @param {ReturnType<typeof light>["level"]} level */
function writeWords(level) {
  const count = adjusted()?.verdict.reasons ?? 0;
  if (level === "red") return "Write all the same: do not use these numbers";
  if (level === "amber") return count ? `Write results, with ${count} warning${count === 1 ? "" : "s"}` : "Write results: check them first";
  if (ageOfNumbers() === "lost") return "Nothing can be written: no connection";
  return level === "green" ? "Write results" : "Write results: not checked yet";
}

/** @param {Outputs} outputs @param {boolean} old */
function age(outputs, old) {
  if (!outputs.files.length) return "none yet";
  return old ? "older than what you see" : "up to date";
}

// Changes that an earlier session could not save, as another program had changed the tables.
/** @param {number} count @param {ProjectActions} project */
const offered = (count, project) => [
  node("p", {}, `An earlier session ended before it could save ${count === 1 ? "a change" : `${count} changes`}, and the files were changed since.`),
  node("p", { class: "dim" }, "Take makes the same changes now; Undo takes them back. Discard offers them no more; they stay in the output folder."),
  node("button", { name: "take-aside", onclick: () => void project.takeAside() }, "Take"),
  node("button", { name: "discard-aside", onclick: () => void project.ask({ t: "discard-aside" }) }, "Discard"),
];

// A bar shown as long as project files differ from the page's state, or cannot be saved.
/** @param {HTMLElement} bar @param {ProjectActions} project */
export function showOutside(bar, project) {
  const { outside, added, aside } = store;
  /** @type {string[]} */
  const words = [];
  if (store.gone) words.push("The program does not answer. Start it again as you did before, by the icon or by a command, and go on in the page that it opens. What it confirmed is saved; what you do here now would be lost.");
  else if (store.silent) words.push("The program is not answering. What you did in the last seconds is not saved yet: this page keeps it, and sends it as soon as the program answers. Leave the page open. If this stays, end the program and start it again; all that you did before is saved.");
  else if (store.fault) words.push(`Not saved: ${store.fault}`);
  else if (outside.length) words.push(`${outside.join(" and ")} ${outside.length > 1 ? "were" : "was"} changed or removed by another program. Nothing is written over. Reload takes the files as they are now. What only this page has is kept beside them, and undo begins anew.`);
  if (added) words.push(added);
  bar.hidden = !words.length && !aside;
  fillIfNew(bar, JSON.stringify([words, outside, aside]), () => [...words.map((one) => node("p", {}, one)), ...(outside.length || added ? [node("button", { name: "reload", onclick: () => void project.reload() }, "Reload")] : []), ...(aside ? offered(aside, project) : [])]);
}
