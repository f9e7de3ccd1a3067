// The marks of one pane as SVG: made when the state changes, moved when the view does.

import { fitOf, isSuspect, picksIn, predictedIn, proposalAt, proposals, standsAt, store } from "../connection/store.js";
import { fault, trustOfPoint } from "../connection/trust.js";
import { put, shape } from "../elements/dom.js";
import { fixed } from "../elements/numbers.js";
import { askedParts } from "./question_place.js";
import { showTag } from "./labels.js";
import { ON_PX } from "./nearby_marks.js";
import { linesIn, pathOf, pathPart, wordsPart } from "./paths.js";
import { residualOf, residualScale } from "./residuals.js";
import { stroke, textShape, titleShape } from "./shapes.js";
import { madeBy, SHAPES, sourceOf } from "./sources.js";
import { tiesPart } from "./ties.js";

/** @import { Fit, Pick, Predicted, Proposal, Spread, Trust } from "../connection/protocol.js" */
/** @import { PageState, Shown } from "../actions/page_state.js" */
/** @import { View } from "./view.js" */

/**
 * An item drawn in a photo. An equal `sign` means that the existing group can be kept.
 * @typedef {object} Part
 * @property {string} key
 * @property {string} sign
 * @property {() => SVGGElement} make
 * @property {(group: SVGGElement, view: View) => void} move moves the group to its place
 * @property {{ label: string, at: [number, number] }} [mark] a point, and its place in the photo
 * @property {Words} [words] a value beside a path; `keepApart` finds its place
 */

/**
 * @typedef {object} Path lines between points, with screen positions of the last move
 * @property {string} kind
 * @property {string} words
 * @property {string[]} points labels
 * @property {boolean} closed
 * @property {[number, number][]} screen
 */

/** @typedef {{ path: Path, text: SVGTextElement | null }} Words */

const CONFIDENCE = 2.4477; // 95 % of a bivariate normal distribution

export const KNOWN = { control: "M0 -13L11.5 7H-11.5Z", check: "M-10 -10H10V10H-10Z" }; // points with known coordinates
export const HOLLOW = "M-8 0A8 8 0 1 0 8 0A8 8 0 1 0 -8 0ZM-2 0H2M0 -2V2"; // found by the program, not accepted
export const OCTAGON = "M-6 -14H6L14 -6V6L6 14H-6L-14 6V-6Z"; // a point that is contradicted: stop
export const DIAMOND = "M0 -13L13 0L0 13L-13 0Z";

// All items drawn in a photo.
/** @param {number} image @param {PageState} state @returns {Part[]} */
export function buildMarks(image, { selected, shown, draft, asked, alike }) {
  const paths = shown.lines ? linesIn(image, selected) : [];
  const drawn = draft.length ? pathOf(image, draft, "draft", "", false) : null;
  const scale = residualScale(image);
  return [
    ...(shown.ties ? [tiesPart(image)] : []),
    ...paths.map(({ name, path }) => pathPart(image, name, path)),
    ...paths.filter(({ path }) => path.words).map(({ name, path }) => wordsPart(name, path)), // above all lines
    ...(drawn ? [pathPart(image, "", drawn)] : []),
    ...(shown.predicted ? predictedIn(image).map((one) => predictedPart(one, selected, shown)) : []),
    ...(shown.predicted ? proposals().filter((one) => one.image === image).map((one) => proposalPart(one, selected, shown)) : []),
    ...(alike?.image === image ? alike.places.map(alikePart) : []),
    ...picksIn(image).map((pick) => pickPart(pick, selected, shown, scale)),
    ...askedParts(asked, image),
  ];
}

/** @param {Pick} pick @param {string | null} selected @param {Shown} shown @param {number} scale @returns {Part} */
function pickPart(pick, selected, shown, scale) {
  const fit = fitOf(pick.image, pick.label);
  const residual = shown.residuals ? residualOf(fit) : null;
  const stands = standsAt(pick.label);
  const tag = tagText(pick.label, stands);
  const high = stands ? `, ${stands.sentence}` : "";
  let spoken = ""; // made once: it is independent of the view
  return {
    key: `pick ${pick.label}`,
    mark: { label: tag, at: [pick.u_px, pick.v_px] },
    sign: JSON.stringify([tag, Boolean(residual), fit?.spread, isSuspect(fit?.status), fit?.w, selected === pick.label, shown, madeBy(pick), trustOfPoint(pick.label)?.status, trustOfPoint(pick.label)?.why]),
    make: () => pickGroup(pick, tag, fit, selected, shown, Boolean(residual)),
    move: (group, view) => {
      place(group, view, pick.u_px, pick.v_px);
      showTag(group);
      if (residual) pull(group, residual, scale);
      put(group, "aria-label", spoken ||= `${spokenPick(pick, fit)}${high}`);
    },
  };
}

// Draws the residual as a line from the mark. At each frame: a query for it would create a list as garbage.
/** @param {SVGGElement} group @param {[number, number]} residual @param {number} scale */
function pull(group, [u, v], scale) {
  for (let line = group.firstElementChild; line; line = line.nextElementSibling) {
    if (line.localName !== "line") continue;
    put(line, "x2", seen(u * scale));
    put(line, "y2", seen(v * scale));
  }
}

// Rounds to visible steps: a drag moves all residuals a little, and those in the same step need no redrawing.
/** @param {number} length */
const seen = (length) => Math.round(length * 2) / 2;

/** @param {Pick} pick @param {string} tag @param {Fit | undefined} fit @param {string | null} selected @param {Shown} shown @param {boolean} pulled */
function pickGroup(pick, tag, fit, selected, shown, pulled) {
  const { label } = pick;
  const source = sourceOf(pick);
  const suspect = isSuspect(fit?.status);
  const trust = trustOfPoint(label);
  const wrong = fault(trust);
  const kind = `mark placed${source === "hand" ? "" : ` found ${source}`}${wrong && ` ${wrong}`}${suspect ? " suspect" : ""}${selected === label ? " selected" : ""}`;
  const group = shape("g", { class: kind, tabindex: 0, role: "button", "data-label": label, "data-status": trust?.status ?? "" }, titleShape(`${label}: ${madeBy(pick)}${toldOf(trust)}`));
  if (shown.ellipses && fit?.spread) group.append(...ellipse(fit.spread));
  if (pulled) group.append(shape("line", { class: "halo", "stroke-width": 4 }), shape("line", { class: "residual" }));
  group.append(...signs(label, suspect, wrong));
  group.append(...stroke(SHAPES[source]), shape("circle", { class: "ring", r: 15, fill: "none" }), shape("circle", { class: "hit", r: ON_PX }));
  if (shown.labels) group.append(textShape(tag, "tag"));
  return group;
}

// Signs round a mark: it does not fit, or depends on observations that do not, or its place is known.
/** @param {string} label @param {boolean} suspect @param {ReturnType<typeof fault>} wrong */
function signs(label, suspect, wrong) {
  const known = knownAs(label);
  const trust = suspect || !wrong ? [] : [shape("g", { class: `trust ${wrong}` }, ...stroke(wrong === "contradicted" ? OCTAGON : DIAMOND))];
  return [...(suspect ? stroke(DIAMOND) : trust), ...(known ? stroke(KNOWN[known]) : [])];
}

/** @param {Trust | undefined} trust */
const toldOf = (trust) => (trust?.words ? `\n${trust.words}: ${trust.why}` : "");

// A label, with the height of its point if that is off the ground.
/** @param {string} label @param {ReturnType<typeof standsAt>} stands */
function tagText(label, stands) {
  return stands ? `${label} ${stands.tag}` : label;
}

/** @param {string} label @returns {"control" | "check" | ""} */
const knownAs = (label) => (store.control.includes(label) ? "control" : store.check.includes(label) ? "check" : "");

/** @param {Pick} pick @param {Fit | undefined} fit */
function spokenPick(pick, fit) {
  const w = fit === undefined || fit.w === null ? "" : `, misfit ${fixed(fit.w, 1)}`;
  const known = knownAs(pick.label);
  const trust = trustOfPoint(pick.label);
  return `${pick.label}${known && `, ${known} point`}${pick.source ? `, ${madeBy(pick)}` : ""}, u ${pick.u_px.toFixed(2)}, v ${pick.v_px.toFixed(2)}${w}${isSuspect(fit?.status) ? ", suspect" : ""}${trust?.words ? `, ${trust.words}` : ""}`;
}

/** @param {Predicted} one @param {string | null} selected @param {Shown} shown @returns {Part} */
function predictedPart({ image, label, pixel_px: at, spread }, selected, shown) {
  const proposed = Boolean(proposalAt(image, label)); // which then has the label
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

// A proposal: a hollow mark, which is no pick before it is accepted.
/** @param {Proposal} one @param {string | null} selected @param {Shown} shown @returns {Part} */
function proposalPart(one, selected, shown) {
  const { label, u_px, v_px, is_sure } = one;
  const words = proposalWords(one);
  const tag = `${label}?${is_sure ? "" : " unsure"}`;
  return {
    key: `proposal ${label}`,
    mark: { label: tag, at: [u_px, v_px] },
    sign: JSON.stringify([words, selected === label, shown.labels]),
    make: () => {
      const group = shape("g", { class: `mark proposed${selected === label ? " selected" : ""}`, tabindex: 0, role: "button", "data-proposal": label, "aria-label": `Accept ${words}` },
        titleShape(`${words}. A click here is a pick of your own, the full stop accepts what was found, Delete refuses it`),
        ...stroke(HOLLOW), shape("circle", { class: "ring", r: 15, fill: "none" }), shape("circle", { class: "hit", r: ON_PX }));
      if (shown.labels) group.append(textShape(tag, "tag"));
      return group;
    },
    move: (group, view) => { place(group, view, u_px, v_px); showTag(group); },
  };
}

// One of several candidates for a label.
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
const proposalWords = ({ label, source, from_image, sigma_px, score, is_sure }) =>
  `${label}, ${is_sure ? "" : "unsure: "}${source === "target" || from_image === null ? "a target that the program found" : `found from the pick in ${store.photos[from_image].name}`}, \u00b1 ${fixed(sigma_px, 2)} px, score ${fixed(score, 2)}`;

/** Resizers of ellipses, which depend on the zoom; `reach_px`: in the photo; `scale`: of the last drawing. @type {WeakMap<Element, { reach_px: number, scale: number, resize: (scale: number) => void }>} */
const resizers = new WeakMap();
/** Last places of the groups on the screen. @type {WeakMap<Element, [number, number]>} */
const places = new WeakMap();
const EDGE = 20; // of the drawing round a mark, for any size of its ellipse

// A 95 % ellipse; `least` keeps it visible if it is smaller than that on the screen. It is a
// path, as a turned <ellipse> has a system of coordinates of its own, and hundreds of those are slow.
/** @param {Spread} spread @param {number} least */
function ellipse({ major_px, minor_px, turn_deg }, least = 0) {
  const angle = ((turn_deg ?? 0) * Math.PI) / 180;
  const made = stroke("");
  for (const one of made) {
    const resize = (/** @type {number} */ scale) => {
      const [rx, ry] = [major_px, minor_px].map((axis) => Math.max((axis ?? 0) * CONFIDENCE * scale, least));
      const [x, y] = [rx * Math.cos(angle), rx * Math.sin(angle)].map((along) => Number(along.toFixed(2)));
      const arc = `A${rx.toFixed(2)} ${ry.toFixed(2)} ${(turn_deg ?? 0).toFixed(1)} 1 0`;
      put(one, "d", `M${-x} ${-y}${arc} ${x} ${y}${arc} ${-x} ${-y}Z`);
    };
    resizers.set(one, { reach_px: (major_px ?? 0) * CONFIDENCE, scale: NaN, resize });
  }
  return made;
}

/** @param {SVGGElement} group @param {View} view @param {number} u @param {number} v */
function place(group, view, u, v) {
  const [x, y] = view.toScreen(u, v);
  const before = places.get(group);
  if (before?.[0] !== x || before[1] !== y) {
    places.set(group, [x, y]);
    put(group, "transform", `translate(${x} ${y})`);
  }
  const away = Math.max(-x, -y, x - view.width, y - view.height);
  for (let child = group.firstElementChild; child; child = child.nextElementSibling) {
    const sized = resizers.get(child);
    // Ellipses outside the view are redrawn when they come into it.
    if (!sized || sized.scale === view.scale || away > sized.reach_px * view.scale + EDGE) continue;
    sized.scale = view.scale;
    sized.resize(view.scale);
  }
}
