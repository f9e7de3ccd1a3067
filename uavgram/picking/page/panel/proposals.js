// Proposals in other photos that are not accepted yet, and labels to be picked by hand.

import { acceptable, MOST_SHOWN, ofLabel } from "../actions/proposals.js";
import { askedFor, isSearching, pickAt, picksOf, proposals, store } from "../connection/store.js";
import { linkButton, signButton } from "../elements/buttons.js";
import { node } from "../elements/dom.js";
import { fixed } from "../elements/numbers.js";
import { about, beneath, cell, drop, folded, keep, table, tableRow, titled } from "../elements/table.js";
import { spot } from "../photos/spot.js";

/** @import { PageState } from "../actions/page_state.js" */
/** @import { Tools } from "../actions/tools.js" */
/** @import { Asked, Proposal } from "../connection/protocol.js" */

const FEW = 6; // a list so short leaves room for the rest

/** @param {PageState} state @param {number | undefined} image the photo in use @param {Tools} tools @returns {(HTMLElement | null)[]} */
export function proposalParts(state, image, tools) {
  return [foundPart(state, image, tools), askedPart(state, tools)];
}

/** @param {PageState} state @param {number | undefined} image @param {Tools} tools */
function foundPart({ selected }, image, tools) {
  const all = first(proposals(), (one) => one.label === selected || (!selected && one.image === image));
  if (!all.length) {
    drop("found");
    return null;
  }
  return keep("found", [all, selected, image, isSearching()], () => titled(`Found by the program (${all.length})`,
    acceptButtons(all.filter(({ is_sure }) => is_sure), selected, tools),
    table("Found by the program", ["point", "photo", about("found", "from a pick in another photo, or as a target that the program recognised; unsure: look at the two pictures before you accept it"), about("(\u00b1) px", "of the place that was found, without what the first pick itself is off"), ""],
      all.slice(0, MOST_SHOWN).flatMap((one) => [foundRow(one, tools), picturesRow(one)])),
    more(all.length)));
}

const UNSURE = "Fewer than three photos show it with all that surrounds it: compare the two pictures. "; // beneath the row
const SURE = "Plates and targets, and points that three or more photos show with all that surrounds them. The others are left for you to look at";

/** @param {Proposal[]} sure @param {string | null} selected @param {Tools} tools */
function acceptButtons(sure, selected, { proposals: found }) {
  const own = ofLabel(selected);
  const { all, words } = acceptable();
  /** @param {string} name @param {string} caption @param {Proposal[]} some @param {string} key @param {string} title */
  const accept = (name, caption, some, key, title = key) => node("button", { name, title, disabled: isSearching(), onclick: () => found.acceptAll(some) }, caption, key ? node("span", { class: "key" }, key) : null);
  const isAll = all.length === sure.length;
  return node("div", { class: "row accept" },
    sure.length ? accept("accept-sure", `Accept all found surely (${sure.length})`, sure, isAll ? "Ctrl+Enter" : "", SURE) : null,
    isAll ? null : accept("accept-all", words, all, "Ctrl+Enter"),
    ...(selected && own.length ? [accept("accept-label", `Accept all of ${selected} (${own.length})`, own, "Shift+Enter"),
      node("button", { name: "refuse-label", title: `Take nothing of what was found of ${selected}`, onclick: () => found.refuseAll(selected) }, `Refuse all of ${selected}`)] : []));
}

/** @param {Proposal} one @param {Tools} tools */
function foundRow(one, tools) {
  const { image, label, sigma_px, score, source } = one;
  const { name } = store.photos[image];
  return tableRow({ "data-row": `found ${label} ${image}` }, cell({ title: label }, label), cell({ class: "named ended", title: name }, goButton(one, name.replace(/\.\w+$/, ""), tools)), cell({ class: one.is_sure ? "" : "is-doubtful", title: `${one.is_sure ? "" : UNSURE}${score === null ? "" : `Alike to ${fixed(100 * score, 0)}\u00a0%`}` }, `${source}${one.is_sure ? "" : ", unsure"}`), fixed(sigma_px, 2),
    cell({}, signButton("accept", `Accept ${label} in ${name}`, "\u2713", () => tools.proposals.accept([one]), { title: "Accept (full stop)" }),
      signButton("remove", `Refuse ${label} in ${name}`, "\u00d7", () => tools.proposals.refuse([[image, label]]), { title: "Refuse" })));
}

// The pick and the find side by side: a wrong one shows without a look at the other photo.
/** @param {Proposal} one */
function picturesRow({ image, label, u_px, v_px, from_image }) {
  const row = beneath(5, "spots");
  const pick = from_image === null ? undefined : pickAt(from_image, label);
  if (pick) row.firstElementChild?.append(spot(pick.image, pick.u_px, pick.v_px, `${label} as picked in ${store.photos[pick.image].name}`), "\u2192");
  row.firstElementChild?.append(spot(image, u_px, v_px, `${label} as found in ${store.photos[image].name}`));
  return row;
}

/** @param {PageState} state @param {Tools} tools */
function askedPart({ selected }, tools) {
  const all = first(askedFor(), (one) => one.label === selected).filter(({ label }) => picksOf(label).length);
  if (!all.length) {
    drop("asked");
    return null;
  }
  const rows = groups(all);
  return keep("asked", [all, selected], () => folded("Still to be picked by hand", all.length, { class: "part asked", open: rows.length <= FEW },
    node("ul", { class: "scroll", tabindex: 0, "aria-label": "What is still to be picked by hand" }, ...rows.slice(0, MOST_SHOWN).map((some) => askedRow(some, tools))), more(rows.length)));
}

/** Groups by point and reason. @param {Asked[]} all @returns {Asked[][]} */
function groups(all) {
  /** @type {Map<string, Asked[]>} */
  const found = new Map();
  for (const one of all) {
    const key = JSON.stringify([one.label, one.why]);
    found.set(key, [...(found.get(key) ?? []), one]);
  }
  return [...found.values()];
}

/** @param {Asked[]} some @param {Tools} tools */
function askedRow(some, tools) {
  const [{ label, why }] = some;
  const photos = some.flatMap((one, k) => [k ? ", " : " in ", goButton(one, store.photos[one.image].name, tools)]);
  return node("li", { "data-row": `asked ${label} ${why}` }, label, ...photos, node("span", { class: "dim" }, ` (${why})`),
    signButton("remove", `Do not ask for ${label} there`, "\u00d7", () => tools.proposals.refuse(some.map((one) => [one.image, one.label])), { title: "It is not to be seen there: do not ask again" }));
}

/** @param {{ image: number, label: string }} one @param {string} words @param {Tools} tools */
const goButton = ({ image, label }, words, tools) => linkButton("go", words, () => tools.proposals.goTo(image, label), { value: image, title: "Show where it is expected" });

/** @param {number} count */
const more = (count) => (count > MOST_SHOWN ? node("p", { class: "dim" }, `and ${count - MOST_SHOWN} more`) : null);

// Sorts the present ones first, then the others by label and photo.
/** @template {{ image: number, label: string }} T @param {T[]} all @param {(one: T) => boolean} isFirst */
function first(all, isFirst) {
  const order = all.sort((a, b) => a.label.localeCompare(b.label, undefined, { numeric: true }) || a.image - b.image);
  return [...order.filter(isFirst), ...order.filter((one) => !isFirst(one))];
}
