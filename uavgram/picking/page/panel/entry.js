// Forms for values that clicks cannot give: a length's reading, a skid's friction, a name.

import { TOOLS } from "../actions/keys.js";
import { freeName } from "../connection/store.js";
import { as, fillIfNew, node, textIn } from "../elements/dom.js";
import { meaning } from "../elements/numbers.js";
import { drop, keep } from "../elements/table.js";
import { DECIMAL_COMMA, fieldText, fieldUnit, LARGEST_M, parseLength, THOUSANDS, typedText, understood } from "../elements/units.js";
import { placeText, speedFacts } from "./speed.js";

/** @import { Entry, NewLine } from "../actions/page_state.js" */
/** @import { Tools } from "../actions/tools.js" */
/** @import { Measurement, SetLine, SetMeasurement } from "../connection/protocol.js" */
/** @import { Attribute } from "../elements/dom.js" */
/** @import { Sort } from "../elements/units.js" */

/** @type {Record<string, string>} */
export const KINDS = {
  distance: "Distance", polyline: "Polyline", area: "Area", angle: "Angle",
  line_distance: "Distance from a line", skid_speed: "Skid speed", coordinate: "Coordinate", speed: "Speed",
  height: "Height", horizontal_distance: "Level distance", vertical_distance: "Difference in height", slope: "Slope",
  plane_distance: "Distance from a plane", volume: "Volume", profile: "Profile",
};

/** @param {Entry | null} entry @param {Tools} tools */
export function entryPart(entry, tools) {
  if (!entry) {
    drop("entry");
    return null;
  }
  const form = keep("entry", entry, () => entryForm(entry, tools));
  if (entry.t === "measure" && entry.kind === "speed") showNeeds(form, entry.points, !entry.was, tools.coming.map((one) => one.label));
  return form;
}

/** @param {Entry} entry @param {Tools} tools */
function entryForm(entry, tools) {
  /** @param {string} name @param {string} caption @param {Attribute} value @param {Record<string, Attribute>} more */
  const field = (name, caption, value, more = {}) => node("label", { title: meaning(caption) }, caption, node("input", { name, value, required: true, autocomplete: "off", ...more }));
  const number = { inputmode: "decimal" };
  const name = field("name", "Name", entry.name, { maxlength: 200 });
  const title = entry.t === "line" ? `Taped length ${entry.start} \u2013 ${entry.end}` : `${KINDS[entry.kind]} ${entry.points.join(" \u2013 ")}`;
  const fields = entry.t === "line" ? [
    lengthField(field, "length_m", "Length", entry.length_m, "length", { placeholder: "none: computed" }), lengthField(field, "sigma_m", "Good to \u00b1", entry.sigma_m, "small"), name,
    node("label", {}, "Use", node("select", { name: "use" }, node("option", { value: "adjust", selected: entry.adjust !== false }, "to compute"),
      node("option", { value: "check", selected: entry.adjust === false }, "only to check"))),
  ] : [name, ...(entry.kind === "skid_speed" ? [
    field("mu", "Friction \u03bc", entry.parameters?.mu ?? "0.7", number), field("mu_sigma", "Uncertainty of \u03bc", entry.parameters?.mu_sigma ?? "0.05", number),
  ] : entry.kind === "volume" ? volumeFields(entry, field) : entry.kind === "speed" ? [node("div", { class: "both needs", role: "status", "aria-label": "What a speed needs" })] : [])];
  const what = entry.t === "line" ? `length ${entry.start} to ${entry.end}` : entry.name;
  return node("form", {
    class: "entry", "data-row": "entry", "aria-label": `${entry.was ? "Change" : "New"} ${what}`, novalidate: true,
    onsubmit: (event) => { event.preventDefault(); tools.entered(as(HTMLFormElement, event.target)); },
  }, node("p", { class: "both title" }, title), ...fields, node("p", { class: "both wrong", role: "alert", hidden: true }),
  node("div", { class: "both row" }, node("button", { type: "submit", title: `The next click in a photo does this, too${isNewLine(entry) ? "; without a length it is a distance that is computed" : ""}` }, entry.was ? "Change (Enter)" : "Add (Enter, next click)"),
    node("button", { type: "button", onclick: () => tools.cancel() }, "Cancel (Esc)")));
}

/** @typedef {(name: string, caption: string, value: Attribute, more?: Record<string, Attribute>) => HTMLElement} Field */

// A field for a length in the unit of the project, or in a unit typed behind the number.
/** @param {Field} field @param {string} name @param {string} caption @param {number | null | undefined} metres @param {Sort} sort @param {Record<string, Attribute>} more */
function lengthField(field, name, caption, metres, sort, more = {}) {
  const words = node("span", { class: "dim understood", role: "status" });
  const unit = fieldUnit(sort);
  const made = field(name, `${caption}, ${WORDS[unit]}`, fieldText(metres, sort), {
    inputmode: unit === "m" ? "decimal" : "text", ...more,
    oninput: ({ target }) => { words.textContent = understood(as(HTMLInputElement, target).value, sort); },
  });
  words.textContent = understood(fieldText(metres, sort), sort);
  made.append(words);
  return made;
}

/** @type {Record<string, string>} */
const WORDS = { m: "metres", ft: "feet", in: "inches" };

// Base surface of a volume, and whether all its points are on the boundary.
/** @param {Measurement} entry @param {Field} field */
function volumeFields({ parameters = {} }, field) {
  const base = "plane" in parameters ? "plane" : "level" in parameters ? "level" : "ground";
  const level = lengthField(field, "level", "Level, height", parameters.level, "length", { required: false });
  level.hidden = base !== "level";
  /** @param {string} value @param {string} words */
  const option = (value, words) => node("option", { value, selected: value === base }, words);
  return [
    node("label", {}, "Over", node("select", { name: "base", onchange: ({ target }) => { level.hidden = as(HTMLSelectElement, target).value !== "level"; } },
      option("ground", "the ground"), option("level", "a level"), option("plane", "a plane through the last three points"))),
    node("label", { class: "both" }, "Top", node("select", { name: "top" }, node("option", { value: "" }, "none: all points are around it"),
      node("option", { value: "1", selected: "top" in parameters }, "the last point (before those of the plane)"))),
    level,
  ];
}

// Shows photos and times of a speed, and obstacles to it, kept up to date while the form is open.
// Unconfirmed points are awaited.
/** @param {HTMLElement} form @param {string[]} points @param {boolean} isNew @param {string[]} coming */
function showNeeds(form, points, isNew, coming) {
  const waits = points.some((label) => coming.includes(label));
  const { seconds, why } = waits ? { seconds: null, why: "" } : speedFacts(points);
  const lines = [...points.map(placeText), ...(seconds ? [`Between the two photos: ${seconds.toFixed(2)} s`] : [])];
  as(HTMLButtonElement, form.querySelector("[type=submit]")).disabled = (waits || Boolean(why)) && isNew;
  fillIfNew(as(HTMLElement, form.querySelector(".needs")), [...lines, why].join("|"),
    () => [...lines.map((line) => node("p", { class: "dim" }, line)), ...(why ? [node("p", { class: "wrong" }, why)] : [])]);
}

const openForm = () => {
  const form = document.querySelector('form[data-row="entry"]');
  return form instanceof HTMLFormElement ? form : null;
};

// Returns the open form with typed input, which further actions must not lose.
export function typedForm() {
  const form = openForm();
  const isTyped = form && [...form.elements].some((one) => one instanceof HTMLInputElement && one.value !== one.defaultValue);
  return isTyped ? form : null;
}

/** @param {Entry} entry @returns {entry is NewLine} */
const isNewLine = (entry) => entry.t === "line" && !entry.was;

/** Whether it is a new line without a reading, which is a distance that is wanted. @param {Entry} entry @returns {entry is NewLine} */
export const isUnread = (entry) => isNewLine(entry) && !typedForm();

/** Returns the open form if the next click takes it: a new one that is complete, or a changed one. @param {Entry} entry */
export const formToTake = (entry) => (entry.was || openForm()?.querySelector("[type=submit]:disabled") ? typedForm() : openForm());

const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;

// Reads a number; a decimal comma is accepted if it is unambiguous, as in the program's readers.
/** @param {string} text */
export function parse(text) {
  const written = text.trim();
  const pointed = THOUSANDS.test(written) ? written : written.replace(DECIMAL_COMMA, ".");
  return NUMBER.test(pointed) ? Number(pointed) : NaN;
}

// Explains why a text is no number, or gives a valid example.
/** @param {string} text @param {string} example */
export function noNumber(text, example = "") {
  const written = text.trim();
  if (THOUSANDS.test(written)) return `Is ${written} meant as ${written.replace(",", ".")} or ${written.replace(",", "")}? Write it without a comma.`;
  return `${written || "nothing"} is no number.${example && ` Write it ${example}.`}`;
}

// Shows a fault beside the fields, and focuses the field concerned.
/** @param {HTMLFormElement} form @param {string} why @param {string} field */
export function showFault(form, why, field) {
  const box = as(HTMLElement, form.querySelector("[role=alert]"));
  box.textContent = why;
  box.hidden = false;
  for (const input of form.querySelectorAll("[aria-invalid]")) input.removeAttribute("aria-invalid");
  const input = as(HTMLInputElement, form.querySelector(`[name="${field}"]`));
  input.setAttribute("aria-invalid", "true");
  input.focus();
  input.select();
}

// Returns the message of a filled-in form, or the fault and its field. A line without a reading is a distance.
// `namesOf`: names of the others of a kind.
/**
 * @typedef {{ message: SetLine | SetMeasurement, why?: undefined, field?: undefined } | { message?: undefined, why: string, field: string }} Filled
 * @param {Entry} entry @param {HTMLFormElement} shown @param {(t: Entry["t"]) => string[]} namesOf @returns {Filled}
 */
export function entryMessage(entry, shown, namesOf) {
  if (isNewLine(entry) && !typedForm()) return { message: { t: "measure", was: "", name: freeName(TOOLS.distance.prefix, new Set(namesOf("measure"))), kind: "distance", points: [entry.start, entry.end] } };
  const form = new FormData(shown);
  const name = textIn(form, "name");
  const was = entry.was ?? "";
  if (!name) return { why: "It needs a name.", field: "name" };
  if (name !== was && namesOf(entry.t).includes(name)) return { why: `There is a ${entry.t === "line" ? "length" : "measurement"} ${name} already: choose another name.`, field: "name" };
  const read = numbersIn(form, wantedOf(entry, form));
  if (!read.found) return read;
  const { found } = read;
  if (entry.t === "line") return { message: { t: "line", was, name, start: entry.start, end: entry.end, length_m: found.length_m, sigma_m: found.sigma_m, adjust: form.get("use") === "adjust" } };
  return { message: { t: "measure", was, name, kind: entry.kind, points: entry.points, parameters: { ...found, ...flagsOf(entry, form) } } };
}

/** @typedef {{ field: string, caption: string, example: string, zero?: boolean, any?: boolean, sort?: Sort }} Wanted a number, of which `sort` a length is; `zero`, `any`: which ones will do beside those greater than 0 */

/** @param {Entry} entry @param {FormData} form */
const wantedOf = (entry, form) => NUMBERS[entry.t === "line" ? "line" : entry.kind === "volume" ? textIn(form, "base") : entry.kind] ?? [];

/** @param {FormData} form @param {Wanted[]} wanted @returns {{ found: Record<string, number> } | { found?: undefined, message?: undefined, why: string, field: string }} */
function numbersIn(form, wanted) {
  /** @type {Record<string, number>} */
  const found = {};
  for (const { field, caption, example, zero, any, sort } of wanted) {
    const value = sort ? parseLength(textIn(form, field), sort) : parse(textIn(form, field));
    if (Number.isNaN(value)) return { why: `${caption}: ${noNumber(textIn(form, field), (sort && EXAMPLES[fieldUnit(sort)]) || example)}`, field };
    if (!any && (value < 0 || (value === 0 && !zero))) return { why: `${caption}: enter a number greater than 0 (read: ${textIn(form, field)}).`, field };
    if (field === "length_m" && value > LARGEST_M) return { why: `${caption}: ${typedText(value)} is longer than any tape. Enter it ${EXAMPLES[fieldUnit()] ?? example}.`, field };
    found[field] = value;
  }
  return { found };
}

// Flags of a volume: whether its last points are a top and a plane.
/** @param {Entry} entry @param {FormData} form @returns {Record<string, number>} */
function flagsOf(entry, form) {
  if (entry.t === "line" || entry.kind !== "volume") return {};
  return { ...(textIn(form, "top") && { top: 1 }), ...(textIn(form, "base") === "plane" && { plane: 1 }) };
}

/** @type {Record<string, string | undefined>} */
const EXAMPLES = { ft: "in feet, such as 13.2 or 13 ft 2 1/2 in, or with its unit, such as 4.01 m", in: "in inches, such as 0.5, or with its unit, such as 1 cm" };

/** @type {Record<string, Wanted[] | undefined>} */
const NUMBERS = {
  line: [{ field: "length_m", caption: "Length", example: "in metres, such as 11.52", sort: "length" }, { field: "sigma_m", caption: "Sigma", example: "in metres, such as 0.01", sort: "small" }],
  level: [{ field: "level", caption: "Level", example: "in metres, such as 1.5", any: true, sort: "length" }],
  skid_speed: [{ field: "mu", caption: "Friction", example: "such as 0.7" }, { field: "mu_sigma", caption: "Uncertainty of the friction", example: "such as 0.05", zero: true }],
};
