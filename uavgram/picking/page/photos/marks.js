// The marks of one pane as SVG: made when the state changes, moved when the view does.

import { adjusted, fitOf, isSuspect, picksIn, placeOf, predictedIn, proposalAt, proposals, standsAt, store } from "../connection/store.js";
import { put, shape } from "../elements/dom.js";
import { fixed, heightText, missing, places, valueText, withSigma } from "../elements/numbers.js";
import { showTag } from "./labels.js";
import { residualOf, residualScale } from "./residuals.js";
import { madeBy, SHAPES, sourceOf } from "./sources.js";
import { tiesPart } from "./ties.js";

/** @import { Fit, Line, Measurement, Pick, Predicted, Proposal, Spread } from "../connection/protocol.js" */
/** @import { PageState, Shown } from "../actions/page_state.js" */
/** @import { View } from "./view.js" */

/**
 * What is drawn in a photo. `sign` tells whether the group that was made before will do.
 * @typedef {object} Part
 * @property {string} key
 * @property {string} sign
 * @property {() => SVGGElement} make
 * @property {(group: SVGGElement, view: View) => void} move brings the group to its place
 * @property {{ label: string, at: [number, number] }} [mark] a point, and where it is in the photo
 * @property {Words} [words] a value that stands at a path; `keepApart` finds its place
 */

/**
 * @typedef {object} Path lines between points, on the screen since they were moved last
 * @property {string} kind
 * @property {string} words
 * @property {string[]} points labels
 * @property {boolean} closed
 * @property {[number, number][]} screen
 */

/** @typedef {{ path: Path, text: SVGTextElement | null }} Words */

const CONFIDENCE = 2.4477; // 95 % of a plane's normal distribution
const CROWD = 24; // measurements from which on they are too many to read

export const KNOWN = { control: "M0 -13L11.5 7H-11.5Z", check: "M-10 -10H10V10H-10Z" }; // points with known coordinates
export const HOLLOW = "M-8 0A8 8 0 1 0 8 0A8 8 0 1 0 -8 0ZM-2 0H2M0 -2V2"; // found by the program, not accepted
export const DIAMOND = "M0 -13L13 0L0 13L-13 0Z";

// Everything that is drawn in a photo.
/** @param {number} image @param {PageState} state @returns {Part[]} */
export function buildMarks(image, { selected, shown, draft, alike }) {
  const paths = shown.lines ? linesIn(image, selected) : [];
  const drawn = draft.length ? pathOf(image, draft, "draft", "", false) : null;
  const scale = residualScale(image);
  return [
    ...(shown.ties ? [tiesPart(image)] : []),
    ...paths.map(({ name, path }) => pathPart(image, name, path)),
    ...paths.filter(({ path }) => path.words).map(({ name, path }) => wordsPart(name, path)), // over all lines
    ...(drawn ? [pathPart(image, "", drawn)] : []),
    ...(shown.predicted ? predictedIn(image).map((one) => predictedPart(one, selected, shown)) : []),
    ...(shown.predicted ? proposals().filter((one) => one.image === image).map((one) => proposalPart(one, selected, shown)) : []),
    ...(alike?.image === image ? alike.places.map(alikePart) : []),
    ...picksIn(image).map((pick) => pickPart(pick, selected, shown, scale)),
  ];
}

// Lengths and measurements. Where these are too many to read, only what hangs on the selected point
// stands out: the others are faint and without their values, which the table has.
/** @param {number} image @param {string | null} selected */
function linesIn(image, selected) {
  const lengths = store.lines.map((line) => ({ name: line.name, path: lengthPath(image, line) }));
  const measured = store.measurements.map((one) => ({ name: one.name, path: measurementPath(image, one) })).filter(({ path }) => path);
  if (measured.length > CROWD) {
    for (const { path } of measured) if (path && !path.points.includes(selected ?? "")) Object.assign(path, { kind: `${path.kind} faint`, words: "" });
  }
  return [...lengths, ...measured].flatMap(({ name, path }) => (path ? [{ name, path }] : []));
}

/** @param {Pick} pick @param {string | null} selected @param {Shown} shown @param {number} scale @returns {Part} */
function pickPart(pick, selected, shown, scale) {
  const fit = fitOf(pick.image, pick.label);
  const residual = shown.residuals ? residualOf(fit) : null;
  const stands = standsAt(pick.label);
  const tag = tagText(pick.label, stands);
  const high = stands ? `, ${heightText(stands)}` : "";
  return {
    key: `pick ${pick.label}`,
    mark: { label: tag, at: [pick.u_px, pick.v_px] },
    sign: JSON.stringify([tag, Boolean(residual), fit?.spread, isSuspect(fit?.status), fit?.w, selected === pick.label, shown, madeBy(pick)]),
    make: () => pickGroup(pick, tag, fit, selected, shown, Boolean(residual)),
    move: (group, view) => {
      place(group, view, pick.u_px, pick.v_px);
      showTag(group);
      for (const line of residual ? group.querySelectorAll("line") : []) {
        put(line, "x2", seen((residual?.[0] ?? 0) * scale));
        put(line, "y2", seen((residual?.[1] ?? 0) * scale));
      }
      put(group, "aria-label", `${spokenPick(pick, fit)}${high}`);
    },
  };
}

// To what can be seen: a drag moves all residuals a little, and what stays need not be drawn anew.
/** @param {number} length */
const seen = (length) => Math.round(length * 2) / 2;

/** A line with its halo. @param {string} d @param {string} [wide] */
const stroke = (d, wide = "halo wide") => [shape("path", { class: wide, d }), shape("path", { class: "thin", d })];

/** @param {Pick} pick @param {string} tag @param {Fit | undefined} fit @param {string | null} selected @param {Shown} shown @param {boolean} pulled */
function pickGroup(pick, tag, fit, selected, shown, pulled) {
  const { label } = pick;
  const source = sourceOf(pick);
  const suspect = isSuspect(fit?.status);
  const kind = `mark placed${source === "hand" ? "" : ` found ${source}`}${suspect ? " suspect" : ""}${selected === label ? " selected" : ""}`;
  const group = shape("g", { class: kind, tabindex: 0, role: "button", "data-label": label }, titleShape(`${label}: ${madeBy(pick)}`));
  if (shown.ellipses && fit?.spread) group.append(...ellipse(fit.spread));
  if (pulled) group.append(shape("line", { class: "halo", "stroke-width": 4 }), shape("line", { class: "residual" }));
  if (suspect) group.append(...stroke(DIAMOND));
  const known = knownAs(label);
  if (known) group.append(...stroke(KNOWN[known]));
  group.append(...stroke(SHAPES[source]), shape("circle", { class: "ring", r: 15, fill: "none" }), shape("circle", { class: "hit", r: 12 }));
  if (shown.labels) group.append(textShape(tag, "tag"));
  return group;
}

// A label, and how high its point stands where it is off the ground.
/** @param {string} label @param {ReturnType<typeof standsAt>} stands */
function tagText(label, stands) {
  return stands ? `${label} ${stands.height < 0 ? "\u2193" : "\u2191"}${fixed(Math.abs(stands.height), Math.min(places(stands.sigma), 2))} m` : label;
}

/** @param {string} label @returns {"control" | "check" | ""} */
const knownAs = (label) => (store.control.includes(label) ? "control" : store.check.includes(label) ? "check" : "");

/** @param {Pick} pick @param {Fit | undefined} fit */
function spokenPick(pick, fit) {
  const w = fit === undefined || fit.w === null ? "" : `, w ${fixed(fit.w, 1)}`;
  const known = knownAs(pick.label);
  return `${pick.label}${known && `, ${known} point`}${pick.source ? `, ${madeBy(pick)}` : ""}, u ${pick.u_px.toFixed(2)}, v ${pick.v_px.toFixed(2)}${w}${isSuspect(fit?.status) ? ", suspect" : ""}`;
}

/** @param {Predicted} one @param {string | null} selected @param {Shown} shown @returns {Part} */
function predictedPart({ image, label, pixel_px: at, spread }, selected, shown) {
  const proposed = Boolean(proposalAt(image, label)); // which has the label then
  return {
    key: `predicted ${label}`,
    mark: proposed ? undefined : { label, at },
    sign: JSON.stringify([label, at, spread, selected === label, shown.labels, proposed]),
    make: () => {
      const group = shape("g", {
        class: `predicted${selected === label ? " selected" : ""}`, "data-predicted": label,
        role: "img", "aria-label": `${label} expected at u ${at[0].toFixed(1)}, v ${at[1].toFixed(1)}`,
      }, ...ellipse(spread, 5));
      if (!proposed) group.append(shape("circle", { class: "ring", r: 15, fill: "none" }));
      if (shown.labels && !proposed) group.append(textShape(label, "tag"));
      return group;
    },
    move: (group, view) => { place(group, view, ...at); showTag(group); },
  };
}

// What the program found: a hollow mark, which is no pick before somebody says so.
/** @param {Proposal} one @param {string | null} selected @param {Shown} shown @returns {Part} */
function proposalPart(one, selected, shown) {
  const { label, u_px, v_px } = one;
  const words = proposalWords(one);
  return {
    key: `proposal ${label}`,
    mark: { label: `${label}?`, at: [u_px, v_px] },
    sign: JSON.stringify([words, selected === label, shown.labels]),
    make: () => {
      const group = shape("g", { class: `mark proposed${selected === label ? " selected" : ""}`, tabindex: 0, role: "button", "data-proposal": label, "aria-label": `Accept ${words}` },
        titleShape(`${words}. Click accepts it, Delete refuses it`),
        ...stroke(HOLLOW), shape("circle", { class: "ring", r: 15, fill: "none" }), shape("circle", { class: "hit", r: 12 }));
      if (shown.labels) group.append(textShape(`${label}?`, "tag"));
      return group;
    },
    move: (group, view) => { place(group, view, u_px, v_px); showTag(group); },
  };
}

// One of several that a label may be meant to be on.
/** @param {[number, number]} at @param {number} number @returns {Part} */
function alikePart(at, number) {
  return {
    key: `alike ${number}`,
    sign: JSON.stringify(at),
    make: () => shape("g", { class: "alike", role: "img", "data-alike": number, "aria-label": `may be meant: u ${at[0].toFixed(1)}, v ${at[1].toFixed(1)}` }, ...stroke(HOLLOW)),
    move: (group, view) => place(group, view, ...at),
  };
}

/** @param {Proposal} one */
const proposalWords = ({ label, from_image, sigma_px, score }) =>
  `${label}, found from the pick in ${store.photos[from_image].name}, \u03c3 ${sigma_px.toFixed(2)} px, score ${score.toFixed(2)}`;

/** @type {WeakMap<Element, (scale: number) => void>} */
const resizers = new WeakMap(); // of ellipses, whose size hangs on the zoom

// A 95 % ellipse; `least` keeps it visible where it is smaller than that on the screen. It is a
// path, as a turned <ellipse> has a system of coordinates of its own, and hundreds of those are slow.
/** @param {Spread} spread @param {number} least */
function ellipse({ major_px, minor_px, turn_deg }, least = 0) {
  const angle = ((turn_deg ?? 0) * Math.PI) / 180;
  const made = stroke("");
  for (const one of made) {
    resizers.set(one, (scale) => {
      const [rx, ry] = [major_px, minor_px].map((axis) => Math.max((axis ?? 0) * CONFIDENCE * scale, least));
      const [x, y] = [rx * Math.cos(angle), rx * Math.sin(angle)].map((along) => Number(along.toFixed(2)));
      const arc = `A${rx.toFixed(2)} ${ry.toFixed(2)} ${(turn_deg ?? 0).toFixed(1)} 1 0`;
      put(one, "d", `M${-x} ${-y}${arc} ${x} ${y}${arc} ${-x} ${-y}Z`);
    });
  }
  return made;
}

/** @param {string} words @param {string} kind */
function textShape(words, kind) {
  const made = shape("text", { x: 0, y: 0, class: kind });
  made.textContent = words;
  return made;
}

/** What is said to who rests the pointer there. @param {string} words */
function titleShape(words) {
  const made = shape("title");
  made.textContent = words;
  return made;
}

/** @param {SVGGElement} group @param {View} view @param {number} u @param {number} v */
function place(group, view, u, v) {
  put(group, "transform", `translate(${view.toScreen(u, v).join(" ")})`);
  for (const child of group.children) resizers.get(child)?.(view.scale);
}

/** @param {number} image @param {Line} line */
function lengthPath(image, line) {
  const now = adjusted()?.lines[line.name];
  const words = now?.adjusted_m ? withSigma(now.adjusted_m, now.sigma_m, "m") : `${line.length_m} m taped`;
  const kind = `length${line.adjust ? "" : " withheld"}${isSuspect(now?.status) ? " suspect" : ""}`;
  return pathOf(image, [line.start, line.end], kind, `${line.name} ${words}`, false);
}

/** @param {number} image @param {Measurement} request */
function measurementPath(image, { name, kind, points, parameters = {} }) {
  const now = adjusted()?.measurements[name];
  const words = now ? `${valueText(now)}${now.words && ` (${now.words})`}` : missing;
  return points.length < 2 ? null : pathOf(image, outline(kind, points, parameters), `measured ${now?.status ?? "ok"}`, `${name} ${words}`, kind === "area" || kind === "volume");
}

// The points that are drawn: of a volume those around it, without its top and its plane.
/** @param {string} kind @param {string[]} points @param {Record<string, number>} parameters */
function outline(kind, points, parameters) {
  const beside = kind === "volume" ? ("top" in parameters ? 1 : 0) + ("plane" in parameters ? 3 : 0) : 0;
  return points.slice(0, points.length - beside);
}

// Lines between labels; none where one of these is not in the photo, or all are only expected there.
/** @param {number} image @param {string[]} points @param {string} kind @param {string} words @param {boolean} closed @returns {Path | null} */
function pathOf(image, points, kind, words, closed) {
  const at = points.map((label) => placeOf(image, label));
  const there = at.every(Boolean) && (kind === "draft" || at.some((one) => one?.picked));
  return there ? { kind, words, points, closed, screen: [] } : null;
}

/** @param {number} image @param {string} name @param {Path} path @returns {Part} */
function pathPart(image, name, path) {
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
function wordsPart(name, path) {
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
