// One sentence over the page, for a while; with a button where something else may have been meant.

import { node } from "./dom.js";

const SHOWN_MS = 8000; // what went well is shown for half of it
const OFFERED_MS = 20_000; // time to read what else may have been meant, and to reach it

/** @typedef {{ words: string, act: () => void }} Instead */

export class Notice {
  /** @param {HTMLElement} box */
  constructor(box) {
    this.box = box;
    this.timer = 0;
  }

  /** @param {string} words @param {boolean} good @param {Instead | null} offer a button beside the words */
  show(words, good = false, offer = null) {
    this.box.replaceChildren(words, ...(offer ? [node("button", { type: "button", name: "offer", onclick: () => { this.hide(); offer.act(); } }, offer.words)] : []));
    this.box.classList.toggle("info", good);
    this.box.hidden = false;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.hide(), offer ? OFFERED_MS : good ? SHOWN_MS / 2 : SHOWN_MS);
  }

  // Something else was done since: the words stand, and the button goes.
  withdraw() {
    this.box.querySelector("button")?.remove();
  }

  /** What a question ended with instead of an answer. @param {unknown} fault */
  fault(fault) {
    this.show(fault instanceof Error ? fault.message : "that failed");
  }

  hide() {
    this.box.hidden = true;
  }
}
