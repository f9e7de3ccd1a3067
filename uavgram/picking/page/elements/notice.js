// One sentence over the page, for a while.

import { node } from "./dom.js";

const SHOWN_MS = 8000; // what went well is shown for half of it

export class Notice {
  /** @param {HTMLElement} box */
  constructor(box) {
    this.box = box;
    this.timer = 0;
  }

  /** @param {string} words @param {boolean} good @param {{ words: string, act: () => void } | null} offer a button beside the words */
  show(words, good = false, offer = null) {
    this.box.textContent = words;
    if (offer) this.box.append(node("button", { name: "offer", onclick: () => { this.hide(); offer.act(); } }, offer.words));
    this.box.classList.toggle("info", good);
    this.box.hidden = false;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.hide(), good && !offer ? SHOWN_MS / 2 : SHOWN_MS);
  }

  /** What a question ended with instead of an answer. @param {unknown} fault */
  fault(fault) {
    this.show(fault instanceof Error ? fault.message : "that failed");
  }

  hide() {
    this.box.hidden = true;
  }
}
