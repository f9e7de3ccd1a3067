// The camera tab: parameters, remarks, and a calibration.

import { keyed } from "../connection/key.js";
import { adjusted, store } from "../connection/store.js";
import { as, node, textIn } from "../elements/dom.js";
import { meaning, SIGMA } from "../elements/numbers.js";
import { about, cell, fill, keep, list, table, tableRow, titled } from "../elements/table.js";

/** @import { ProjectActions } from "../actions/project_actions.js" */
/** @import { Calibration, Camera, Folder } from "../connection/protocol.js" */

/** @type {Record<string, string | undefined>} */
const LENSES = { brown: "ordinary", fisheye: "fisheye" };
const DICTIONARIES = [4, 5, 6, 7].flatMap((bits) => [50, 100, 250, 1000].map((size) => `DICT_${bits}X${bits}_${size}`));

/** @param {Element} section @param {Folder[]} folders @param {ProjectActions} project */
export function showCamera(section, folders, project) {
  const { camera, calibration } = store;
  if (camera) fill(section, () => [knownPart(camera, project), formPart(folders, project), calibration ? keep("calibration", calibration, () => runShown(calibration, project)) : null]);
}

/** @param {Camera} camera @param {ProjectActions} project */
function knownPart(camera, project) {
  const learnt = (adjusted()?.messages ?? []).filter(({ code }) => code.startsWith("camera-") || code.startsWith("lens-"));
  const all = [...new Map([...camera.messages, ...learnt].map((message) => [message.text, message])).values()];
  return keep("camera", [camera, all], () => {
    const rows = camera.parameters.map((words) => tableRow({}, ...words.map((one) => cell({ title: meaning(one) }, one === "\u2013" ? "" : one))));
    const [warnings, others] = [all.filter(({ level }) => level !== "info"), all.filter(({ level }) => level === "info")];
    return node("div", {}, warnings.length ? titled(`Warnings (${warnings.length})`, list(warnings)) : null,
      titled("Camera", node("p", {}, `${camera.name}: ${camera.width_px} \u00d7 ${camera.height_px} px, `, about(`${LENSES[camera.model] ?? camera.model} lens`, meaning(camera.model) ?? ""), camera.file && ` (${camera.file})`),
        ...camera.source.map((line) => node("p", { class: "dim" }, line)),
        node("p", {}, node("button", { name: "setup", onclick: () => void project.leave("setup") }, "Change camera, mount, tape or case")),
        table("What the lens does", ["parameter", "value", about("(\u00b1)", SIGMA), about("(\u00b1), share", "the uncertainty as a share of the value")], rows)),
      titled("What that means", node("dl", { class: "facts" }, ...camera.facts.flatMap((line) => {
        const [, name, words] = /^(.*?) {2,}(.*)$/.exec(line) ?? ["", "", line];
        return [node("dt", { title: meaning(name) }, name), node("dd", {}, words)];
      })), others.length ? list(others) : null));
  });
}

/** @param {string | number} value @param {string} words */
const option = (value, words) => node("option", { value }, words);

/** @param {Folder[]} folders @param {ProjectActions} project */
function formPart(folders, project) {
  return keep("calibrate", folders, () => {
    /** @param {string} name @param {string} caption @param {string} value @param {string} kind */
    const field = (name, caption, value, kind = "") => node("label", { class: kind }, caption, node("input", { name, value, inputmode: "decimal", autocomplete: "off", required: true }));
    const form = node("form", {
      class: "entry", "data-row": "calibrate", "aria-label": "Calibration", "data-kind": "chessboard",
      onsubmit: (event) => { event.preventDefault(); void project.calibrate(new FormData(form)); },
    },
    node("label", { class: "both" }, "Folder with photos of a board", node("select", { name: "folder", required: true },
      ...folders.map((one) => option(one.id, `${one.name}: ${one.photos} photo files, ${one.width_px} \u00d7 ${one.height_px} px`)))),
    node("label", {}, "Board", node("select", { name: "kind", onchange: (event) => { form.dataset.kind = as(HTMLSelectElement, event.target).value; } }, option("chessboard", "Chessboard"), option("charuco", "ChArUco"))),
    node("label", {}, "Lens", node("select", { name: "model" }, ...Object.entries(LENSES).map(([model, words]) => option(model, words ?? model)))),
    field("columns", "Inner corners across", "9", "chess"), field("rows", "Inner corners down", "6", "chess"),
    field("across", "Squares across", "8", "charuco"), field("down", "Squares down", "6", "charuco"),
    field("square", "Side of a square, mm", "25"), field("marker", "Side of a marker, mm", "18", "charuco"),
    node("label", { class: "both charuco" }, "Markers", node("select", { name: "dictionary" }, ...DICTIONARIES.map((one) => option(one, one)))),
    node("div", { class: "both row" }, node("button", { type: "submit", disabled: !folders.length }, "Start"),
      node("button", { type: "button", onclick: () => void project.listFolders() }, "Look again")));
    return titled("Calibrate on a folder", folders.length ? null : node("p", { class: "dim" }, "No folder in the project's folder or beside it holds three photos. Copy those of the board there."), form);
  });
}

/** @param {Calibration} run @param {ProjectActions} project */
function runShown(run, project) {
  if (run.state === "running") {
    return titled("Calibration", node("p", { role: "status" }, `${run.what}: ${run.done} of ${run.total}`),
      node("div", { class: "row" }, node("progress", { max: run.total, value: run.done, "aria-label": run.what }), node("button", { onclick: () => void project.ask({ t: "stop-work", work: "calibration" }) }, "Stop")));
  }
  if (run.state === "failed") return titled("Calibration", node("p", { class: "why", role: "alert" }, run.why));
  const { width_px, height_px } = store.photos[0];
  const fits = run.width_px === width_px && run.height_px === height_px;
  const use = fits
    ? [node("p", {}, "To use it, put ", node("code", {}, `camera: ${run.file}`), " in the project file, or"),
      node("button", { onclick: () => void project.useCamera() }, "Use it in the project")]
    : [node("p", { class: "why" }, `It is for ${run.width_px} \u00d7 ${run.height_px} px, the project's photos have ${width_px} \u00d7 ${height_px}: it is not theirs.`)];
  return titled("Calibration", node("p", { role: "status" }, run.verdict), list(run.reasons.map((text) => ({ level: /** @type {const} */ ("warning"), text }))), node("p", { class: "dim" }, run.counts),
    node("dl", { class: "facts" }, ...run.facts.flatMap(([question, answer]) => [node("dt", {}, question), node("dd", {}, answer)])),
    node("p", {}, "Written: ", node("code", {}, run.file), ". ", node("a", { href: keyed("/calibration"), target: "_blank", rel: "noopener" }, "Open its report")), ...use);
}

// The board in the notation of the command line.
/** @param {FormData} form */
export function boardText(form) {
  /** @param {string} name */
  const get = (name) => textIn(form, name);
  if (get("kind") === "chessboard") return `chessboard:${get("columns")}x${get("rows")}:${get("square")}mm`;
  return `charuco:${get("across")}x${get("down")}:${get("square")}mm:${get("marker")}mm:${get("dictionary")}`;
}
