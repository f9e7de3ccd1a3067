// How far the shown numbers can be trusted: the server's verdict, if it belongs to the present picks.
// Never green before there are numbers, while they are older than the picks, or without the server.

import { adjusted, store } from "./store.js";

/** @import { Trust, Verdict } from "./protocol.js" */
/** @typedef {"current" | "first-order" | "old" | "stopped" | "none" | "lost"} Age of the numbers */
/** @typedef {{ level: NonNullable<Verdict["level"]> | "none", words: string }} Light */

/** @type {Record<Exclude<Age, "current">, string>} */
const WORDS = {
  none: "Not checked yet",
  "first-order": "Not checked yet: first estimates",
  old: "Not checked yet: being computed",
  stopped: "Not checked: you stopped the computation",
  lost: "Not checked: no connection",
};

/** @returns {Age} */
export function ageOfNumbers() {
  if (store.begun && !store.connected) return "lost";
  if (!adjusted()) return "none";
  if (store.mode === "linearised") return "first-order";
  if (store.waits) return "old";
  return adjusted()?.stopped ? "stopped" : "current";
}

/** @returns {Light} */
export function light() {
  const age = ageOfNumbers();
  const verdict = adjusted()?.verdict;
  return age === "current" && verdict ? { level: verdict.level ?? "none", words: verdict.words } : { level: "none", words: WORDS[age === "current" ? "none" : age] };
}

/** Status of the point with this label. @param {string} label @returns {Trust | undefined} */
export const trustOfPoint = (label) => adjusted()?.points[label];

/** @param {number} image @returns {Trust | undefined} */
export const trustOfPhoto = (image) => adjusted()?.frames[image]?.standing;

/** Returns "doubtful" or "contradicted", which are shown differently; else empty. @param {Trust | undefined} trust @returns {"doubtful" | "contradicted" | ""} */
export const fault = (trust) => (trust?.status === "doubtful" || trust?.status === "contradicted" ? trust.status : "");
