// Brightness of each photo, kept as long as the page is open. It is for display only: measurements,
// matching and snapping use the file's own pixels.
//
// The server brightens the tiles. A filter on the canvas works on each frame anew: without a GPU one
// frame in twenty took 50 ms then, and 17 ms without a filter. And stretching a JPEG again shows its steps.

import { keyed } from "../connection/key.js";
import { store } from "../connection/store.js";

/** @import { Tone, Tones } from "../connection/protocol.js" */
/** @typedef {{ stretch: boolean, brightness: number, contrast: number }} Choice sliders in powers of two, on the automatic stretch or on the photo as it is */

/** @type {Tone} */
const AS_IT_IS = { black: 0, white: 255, gamma: 1 };
const [LEAST_GAMMA, MOST_GAMMA] = [0.1, 10];

/** Curves from the server, by photo. @type {Map<number, Tones>} */
const known = new Map();
/** @type {Set<number>} */
const asked = new Set();
/** @type {Map<number, Choice>} */
const choices = new Map();
/** @type {(photo: number) => void} */
let changed = () => undefined;

/** @param {(photo: number) => void} callback */
export function onTone(callback) {
  changed = callback;
}

/** @param {Tone | undefined} tone */
const isAsItIs = (tone) => !tone || (tone.black === AS_IT_IS.black && tone.white === AS_IT_IS.white && tone.gamma === AS_IT_IS.gamma);

/** The choice for a photo, or its default. @param {number} photo @returns {Choice} */
export const choiceOf = (photo) => choices.get(photo) ?? { stretch: !isAsItIs(known.get(photo)?.first), brightness: 0, contrast: 0 };

/** The brightness in a request to the server. @param {number} photo */
export function toneSign(photo) {
  const chosen = choices.get(photo);
  if (!chosen) return "first";
  const { black, white, gamma } = toneBy(chosen, known.get(photo));
  return `${black.toFixed(1)},${white.toFixed(1)},${gamma.toFixed(2)}`;
}

/** @param {Choice} choice @param {Tones | undefined} tones @returns {Tone} */
function toneBy({ stretch, brightness, contrast }, tones) {
  const base = (stretch ? tones?.stretched : null) ?? AS_IT_IS;
  const [middle, half] = [(base.white + base.black) / 2, (base.white - base.black) / 2 / 2 ** contrast];
  return { black: middle - half, white: middle + half, gamma: Math.min(Math.max(base.gamma * 2 ** brightness, LEAST_GAMMA), MOST_GAMMA) };
}

/** Note on the photo; empty if it is shown as in its file. @param {number} photo */
export function toneWords(photo) {
  const chosen = choices.get(photo);
  if (!chosen) return isAsItIs(known.get(photo)?.first) ? "" : "Brightened for display";
  return isAsItIs(toneBy(chosen, known.get(photo))) ? "" : "Changed for display";
}

/** @param {number} photo @param {Choice} choice */
export function chooseTone(photo, choice) {
  choices.set(photo, choice);
  changed(photo);
}

// Switches between the automatic stretch and the photo as it is.
/** @param {number} photo */
export function toggleStretch(photo) {
  const { stretch, brightness, contrast } = choiceOf(photo);
  chooseTone(photo, { stretch: !stretch && !brightness && !contrast, brightness: 0, contrast: 0 });
}

/** Asks the server once for the curves of a photo. @param {number} photo */
export async function askTones(photo) {
  if (asked.has(photo)) return;
  asked.add(photo);
  try {
    const answer = await fetch(keyed(`/photo/${photo}/tones.json?${store.photos[photo].digest}`));
    if (!answer.ok) return; // the photo's tiles report the reason
    /** @type {unknown} */
    const said = await answer.json();
    known.set(photo, /** @type {Tones} */ (said));
  } catch {
    asked.delete(photo); // no answer, which is reported elsewhere; ask again at the next display
    return;
  }
  changed(photo);
}
