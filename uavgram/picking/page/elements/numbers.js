// Numbers in readable form.

export const NUMERAL = /^[\d.,]$/; // characters that begin or continue a number

// Explanations of technical terms, shown as tooltips.
export const SIGMA = "standard deviation: the true value lies within twice as much 19 times out of 20";
export const MISFIT = "how far it is off, in its own standard deviations; what is above about 3 deserves a second look";
const BENDS = "how the lens bends straight lines, the more the farther from the middle";
/** By the first word of the term. @type {Record<string, string | undefined>} */
const TERMS = {
  Good: SIGMA, Uncertainty: SIGMA, Likely: SIGMA, Friction: "how well the tyres hold on this road, such as 0.7 on dry asphalt",
  fx: "focal length across the photo", fy: "focal length down the photo", cx: "where the lens looks straight ahead: from the left", cy: "where the lens looks straight ahead: from the top",
  k1: BENDS, k2: BENDS, k3: BENDS, k4: BENDS, p1: "how the lens is tilted against the sensor", p2: "how the lens is tilted against the sensor",
  principal: "where the lens looks straight ahead", distortion: BENDS, folds: "from where on the formula of the lens no longer holds",
  brown: "bends lines by Brown's formula, as ordinary lenses do", fisheye: "sees very wide, and bends lines strongly",
};

/** Terms in sentences. @type {Record<string, string>} */
const STATISTICS = { sigma: SIGMA, "expected error": MISFIT };

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
