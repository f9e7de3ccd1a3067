// Set-up of a project: the files found in the folder, and data that only a person knows: camera, mount, tape, case.

import { keyed } from "../connection/key.js";
import { as, node, textIn } from "../elements/dom.js";
import { keepSet } from "./unsent_settings.js";
import { anglesIn, mountPart } from "./mount.js";
import { WrongField } from "./server.js";

/** @import { Child } from "../elements/dom.js" */
/** @import { Found, FoundPhotos, Wanted } from "../connection/protocol.js" */
/** @import { Doubt } from "../connection/tab_memory.js" */

const [CM, INCH] = [0.01, 0.0254];
/** @type {[string, string, string][]} */
const CASE = [["number", "Case number", ""], ["title", "What it is about", "such as Collision, two cars"], ["place", "Place", ""], ["date", "Date", "of the flight"], ["agency", "Agency", ""]];

/** @typedef {{ size: string, photos: FoundPhotos[], index: number }} Kind photos of one size, and of different names: a project has one */

/** @param {FoundPhotos[]} photos @returns {Kind[]} */
function kindsOf(photos) {
  /** @type {Map<number, Kind>} */
  const kinds = new Map();
  photos.forEach((one, index) => {
    const kind = kinds.get(one.kind);
    if (kind) kind.photos.push(one);
    else kinds.set(one.kind, { size: `${one.width_px} \u00d7 ${one.height_px}`, photos: [one], index });
  });
  return [...kinds.values()].sort((a, b) => countOf(b) - countOf(a));
}

/** @param {Kind} kind */
const countOf = ({ photos }) => photos.reduce((sum, { count }) => sum + count, 0);

/** @param {Element} section @param {Found} found @param {{ begin: (wanted: Wanted, hasLengths: boolean) => void, again: () => void, back: () => void, wrong: (fault: unknown) => void }} act */
export function showSetup(section, found, act) {
  const kinds = kindsOf(found.photos);
  const heading = node("h2", { id: "setup-title", tabindex: -1 }, found.has_project ? `${found.name}: a project is here already` : found.name);
  if (!kinds.length || found.fault) {
    section.replaceChildren(heading, node("div", { class: "none", role: "alert" }, ...(found.fault ? unreadable(found.fault, act) : nothing(found))), bar(found, act));
    return;
  }
  const form = node("form", { novalidate: true, onsubmit: (event) => { event.preventDefault(); begin(event instanceof SubmitEvent && event.submitter?.getAttribute("name") === "begin"); } });
  const begin = (/** @type {boolean} */ hasLengths) => {
    try {
      act.begin(wantedOf(found, kinds, new FormData(form)), hasLengths && !found.has_project);
    } catch (fault) {
      act.wrong(fault);
    }
  };
  const camera = node("div", {});
  const mount = node("div", {});
  /** @param {Kind} kind */
  const showKind = (kind) => {
    camera.replaceChildren(...cameraPart(found, kind));
    mount.replaceChildren(mountPart(found, kind.photos));
  };
  showKind(kinds[0]);
  form.append(
    node("div", { class: "columns" },
      node("div", { class: "found" }, unusablePart(found), photosPart(found, kinds, showKind), filesPart(found), camera, otherPart(found)),
      node("div", { class: "asked-for" }, mount, tapePart(found), casePart(found))),
    bar(found, act, true));
  section.replaceChildren(heading, node("p", { class: "dim path" }, found.path), form);
  keepSet(form, found);
}

/** @param {string} fault @param {{ again: () => void }} act @returns {Node[]} */
const unreadable = (fault, act) => [node("p", {}, "The project in this folder cannot be read:"), node("p", {}, fault),
  node("p", {}, "Correct the file with a text editor, and read it again. Or move it out of the folder: then this page asks anew how the camera hung, and makes another."),
  node("button", { type: "button", name: "again", onclick: () => act.again() }, "Read it again")];

/** @param {Found} found @returns {Node[]} */
const nothing = ({ unusable, passed_over }) => [node("p", {}, `There are no photos (.jpg, .png, .tif)${unusable.length ? " that can be used" : ""} in this folder, nor in the folders in it.`),
  ...unusable.map((why) => node("p", {}, why)),
  node("p", {}, "Choose the folder of the flight, or copy the photos from the memory card into it."), ...(passed_over ? [node("p", { class: "dim" }, passed_over)] : [])];

/** @param {Found} found @param {{ back: () => void }} act @param {boolean} [isReady] */
const bar = ({ has_project }, act, isReady = false) => node("div", { class: "bar" }, node("button", { type: "button", name: "back", onclick: () => act.back() }, "Another folder"),
  isReady ? node("button", { type: "submit", name: "begin", class: "main" }, has_project ? "Open the project" : "Begin with the taped lengths") : null,
  isReady && !has_project ? node("button", { type: "submit", name: "mark" }, "No lengths: mark points") : null);

/** @param {string} title @param {...Child} parts */
const box = (title, ...parts) => node("fieldset", {}, node("legend", {}, title), ...parts);

// Damaged files, by name: without them the project differs from the one that was intended.
/** @param {Found} found */
const unusablePart = ({ unusable }) => (unusable.length ? node("fieldset", { class: "unusable" }, node("legend", {}, "Cannot be used"), ...unusable.map((why) => node("p", {}, why))) : null);

/** @param {Found} found @param {Kind[]} kinds @param {(kind: Kind) => void} choose */
function photosPart({ number, has_project }, kinds, choose) {
  const picture = node("img", { alt: "The first photo", src: keyed(`/door/picture.jpg?folder=${number}&group=${kinds[0].index}`) });
  const isOneSize = new Set(kinds.map(({ size }) => size)).size === 1;
  /** @param {Kind} kind */
  const isTurned = ({ photos: [one] }) => one.width_px === kinds[0].photos[0].height_px && one.height_px === kinds[0].photos[0].width_px && one.width_px !== one.height_px;
  /** @param {Kind} kind */
  const words = (kind) => `${countOf(kind)} photo${countOf(kind) === 1 ? "" : "s"} of ${kind.size} px${isTurned(kind) ? ", turned by 90 degrees" : ""}, such as ${kind.photos[0].example}${isOneSize && kinds.length > 1 ? ` (${kind.photos.map(({ pattern }) => pattern).join(", ")})` : ""}`;
  if (kinds.length === 1 || has_project) return box("Photos", picture, node("p", {}, kinds.map(words).join("; ")));
  return box("Photos", picture, node("p", {}, isOneSize ? "Several folders have photos of the same file names, and a project tells photos apart by their file names. Choose the folder:" : "There are photos of several sizes, and a project has those of one camera. Choose the ones to use; the others take no part. Copy a turned photo from the camera once more to use it, too."),
    ...kinds.map((kind, k) => node("label", { class: "choice" }, node("input", { type: "radio", name: "kind", value: k, checked: k === 0, onchange: () => {
      picture.src = keyed(`/door/picture.jpg?folder=${number}&group=${kind.index}`);
      choose(kind);
    } }), words(kind))));
}

/** @param {string | number} value @param {string} words @param {boolean} [selected] */
const option = (value, words, selected = false) => node("option", { value, selected }, words);

// A single file of a kind is preselected; among several a person chooses.
/** @param {string} name @param {string[]} all @param {string} what @param {string} chosen empty: to be chosen @param {[string, string] | null} none how to choose none of them */
const oneOf = (name, all, what, chosen, none = null) => node("label", { class: "wide" }, chosen || all.length < 2 ? node("span", { class: "unseen" }, what) : `There are ${all.length}: choose the ${what} of these photos`,
  node("select", { name }, chosen ? null : option("", "choose\u2026", true), ...all.map((one) => option(one, one, one === chosen)), none ? option(...none, none[0] === chosen) : null));

const NO_LOG = "none";

/** @param {Found} found */
function filesPart({ logs, log, photos, poses, has_project }) {
  const all = [...new Set([...(log ? [log] : []), ...logs])];
  if (all.length) return box("Flight log", oneOf("log", all, "flight log", log ?? (has_project ? NO_LOG : all.length === 1 ? all[0] : ""), [NO_LOG, "none of these: work without a log"]));
  if (poses.length) return box("Places of the photos", has_project ? node("p", {}, poses.join(", ")) : oneOf("poses", poses, "file", poses.length === 1 ? poses[0] : ""));
  return box("Flight log", node("p", { class: "dim" }, photos.some(({ has_position }) => has_position) ? "None: the photos' own positions are used." : "None, and the photos state no positions: taped lengths alone are used."));
}

// Camera files for these photos, including the one that the project names.
/** @param {Found} found @param {Kind} kind */
function cameraFiles({ cameras, camera }, { photos: [{ width_px, height_px }] }) {
  const fitting = cameras.filter((one) => one.width_px === width_px && one.height_px === height_px).map(({ name }) => name);
  const named = camera && !["auto", "unknown"].includes(camera) ? [camera] : [];
  return { files: [...new Set([...named, ...fitting])], others: cameras.length - fitting.length };
}

/** @param {Found} found @param {Kind} kind @returns {Node[]} */
function cameraPart(found, kind) {
  const { camera, has_project } = found;
  const { files, others } = cameraFiles(found, kind);
  const said = kind.photos.find((one) => one.camera)?.camera ?? "";
  const likely = files.length ? files[1] ? "" : files[0] : said ? "auto" : "unknown";
  const chosen = camera ?? likely;
  return [box("Camera", node("label", { class: "wide" }, node("span", { class: "unseen" }, "Camera"), node("select", { name: "camera" },
    !has_project && files.length > 1 ? option("", "choose\u2026", true) : null,
    ...files.map((one) => option(one, `Calibration file ${one}`, one === chosen)),
    said || chosen === "auto" ? option("auto", `As the photos say${said ? `: ${said}` : ""}`, chosen === "auto") : null,
    option("unknown", "Not known: an ordinary drone camera", chosen === "unknown"))),
  node("p", { class: "dim" }, others ? `${others} calibration file${others === 1 ? " is" : "s are"} for photos of another size. ` : "", "A calibration gives the most exact values; one can be made later, under Camera."))];
}

/** @param {Found} found */
function otherPart({ gcp_lists, tables, passed_over, has_project }) {
  const points = gcp_lists.length && !has_project ? [node("label", { class: "choice" }, node("input", { type: "checkbox", name: "gcp", value: "yes", checked: true }), `Use the points with known coordinates of ${gcp_lists[0]}`),
    node("label", { class: "choice inner" }, "They are known to \u00b1", node("input", { name: "gcp_sigma", value: "2", size: 4, inputmode: "decimal", autocomplete: "off" }), "cm")] : [];
  if (!points.length && !tables.length && !passed_over) return null;
  return box("Also found", ...points, tables.length ? node("p", {}, tables.join(", ")) : null,
    passed_over ? node("details", {}, node("summary", {}, "What is not used"), node("p", { class: "dim" }, passed_over)) : null);
}

/** @param {Found} found */
function tapePart({ setup: { units, reading_sigma_m } }) {
  const unit = node("span", { class: "unit" });
  const sigma = node("input", { name: "sigma", size: 5, inputmode: "decimal", autocomplete: "off" });
  const isFeet = () => as(HTMLSelectElement, select).value === "imperial";
  /** @param {number} metres */
  const show = (metres) => {
    unit.textContent = isFeet() ? "inches" : "cm";
    sigma.value = `${Number((metres / (isFeet() ? INCH : CM)).toPrecision(3))}`;
  };
  const select = node("select", { name: "units", onchange: () => show(reading_sigma_m) },
    units ? null : option("", "as the project says", true), option("metric", "metres (and km/h)", units === "metric"), option("imperial", "feet and inches (and mph)", units === "imperial"));
  show(reading_sigma_m);
  return box("Tape", node("div", { class: "pair" }, node("label", {}, "Lengths are in", select), node("label", {}, "A reading of the tape is good to \u00b1", node("span", {}, sigma, " ", unit))));
}

/** @param {Found} found */
const casePart = ({ setup }) => node("details", { class: "case", open: Object.values(setup.case).some(Boolean) }, node("summary", {}, "Case, for the head of the report (may stay empty)"),
  node("div", { class: "pair" }, ...CASE.map(([key, words, hint]) => node("label", {}, words, node("input", { name: `case-${key}`, value: setup.case[key], maxlength: 200, autocomplete: "off", placeholder: hint || null })))));

/** @param {FormData} form @param {string} name @param {string} what */
function positive(form, name, what) {
  const written = textIn(form, name);
  const value = Number(written.replace(",", "."));
  if (!(value > 0)) throw new WrongField(`${what}: enter a number greater than 0 (read: ${written || "nothing"}).`, name);
  return value;
}

/** Fields of settings, where these have other names. @type {Record<string, string | undefined>} */
const FIELDS = { mount: "pitch", "mount.gimbal": "pitch", "mount.pitch_deg": "pitch", "mount.yaw_deg": "yaw", "mount.roll_deg": "roll", "tape.reading_sigma_m": "sigma" };

/** Shows at its field what the verdict doubts. @param {Element} section @param {Doubt} doubt */
export function showDoubt(section, { settings, why }) {
  const [setting] = settings.sort((a, b) => b.length - a.length); // the most particular one
  showAtField(section, { field: FIELDS[setting] ?? setting, message: why });
}

/** Shows what is wrong with a field beneath it; returns whether the field is there. @param {Element} section @param {{ field: string, message: string }} fault */
export function showAtField(section, { field, message }) {
  for (const one of section.querySelectorAll(".at-field")) one.remove();
  const input = section.querySelector(`[name="${CSS.escape(field)}"]`);
  if (!(input instanceof HTMLInputElement || input instanceof HTMLSelectElement)) return false;
  const words = node("span", { class: "at-field", role: "alert" }, message);
  const around = input.closest("details");
  if (around) around.open = true;
  (input.closest("label") ?? input.parentElement)?.append(words);
  input.addEventListener("input", () => words.remove(), { once: true });
  input.focus();
  input.scrollIntoView({ block: "center" });
  return true;
}

/** @param {Found} found @param {Kind[]} kinds @param {FormData} form @returns {Wanted} */
function wantedOf(found, kinds, form) {
  for (const [name, what] of [["log", "flight log"], ["poses", "file of the photos' places"], ["camera", "camera"]]) {
    if (form.has(name) && !textIn(form, name)) throw new Error(`Choose the ${what}: the folder holds several.`);
  }
  const units = textIn(form, "units");
  const kind = kinds[Number(textIn(form, "kind") || 0)];
  const isOneKind = kinds.length === 1;
  return {
    folder: found.number, images: isOneKind ? [] : kind.photos.flatMap(({ pattern, names }) => (names.length ? names : [pattern])),
    log: textIn(form, "log") || null, poses: textIn(form, "poses") || null, camera: textIn(form, "camera") || null,
    gcp_list: textIn(form, "gcp") ? found.gcp_lists[0] : null, gcp_sigma_m: textIn(form, "gcp") ? positive(form, "gcp_sigma", "Points with known coordinates") * CM : 0.02,
    setup: {
      ...anglesIn(form), units: units === "metric" || units === "imperial" ? units : "",
      reading_sigma_m: Number((positive(form, "sigma", "Tape") * (units === "imperial" ? INCH : CM)).toPrecision(6)),
      case: Object.fromEntries(CASE.map(([key]) => [key, textIn(form, `case-${key}`)])),
    },
  };
}
