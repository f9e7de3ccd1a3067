// The keyboard. Keys are initial letters where possible; they are ignored while text is typed.

import { as, byId } from "../elements/dom.js";
import { mayBecomeLength } from "../elements/units.js";
import { toggleStretch } from "../photos/tone.js";
import { stepTone } from "../photos/tone_control.js";
import { acceptable, ofLabel } from "./proposals.js";
import { snap } from "./snap.js";

/** @import { Kind } from "../connection/protocol.js" */
/** @import { Panes } from "../photos/panes.js" */
/** @import { Navigation } from "./navigation.js" */
/** @import { PageState, ShownKind } from "./page_state.js" */
/** @import { ProjectActions } from "./project_actions.js" */
/** @import { Tools } from "./tools.js" */

/**
 * Objects that the keys act on.
 * @typedef {object} Acted
 * @property {PageState} state
 * @property {Panes} panes
 * @property {Tools} tools
 * @property {Navigation} navigation
 * @property {ProjectActions} project
 * @property {(count: number) => void} setPanes
 */

/** @typedef {"pick" | "length" | Kind} ToolName */
/** @typedef {{ key: string, name: string, prefix: string, use?: "mark" | "known", least: number, most?: number, apart?: boolean, more?: boolean, what: string }} Tool */

// `what` explains a tool to beginners; `apart`: each point is a separate place, in one photo;
// `more`: the tool is in the menu. A tool marks a place, enters a known value, or measures a wanted one.
/** @type {Record<ToolName, Tool>} */
export const TOOLS = {
  pick: { key: "p", name: "Point", prefix: "P", use: "mark", least: 1, what: "marks a place on the ground by a label; the same label in another photo is the same place" },
  length: { key: "l", name: "Taped length", prefix: "L", use: "known", least: 2, most: 2, what: "a length that somebody measured with a tape on the ground; type what the tape read, and everything is scaled by it; without a reading it is a wanted distance" },
  distance: { key: "d", name: "Distance", prefix: "D", least: 2, most: 2, what: "wanted: how far two points are apart, computed from the photos" },
  area: { key: "a", name: "Area", prefix: "A", least: 3, what: "what three or more points enclose, in their order" },
  polyline: { key: "y", name: "Polyline", prefix: "W", least: 2, what: "the way along points, in their order" },
  height: { key: "3", name: "Height", prefix: "HT", least: 1, most: 2, what: "how high a point stands over the ground, or over the first of two points" },
  profile: { key: "9", name: "Profile", prefix: "PR", least: 2, more: true, what: "heights of points along the line from the first to the last" },
  angle: { key: "j", name: "Angle", prefix: "J", least: 3, most: 3, more: true, what: "the angle at the second of three points" },
  line_distance: { key: "i", name: "From line", prefix: "H", least: 3, most: 3, more: true, what: "how far the first point is from the line through the two others" },
  plane_distance: { key: "7", name: "From plane", prefix: "PD", least: 4, most: 4, more: true, what: "how far the first point is from the plane through the three others: a dent, a rut" },
  horizontal_distance: { key: "4", name: "Level distance", prefix: "LD", least: 2, most: 2, more: true, what: "how far two points are apart on a map" },
  vertical_distance: { key: "5", name: "Difference in height", prefix: "VD", least: 2, most: 2, more: true, what: "by how much the second point is higher than the first" },
  slope: { key: "6", name: "Slope", prefix: "SL", least: 2, most: 2, more: true, what: "how steep it is from the first point up to the second" },
  volume: { key: "8", name: "Volume", prefix: "VO", least: 3, more: true, what: "what lies under three or more points around it, over the ground, a level or a plane" },
  skid_speed: { key: "v", name: "Skid", prefix: "V", least: 2, more: true, what: "the speed before a skid to rest, from the length of its mark and the friction" },
  coordinate: { key: "c", name: "Coordinate", prefix: "C", least: 1, most: 1, more: true, what: "where a point is: east and north, latitude and longitude" },
  speed: { key: "h", name: "Speed", prefix: "S", least: 2, most: 2, apart: true, more: true, what: "the mean speed of what moved between two photos" },
};

const MOVING = ["Tab", "F6", "Enter"]; // these keys make the focus visible
const PAGES = ["PageUp", "PageDown", "Home", "End"];
/** @type {Record<string, [number, number] | undefined>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** @param {Acted} acted */
export function listenToKeys(acted) {
  window.addEventListener("keydown", (event) => {
    if (ARROWS[event.key] || MOVING.includes(event.key)) document.body.classList.add("keyed");
    if (closesHelp(event)) event.preventDefault();
    else if (!isTyped(event) && isTaken(acted, event)) event.preventDefault();
  });
  window.addEventListener("keyup", ({ key }) => { if (key === " ") acted.state.spaceHeld = false; });
  window.addEventListener("blur", () => { acted.state.spaceHeld = false; });
  window.addEventListener("pointermove", () => document.body.classList.remove("keyed"));
}

// Arrow keys go through the buttons of a group, which is one stop for Tab; radio buttons and tabs are also
// chosen by them.
/** @param {HTMLElement} group */
export function roving(group) {
  group.addEventListener("keydown", (event) => {
    const [dx, dy] = ARROWS[event.key] ?? [0, 0];
    const all = [...group.querySelectorAll(":scope > button")].map((button) => as(HTMLButtonElement, button));
    const at = all.findIndex((button) => event.target instanceof Node && button.contains(event.target));
    const last = all.length - 1;
    const to = event.key === "Home" ? 0 : event.key === "End" ? last : (at + dx + dy + all.length) % all.length;
    if (at < 0 || to === at || event.ctrlKey) return;
    event.preventDefault();
    all[to].focus();
    if (group.getAttribute("role")) all[to].click();
  });
}

// Up and down go to the same field of the next row of a table.
/** @param {HTMLElement} panel */
export function throughRows(panel) {
  panel.addEventListener("keydown", (event) => {
    const { key, target } = event;
    const name = target instanceof HTMLInputElement || target instanceof HTMLButtonElement ? target.name : "";
    const row = target instanceof Element ? target.closest("tbody tr") : null;
    if (!row || !name || !["ArrowUp", "ArrowDown"].includes(key)) return;
    event.preventDefault();
    const rows = [...(row.parentElement?.querySelectorAll("tr[data-row]") ?? [])];
    const next = rows.at(Math.max(rows.indexOf(row) + (key === "ArrowUp" ? -1 : 1), 0));
    /** @type {HTMLElement | null | undefined} */ (next?.querySelector(`[name="${name}"]`))?.focus();
  });
}

// Closes the help before the key is handled: the browser's own closing is too late for the next key.
/** @param {KeyboardEvent} event */
function closesHelp({ key }) {
  const help = as(HTMLDialogElement, byId("help"));
  const closes = help.open && key === "Escape";
  if (closes) help.close();
  return closes;
}

// Returns whether a key belongs to the focused element: a text field, a button, a table.
/** @param {KeyboardEvent} event */
function isTyped(event) {
  const { key, target } = event;
  if (!(target instanceof HTMLElement || target instanceof SVGElement)) return false;
  if (isForOpened(event)) return true;
  if (key === "F6" || turnsPhotos(key, target)) return false;
  if ((ARROWS[key] || PAGES.includes(key)) && target.closest("#panel, [role=radiogroup], #strip")) return true;
  const isField = takesText(event, target);
  if (isField && key === "Escape") {
    target.blur();
    return false;
  }
  return isField || (target.matches("button, a, summary") && ["Enter", " "].includes(key));
}

// Returns whether a dialog or a menu is open that the key is for: nothing is changed behind it.
/** @param {KeyboardEvent} event */
function isForOpened(event) {
  const [name] = namesOf(event);
  return Boolean(document.querySelector(OF_MENUS.has(name) ? "dialog[open]" : "dialog[open], :popover-open"));
}

// A field for a number has no pages: these keys turn the photos there, too.
/** @param {string} key @param {Element} target */
const turnsPhotos = (key, target) => ["PageUp", "PageDown"].includes(key) && target.matches("form.entry input");

/** @param {KeyboardEvent} event @param {Element} target */
const takesText = (event, target) => target.matches("input, select, textarea") && !choosesTool(event, target);

// A letter that continues no number ends the reading in a form, and chooses its tool.
/** @param {KeyboardEvent} event @param {Element} target */
function choosesTool({ key, ctrlKey, altKey, metaKey }, target) {
  if (!(target instanceof HTMLInputElement) || !target.matches("form.entry input[inputmode]") || ctrlKey || altKey || metaKey) return false;
  return /^[a-z]$/i.test(key) && Object.values(TOOLS).some((tool) => tool.key === key.toLowerCase()) && !mayBecomeLength(target.value + key);
}

// Carries out a key, or keeps it from acting. One that an open form takes is left to the browser, which types it there.
/** @param {Acted} acted @param {KeyboardEvent} event */
function isTaken(acted, event) {
  const { question, typedNumbers } = acted.tools;
  const where = question.isOpen && question.answers(event) ? "nowhere" : typedNumbers.takes(event);
  return where === "nowhere" || (!where && handle(acted, event));
}

// Yields the names of a key in the tables above.
/** @param {KeyboardEvent} event */
function* namesOf({ key, shiftKey, altKey, ctrlKey, metaKey }) {
  const control = ctrlKey || metaKey ? "Ctrl+" : "";
  const one = control ? key.toLowerCase() : key;
  const named = key.length > 1 ? key : one;
  if (shiftKey) yield `${control}Shift+${named}`;
  if (altKey) yield `${control}Alt+${named}`;
  yield `${control}${named}`;
  yield `${control}${named.toLowerCase()}`; // with the capitals' lock on
}

// Carries out the action of a key; returns whether there was one.
/** @param {Acted} acted @param {KeyboardEvent} event @returns {boolean} */
function handle(acted, event) {
  for (const name of namesOf(event)) {
    const act = ACTS.get(name);
    if (act) return isHeldUp(acted, name) || act(acted, event) !== false;
  }
  return false;
}

// Returns whether something that waits for an answer takes no such key.
/** @param {Acted} acted @param {string} name */
function isHeldUp({ tools }, name) {
  return tools.typedNumbers.holdsUp(name, VIEWING.has(name));
}

/**
 * Actions of keys, or of the mouse.
 * @typedef {(acted: Acted, event: KeyboardEvent) => void | boolean} Act false: nothing was to be done
 * @typedef {object} Binding
 * @property {string} keys as named in the help
 * @property {string} what in words
 * @property {Record<string, Act>} [does] by the keyboard's name of the key; actions of the mouse are handled elsewhere
 */

/** @param {string} before @param {(acted: Acted, dx: number, dy: number, event: KeyboardEvent) => void | boolean} act */
const arrows = (before, act) => Object.fromEntries(Object.entries(ARROWS).map(([key, to]) => [`${before}${key}`, /** @type {Act} */ ((acted, event) => act(acted, ...(to ?? [0, 0]), event))]));

/** @param {Record<string, ShownKind>} kinds @returns {Record<string, Act>} */
const toggles = (kinds) => Object.fromEntries(Object.entries(kinds).map(([key, kind]) => [key, ({ navigation }) => navigation.toggle(kind)]));

/** @param {{ brightness?: number, contrast?: number }} step @returns {Act} */
const toning = (step) => ({ panes }) => { if (panes.active) stepTone(panes.active.image, step); };

/** @returns {Binding[]} */
const toolBindings = () => Object.entries(TOOLS).map(([name, { key, name: words, what }]) => ({
  keys: key.toUpperCase(), what: `${words}: ${what}`, does: { [key]: ({ tools }) => tools.setTool(/** @type {ToolName} */ (name)) },
}));

// All keys and their actions; the help is made from this table.
/** @type {[string, Binding[]][]} */
export const KEYS = [
  ["Photos", [
    { keys: "wheel, + \u2212", what: "zoom at the pointer; by touch: two fingers", does: { "+": ({ navigation }) => navigation.zoom(1.25), "=": ({ navigation }) => navigation.zoom(1.25), "-": ({ navigation }) => navigation.zoom(0.8) } },
    { keys: "drag, Space + drag", what: "pan (middle and right button too)", does: { " ": ({ state }) => { state.spaceHeld = true; } } },
    { keys: "Ctrl + arrows", what: "pan; the arrows alone where no point is selected", does: arrows("Ctrl+", ({ navigation }, dx, dy) => navigation.pan(dx, dy)) },
    { keys: "F   1   Z", what: "fit; one to one; to the selected point, \u00d74", does: { f: ({ panes }) => panes.active?.fit(), 1: ({ panes }) => panes.active?.scaleTo(1), z: ({ navigation }) => navigation.toSelected(4) } },
    { keys: "Page Down, Page Up", what: "next, previous photo; Alt: where the label is expected", does: {
      PageDown: ({ navigation }) => navigation.turn(1, false), PageUp: ({ navigation }) => navigation.turn(-1, false),
      "Alt+PageDown": ({ navigation }) => navigation.turn(1, true), "Alt+PageUp": ({ navigation }) => navigation.turn(-1, true) } },
    { keys: "Ctrl+1  2  4", what: "panes", does: Object.fromEntries([1, 2, 4].map((count) => [`Ctrl+${count}`, /** @type {Act} */ (({ setPanes }) => setPanes(count))])) },
    { keys: "K", what: "all panes show the same ground", does: { k: ({ panes }) => panes.toggleLink() } },
    { keys: "E R O T U", what: "ellipses (how exact), misfits, where points are expected, labels, lines", does: toggles({ e: "ellipses", r: "residuals", o: "predicted", t: "labels", u: "lines" }) },
    { keys: "Shift+T", what: "tie points", does: { T: ({ navigation }) => void navigation.toggleTies() } },
    { keys: "M", what: "magnifier; by touch: let a finger rest, slide, and lift it to place", does: { m: ({ navigation }) => navigation.toggleLoupe() } },
    { keys: "0   [ ]   { }", what: "brightness: automatic or as it is; darker, brighter; contrast", does: {
      0: ({ panes }) => { if (panes.active) toggleStretch(panes.active.image); },
      "[": toning({ brightness: -1 }), "]": toning({ brightness: 1 }), "{": toning({ contrast: -1 }), "}": toning({ contrast: 1 }) } },
  ]],
  ["Points", [
    { keys: "click, Enter", what: "the point that is expected there, else a new one (Enter: in the middle of the view)", does: { Enter: ({ tools, navigation }) => tools.proposals.acceptFocused() || navigation.enter() } },
    { keys: "drag, Shift + drag", what: "move; ten times finer" },
    { keys: "arrows, Shift, Alt", what: "nudge by 0.1, 1, 10 px", does: arrows("", ({ navigation }, dx, dy, { shiftKey, altKey }) => navigation.arrow(dx, dy, shiftKey ? 1 : altKey ? 10 : 0.1)) },
    { keys: "G", what: "go to where the label is expected", does: { g: ({ navigation }) => navigation.goToPredicted() } },
    { keys: "S, Shift+S", what: "snap to the target or corner there; to a target alone", does: { s: ({ tools }) => void snap(tools, "any"), S: ({ tools }) => void snap(tools, "target") } },
    { keys: "Q", what: "height: free (found from photos), or on the ground", does: { q: ({ tools }) => tools.heights.toggle() } },
    { keys: "N, B, Tab", what: "next, previous point", does: { n: ({ navigation }) => navigation.step(1), b: ({ navigation }) => navigation.step(-1) } },
    { keys: "/", what: "to the label: type one, Enter selects it", does: { "/": ({ tools }) => tools.toLabel() } },
    { keys: "F2", what: "rename", does: { F2: ({ navigation }) => navigation.beginRename() } },
    { keys: "Delete, Shift+Delete", what: "remove here, everywhere", does: { Delete: ({ tools }) => tools.remove(false), "Shift+Delete": ({ tools }) => tools.remove(true) } },
    { keys: ".   Delete", what: "a hollow mark (P1?): accept, refuse (all: buttons in the panel)", does: { ".": ({ tools }) => tools.proposals.acceptSelected() } },
    { keys: "Shift, Ctrl + Enter", what: "accept all of the point, all that were found in all photos", does: { "Shift+Enter": ({ state, tools }) => tools.proposals.acceptAll(ofLabel(state.selected), " of this point"), "Ctrl+Enter": ({ tools }) => tools.proposals.acceptAll(acceptable().all) } },
  ]],
  ["Tools", [
    ...toolBindings(),
    { keys: "click points; N B, Enter", what: "points in order; Enter takes one, once more ends" },
    { keys: "Esc", what: "stop", does: { Escape: ({ tools }) => tools.cancel() } },
  ]],
  ["All", [
    { keys: "Ctrl+Z, Ctrl+Shift+Z", what: "undo, redo", does: { "Ctrl+z": ({ tools }) => tools.clicks.step("undo"), "Ctrl+Shift+z": ({ tools }) => tools.clicks.step("redo"), "Ctrl+y": ({ tools }) => tools.clicks.step("redo") } },
    { keys: "F6, Shift+F6", what: "next, previous part of the page", does: { F6: ({ navigation }) => navigation.nextRegion(1), "Shift+F6": ({ navigation }) => navigation.nextRegion(-1) } },
    { keys: "X, Shift+X", what: "next, previous tab: measure, photos, camera, results", does: { x: ({ navigation }) => navigation.nextTab(1), X: ({ navigation }) => navigation.nextTab(-1) } },
    { keys: "up, down", what: "in a table: the same in the next row" },
    { keys: "W", what: "write the results, and show them", does: { w: ({ project }) => void project.exportAll() } },
    { keys: "?", what: "this help", does: { "?": ({ navigation }) => navigation.help() } },
  ]],
];

/** Keys that only change the view, and those that take back, end or explain. */
const VIEWING = new Set([...KEYS[0][1].flatMap(({ does = {} }) => Object.keys(does)), "Escape", "?", "F6", "Shift+F6", "Ctrl+z", "Ctrl+Shift+z", "Ctrl+y"]);

/** Keys that act while a menu is open, as it shows them: of tools, and of brightness and contrast. All others are for the menu. */
const OF_MENUS = new Set([...Object.values(TOOLS).map(({ key }) => key), "0", "[", "]", "{", "}"]);

/** @type {Map<string, Act>} */
const ACTS = new Map(KEYS.flatMap(([, all]) => all.flatMap(({ does = {} }) => Object.entries(does))));
