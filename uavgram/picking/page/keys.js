// Everything by key. Keys are letters where they name a thing, and nothing while text is typed.

export const KEYS = [
  ["Photos", [
    ["wheel, + \u2212", "zoom at the pointer"], ["drag, Space + drag", "pan (middle and right button too)"], ["Ctrl + arrows", "pan; the arrows alone where no point is selected"],
    ["F   1   Z", "fit; one to one; to the selected point, \u00d74"], ["Page Down, Page Up", "next, previous photo; with Alt only those where the label is expected"],
    ["Ctrl+1  2  4", "panes"], ["K", "all panes show the same ground"], ["E R O T U", "ellipses, residuals, predictions, labels, lines"], ["M", "magnifier"],
  ]],
  ["Points", [
    ["click, Enter", "place the label (Enter: in the middle of the photo)"], ["drag, Shift + drag", "move; ten times finer"],
    ["arrows, Shift, Alt", "nudge by 0.1, 1, 10 px"], ["G", "go to where the label is expected"], ["S, Shift+S", "snap to a corner, to a round target"],
    ["N, B, Tab", "next, previous point"], ["/", "to the label: type one, Enter selects it"], ["F2", "rename"], ["Delete, Shift+Delete", "remove here, everywhere"],
  ]],
  ["Lengths and measurements", [
    ["P L D A Y J", "tools: point, length, distance, area, polyline, angle"], ["I V", "distance from a line, skid speed"], ["C H", "coordinate, speed between two photos"],
    ["click points; N B, Enter", "the points in order; Enter takes the selected one, once more ends"], ["Esc", "stop"],
  ]],
  ["All", [["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"], ["F6, Shift+F6", "next, previous part of the page"], ["X, Shift+X", "next, previous tab: measure, frames, camera"], ["up, down", "in a table: the same in the next row"],
    ["W", "write report and exports"], ["?", "this help"]]],
];

// `what` is for who has never used the tool; `apart`: each point is a place of its own, in one photo.
export const TOOLS = {
  pick: { key: "p", name: "Point", prefix: "P", what: "marks a place on the ground by a label" },
  length: { key: "l", name: "Length", prefix: "L", least: 2, most: 2, what: "a length that was taped, which the adjustment takes as known" },
  distance: { key: "d", name: "Distance", prefix: "D", least: 2, most: 2, what: "how far two points are apart" },
  area: { key: "a", name: "Area", prefix: "A", least: 3, what: "what three or more points enclose, in their order" },
  polyline: { key: "y", name: "Polyline", prefix: "W", least: 2, what: "the way along points, in their order" },
  angle: { key: "j", name: "Angle", prefix: "J", least: 3, most: 3, what: "the angle at the second of three points" },
  line_distance: { key: "i", name: "From line", prefix: "H", least: 3, most: 3, what: "how far the first point is from the line through the two others" },
  skid_speed: { key: "v", name: "Skid", prefix: "V", least: 2, what: "the speed before a skid to rest, from the length of its mark and the friction" },
  coordinate: { key: "c", name: "Coordinate", prefix: "C", least: 1, most: 1, what: "where a point is: east and north, latitude and longitude" },
  speed: { key: "h", name: "Speed", prefix: "S", least: 2, most: 2, apart: true, what: "the mean speed of what moved between two photos" },
};

const MOVING = ["Tab", "F6", "Enter"]; // who uses these is to see where he is
const PAGES = ["PageUp", "PageDown", "Home", "End"];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export function listenToKeys(desk) {
  window.addEventListener("keydown", (event) => {
    if (ARROWS[event.key] || MOVING.includes(event.key)) document.body.classList.add("keyed");
    if (typing(event)) return;
    if (handle(desk, event)) event.preventDefault();
  });
  window.addEventListener("keyup", (event) => { if (event.key === " ") desk.spaceHeld = false; });
  window.addEventListener("blur", () => { desk.spaceHeld = false; });
  window.addEventListener("pointermove", () => document.body.classList.remove("keyed"));
}

// The arrows go through the buttons of a group, which is one stop for Tab: of radio buttons and tabs
// they choose as well.
export function roving(group) {
  group.addEventListener("keydown", (event) => {
    const [dx, dy] = ARROWS[event.key] ?? [0, 0];
    const all = [...group.children];
    const at = all.indexOf(event.target.closest("button"));
    const last = all.length - 1;
    const to = event.key === "Home" ? 0 : event.key === "End" ? last : (at + dx + dy + all.length) % all.length;
    if (at < 0 || to === at || event.ctrlKey) return;
    event.preventDefault();
    all[to].focus();
    if (group.getAttribute("role")) all[to].click();
  });
}

// Up and down go to the same field of the next row of a table.
export function throughRows(panel) {
  panel.addEventListener("keydown", (event) => {
    const row = event.target.closest("tbody tr");
    const next = { ArrowUp: row?.previousElementSibling, ArrowDown: row?.nextElementSibling }[event.key];
    if (!row || !event.target.name || !["ArrowUp", "ArrowDown"].includes(event.key)) return;
    event.preventDefault();
    next?.querySelector(`[name="${event.target.name}"]`)?.focus();
  });
}

function typing(event) {
  const { target } = event;
  if (target.closest?.("dialog")) return true;
  if (event.key === "F6") return false;
  if ((ARROWS[event.key] || PAGES.includes(event.key)) && target.closest?.("#panel, [role=radiogroup], #strip")) return true;
  const field = target.matches?.("input, select, textarea");
  if (field && event.key === "Escape") {
    target.blur();
    return false;
  }
  return field || (target.matches?.("button, a, summary") && ["Enter", " "].includes(event.key));
}

function handle(desk, event) {
  const { key } = event;
  if (event.ctrlKey || event.metaKey) return ARROWS[key] ? desk.pan(...ARROWS[key]) : withControl(desk, key.toLowerCase(), event.shiftKey);
  if (ARROWS[key]) return desk.arrow(...ARROWS[key], event.shiftKey ? 1 : event.altKey ? 10 : 0.1);
  const named = NAMED[key];
  if (named) return named(desk, event) !== false;
  const tool = Object.entries(TOOLS).find(([, one]) => one.key === key.toLowerCase());
  if (tool) desk.setTool(tool[0]);
  return Boolean(tool);
}

function withControl(desk, key, shift) {
  if (key === "z") desk.send({ t: shift ? "redo" : "undo" });
  else if (key === "y") desk.send({ t: "redo" });
  else if (["1", "2", "4"].includes(key)) desk.setPanes(Number(key));
  else return false;
  return true;
}

const letter = (action) => (desk) => action(desk);
const NAMED = {
  Enter: (desk) => desk.enter(),
  Escape: (desk) => desk.cancel(),
  Delete: (desk, event) => desk.remove(event.shiftKey),
  F2: (desk) => desk.beginRename(),
  "/": (desk) => desk.toLabel(),
  F6: (desk, event) => desk.nextRegion(event.shiftKey ? -1 : 1),
  PageDown: (desk, event) => desk.turn(1, event.altKey),
  PageUp: (desk, event) => desk.turn(-1, event.altKey),
  "+": (desk) => desk.zoom(1.25), "=": (desk) => desk.zoom(1.25), "-": (desk) => desk.zoom(0.8),
  " ": (desk) => { desk.spaceHeld = true; },
  "?": (desk) => desk.help(),
};
for (const [name, action] of Object.entries({
  f: (desk) => desk.active?.fit(), 1: (desk) => desk.active?.scaleTo(1), z: (desk) => desk.toSelected(4), g: (desk) => desk.goToPredicted(),
  n: (desk) => desk.step(1), b: (desk) => desk.step(-1), k: (desk) => desk.toggleLink(), m: (desk) => desk.toggleLoupe(),
  e: (desk) => desk.toggle("ellipses"), r: (desk) => desk.toggle("residuals"), o: (desk) => desk.toggle("predicted"), t: (desk) => desk.toggle("labels"), u: (desk) => desk.toggle("lines"),
  s: (desk) => desk.snap("corner"), S: (desk) => desk.snap("circle"),
  x: (desk) => desk.nextTab(1), X: (desk) => desk.nextTab(-1), w: (desk) => { desk.exportAll(); },
})) NAMED[name] = letter(action);
