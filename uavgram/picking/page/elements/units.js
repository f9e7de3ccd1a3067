// Lengths as people type them, and those of the page's own drawings, in the units of the project. All
// other numbers come as texts from the server.

/** @import { Units } from "../connection/protocol.js" */

const FOOT_M = 0.3048; // the international foot, exactly
const INCHES = 12;
const INCH_M = FOOT_M / INCHES;
const FINEST = 64; // of an inch, on a tape

/** @type {Units} */
let units = { length: "m", speed: "km/h" };

/** @param {Units} project */
export function useUnits(project) { units = project; }

// "40 ft 6 1/8 in": a length rounded to a fraction of an inch.
/** @param {number} value inches @param {number} step */
function feetInches(value, step) {
  const parts = Math.round(FINEST * step) * Math.floor(Math.abs(value) / step + 0.5);
  const sign = value < 0 && parts ? "-" : "";
  const feet = Math.floor(parts / (FINEST * INCHES));
  const rest = parts - feet * FINEST * INCHES;
  const [inches, part] = [Math.floor(rest / FINEST), rest % FINEST];
  const told = [inches || !part ? `${inches}` : "", part ? fraction(part) : ""].filter(Boolean).join(" ");
  return feet ? `${sign}${feet} ft ${told} in` : `${sign}${told} in`;
}

/** @param {number} part sixty-fourths of an inch */
function fraction(part) {
  let common = FINEST;
  while (part % common) common /= 2;
  return `${part / common}/${FINEST / common}`;
}

// A small or large length in a sentence.
/** @param {number} metres */
export function sizeText(metres) {
  if (units.length === "ft-in") return metres < FOOT_M ? `${Number((metres / INCH_M).toPrecision(3))} in` : feetInches(metres / INCH_M, 1 / 4);
  if (units.length === "ft") return `${Number((metres / FOOT_M).toPrecision(3))} ft`;
  if (metres >= 1) return `${metres} m`;
  return metres >= 0.01 ? `${Number((100 * metres).toPrecision(3))} cm` : `${Number((1000 * metres).toPrecision(3))} mm`;
}

// Unit for table heads: feet have decimals there.
export const lengthUnit = () => (units.length === "m" ? "m" : "ft");
export const smallUnit = () => (units.length === "m" ? "mm" : "in");
/** @param {number} metres */
export const inLength = (metres) => (units.length === "m" ? metres : metres / FOOT_M);

// Parsing.

// A field takes lengths such as "13.2", in its own unit, "13 ft 2 1/2 in", 13' 2 1/2", "4.1 m" or "401 cm".
/** @typedef {"length" | "small"} Sort sigmas are small: a bare number is inches where lengths are feet and inches */

/** @param {Sort} [sort] */
export const fieldUnit = (sort = "length") => (units.length === "m" ? "m" : units.length === "ft" || sort === "length" ? "ft" : "in");

/** @type {Record<string, number | undefined>} */
const SCALES = { m: 1, cm: 0.01, mm: 0.001, km: 1000, ft: FOOT_M, feet: FOOT_M, foot: FOOT_M, "'": FOOT_M, "\u2032": FOOT_M, in: INCH_M, inch: INCH_M, inches: INCH_M, "\"": INCH_M, "\u2033": INCH_M, yd: 3 * FOOT_M };
const ONE = /^([-+]?)(\d+\.?\d*|\.\d+)(e[-+]?\d+)?\s*(m|cm|mm|km|ft|feet|foot|'|\u2032|in|inch|inches|"|\u2033|yd)?$/i;
const INCH_FRACTION = /^([-+]?)(?:(\d+)\s*(?:ft|feet|foot|'|\u2032)\s*-?\s*)?(?:(\d+\.?\d*|\.\d+)(?:[\s-]+(\d+)\/(\d+))?|(\d+)\/(\d+))\s*(?:in|inch|inches|"|\u2033|'')$/i;

// Whether a text may be the beginning of a length: its last letters are those of a unit, or of an exponent.
/** @param {string} text */
export function mayBecomeLength(text) {
  const letters = (/[a-z]*$/i.exec(text)?.[0] ?? "").toLowerCase();
  return ["e", ...Object.keys(SCALES)].some((unit) => unit.startsWith(letters));
}

export const THOUSANDS = /^[-+]?[1-9]\d{0,2},\d{3}(?![\d.,])/; // the comma may be that of thousands, or a decimal comma
export const DECIMAL_COMMA = /,(?=\d+(?![\d.,]))/;
export const LARGEST_M = 1000; // no drone's photo shows a taped length of a kilometre

// Returns metres; NaN if the text is not a length. A comma before three digits is that of decimals if the number without
// it is larger than any taped length; else the text has two meanings, and is refused.
/** @param {string} text @param {Sort} [sort] */
export function parseLength(text, sort = "length") {
  const whole = THOUSANDS.test(text.trim()) ? readPointed(text.replace(",", ""), sort) : Infinity;
  return Math.abs(whole) < LARGEST_M ? NaN : readPointed(text.replace(DECIMAL_COMMA, "."), sort);
}

/** @param {string} text a length with a decimal point @param {Sort} sort */
function readPointed(text, sort) {
  const written = text.trim();
  const one = ONE.exec(written);
  if (one) return exact(Number(`${one[1]}${one[2]}${one[3] ?? ""}`) * (SCALES[(one[4] ?? fieldUnit(sort)).toLowerCase()] ?? NaN));
  const parts = INCH_FRACTION.exec(written);
  if (!parts) return NaN;
  const [, sign, feet = "0", inches = "0", over = "0", under = "1", alone = "0", of = "1"] = parts;
  return exact((sign === "-" ? -1 : 1) * (Number(feet) * INCHES + Number(inches) + Number(over) / Number(under) + Number(alone) / Number(of)) * INCH_M);
}

// Rounds to eight digits, one less than a field shows: an unchanged field keeps its meaning.
/** @param {number} metres @returns {number} */
const exact = (metres) => (Number.isFinite(metres) ? Number(metres.toPrecision(8)) : NaN);

// Rounds a small length to three digits in the unit of its field.
/** @param {number} metres */
export function roundSmall(metres) {
  const unit = parseLength("1", "small");
  return exact(Number((metres / unit).toPrecision(3)) * unit);
}

// Text of a field that is read back with the same meaning: "13.2", or "13 ft 2 1/2 in".
/** @param {number | null | undefined} metres @param {Sort} [sort] */
export function fieldText(metres, sort = "length") {
  if (metres === null || metres === undefined) return "";
  if (units.length === "m") return `${metres}`;
  if (units.length === "ft" || sort === "small") return `${Number((metres / (fieldUnit(sort) === "in" ? INCH_M : FOOT_M)).toPrecision(9))}`;
  const inches = metres / INCH_M;
  const isOnTape = Math.abs(inches * FINEST - Math.round(inches * FINEST)) < 1e-5 * FINEST;
  return isOnTape ? feetInches(inches, 1 / FINEST) : `${Number((metres / FOOT_M).toPrecision(9))} ft`;
}

// A length as it was typed, with its unit.
/** @param {number} metres */
export const typedText = (metres) => fieldText(metres) + (units.length === "ft-in" ? "" : ` ${lengthUnit()}`);

// The parsed value in metres, if it differs from the text.
/** @param {string} text @param {Sort} [sort] */
export function understood(text, sort = "length") {
  const metres = parseLength(text, sort);
  return Number.isNaN(metres) || `${metres}` === text.trim() || (units.length === "m" && Number(text) === metres) ? "" : `= ${Number(metres < 1 ? metres.toPrecision(4) : metres.toFixed(3))} m`;
}
