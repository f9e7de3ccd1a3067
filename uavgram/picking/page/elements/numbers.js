// Numbers in readable form.

import { lengthUnit, quantity, sizeText } from "./units.js";

/** @import { Measured } from "../connection/protocol.js" */

export const NUMERAL = /^[\d.,]$/; // characters that begin or continue a number

// Explanations of technical terms, shown as tooltips.
export const SIGMA = "standard deviation: the true value lies within twice as much 19 times out of 20";
export const MISFIT = "how far it is off, in its own standard deviations; what is above about 3 deserves a second look";
const BENDS = "how the lens bends straight lines, the more the farther from the middle";
/** By the first word of the term. @type {Record<string, string | undefined>} */
const TERMS = {
  Sigma: SIGMA, Likely: SIGMA, Friction: "how well the tyres hold on this road, such as 0.7 on dry asphalt",
  fx: "focal length across the photo", fy: "focal length down the photo", cx: "where the lens looks straight ahead: from the left", cy: "where the lens looks straight ahead: from the top",
  k1: BENDS, k2: BENDS, k3: BENDS, k4: BENDS, p1: "how the lens is tilted against the sensor", p2: "how the lens is tilted against the sensor",
  principal: "where the lens looks straight ahead", distortion: BENDS, folds: "from where on the formula of the lens no longer holds",
  brown: "bends lines by Brown's formula, as ordinary lenses do", fisheye: "sees very wide, and bends lines strongly",
};

/** Terms in sentences. @type {Record<string, string>} */
const STATISTICS = { sigma: SIGMA, w: MISFIT, "variance factor": "how much larger misfits are than stated errors explain; 1 is as stated", "chi-square": "the squares of all misfits together, which chance alone makes about as many as there are values" };

/** Explains the terms in a sentence. @param {string} text */
export const explained = (text) => Object.entries(STATISTICS).flatMap(([term, words]) => (new RegExp(`\\b${term}s?\\b`).test(text) ? [`${term}: ${words}`] : [])).join("\n") || null;

/** Explains a caption that is a technical term. @param {string} caption */
export const meaning = (caption) => TERMS[caption.split(/[ ,]/)[0]] ?? null;

/** Empty if there is no value. @param {number | null | undefined} value @param {number} digits */
export function fixed(value, digits) {
  if (value === null || value === undefined) return "";
  const words = value.toFixed(digits);
  return Number(words) === 0 ? words.replace("-", "") : words;
}

// Decimals of a number from its sigma: two significant digits of the sigma, at most 3 places.
/** @param {number | null | undefined} sigma */
export function places(sigma) {
  if (!sigma || !(sigma > 0)) return 3;
  return Math.min(Math.max(1 - Math.floor(Math.log10(sigma)), 0), 3);
}

// Formats a value with sigma; `unit` is the server's ("m", "m2", "m/s"...), shown in the units of the project.
/** @param {number | null | undefined} value @param {number | null | undefined} sigma @param {string} unit */
export function withSigma(value, sigma, unit = "") {
  if (value === null || value === undefined) return "";
  if (unit && unit !== "%") return quantity(value, sigma, unit);
  const digits = places(sigma);
  const error = sigma === null || sigma === undefined ? "" : ` \u00b1 ${sigma.toFixed(digits)}`;
  return `${fixed(value, digits)}${error}${unit && ` ${unit}`}`;
}

// Height of a point in everyday form: with one digit of its sigma, or two if the first is 1.
/** @param {{ height: number, sigma: number | null }} stands */
export function heightText({ height, sigma }) {
  const order = sigma ? Math.floor(Math.log10(sigma)) : -3;
  const digits = sigma && sigma < 2 * 10 ** order ? 1 - order : -order;
  const round = sigma && Number(sigma.toFixed(Math.max(digits, 0)));
  const spread = round ? `, \u00b1 ${sizeText(round)}` : "";
  const high = lengthUnit() === "m" ? `${fixed(Math.abs(height), Math.min(Math.max(digits, 0), 3))} m` : valueOnly(Math.abs(height), sigma, "m");
  return `${high} ${height < 0 ? "below" : "above"} the ground${spread}`;
}

// A value without its sigma, which only determines the number of digits.
/** @param {number} value @param {number | null} sigma @param {string} unit */
export const valueOnly = (value, sigma, unit) => {
  const [told, ...rest] = quantity(value, sigma, unit).split(" \u00b1 ");
  const symbol = rest.join().split(" ").at(-1) ?? "";
  return rest.length && !/[a-z]/.test(told) ? `${told} ${symbol}` : told;
};

const METRES_OF_A_DEGREE = 111_320; // of a great circle

// Latitude or longitude, with the digits justified by the sigma in metres.
/** @param {number} value @param {number | null} sigma */
export function degrees(value, sigma) {
  const digits = sigma && sigma > 0 ? 1 - Math.floor(Math.log10(sigma / METRES_OF_A_DEGREE)) : 7;
  return `${value.toFixed(Math.min(Math.max(digits, 4), 8))}\u00b0`;
}

// A measurement as the page shows it.
/** @param {Measured} found */
export const valueText = ({ value, sigma, unit }) => withSigma(value, sigma, unit);

// A slope as on a road sign.
/** @param {Measured} found its angle [deg] */
export function gradeText({ value, sigma }) {
  if (value === null) return "";
  const [angle, spread] = [value, sigma ?? 0].map((degree) => (degree * Math.PI) / 180);
  return withSigma(100 * Math.tan(angle), sigma === null ? null : (100 * spread) / Math.cos(angle) ** 2, "%");
}

// Values of other solutions that fit as well; empty if there is none.
/** @param {Measured} found */
export function alternativesText({ alternatives, sigma, unit }) {
  const words = alternatives.flatMap((value) => (value === null ? [] : [valueOnly(value, sigma, unit)]));
  if (!words.length) return "";
  const last = /^\S+( \S+)$/.exec(words[words.length - 1])?.[1] ?? ""; // a common unit is written once
  const alike = last && words.every((one) => one.endsWith(last));
  return `or ${words.map((one, k) => (alike && k < words.length - 1 ? one.slice(0, -last.length) : one)).join(", ")}`;
}
