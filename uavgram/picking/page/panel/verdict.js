// The verdict of the adjustment, above the numbers: its light, the likeliest reason in one plain sentence, and
// its remedies. Statistics and all else are folded behind "why". Level and words come from the server.

import { acceptable } from "../actions/proposals.js";
import { adjusted, isSearching, picksOf, remarks, stale, store } from "../connection/store.js";
import { light } from "../connection/trust.js";
import { byId, fillIfNew, node } from "../elements/dom.js";
import { list } from "../elements/table.js";
import { spot } from "../photos/spot.js";

/** @import { ProjectActions } from "../actions/project_actions.js" */
/** @import { Tools } from "../actions/tools.js" */
/** @import { Mend, Note, Remark } from "../connection/protocol.js" */

/** @param {HTMLElement} box @param {Tools} tools @param {ProjectActions} project */
export function showVerdict(box, tools, project) {
  const { level, words } = light();
  const { first, why, unseen } = adjusted()?.verdict ?? unjudged();
  box.hidden = false;
  box.dataset.level = level;
  if (byId("light").textContent !== words) byId("light").textContent = words;
  const isOld = level === "none";
  const plain = first.plain || unseen;
  /** @param {Remark} remark */
  const buttons = (remark) => actionsOf(remark, isOld, tools, project);
  fillIfNew(byId("first"), JSON.stringify([first, plain, isOld, store.damaged, isSearching(), acceptable()]), () => (plain ? [node("span", { title: first.text || plain }, plain), buttons(first) ?? leaveOutButton(project) ?? ""] : []));
  const height = isOld ? "" : adjusted()?.verdict.height ?? "";
  if (byId("height").textContent !== height) byId("height").textContent = height;
  const behind = first.plain === first.text || isTold(first, why) ? why : [first, ...why];
  byId("why").hidden = !behind.length;
  byId("why-title").textContent = `${first.text ? "Why" : "Warnings"} (${behind.length})`;
  fillIfNew(byId("reasons"), JSON.stringify([behind, isOld, isSearching(), acceptable()]), () => [list(behind, (remark) => (remark === first ? null : buttons(remark)))]);
}

// Warnings as remarks, before there are numbers; damaged photos come first.
/** @param {Note} note @returns {Remark} */
const asRemark = ({ level, code, text, labels }) => ({ level, code, text, plain: text, labels, frames: [], lengths: [], measurements: [], mends: [], show: [] });
const NOTHING = asRemark({ level: "warning", code: "", text: "", labels: [] });
function unjudged() {
  const damage = store.opening.find(({ code }) => code === "photo-damaged");
  const why = remarks().filter(({ level, text }) => level !== "info" && text !== damage?.text);
  return { first: NOTHING, why: why.map(asRemark), unseen: damage?.text ?? "" };
}

/** The button that leaves all damaged photos out; none without any. @param {ProjectActions} project */
export function leaveOutButton(project) {
  const { damaged } = store;
  if (!damaged.length) return null;
  const words = `Leave ${damaged.length === 1 ? damaged[0] : `these ${damaged.length} photos`} out`;
  return node("span", { class: "mends" }, node("button", { name: "leave-out", class: "main", title: "Their picks stay in the table", onclick: () => void project.leaveOut(damaged, false) }, words));
}

// Returns whether another remark gives the reason at more length.
/** @param {Remark} reason @param {Remark[]} others */
const isTold = ({ text }, others) => others.some((other) => other.text.startsWith(text.replace(/\.$/, "")));

// Buttons for remedies, the likeliest first, and one to see the place. Remedies of old numbers are disabled:
// a remedy for earlier picks may harm the present ones.
/** @param {Remark} remark @param {boolean} isOld @param {Tools} tools @param {ProjectActions} project */
function actionsOf({ code, labels, mends, plain, show }, isOld, tools, project) {
  const ways = mends.map((mend) => ({ name: "mend", words: mend.words, rank: rankOf(mend), disabled: isOld, act: () => { putRight(mend, plain, tools, project); } }));
  const isContradicted = !mends.length && labels.length === 1 && show.length > 1; // one of its clicks is wrong: another one of each decides
  const again = labels.length && (code === "nothing-checks" || isContradicted) ? [{ name: "again", words: "Click again", rank: MEND, disabled: isOld, act: () => tools.again.begin(labels) }] : [];
  const looks = show.map(({ image, label }) => ({ name: "show", words: isContradicted ? `Show ${label} in ${store.photos[image].name}` : show.length > 1 ? `Show ${label}` : "Show me", rank: LOOK, disabled: false, act: () => tools.panes.look(image, label) }));
  const { all: found, words: accept } = acceptable(); // places in other photos check a length, though no click
  const taking = code === "nothing-checks" && !labels.length && found.length ? [{ name: "accept-found", words: accept, rank: MEND, disabled: isOld || isSearching(), act: () => tools.proposals.acceptAll(found) }] : [];
  const all = [...ways, ...again, ...taking, ...looks].sort((a, b) => a.rank - b.rank);
  return all.length ? node("span", { class: "mends" }, compared(mends), ...all.map(({ name, words, disabled, act }, k) => node("button", { name, value: words, class: k ? "" : "main", disabled, onclick: act }, words))) : null;
}

const MOST_COMPARED = 6; // pictures of a point

// Pictures of the points that one of several swaps would exchange, in all their photos: only a person knows which is which.
/** @param {Mend[]} mends */
function compared(mends) {
  const swaps = mends.map(({ changes }) => changes.filter((change) => change.t === "swap")).filter((some) => some.length);
  if (swaps.length < 2) return null;
  const labels = new Set(swaps.flat().flatMap(({ label, other }) => [label, other]));
  const rows = [...labels].map((label) => node("span", {}, `${label} `, ...picksOf(label).slice(0, MOST_COMPARED).map(({ image, u_px, v_px }) => spot(image, u_px, v_px, `${label} in ${store.photos[image].name}`, SPOT_PX))));
  const photos = new Set([...labels].flatMap((label) => picksOf(label).map(({ image }) => image)));
  const how = photos.size > 2 ? "Compare the places, and take the photo in which they differ from the others:" : "Compare the places with your notes or a sketch, as two photos do not show which, and take the photo in which they are exchanged:";
  return node("span", { class: "compared" }, `Only one of these is right. ${how}`, ...rows);
}

const SPOT_PX = 40;
const [MEND, LOOK, REMOVE] = [0, 1, 2];
const REMOVALS = ["unpick", "remove-line"];

// Removals come last: a person should look first.
/** @param {Mend} mend */
const rankOf = ({ changes, way }) => (way?.to === "leave-out" || (changes.length && changes.every(({ t }) => REMOVALS.includes(t))) ? REMOVE : MEND);

/** @param {Mend} mend @param {string} why @param {Tools} tools @param {ProjectActions} project */
function putRight({ words, changes, way }, why, tools, project) {
  if (way?.to === "set-up") void project.leave("setup", { settings: way.names, why });
  if (way?.to === "recorded") void project.useRecorded();
  if (way?.to === "leave-out") void project.leaveOut(way.names, false);
  const line = way && store.lines.find(({ name }) => name === way.names[0]);
  if (line && way?.to === "length") tools.changeLine(line);
  if (way) return;
  // The second click of two would undo the first; and a change just made may need another remedy.
  if (stale() || tools.link.unconfirmed.length) return;
  tools.offers.show(`Done: ${words}.`, tools.send({ t: "all", changes }), { words: "Undo", act: () => tools.send({ t: "undo" }) });
}
