// Lengths, areas, volumes and speeds, formatted and parsed in the units of the project. The server
// sends and takes metres. views/units.py has the same rules.

/** @import { Units } from "../connection/protocol.js" */
/** @typedef {{ factor: number, symbol: string, least: number, most: number }} Shown factor from the server's unit, name, least and most decimals */

const FOOT_M = 0.3048; // the international foot, exactly
const INCHES = 12;
const INCH_M = FOOT_M / INCHES;
const YARD_FT3 = 27;
const SIXTEENTHS = 16;
const FINEST = 64; // of an inch, on a tape
const STEPS_IN = [[0.1, 1 / 16], [0.3, 1 / 8], [0.75, 1 / 4], [1.5, 1 / 2], [12, 1]]; // fraction by largest sigma

/** @type {Units} */
let units = { length: "m", speed: "km/h" };

/** @param {Units} project */
export function useUnits(project) { units = project; }

/** @type {Record<string, Shown | undefined>} */
const METRES = { m: { factor: 1, symbol: "m", least: 2, most: 4 }, m2: { factor: 1, symbol: "m\u00b2", least: 0, most: 4 }, m3: { factor: 1, symbol: "m\u00b3", least: 0, most: 4 } };
/** @type {Record<string, Shown | undefined>} */
const FEET = { m: { factor: 1 / FOOT_M, symbol: "ft", least: 2, most: 4 }, m2: { factor: FOOT_M ** -2, symbol: "ft\u00b2", least: 0, most: 4 }, m3: { factor: FOOT_M ** -3, symbol: "ft\u00b3", least: 0, most: 4 } };
const YARDS = { factor: FOOT_M ** -3 / YARD_FT3, symbol: "yd\u00b3", least: 0, most: 4 };
/** @type {Record<Units["speed"], number>} */
const PACES = { "km/h": 3.6, mph: 3600 / (5280 * FOOT_M), "m/s": 1 };

// Returns how values of a unit are shown; small volumes in cubic feet.
/** @param {string} unit as the server sends it @param {number} value @returns {Shown} */
export function shown(unit, value = Infinity) {
  if (unit === "m/s") return { factor: PACES[units.speed], symbol: units.speed, least: 0, most: 4 };
  const found = (units.length === "m" ? METRES : FEET)[unit] ?? { factor: 1, symbol: unit === "deg" ? "\u00b0" : unit, least: 0, most: 4 };
  return found.symbol === "ft\u00b3" && Math.abs(value) * found.factor >= YARD_FT3 ? YARDS : found;
}

/** @param {number | null | undefined} sigma in the shown unit @param {Shown} one */
function decimals(sigma, { least, most }) {
  if (!sigma || !(sigma > 0)) return Math.max(least, 2);
  return Math.min(Math.max(1 - Math.floor(Math.log10(sigma)), least), most);
}

// "12.345 ± 0.021 m", "40.502 ± 0.069 ft" or "40 ft 6 in ± 0.83 in".
/** @param {number} value @param {number | null | undefined} sigma @param {string} unit */
export function quantity(value, sigma, unit) {
  if (unit === "m" && units.length === "ft-in") return withInches(value / INCH_M, sigma === null || sigma === undefined ? null : sigma / INCH_M);
  const { factor, symbol, ...bounds } = shown(unit, value);
  const places = decimals((sigma ?? 0) * factor, { factor, symbol, ...bounds });
  return `${steady(value * factor, places)}${sigma === null || sigma === undefined ? "" : ` \u00b1 ${(sigma * factor).toFixed(places)}`} ${symbol}`;
}

/** @param {number} value @param {number | null} sigma both in inches */
function withInches(value, sigma) {
  if (Math.abs(value) < INCHES && (sigma ?? 0) < INCHES) {
    return sigma === null ? `${steady(value, 2)} in` : `${steady(value, placesIn(sigma))} \u00b1 ${spreadIn(sigma)}`;
  }
  return feetInches(value, stepIn(sigma ?? 0)) + (sigma === null ? "" : ` \u00b1 ${spreadIn(sigma)}`);
}

/** @param {number} sigma */
function spreadIn(sigma) {
  if (sigma < INCHES) return `${sigma.toFixed(placesIn(sigma))} in`;
  const feet = sigma / INCHES;
  return `${feet.toFixed(feet >= 10 ? 0 : 1)} ft`;
}

/** @param {number} sigma */
const placesIn = (sigma) => (sigma > 0 ? Math.min(Math.max(1 - Math.floor(Math.log10(sigma)), 0), 2) : 2);

/** @param {number} sigma */
function stepIn(sigma) {
  if (!(sigma > 0)) return 1 / SIXTEENTHS;
  return (STEPS_IN.find(([most]) => sigma < most) ?? [0, INCHES])[1];
}

// "40 ft 6 1/8 in": a length rounded to a fraction of an inch, or to feet.
/** @param {number} value inches @param {number} step */
function feetInches(value, step) {
  const parts = Math.round(FINEST * step) * Math.floor(Math.abs(value) / step + 0.5);
  const sign = value < 0 && parts ? "-" : "";
  const feet = Math.floor(parts / (FINEST * INCHES));
  if (step >= INCHES) return `${sign}${feet} ft`;
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

/** @param {number} value @param {number} places */
function steady(value, places) {
  const words = value.toFixed(places);
  return Number(words) === 0 ? words.replace("-", "") : words;
}

// A small or large length in a sentence.
/** @param {number} metres */
export function sizeText(metres) {
  if (units.length === "ft-in") return metres < FOOT_M ? `${Number((metres / INCH_M).toPrecision(3))} in` : feetInches(metres / INCH_M, 1 / 4);
  if (units.length === "ft") return `${Number((metres / FOOT_M).toPrecision(3))} ft`;
  if (metres >= 1) return `${metres} m`;
  return metres >= 0.01 ? `${Number((100 * metres).toPrecision(3))} cm` : `${Number((1000 * metres).toPrecision(3))} mm`;
}

// A short form of a length beside a mark.
/** @param {number} metres @param {number | null} sigma */
export function shortText(metres, sigma) {
  if (units.length === "ft-in") return metres < FOOT_M ? `${steady(metres / INCH_M, 1)} in` : feetInches(metres / INCH_M, Math.max(stepIn((sigma ?? 0) / INCH_M), 1 / 4));
  const one = shown("m");
  return `${steady(metres * one.factor, Math.min(decimals((sigma ?? 0) * one.factor, { ...one, least: 0 }), units.length === "m" ? 2 : 1))} ${one.symbol}`;
}

// Unit for table heads: feet have decimals there.
export const lengthUnit = () => shown("m").symbol;
export const smallUnit = () => (units.length === "m" ? { symbol: "mm", metres: 0.001 } : { symbol: "in", metres: INCH_M });
/** @template {number | null | undefined} T @param {T} metres @returns {T | number} */
export const inLength = (metres) => (typeof metres === "number" ? metres * shown("m").factor : metres);

// Parsing.

// A field takes lengths such as "13.2", in its own unit, "13 ft 2 1/2 in", 13' 2 1/2", "4.1 m" or "401 cm".
/** @typedef {"length" | "small"} Sort sigmas are small: a bare number is inches where lengths are feet and inches */

/** @param {Sort} [sort] */
export const fieldUnit = (sort = "length") => (units.length === "m" ? "m" : units.length === "ft" || sort === "length" ? "ft" : "in");

/** @type {Record<string, number | undefined>} */
const SCALES = { m: 1, cm: 0.01, mm: 0.001, km: 1000, ft: FOOT_M, feet: FOOT_M, foot: FOOT_M, "'": FOOT_M, "\u2032": FOOT_M, in: INCH_M, inch: INCH_M, inches: INCH_M, "\"": INCH_M, "\u2033": INCH_M, yd: 3 * FOOT_M };
const ONE = /^([-+]?)(\d+\.?\d*|\.\d+)(e[-+]?\d+)?\s*(m|cm|mm|km|ft|feet|foot|'|\u2032|in|inch|inches|"|\u2033|yd)?$/i;
const INCH_FRACTION = /^([-+]?)(?:(\d+)\s*(?:ft|feet|foot|'|\u2032)\s*-?\s*)?(?:(\d+\.?\d*|\.\d+)(?:[\s-]+(\d+)\/(\d+))?|(\d+)\/(\d+))\s*(?:in|inch|inches|"|\u2033|'')$/i;

// Returns metres; NaN if the text is not a length.
/** @param {string} text @param {Sort} [sort] */
export function parseLength(text, sort = "length") {
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

// The parsed value in metres, if it differs from the text.
/** @param {string} text @param {Sort} [sort] */
export function understood(text, sort = "length") {
  const metres = parseLength(text, sort);
  return Number.isNaN(metres) || `${metres}` === text.trim() || (units.length === "m" && Number(text) === metres) ? "" : `= ${Number(metres.toPrecision(4))} m`;
}
