// The selected point, and its pick in this photo: statements of a person about them, and its adjusted
// height.

import { roving } from "../actions/keys.js";
import { adjusted, heightOf, pickAt, picksOf, stale, standsAt, store } from "../connection/store.js";
import { as, fillIfNew, node } from "../elements/dom.js";
import { meaning } from "../elements/numbers.js";
import { keep } from "../elements/table.js";
import { fieldText, fieldUnit, parseLength } from "../elements/units.js";
import { madeBy } from "../photos/sources.js";
import { editsPart, editsSign } from "./label_edits.js";

/** @import { PageState } from "../actions/page_state.js" */
/** @import { Tools } from "../actions/tools.js" */
/** @import { Height, Pick } from "../connection/protocol.js" */

/** @param {PageState} state @param {number | undefined} image @param {Tools} tools */
export function pointPart(state, image, tools) {
  const { selected: label, entry } = state;
  if (!label || entry || image === undefined || !picksOf(label).length) return null;
  const pick = pickAt(image, label);
  const height = heightOf(label);
  const form = keep("pick", [image, label, pick && madeBy(pick), height.height_m, height.height_sigma_m, height.is_free, editsSign(label)],
    () => pointForm(label, pick, height, tools, editsPart(label, image, state, tools)));
  showHeight(as(HTMLElement, form.querySelector(".stands")), label, tools);
  return form;
}

/** @param {string} label @param {Pick | undefined} pick @param {Height} height @param {Tools} tools @param {HTMLElement | null} edits */
function pointForm(label, pick, { height_m, height_sigma_m = null, is_free }, tools, edits) {
  const { heights, state: { refusedName } } = tools;
  const refused = refusedName?.label === label ? refusedName.name : null;
  /** @param {string} name @param {string} caption @param {number | string | null} value @param {string} usual @param {(value: number | null) => void} act @param {(text: string) => number} [read] */
  const field = (name, caption, value, usual, act, read) => node("label", { title: meaning(caption) }, caption, node("input", {
    name, value: value ?? "", inputmode: "decimal", placeholder: usual, autocomplete: "off", onchange: ({ target }) => tools.number(as(HTMLInputElement, target), act, read),
  }));
  const stated = field("height", `Height over ground, ${fieldUnit()}`, fieldText(height_m), is_free ? "from photos" : "0", (value) => heights.set(label, value, height_sigma_m), parseLength);
  /** @param {string} words @param {string} title @param {boolean} chosen @param {() => void} act */
  const choice = (words, title, chosen, act) => node("button", { type: "button", role: "radio", name: words, title, "aria-checked": chosen, tabindex: chosen ? 0 : -1, onclick: act }, words);
  const choices = node("div", { class: "both group", role: "radiogroup", "aria-label": "Height" },
    choice("On the ground", "It lies on the ground (Q)", !is_free && height_m === null, () => heights.set(label, null)),
    choice("As stated", "Its height over the ground was measured: type it", height_m !== null, () => as(HTMLElement, stated.lastChild).focus()),
    choice("Free", "Its height is found from two or more photos (Q)", Boolean(is_free), () => heights.free([label])));
  roving(choices);
  return node("form", { class: "entry", "data-row": "pick", "aria-label": `Point ${label}`, onsubmit: (event) => { event.preventDefault(); if (!tools.question.isOpen) tools.panes.active?.focus(); } },
    node("label", { class: "both" }, "Label", node("input", { name: "rename", value: refused ?? label, "aria-invalid": refused ? "true" : null, maxlength: 200, autocomplete: "off", onchange: ({ target }) => renamed(label, as(HTMLInputElement, target), tools) })),
    pick && field("sigma", "Likely error (\u00b1), px", pick.sigma_px, `${store.pickSigmaPx}`, (sigma_px) => tools.send({ t: "sigma", image: pick.image, label, sigma_px })),
    pick?.source ? node("p", { class: "both dim made" }, `${madeBy(pick)}. Move it, and it is yours.`) : null,
    stated,
    height_m === null ? null : field("height_sigma", `Uncertainty of the height, ${fieldUnit("small")}`, fieldText(height_sigma_m, "small"), "exact", (sigma) => heights.set(label, height_m, sigma), (text) => parseLength(text, "small")),
    choices, edits, node("div", { class: "both stands", role: "status", "aria-label": "How high it stands" }),
    node("button", { type: "submit", hidden: true }, "Done")); // without it Enter would not submit the form
}

// Keeps the valid name in the field until the new one is confirmed.
/** @param {string} label @param {HTMLInputElement} field @param {Tools} tools */
function renamed(label, field, { edits, state }) {
  state.refusedName = null;
  edits.rename(label, field.value);
  Object.assign(field, { value: label });
}

// Shows the adjusted height of the point, or why it cannot be found.
/** @param {HTMLElement} box @param {string} label @param {Tools} tools */
function showHeight(box, label, tools) {
  const stands = standsAt(label);
  const words = stands?.sentence ?? "";
  const told = offGround().includes(label);
  const why = told ? "Nobody said so: its picks fit at that height, and not on the ground." : unfound(label);
  fillIfNew(box, JSON.stringify([label, words, told, why]), () => [
    ...(words ? [node("p", { class: "value" }, words)] : []),
    ...(why ? [node("p", { class: "wrong" }, why)] : []),
    ...(told ? [node("button", { type: "button", name: "free", onclick: () => tools.heights.free([label]) }, "Free its height (Q)")] : []),
  ]);
}

const OFF_GROUND = "point-off-ground"; // code of the message about them

// Labels that fit off the ground without a stated height.
function offGround() {
  const all = (store.live?.messages ?? []).flatMap(({ code, labels }) => (code === OFF_GROUND ? labels ?? [] : []));
  return all.filter((label) => picksOf(label).length && !heightOf(label).is_free);
}

// Returns why the height of a free point cannot be found; empty if it can, or if that is not known yet.
/** @param {string} label */
function unfound(label) {
  const now = adjusted();
  if (!now || stale() || !heightOf(label).is_free || now.points[label]) return "";
  if (picksOf(label).length === 1) return "Not used: one photo does not tell its height. Pick it in a second photo, taken from further aside, or state its height.";
  const told = now.messages.find(({ code, labels }) => code === "pick-left-out" && labels?.includes(label));
  return told?.labels?.length === 1 ? told.text : "Not used: its photos look from nearly one place. Pick it in one from further aside, or state its height.";
}
