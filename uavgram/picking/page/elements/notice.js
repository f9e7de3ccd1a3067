// A temporary message over the page, with a button for an alternative if there is one.

import { node, sentence } from "./dom.js";

const SHOWN_MS = 8000; // messages of success are shown for half of it
const OFFERED_MS = 20_000; // time to read about the alternative, and to reach the button

/** @typedef {{ words: string, act: () => void }} Instead */

export class Notice {
  /** @param {HTMLElement} box */
  constructor(box) {
    this.box = box;
    this.timer = 0;
    /** @type {(Node | string)[]} */
    this.lasting = []; // shown where nothing else is
  }

  /** @param {string} words @param {boolean} good @param {Instead | null} offer a button beside the words */
  show(words, good = false, offer = null) {
    this.box.replaceChildren(sentence(words), ...(offer ? [node("button", { type: "button", name: "offer", onclick: () => { this.hide(); offer.act(); } }, offer.words)] : []));
    this.box.classList.toggle("info", good);
    this.box.hidden = false;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.hide(), offer ? OFFERED_MS : good ? SHOWN_MS / 2 : SHOWN_MS);
  }

  /** Shows what stays, or no more if there are no parts. @param {...(Node | string)} parts */
  stay(...parts) {
    this.lasting = parts;
    this.hide();
  }

  // Removes the button, but keeps the words, after something else was done.
  withdraw() {
    this.box.querySelector("button")?.remove();
  }

  /** Shows the error of a failed question. @param {unknown} fault */
  fault(fault) {
    this.show(fault instanceof Error ? fault.message : "that failed");
  }

  hide() {
    this.box.replaceChildren(...this.lasting);
    this.box.classList.add("info");
    this.box.hidden = !this.lasting.length;
  }
}
