// Placement of labels and values beside their marks, without overlaps.

import { put } from "../elements/dom.js";

/** @import { Part, Path } from "./marks.js" */
/** @import { View } from "./view.js" */
/** @typedef {{ x: number, y: number, width: number, height: number }} Box on the screen */

const CHARACTER_PX = 6.8;
const LINE_PX = 15;
const LEAST_ROOM_PX = 60; // length of a line with a value, at least

// Positions of a label beside its mark, the usual one first: offset, and the part of the text that is
// to the left of it.
const SPOTS = [
  { dx: 12, dy: -8, anchor: "start", aside: 0 }, { dx: 12, dy: 19, anchor: "start", aside: 0 },
  { dx: -12, dy: -8, anchor: "end", aside: 1 }, { dx: -12, dy: 19, anchor: "end", aside: 1 },
  { dx: 0, dy: -14, anchor: "middle", aside: 0.5 }, { dx: 0, dy: 25, anchor: "middle", aside: 0.5 },
];

/** @type {WeakMap<Element, number>} */
const spots = new WeakMap(); // by each mark's group; -1: there is no room

/** @param {Element | undefined} group */
const spotOf = (group) => SPOTS[Math.max((group && spots.get(group)) ?? 0, 0)];

/** @param {SVGGElement} group */
export function showTag(group) {
  const tag = group.lastElementChild;
  if (!tag?.classList.contains("tag")) return;
  const { dx, dy, anchor } = spotOf(group);
  const hidden = spots.get(group) === -1 && !group.classList.contains("selected");
  put(tag, "display", hidden ? "none" : "inline");
  put(tag, "x", dx);
  put(tag, "y", dy);
  put(tag, "text-anchor", anchor);
}

/** @param {string} label @param {[number, number]} at @param {typeof SPOTS[0]} spot @returns {Box} */
function tagBox(label, [x, y], { dx, dy, aside }) {
  const width = label.length * CHARACTER_PX;
  return { x: x + dx - aside * width, y: y + dy - LINE_PX + 3, width, height: LINE_PX };
}

/** The marks among the parts. @param {Map<Part, SVGGElement>} parts @param {View} view @returns {{ label: string, group: SVGGElement, at: [number, number] }[]} */
const marksOn = (parts, view) => [...parts].flatMap(([{ mark }, group]) => (mark ? [{ label: mark.label, group, at: view.toScreen(...mark.at) }] : []));

// Places the labels of marks close together. It depends on the view alone, so it is done when that is at rest.
/** @param {Map<Part, SVGGElement>} parts @param {View} view */
export function spreadTags(parts, view) {
  const marks = marksOn(parts, view).filter(({ at: [x, y] }) => x > -50 && y > -50 && x < view.width + 50 && y < view.height + 50);
  const over = furniture(view);
  const taken = marks.map(({ at: [x, y] }) => ({ x: x - 8, y: y - 8, width: 16, height: 16 }));
  for (const { label, group, at } of marks) {
    const boxes = SPOTS.map((spot) => tagBox(label, at, spot));
    const open = boxes.map((box) => isFree(taken, box));
    const best = boxes.findIndex((box, k) => open[k] && isWithin(view, box) && isFree(over, box));
    const spot = best >= 0 ? best : open.indexOf(true);
    spots.set(group, spot);
    if (spot >= 0) taken.push(boxes[spot]);
    showTag(group);
  }
}

// Places values where nothing else is: in the middle of their line, else nearer to an end, else they
// are left out of the photo (the table has them).
/** @param {Map<Part, SVGGElement>} parts @param {View} view */
export function keepApart(parts, view) {
  const taken = [...furniture(view), ...marksOn(parts, view).map(({ label, group, at: [x, y] }) => {
    const tag = tagBox(label, [x, y], spotOf(group));
    const [left, top] = [Math.min(tag.x, x - 9), Math.min(tag.y, y - 9)];
    return { x: left, y: top, width: Math.max(tag.x + tag.width, x + 9) - left, height: Math.max(tag.y + LINE_PX, y + 9) - top };
  })];
  for (const { words } of parts.keys()) {
    if (!words?.text) continue;
    const width = words.path.words.length * CHARACTER_PX;
    const boxes = wordsPlaces(words.path).map(([x, y]) => ({ x: x - width / 2, y: y - LINE_PX, width, height: LINE_PX }));
    const box = boxes.find((one) => isWithin(view, one) && isFree(taken, one));
    put(words.text, "display", box ? "inline" : "none");
    if (!box) continue;
    put(words.text, "x", box.x + width / 2);
    put(words.text, "y", box.y + LINE_PX - 4);
    taken.push(box);
  }
}

/** @param {Path} path @returns {[number, number][]} */
function wordsPlaces({ screen, closed }) {
  if (closed) {
    const [x, y] = [0, 1].map((k) => screen.reduce((sum, point) => sum + point[k], 0) / screen.length);
    return [[x, y], [x, y + 18], [x, y - 18]];
  }
  const [[x, y], [toX, toY]] = screen;
  if (!(Math.hypot(toX - x, toY - y) > LEAST_ROOM_PX)) return [];
  return [0.5, 0.35, 0.65, 0.22, 0.78].map((part) => [x + (toX - x) * part, y + (toY - y) * part]);
}

/** Controls over every photo: the box that chooses it, and the line of numbers beneath. @param {View} view @returns {Box[]} */
const furniture = ({ height }) => [{ x: 0, y: 0, width: 212, height: 38 }, { x: 0, y: height - 34, width: 330, height: 34 }];

/** @param {View} view @param {Box} box */
const isWithin = (view, { x, y, width, height }) => x >= 0 && y >= 0 && x + width <= view.width && y + height <= view.height;

/** @param {Box[]} taken @param {Box} one */
const isFree = (taken, one) => !taken.some((box) => one.x < box.x + box.width && one.x + one.width > box.x && one.y < box.y + box.height && one.y + one.height > box.y);
