// Lines between points in a photo: lengths and measurements, with their values.

import { adjusted, placeOf, store } from "../connection/store.js";
import { fault } from "../connection/trust.js";
import { put, shape } from "../elements/dom.js";
import { typedText } from "../elements/units.js";
import { textShape } from "./shapes.js";

/** @import { Line, Measurement } from "../connection/protocol.js" */
/** @import { Part, Path, Words } from "./marks.js" */

const CROWD = 24; // number of measurements from which on they are too many to read

// Lengths and measurements. If these are too many to read, only those of the selected point are
// emphasised: the others are faint and without their values, which the table has.
/** @param {number} image @param {string | null} selected */
export function linesIn(image, selected) {
  const lengths = store.lines.map((line) => ({ name: line.name, path: lengthPath(image, line) }));
  const measured = store.measurements.map((one) => ({ name: one.name, path: measurementPath(image, one) })).filter(({ path }) => path);
  if (measured.length > CROWD) {
    for (const { path } of measured) if (path && !path.points.includes(selected ?? "")) Object.assign(path, { kind: `${path.kind} faint`, words: "" });
  }
  return [...lengths, ...measured].flatMap(({ name, path }) => (path ? [{ name, path }] : []));
}

/** @param {number} image @param {Line} line */
function lengthPath(image, line) {
  const now = adjusted()?.lines[line.name];
  const words = now?.text || `${typedText(line.length_m)} taped`;
  const kind = `length${line.adjust ? "" : " withheld"}${fault(now) && ` ${fault(now)}`}`;
  return pathOf(image, [line.start, line.end], kind, `${line.name} ${words}${fault(now) && ` (${fault(now)})`}`, false);
}

/** @param {number} image @param {Measurement} request */
function measurementPath(image, { name, kind, points, parameters = {} }) {
  const now = adjusted()?.measurements[name];
  const words = now ? `${now.text}${now.words && ` (${now.words})`}` : "";
  return points.length < 2 ? null : pathOf(image, outline(kind, points, parameters), `measured ${now?.status ?? "ok"}`, `${name} ${words}`.trim(), kind === "area" || kind === "volume");
}

// The drawn points: those on the boundary of a volume, without its top and its plane.
/** @param {string} kind @param {string[]} points @param {Record<string, number>} parameters */
function outline(kind, points, parameters) {
  const beside = kind === "volume" ? ("top" in parameters ? 1 : 0) + ("plane" in parameters ? 3 : 0) : 0;
  return points.slice(0, points.length - beside);
}

// Lines between labels; null if one of these is not in the photo, or all are only expected there.
/** @param {number} image @param {string[]} points @param {string} kind @param {string} words @param {boolean} closed @returns {Path | null} */
export function pathOf(image, points, kind, words, closed) {
  const at = points.map((label) => placeOf(image, label));
  const there = at.every(Boolean) && (kind === "draft" || at.some((one) => one?.picked));
  return there ? { kind, words, points, closed, screen: [] } : null;
}

/** @param {number} image @param {string} name @param {Path} path @returns {Part} */
export function pathPart(image, name, path) {
  const at = path.points.flatMap((label) => placeOf(image, label) ?? []);
  return {
    key: `path ${path.kind.split(" ", 1)[0]} ${name}`,
    sign: path.kind,
    make: () => shape("g", { class: path.kind, "aria-hidden": "true" }, shape("polyline", { class: "halo wide" }), shape("polyline", { class: "thin" })),
    move: (group, view) => {
      path.screen = at.map(({ u, v }) => view.toScreen(u, v));
      const points = (path.closed ? [...path.screen, path.screen[0]] : path.screen).map((point) => point.join()).join(" ");
      for (const line of group.children) put(line, "points", points);
    },
  };
}

/** @param {string} name @param {Path} path @returns {Part} */
export function wordsPart(name, path) {
  /** @type {Words} */
  const words = { path, text: null };
  return {
    key: `words ${path.kind.split(" ", 1)[0]} ${name}`,
    sign: JSON.stringify([path.kind, path.words]),
    words,
    make: () => {
      const text = textShape(path.words, "value");
      text.setAttribute("text-anchor", "middle");
      return shape("g", { class: path.kind, "aria-hidden": "true" }, text);
    },
    move: (group) => { words.text = group.querySelector("text"); },
  };
}
