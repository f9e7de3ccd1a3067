// Buttons in rows of tables and lists.

import { node } from "./dom.js";

/** @import { Attribute, Child } from "./dom.js" */

/** A sign. `what`: its words for readers of the screen, and as a tooltip unless there is a `title`. @param {string} name @param {string} what @param {string} sign @param {() => void} act @param {Record<string, Attribute>} more */
export const signButton = (name, what, sign, act, more = {}) => node("button", { class: "small", name, "aria-label": what, title: what, onclick: act, ...more }, sign);

/** A name that leads to its object. @param {string} name @param {Child} words @param {() => void} act @param {Record<string, Attribute>} more */
export const linkButton = (name, words, act, more = {}) => node("button", { class: "link", name, onclick: act, ...more }, words);
