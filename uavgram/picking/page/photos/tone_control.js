// The brightness button of a pane, and its sliders.

import { as, node } from "../elements/dom.js";
import { choiceOf, chooseTone, toneWords } from "./tone.js";

/** @import { Choice } from "./tone.js" */

const [MOST, STEP] = [2, 0.1]; // powers of two
let controls = 0;

export class ToneControl {
  constructor() {
    this.image = -1;
    const id = `tone-${(controls += 1)}`;
    this.words = node("span", {});
    this.button = node("button", { class: "tone", popovertarget: id, "aria-label": "Brightness and contrast", title: "Brightness and contrast, for looking only (0: automatic or as it is; [ ]: darker, brighter; { }: less, more contrast)" },
      node("span", { "aria-hidden": true }, "\u25d0"), this.words);
    this.brightness = this.slider((brightness) => ({ brightness }));
    this.contrast = this.slider((contrast) => ({ contrast }));
    this.auto = node("button", { "aria-pressed": false, onclick: () => this.begin(true) }, "Auto");
    this.plain = node("button", { "aria-pressed": false, onclick: () => this.begin(false) }, "As it is");
    this.box = node("div", { id, class: "tones", popover: "auto", role: "group", "aria-label": "Brightness and contrast", ontoggle: () => this.place() },
      node("label", {}, "Brightness", this.brightness), node("label", {}, "Contrast", this.contrast),
      node("div", { class: "row" }, this.auto, this.plain), node("p", { class: "dim" }, "For looking only: the file stays as it is, and what is measured comes from its own pixels."));
  }

  /** @param {(value: number) => Partial<Choice>} choice */
  slider(choice) {
    const made = node("input", { type: "range", min: -MOST, max: MOST, step: STEP, oninput: () => chooseTone(this.image, { ...choiceOf(this.image), ...choice(Number(made.value)) }) });
    return made;
  }

  /** @param {boolean} stretch */
  begin(stretch) {
    chooseTone(this.image, { stretch, brightness: 0, contrast: 0 });
  }

  /** @param {number} image */
  show(image) {
    this.image = image;
    const { stretch, brightness, contrast } = choiceOf(image);
    this.brightness.value = `${brightness}`;
    this.contrast.value = `${contrast}`;
    this.auto.setAttribute("aria-pressed", `${stretch}`);
    this.plain.setAttribute("aria-pressed", `${!stretch && !brightness && !contrast}`);
    this.words.textContent = toneWords(image);
  }

  // Places the sliders beneath their button, as popovers are not positioned by the page.
  place() {
    const { left, bottom } = this.button.getBoundingClientRect();
    Object.assign(as(HTMLElement, this.box).style, { left: `${left}px`, top: `${bottom + 4}px` });
  }
}

/** Changes the brightness of a photo by steps. @param {number} image @param {Partial<Record<"brightness" | "contrast", number>>} by */
export function stepTone(image, { brightness = 0, contrast = 0 }) {
  const now = choiceOf(image);
  /** @param {number} value */
  const within = (value) => Math.min(Math.max(value, -MOST), MOST);
  chooseTone(image, { ...now, brightness: within(now.brightness + 2 * STEP * brightness), contrast: within(now.contrast + 2 * STEP * contrast) });
}
