// Orientation of the camera on the drone. Small drawings: a drone from its side, flying to the right.

import { node, shape, textIn } from "../elements/dom.js";
import { WrongField } from "./server.js";

/** @import { Found, FoundPhotos } from "../connection/protocol.js" */

const OTHER = "other";
const AT = /** @type {const} */ ([44, 30]); // the camera
const [REACH, HALF_VIEW_DEG] = [44, 22];

/** @type {[string, string, string][]} value, words, explanation */
const WAYS = [
  ["auto", "", ""], // described by what is recorded
  ["-90", "Straight down", "fixed, looking at the ground below"],
  ["-45", "45\u00b0 down", "fixed, looking forward and down"],
  ["0", "Forward", "fixed, looking at the horizon"],
  [OTHER, "Another angle", ""],
];

/** @param {number} deg below the horizon @param {number} reach */
const ray = (deg, reach) => {
  const turn = (deg * Math.PI) / 180;
  return `${(AT[0] + reach * Math.cos(turn)).toFixed(1)} ${(AT[1] + reach * Math.sin(turn)).toFixed(1)}`;
};

/** @param {string} way */
function drawing(way) {
  const deg = way === "auto" ? null : way === OTHER ? 65 : -Number(way);
  const drone = "M22 20h44M22 20v-6M66 20v-6M14 14h16M58 14h16M36 20l4 6h8l4-6";
  /** @type {Node[]} */
  const seen = deg === null
    ? [90, 45, 5].map((one) => shape("path", { class: "ray", d: `M${AT.join(" ")}L${ray(one, REACH)}` }))
    : [shape("path", { class: "view", d: `M${AT.join(" ")}L${ray(deg - HALF_VIEW_DEG, REACH)}L${ray(deg + HALF_VIEW_DEG, REACH)}z` }), shape("path", { class: "ray", d: `M${AT.join(" ")}L${ray(deg, REACH + 6)}` })];
  return shape("svg", { class: "hang", viewBox: "0 0 112 84", "aria-hidden": "true" },
    shape("path", { class: "ground", d: "M2 78h108M8 78l-4 5M28 78l-4 5M48 78l-4 5M68 78l-4 5M88 78l-4 5M108 78l-4 5" }), ...seen, shape("path", { class: "drone", d: drone }), shape("circle", { class: "lens", cx: AT[0], cy: AT[1], r: 4 }));
}

const AS_RECORDED = "As recorded";

// Describes the recorded orientation in a title and words, as far as it is known before the files are read.
/** @param {Found} found @param {number | null} looks @param {boolean} isPlaced */
function recorded({ logs, has_gimbal }, looks, isPlaced) {
  if (!isPlaced) return [AS_RECORDED, "nothing is recorded, and nothing is needed"];
  if (looks !== null) return [AS_RECORDED, `the photos say ${Math.round(looks)}\u00b0 below the horizon`];
  if (has_gimbal) return [AS_RECORDED, "by the gimbal, in the log"];
  return logs.length && has_gimbal === null ? [AS_RECORDED, "by a gimbal, where the log has one"] : ["I do not know", "90\u00b0 down is assumed, with a large error"];
}

// Why a person has to choose.
/** @param {Found} found */
const unrecorded = ({ logs, has_gimbal }) => (logs.length && has_gimbal === null
  ? "Whether a flight log has the angles of a gimbal is found out only when it is read. Choose how the camera hung."
  : "Neither a flight log nor the photos record the angle. Choose how the camera hung.");

// Says that a choice replaces what is recorded.
/** @param {Found} found @param {number | null} looks */
function replaced({ has_gimbal }, looks) {
  const said = looks !== null ? `the photos say ${Math.round(looks)}\u00b0 below the horizon` : has_gimbal ? "the log has the angles of a gimbal" : "";
  return said && `Check this: ${said}. Your choice replaces it; As recorded takes it.`;
}

/** @param {Found} found @param {FoundPhotos[]} photos */
export function mountPart(found, photos) {
  const looks = photos.find(({ looks_deg }) => looks_deg !== null)?.looks_deg ?? null; // below the horizon
  const set = `${found.setup.pitch_deg}`;
  const chosen = WAYS.some(([value]) => value === set) ? set : OTHER;
  const deg = node("input", { name: "pitch_below", inputmode: "decimal", autocomplete: "off", value: chosen === OTHER ? -Number(set) : "", "aria-label": "Degrees below the horizon", size: 4 });
  const isPlaced = Boolean(found.log) || found.logs.length + found.poses.length > 0 || photos.some(({ has_position }) => has_position);
  const isUnrecorded = isPlaced && looks === null && !found.has_gimbal; // only a person knows
  const [title, meaning] = recorded(found, looks, isPlaced);
  const isAsked = isUnrecorded && set === "auto" && !found.has_project;
  const remark = node("p", { class: "replaced", role: "status" });
  const part = node("fieldset", { class: "mount" }, node("legend", {}, "How did the camera hang?"),
    isPlaced ? null : node("p", { class: "dim" }, "There is no flight log, and the photos state no positions: the lengths on the ground place them, and any choice gives the same result."),
    isUnrecorded ? node("p", { class: "dim" }, unrecorded(found)) : null,
    node("div", { class: "ways" }, ...WAYS.map(([value, words, meant]) => node("label", { class: "way-of" },
      node("input", { type: "radio", name: "pitch", value, checked: value === chosen && !isAsked }), drawing(value), node("b", {}, words || title),
      value === OTHER ? node("span", { class: "dim" }, deg, "\u00b0 below the horizon") : node("span", { class: "dim" }, meant || meaning)))),
    remark, isPlaced ? turnPart(found) : null);
  const show = () => {
    const way = part.querySelector("input[type=radio]:checked")?.getAttribute("value") ?? "auto";
    remark.textContent = way === "auto" ? "" : replaced(found, looks);
  };
  part.addEventListener("change", show);
  show();
  deg.addEventListener("input", () => { for (const one of part.querySelectorAll("input")) if (one.value === OTHER) one.checked = true; show(); });
  return part;
}

/** A camera that was turned or tilted on the drone, which is rare. @param {Found} found */
function turnPart({ setup }) {
  /** @param {"yaw" | "roll"} name @param {string} words */
  const field = (name, words) => {
    const set = setup[`${name}_deg`];
    return node("label", {}, words, node("span", {}, node("input", { name, value: set === "auto" ? "" : set, size: 5, autocomplete: "off", placeholder: "0" }), " \u00b0"));
  };
  return node("details", { class: "turned", open: setup.yaw_deg !== "auto" || setup.roll_deg !== "auto" }, node("summary", {}, "It was turned or tilted on the drone (rare)"),
    node("div", { class: "pair" },
      field("yaw", "Turned from the nose: 90 right, 180 back, 270 left. Straight down: where the top of the picture points"),
      field("roll", "Tilted about its line of sight: right side down")),
    node("p", { class: "dim" }, "Empty: not turned, or as recorded."));
}

/** Reads the angles from a form: pitch in degrees above the horizon. @param {FormData} form */
export const anglesIn = (form) => ({ pitch_deg: pitchIn(form), yaw_deg: turnIn(form, "yaw"), roll_deg: turnIn(form, "roll") });

/** @param {FormData} form @param {string} name @returns {number | "auto"} */
function turnIn(form, name) {
  const written = textIn(form, name);
  const deg = Number(written.replace(",", ".").replace("\u2212", "-"));
  if (Number.isNaN(deg)) throw new WrongField(`Enter degrees, such as 90 (read: ${written}).`, name);
  return written ? deg : "auto";
}

/** @param {FormData} form @returns {number | "auto"} */
function pitchIn(form) {
  const way = textIn(form, "pitch");
  if (!way) throw new Error("How did the camera hang? Choose one of the drawings.");
  if (way !== OTHER) return way === "auto" ? "auto" : Number(way);
  const written = textIn(form, "pitch_below");
  const deg = Number(written.replace(",", "."));
  if (!written || Number.isNaN(deg)) throw new WrongField("Enter how many degrees below the horizon, such as 60.", "pitch_below");
  return -deg;
}
