// The marks of one pane as SVG: made when the state changes, moved when the view does.

import { fixed, missing, put, shape, valueText, withSigma } from "./format.js";
import { adjusted, fitOf, isSuspect, picksIn, placeOf, predictedIn, store } from "./store.js";

const RESIDUAL_SCALES = [20, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01]; // screen pixels for each of the photo
const LONGEST_RESIDUAL_PX = 90;
export const CONFIDENCE = 2.4477; // 95 % of a plane's normal distribution

export const CROSS = "M-9 0H-3M3 0H9M0 -9V-3M0 3V9";
export const KNOWN = { control: "M0 -13L11.5 7H-11.5Z", check: "M-10 -10H10V10H-10Z" }; // points with known coordinates
export const DIAMOND = "M0 -13L13 0L0 13L-13 0Z";

// The largest scale that leaves the photo's residuals readable; it is written beside the zoom.
export function residualScale(image) {
  const sizes = picksIn(image).map((pick) => Math.hypot(...(fitOf(image, pick.label)?.residual ?? [0])));
  const longest = Math.max(...sizes.filter(Number.isFinite), 1e-9);
  return RESIDUAL_SCALES.find((scale) => scale * longest <= LONGEST_RESIDUAL_PX) ?? RESIDUAL_SCALES.at(-1);
}

// Everything that is drawn in a photo, as [{key, sign, make(), move(group, view)}]: `sign` tells
// whether what was made before will do, `move` brings it to its place.
export function buildMarks(image, { selected, shown, draft }) {
  const parts = shown.lines ? linesIn(image, selected) : [];
  parts.push(...parts.filter((part) => part.words).map(wordsPart)); // over all lines
  if (draft.length) parts.push(pathPart(image, "", draft, "draft", "", false));
  if (shown.predicted) {
    for (const one of predictedIn(image)) parts.push(predictedPart(one, selected, shown));
  }
  const scale = residualScale(image);
  for (const pick of picksIn(image)) parts.push(pickPart(pick, selected, shown, scale));
  return parts.filter(Boolean);
}

// Lengths and measurements. Where these are too many to read, only what hangs on the selected point
// stands out: the others are faint and without their values, which the table has.
function linesIn(image, selected) {
  const measured = store.measurements.map((one) => measurementPart(image, one)).filter(Boolean);
  if (measured.length > CROWD) for (const part of measured) if (!part.points.includes(selected)) soften(part);
  return [...store.lines.map((line) => lengthPart(image, line)).filter(Boolean), ...measured];
}

const CROWD = 24;

function soften(part) {
  part.kind += " faint";
  part.sign = part.kind;
  part.words = "";
}

function pickPart(pick, selected, shown, scale) {
  const fit = fitOf(pick.image, pick.label);
  const suspect = isSuspect(fit?.status);
  const residual = shown.residuals && fit?.residual?.[0] !== null ? fit?.residual : null;
  const sign = JSON.stringify([Boolean(residual), fit?.spread, suspect, fit?.w, selected === pick.label, shown]);
  const move = (group, view) => {
    place(group, view, pick.u, pick.v);
    showTag(group);
    stretch(group, residual, scale);
    put(group, "aria-label", spokenPick(pick, fit, suspect));
  };
  const make = () => pickGroup(pick, fit, suspect, selected, shown, residual);
  return { key: `pick ${pick.label}`, label: pick.label, at: [pick.u, pick.v], sign, make, move };
}

function stretch(group, residual, scale) {
  for (const line of residual ? group.querySelectorAll("line") : []) {
    put(line, "x2", seen(residual[0] * scale));
    put(line, "y2", seen(residual[1] * scale));
  }
}

// To what can be seen: a drag moves all residuals a little, and what stays need not be drawn anew.
const seen = (length) => Math.round(length * 2) / 2;

function pickGroup(pick, fit, suspect, selected, shown, residual) {
  const group = shape("g", {
    class: `mark placed${suspect ? " suspect" : ""}${selected === pick.label ? " selected" : ""}`,
    tabindex: 0, role: "button", "data-label": pick.label,
  });
  if (shown.ellipses && fit?.spread) group.append(...ellipse(fit.spread));
  if (residual) group.append(shape("line", { class: "halo", "stroke-width": 4 }), shape("line", { class: "residual" }));
  if (suspect) group.append(shape("path", { class: "halo wide", d: DIAMOND }), shape("path", { class: "thin", d: DIAMOND }));
  const known = KNOWN[knownAs(pick.label)];
  if (known) group.append(shape("path", { class: "halo wide", d: known }), shape("path", { class: "thin", d: known }));
  group.append(shape("path", { class: "halo wide", d: CROSS }), shape("path", { class: "thin", d: CROSS }),
    shape("circle", { class: "ring", r: 15, fill: "none" }), shape("circle", { class: "hit", r: 12 }));
  if (shown.labels) group.append(text(pick.label, 0, 0, "tag"));
  return group;
}

const knownAs = (label) => (store.control.includes(label) ? "control" : store.check.includes(label) ? "check" : "");

export function spokenPick(pick, fit, suspect) {
  const w = fit?.w === null || fit?.w === undefined ? "" : `, w ${fixed(fit.w, 1)}`;
  const known = knownAs(pick.label);
  return `${pick.label}${known && `, ${known} point`}, u ${pick.u.toFixed(2)}, v ${pick.v.toFixed(2)}${w}${suspect ? ", suspect" : ""}`;
}

function predictedPart(one, selected, shown) {
  const sign = JSON.stringify([one, selected === one.label, shown.labels]);
  const make = () => predictedGroup(one, selected, shown);
  return { key: `predicted ${one.label}`, label: one.label, at: one.at, sign, make, move: (group, view) => { place(group, view, one.at[0], one.at[1]); showTag(group); } };
}

function predictedGroup(one, selected, shown) {
  const group = shape("g", {
    class: `predicted${selected === one.label ? " selected" : ""}`, "data-predicted": one.label,
    role: "img", "aria-label": `${one.label} expected at u ${one.at[0].toFixed(1)}, v ${one.at[1].toFixed(1)}`,
  });
  group.append(...ellipse(one.spread, 5), shape("circle", { class: "ring", r: 15, fill: "none" }));
  if (shown.labels) group.append(text(one.label, 0, 0, "tag"));
  return group;
}

// A 95 % ellipse; `least` keeps it visible where it is smaller than that on the screen. It is a
// path, as a turned <ellipse> has a system of coordinates of its own, and hundreds of those are slow.
function ellipse([major, minor, turn], least = 0) {
  const angle = ((turn ?? 0) * Math.PI) / 180;
  const make = (kind) => {
    const made = shape("path", { class: kind });
    made.resize = (scale) => {
      const [rx, ry] = [major, minor].map((axis) => Math.max((axis ?? 0) * CONFIDENCE * scale, least).toFixed(2));
      const [x, y] = [rx * Math.cos(angle), rx * Math.sin(angle)].map((along) => along.toFixed(2));
      const arc = `A${rx} ${ry} ${(turn ?? 0).toFixed(1)} 1 0`;
      put(made, "d", `M${-x} ${-y}${arc} ${x} ${y}${arc} ${-x} ${-y}Z`);
    };
    return made;
  };
  return [make("halo wide"), make("thin")];
}

function text(words, x, y, kind = "") {
  const made = shape("text", { x, y, class: kind });
  made.textContent = words;
  return made;
}

function place(group, view, u, v) {
  const [x, y] = view.toScreen(u, v);
  put(group, "transform", `translate(${x} ${y})`);
  for (const child of group.children) child.resize?.(view.scale);
}

function lengthPart(image, line) {
  const now = adjusted()?.lines[line.name];
  const words = now?.adjusted ? withSigma(now.adjusted, now.sigma, "m") : `${line.length} m taped`;
  const kind = `length${line.adjust ? "" : " withheld"}${isSuspect(now?.status) ? " suspect" : ""}`;
  return pathPart(image, line.name, [line.start, line.end], kind, `${line.name} ${words}`, false);
}

function measurementPart(image, request) {
  const now = adjusted()?.measurements[request.name];
  const words = now ? valueText(now) : missing;
  if (request.points.length < 2) return null;
  return pathPart(image, request.name, request.points, "measured", `${request.name} ${words}`, request.kind === "area");
}

function pathPart(image, key, points, kind, words, closed) {
  const at = points.map((label) => placeOf(image, label));
  if (at.some((one) => one === null) || (kind !== "draft" && !at.some((one) => one.picked))) return null;
  if (closed) at.push(at[0]);
  return {
    key: `path ${kind.split(" ")[0]} ${key}`,
    sign: kind,
    kind,
    words,
    points,
    make() { return shape("g", { class: this.kind, "aria-hidden": "true" }, shape("polyline", { class: "halo wide" }), shape("polyline", { class: "thin" })); },
    move(group, view) {
      const [halo, thin] = group.children;
      const screen = at.map(({ u, v }) => view.toScreen(u, v));
      const path = screen.map((point) => point.join()).join(" ");
      put(halo, "points", path);
      put(thin, "points", path);
      const [a, b] = [screen[0], screen[1] ?? screen[0]];
      this.along = [a, b];
      this.middle = closed ? average(screen.slice(0, -1)) : null;
      this.room = closed ? Infinity : Math.hypot(b[0] - a[0], b[1] - a[1]);
    },
  };
}

// What stands at a path; `keepApart` finds its place.
function wordsPart(path) {
  return {
    key: `words ${path.key}`,
    sign: JSON.stringify([path.kind, path.words]),
    path,
    make() {
      const label = text(path.words, 0, 0, "value");
      label.setAttribute("text-anchor", "middle");
      return shape("g", { class: path.kind, "aria-hidden": "true" }, label);
    },
    move(group) { this.element = group.firstChild; },
  };
}

// Where a label may stand beside its mark, the usual place first.
const TAG_SPOTS = [[12, -8, "start"], [12, 19, "start"], [-12, -8, "end"], [-12, 19, "end"], [0, -14, "middle"], [0, 25, "middle"]];
const ASIDE = { start: 0, middle: 0.5, end: 1 }; // part of a text that stands left of its place

function showTag(group) {
  const tag = group.lastChild;
  if (!tag?.classList.contains("tag")) return;
  const hidden = group.spot < 0 && !group.classList.contains("selected"); // there is no room for it
  put(tag, "display", hidden ? "none" : "inline");
  const [x, y, anchor] = TAG_SPOTS[Math.max(group.spot ?? 0, 0)];
  put(tag, "x", x);
  put(tag, "y", y);
  put(tag, "text-anchor", anchor);
}

function tagBox(part, [x, y], spot) {
  const [dx, dy, anchor] = TAG_SPOTS[spot];
  const width = part.label.length * CHARACTER_PX;
  return { x: x + dx - ASIDE[anchor] * width, y: y + dy - LINE_PX + 3, width, height: LINE_PX };
}

// Labels of marks that lie close together, each where no other label and no mark is. That hangs on
// the view alone, so it is done when that rests.
export function spreadTags(parts, view) {
  const marks = parts.filter((part) => part.label).map((part) => ({ part, at: view.toScreen(...part.at) }))
    .filter(({ at: [x, y] }) => x > -50 && y > -50 && x < view.width + 50 && y < view.height + 50);
  const over = furniture(view);
  const taken = marks.map(({ at: [x, y] }) => ({ x: x - 8, y: y - 8, width: 16, height: 16 }));
  for (const { part, at } of marks) {
    const boxes = TAG_SPOTS.map((_, spot) => tagBox(part, at, spot));
    const open = boxes.map((box) => free(taken, box.x, box.y, box.width));
    const best = boxes.findIndex((box, k) => open[k] && within(view, box) && free(over, box.x, box.y, box.width));
    part.group.spot = best >= 0 ? best : open.indexOf(true);
    if (part.group.spot >= 0) taken.push(boxes[part.group.spot]);
    showTag(part.group);
  }
}

const average = (points) => [0, 1].map((k) => points.reduce((sum, point) => sum + point[k], 0) / points.length);
const CHARACTER_PX = 6.8;
const LINE_PX = 15;

// Values stand where nothing else does: in the middle of their line, else nearer to an end, else
// they are left out of the photo (the table has them).
export function keepApart(parts, view) {
  const taken = furniture(view);
  taken.push(...parts.filter((part) => part.label).map((part) => {
    const [x, y] = view.toScreen(...part.at);
    const tag = tagBox(part, [x, y], Math.max(part.group.spot ?? 0, 0));
    const top = Math.min(tag.y, y - 9);
    const left = Math.min(tag.x, x - 9);
    return { x: left, y: top, width: Math.max(tag.x + tag.width, x + 9) - left, height: Math.max(tag.y + LINE_PX, y + 9) - top };
  }));
  for (const part of parts) {
    if (!part.path) continue;
    const { element: label, path: { words, room } } = part;
    const width = words.length * CHARACTER_PX;
    const spot = words && room > 60 ? spots(part.path).find(([x, y]) => within(view, { x: x - width / 2, y: y - LINE_PX, width }) && free(taken, x - width / 2, y - LINE_PX, width)) : null;
    put(label, "display", spot ? "inline" : "none");
    if (!spot) continue;
    put(label, "x", spot[0]);
    put(label, "y", spot[1] - 4);
    taken.push({ x: spot[0] - width / 2, y: spot[1] - LINE_PX, width, height: LINE_PX });
  }
}

function spots({ along: [a, b], middle }) {
  if (middle) return [middle, [middle[0], middle[1] + 18], [middle[0], middle[1] - 18]];
  return [0.5, 0.35, 0.65, 0.22, 0.78].map((part) => [a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part]);
}

// What lies over every photo: the box that chooses it, and the line of numbers beneath.
const furniture = ({ height }) => [{ x: 0, y: 0, width: 212, height: 38 }, { x: 0, y: height - 34, width: 330, height: 34 }];

const within = (view, { x, y, width }) => x >= 0 && y >= 0 && x + width <= view.width && y + LINE_PX <= view.height;

function free(taken, x, y, width) {
  return !taken.some((box) => x < box.x + box.width && x + width > box.x && y < box.y + box.height && y + LINE_PX > box.y);
}
