// Everything by key. Keys are letters where they name a thing, and nothing while text is typed.

import { as } from "../elements/dom.js";
import { snap } from "./snap.js";

/** @import { Kind } from "../connection/protocol.js" */
/** @import { Panes } from "../photos/panes.js" */
/** @import { Navigation } from "./navigation.js" */
/** @import { PageState } from "./page_state.js" */
/** @import { ProjectActions } from "./project_actions.js" */
/** @import { Tools } from "./tools.js" */

/**
 * What the keys act on.
 * @typedef {object} Acted
 * @property {PageState} state
 * @property {Panes} panes
 * @property {Tools} tools
 * @property {Navigation} navigation
 * @property {ProjectActions} project
 * @property {(count: number) => void} setPanes
 */

/** @typedef {"pick" | "length" | Kind} ToolName */
/** @typedef {{ key: string, name: string, prefix: string, least: number, most?: number, apart?: boolean, more?: boolean, what: string }} Tool */

/** @type {[string, [string, string][]][]} */
export const KEYS = [
  ["Photos", [
    ["wheel, + \u2212", "zoom at the pointer"], ["drag, Space + drag", "pan (middle and right button too)"], ["Ctrl + arrows", "pan; the arrows alone where no point is selected"],
    ["F   1   Z", "fit; one to one; to the selected point, \u00d74"], ["Page Down, Page Up", "next, previous photo; Alt: where the label is expected"],
    ["Ctrl+1  2  4", "panes"], ["K", "all panes show the same ground"], ["E R O T U", "ellipses, residuals, predictions, labels, lines"], ["Shift+T", "tie points"], ["M", "magnifier"],
  ]],
  ["Points", [
    ["click, Enter", "place the label (Enter: in the middle of the photo)"], ["drag, Shift + drag", "move; ten times finer"],
    ["arrows, Shift, Alt", "nudge by 0.1, 1, 10 px"], ["G", "go to where the label is expected"], ["S, Shift+S", "snap to the target or corner there; to a target alone"],
    ["Q", "height: free (found from photos), or on the ground"], ["N, B, Tab", "next, previous point"], ["/", "to the label: type one, Enter selects it"], ["F2", "rename"], ["Delete, Shift+Delete", "remove here, everywhere"],
    [".   Delete", "a hollow mark (P1?): accept, refuse"], ["Shift, Ctrl + Enter", "accept all of the point, all in the photo"],
  ]],
  ["Lengths and measurements", [
    ["P L D A Y J", "tools: point, length, distance, area, polyline, angle"], ["I V C H", "distance from a line, skid, coordinate, speed"],
    ["3 9 8", "height, profile, volume"], ["4 5 6 7", "level distance, rise, slope, distance from a plane"],
    ["click points; N B, Enter", "points in order; Enter takes one, once more ends"], ["Esc", "stop"],
  ]],
  ["All", [["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"], ["F6, Shift+F6", "next, previous part of the page"], ["X, Shift+X", "next, previous tab: measure, frames, camera"], ["up, down", "in a table: the same in the next row"],
    ["W", "write report and exports"], ["?", "this help"]]],
];

// `what` is for who has never used the tool; `apart`: each point is a place of its own, in one photo;
// `more`: it stands in the menu.
/** @type {Record<ToolName, Tool>} */
export const TOOLS = {
  pick: { key: "p", name: "Point", prefix: "P", least: 1, what: "marks a place on the ground by a label" },
  length: { key: "l", name: "Length", prefix: "L", least: 2, most: 2, what: "a length that was taped, which the adjustment takes as known" },
  distance: { key: "d", name: "Distance", prefix: "D", least: 2, most: 2, what: "how far two points are apart" },
  area: { key: "a", name: "Area", prefix: "A", least: 3, what: "what three or more points enclose, in their order" },
  polyline: { key: "y", name: "Polyline", prefix: "W", least: 2, what: "the way along points, in their order" },
  height: { key: "3", name: "Height", prefix: "HT", least: 1, most: 2, what: "how high a point stands over the ground, or over the first of two points" },
  profile: { key: "9", name: "Profile", prefix: "PR", least: 2, what: "heights of points along the line from the first to the last" },
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

const MOVING = ["Tab", "F6", "Enter"]; // who uses these is to see where he is
const PAGES = ["PageUp", "PageDown", "Home", "End"];
/** @type {Record<string, [number, number] | undefined>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** @param {Acted} acted */
export function listenToKeys(acted) {
  window.addEventListener("keydown", (event) => {
    if (ARROWS[event.key] || MOVING.includes(event.key)) document.body.classList.add("keyed");
    if (!isTyped(event) && handle(acted, event)) event.preventDefault();
  });
  window.addEventListener("keyup", ({ key }) => { if (key === " ") acted.state.spaceHeld = false; });
  window.addEventListener("blur", () => { acted.state.spaceHeld = false; });
  window.addEventListener("pointermove", () => document.body.classList.remove("keyed"));
}

// The arrows go through the buttons of a group, which is one stop for Tab: of radio buttons and tabs
// they choose as well.
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
    const next = key === "ArrowUp" ? row.previousElementSibling : row.nextElementSibling;
    /** @type {HTMLElement | null | undefined} */ (next?.querySelector(`[name="${name}"]`))?.focus();
  });
}

// Whether a key belongs to what is focused: to a text, a button, a table.
/** @param {KeyboardEvent} event */
function isTyped({ key, target }) {
  if (!(target instanceof HTMLElement || target instanceof SVGElement)) return false;
  if (target.closest("dialog")) return true;
  if (key === "F6") return false;
  if ((ARROWS[key] || PAGES.includes(key)) && target.closest("#panel, [role=radiogroup], #strip")) return true;
  const isField = target.matches("input, select, textarea");
  if (isField && key === "Escape") {
    target.blur();
    return false;
  }
  return isField || (target.matches("button, a, summary") && ["Enter", " "].includes(key));
}

// Does what a key says; whether it says something.
/** @param {Acted} acted @param {KeyboardEvent} event @returns {boolean} */
function handle(acted, event) {
  const { key, shiftKey, altKey } = event;
  const arrow = ARROWS[key];
  if (key === "Enter" && (shiftKey || event.ctrlKey)) return acted.tools.proposals.acceptAll(event.ctrlKey);
  if (event.ctrlKey || event.metaKey) return arrow ? acted.navigation.pan(...arrow) : withControl(acted, key.toLowerCase(), shiftKey);
  if (arrow) return acted.navigation.arrow(...arrow, shiftKey ? 1 : altKey ? 10 : 0.1);
  if (key === "Enter") return acted.tools.proposals.acceptFocused() || acted.navigation.enter();
  const named = NAMED[key];
  if (named) {
    named(acted, event);
    return true;
  }
  const tool = Object.entries(TOOLS).find(([, one]) => one.key === key.toLowerCase());
  if (tool) acted.tools.setTool(/** @type {ToolName} */ (tool[0]));
  return Boolean(tool);
}

/** @param {Acted} acted @param {string} key @param {boolean} shift */
function withControl({ tools, setPanes }, key, shift) {
  if (key === "z") tools.send({ t: shift ? "redo" : "undo" });
  else if (key === "y") tools.send({ t: "redo" });
  else if (["1", "2", "4"].includes(key)) setPanes(Number(key));
  else return false;
  return true;
}

/** @type {Record<string, ((acted: Acted, event: KeyboardEvent) => void) | undefined>} */
const NAMED = {
  Escape: ({ tools }) => tools.cancel(),
  Delete: ({ tools }, { shiftKey }) => tools.remove(shiftKey),
  ".": ({ tools }) => tools.proposals.acceptSelected(),
  F2: ({ navigation }) => navigation.beginRename(),
  "/": ({ tools }) => tools.toLabel(),
  F6: ({ navigation }, { shiftKey }) => navigation.nextRegion(shiftKey ? -1 : 1),
  PageDown: ({ navigation }, { altKey }) => navigation.turn(1, altKey),
  PageUp: ({ navigation }, { altKey }) => navigation.turn(-1, altKey),
  "+": ({ navigation }) => navigation.zoom(1.25),
  "=": ({ navigation }) => navigation.zoom(1.25),
  "-": ({ navigation }) => navigation.zoom(0.8),
  " ": ({ state }) => { state.spaceHeld = true; },
  "?": ({ navigation }) => navigation.help(),
  f: ({ panes }) => panes.active?.fit(),
  1: ({ panes }) => panes.active?.scaleTo(1),
  z: ({ navigation }) => navigation.toSelected(4),
  g: ({ navigation }) => navigation.goToPredicted(),
  n: ({ navigation }) => navigation.step(1),
  b: ({ navigation }) => navigation.step(-1),
  k: ({ panes }) => panes.toggleLink(),
  m: ({ navigation }) => navigation.toggleLoupe(),
  e: ({ navigation }) => navigation.toggle("ellipses"),
  r: ({ navigation }) => navigation.toggle("residuals"),
  o: ({ navigation }) => navigation.toggle("predicted"),
  t: ({ navigation }) => navigation.toggle("labels"),
  u: ({ navigation }) => navigation.toggle("lines"),
  T: ({ navigation }) => void navigation.toggleTies(),
  s: ({ tools }) => void snap(tools, "any"),
  S: ({ tools }) => void snap(tools, "target"),
  q: ({ tools }) => tools.heights.toggle(),
  x: ({ navigation }) => navigation.nextTab(1),
  X: ({ navigation }) => navigation.nextTab(-1),
  w: ({ project }) => void project.exportAll(),
};
