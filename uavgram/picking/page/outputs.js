// What stands at the foot of the measurements: one click runs the project and writes everything.

import { node } from "./format.js";
import { store } from "./store.js";
import { keep } from "./table.js";

const link = (href, words, more = {}) => node("a", { href, ...more }, words);
const aside = { target: "_blank", rel: "noopener" };

export function showOutputs(foot, desk) {
  const { outputs, version } = store;
  if (!outputs) return;
  const old = outputs.files.length > 0 && outputs.version !== version;
  const made = keep("outputs", [outputs, old, desk.exporting], () => node("div", {},
    node("div", { class: "row" },
      node("button", { name: "export", class: "main", disabled: desk.exporting, title: "Save, run the project, write report, tables, drawings and recording (W)", onclick: () => desk.exportAll() },
        desk.exporting ? "Writing\u2026" : "Write report and exports"),
      node("span", { class: "dim", role: "status" }, desk.exporting ? "" : age(outputs, old))),
    outputs.files.length || outputs.recording ? node("nav", { "aria-label": "Outputs" }, ...links(outputs)) : null));
  if (foot.firstChild !== made) foot.replaceChildren(made);
}

function age(outputs, old) {
  if (!outputs.files.length) return "none yet";
  return old ? "older than what you see" : "up to date";
}

function links({ files, recording, folder }) {
  const [shown, saved] = [files.filter(({ name }) => name.endsWith(".html")), files.filter(({ name }) => !name.endsWith(".html"))];
  return [
    ...shown.map(({ name, words }) => link(`/output/${name}`, words, aside)),
    recording ? link("/recording", "Recording in the Rerun viewer", aside) : null,
    ...saved.filter(({ name }) => name.endsWith(".csv")).map(({ name, words }) => link(`/output/${name}`, words, { download: name })),
    files.length && node("details", {}, node("summary", {}, "More"), node("ul", {}, ...saved.filter(({ name }) => !name.endsWith(".csv")).map(({ name, words }) => node("li", {}, link(`/output/${name}`, words, { download: name })))),
      node("p", { class: "dim" }, "All in ", node("code", {}, folder))),
  ].filter(Boolean);
}

// What an earlier session could not save, as another program had changed the tables.
const offered = (count, desk) => [
  node("p", {}, `An earlier session ended before it could save ${count === 1 ? "a change" : `${count} changes`}, and the files were changed since.`),
  node("p", { class: "dim" }, "Take makes the same changes now; Undo takes them back. Discard offers them no more; they stay in the output folder."),
  node("button", { name: "take-aside", onclick: () => desk.takeAside() }, "Take"),
  node("button", { name: "discard-aside", onclick: () => desk.discardAside() }, "Discard"),
];

// A bar that stays while files of the project differ from what the page shows, or cannot be saved.
export function showOutside(bar, desk) {
  const outside = store.outside ?? [];
  const words = [];
  if (store.gone) words.push("The program does not answer. Start uavgram pick again, and open the address that it prints. What it confirmed is saved; what you do here now would be lost.");
  else if (store.fault) words.push(`Not saved: ${store.fault}`);
  else if (outside.length) words.push(`${outside.join(" and ")} ${outside.length > 1 ? "were" : "was"} changed by another program. Nothing is written over.`);
  bar.hidden = !words.length && !store.aside;
  const sign = JSON.stringify([words, outside, store.aside]);
  if (bar.sign === sign) return;
  bar.sign = sign;
  bar.replaceChildren(node("p", {}, ...words), ...(outside.length ? [
    node("p", { class: "dim" }, "Reload takes the files as they are now. What only this page has is kept beside them, and undo begins anew."),
    node("button", { name: "reload", onclick: () => desk.reload() }, "Reload")] : []), ...(store.aside ? offered(store.aside, desk) : []));
}
