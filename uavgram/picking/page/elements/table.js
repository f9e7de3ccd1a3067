// Tables and lists of the panel, and reuse of unchanged parts.

import { isSuspect } from "../connection/store.js";
import { signButton } from "./buttons.js";
import { alike, arrange, fillIfNew, node } from "./dom.js";
import { explained, fixed } from "./numbers.js";

/** @import { Remark, Trust } from "../connection/protocol.js" */
/** @import { Attribute, Child } from "./dom.js" */
/** @typedef {{ name: string, row: string | undefined, table: string | null | undefined, place: number }} Focus a field or button of a section */

const LONG = 9; // number of rows from which on a table scrolls by itself

/** @type {Map<string, { sign: string, made: HTMLElement }>} */
const kept = new Map();

/** The field in which a text is being typed that is not taken yet. @type {EventTarget | null} */
let typing = null;
addEventListener("input", ({ target }) => { typing = target; });
for (const end of ["change", "focusout"]) addEventListener(end, () => { typing = null; }, true);

// Returns the existing part, with what is new in its content. It is not touched while a text is being typed in it.
/** @param {string} name @param {unknown} sign @param {() => HTMLElement} make */
export function keep(name, sign, make) {
  const before = kept.get(name);
  const now = JSON.stringify(sign);
  if (before && (before.sign === now || (typing instanceof Node && before.made.contains(typing)))) return before.made;
  const made = before ? alike(before.made, make()) : make();
  kept.set(name, { sign: now, made });
  return made;
}

/** @param {string} name */
export const drop = (name) => { kept.delete(name); };

// Shows parts in a section, and keeps the focus, or moves it on if its row is gone.
/** @param {Element} section @param {() => (HTMLElement | null)[]} make */
export function fill(section, make) {
  const focus = focusIn(section);
  arrange(section, make().filter((part) => part !== null));
  restore(section, focus);
}

/** @param {Element | null | undefined} at */
const isField = (at) => at instanceof HTMLInputElement || at instanceof HTMLButtonElement || at instanceof HTMLSelectElement;

/** @param {Element} section @returns {Focus | null} */
function focusIn(section) {
  const at = document.activeElement;
  if (!isField(at) || !section.contains(at) || !at.name) return null;
  /** @type {HTMLElement | null} */
  const row = at.closest("[data-row]");
  const rows = rowsOf(row?.closest("tbody"));
  return { name: at.name, row: row?.dataset.row, table: row?.closest("table")?.getAttribute("aria-label"), place: rows.findIndex((one) => one === row) };
}

// Rows of items, without the rows of remarks beneath them.
/** @param {Element | null | undefined} body */
const rowsOf = (body) => [...(body?.querySelectorAll("tr[data-row]") ?? [])];

// The focused row; if its button removed it, the row in its place, or the last.
/** @param {Element} section @param {Focus} focus */
function rowOf(section, { name, row, table: caption, place }) {
  const same = section.querySelector(`[data-row="${CSS.escape(row ?? "")}"]`);
  if (same || name !== "remove") return same;
  const rows = rowsOf(section.querySelector(`table[aria-label="${caption}"] tbody`));
  return rows[Math.min(place, rows.length - 1)];
}

/** @param {Element} section @param {Focus | null} focus */
function restore(section, focus) {
  if (!focus) return;
  const scope = focus.row === undefined ? section : rowOf(section, focus);
  const at = scope?.querySelector(`[name="${focus.name}"]`);
  if (!isField(at) || at === document.activeElement) return;
  at.focus({ preventScroll: true });
}

// A long table scrolls in its own box, so that the parts beneath it stay in reach.
/** @param {string} caption @param {(string | Node)[]} heads @param {Node[]} rows */
export function table(caption, heads, rows) {
  const made = node("table", { "aria-label": caption },
    node("thead", {}, node("tr", {}, ...heads.map((head) => node("th", { scope: "col" }, head)))),
    node("tbody", {}, ...rows));
  return node("div", made.querySelectorAll("tr[data-row]").length > LONG ? { class: "scroll", tabindex: 0, role: "region", "aria-label": `${caption}, scrolls` } : {}, made);
}

/** A row; what is no cell becomes one. @param {Record<string, Attribute>} attributes @param {...Child} cells */
export const tableRow = (attributes, ...cells) => node("tr", attributes, ...cells.map((cell) => (cell instanceof HTMLTableCellElement ? cell : node("td", {}, cell))));

/** A cell, by default for a number that `withValues` fills in. @param {Record<string, Attribute>} attributes @param {...Child} content */
export const cell = (attributes = { class: "value" }, ...content) => node("td", attributes, ...content);

// A word with an explanation as a tooltip.
/** @param {string} words @param {string} meaning */
export const about = (words, meaning) => node("span", { class: "about", title: meaning }, words);

/** @param {string} title @param {...Child} parts */
export const titled = (title, ...parts) => node("div", { class: "part" }, node("h2", {}, title), ...parts);

/** A part that unfolds, with the number of its entries. @param {string} title @param {number} count @param {Record<string, Attribute>} attributes @param {...Child} parts */
export const folded = (title, count, attributes, ...parts) => node("details", { class: "part", "aria-label": title, ...attributes }, node("summary", {}, `${title} (${count})`), ...parts);

/** @param {string} what @param {() => void} act */
export const remove = (what, act) => signButton("remove", `Remove ${what}`, "\u00d7", act);

// `more`: content beneath a message, such as a button for its remedy.
/** @template {Pick<Remark, "level" | "text"> & Partial<Remark>} M @param {M[]} messages @param {(message: M) => Node | null} more */
export const list = (messages, more = () => null) => node("ul", { class: "messages" }, ...messages.map((message) => node("li", { class: message.level, title: explained(message.text) }, message.text, message.code ? node("small", { class: "code" }, ` ${message.code}`) : null, more(message))));

// Updates the numbers in the cells of an existing part: making it anew at each move of a drag takes too
// long, and so do cells with unchanged content. `sign`: content of a row's cells.
/** @param {HTMLElement} part @param {{ sign: unknown[], make: () => (string | Element)[][] }[]} rows */
export function withValues(part, rows) {
  if (part.querySelectorAll("tr[data-row]").length !== rows.length) return part; // it is kept, as a text is being typed in it
  const cells = part.querySelectorAll("td.value");
  const each = cells.length / rows.length;
  rows.forEach(({ sign, make }, row) => {
    const now = JSON.stringify(sign);
    /** @type {(string | Element)[][] | null} */
    let made = null;
    for (let k = 0; k < each; k += 1) fillIfNew(cells[row * each + k], now, () => (made ??= make())[k]);
  });
  return part;
}

// A value with its status: grey or struck out if it is not reliable, with the reason as a tooltip.
/** @param {Trust | undefined} trust @param {...(Node | string)} value */
export const trusted = (trust, ...value) => node("span", { class: `is-${trust?.status ?? "ok"}`, title: trust?.why }, ...value);

// The sign of a status that is not ok; nothing otherwise. `words`: whether it is written beside the sign.
/** @param {Trust | undefined} trust @param {boolean} spelt */
export function standingSign(trust, spelt = false) {
  if (!trust?.words) return null;
  return node("span", { class: `standing ${trust.status}`, title: `${trust.words}: ${trust.why}`, role: spelt ? null : "img", ...(spelt ? {} : { "aria-label": trust.words }) }, spelt ? trust.words : "");
}

// A remark beneath a row, over its whole width; empty ones take no room.
/** @param {number} columns @param {string} kind */
export const beneath = (columns, kind = "") => node("tr", { class: "beneath" }, node("td", { class: kind, colspan: columns }));

// `why`: tooltip.
/** @param {number | null | undefined} w @param {string | undefined} status */
export function wCell(w, status, why = "") {
  if (w === null || w === undefined) return "";
  const words = fixed(w, Math.abs(w) < 100 ? 1 : 0); // a large value needs its room
  if (isSuspect(status)) return node("span", { class: "bad", title: why || "suspect" }, `\u25c6 ${words}`);
  return why ? node("span", { title: why }, words) : words;
}
