// A question with buttons, beside its subject. Another tool or photo cancels it.

import { node } from "./dom.js";
import { NUMERAL } from "./numbers.js";

/** @typedef {{ words: string, act: () => void }} Choice */

const CANCEL = "Cancel (Esc)";
/** @type {Record<string, number | undefined>} */
const STEPS = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };

export class Question {
  /** @param {(isAnswered: boolean) => void} ended @param {(key: string) => void} refused */
  constructor(ended, refused) {
    this.ended = ended;
    this.refused = refused;
    /** @type {HTMLElement | null} */
    this.box = null;
    this.counted = true;
  }

  get isOpen() {
    return this.box !== null;
  }

  /** @param {string} words @param {Choice[]} choices none is chosen by Enter before a person goes to it @param {Element} place its container @param {boolean} counted whether digits answer it */
  ask(words, choices, place = document.body, counted = true) {
    this.cancel();
    const buttons = choices.map((choice, k) => node("button", {
      type: "button", onclick: () => this.end(choice.act), ...(counted ? { "aria-keyshortcuts": `${k + 1}`, title: `${k + 1}` } : {}),
    }, counted ? node("kbd", { "aria-hidden": "true" }, `${k + 1} `) : null, choice.words));
    this.counted = counted;
    this.box = node("div", { class: "question", role: "alertdialog", tabindex: -1, "aria-labelledby": "question" },
      node("p", { id: "question" }, words),
      node("div", { class: "answers" }, ...buttons, node("button", { type: "button", onclick: () => this.cancel() }, CANCEL)));
    this.box.addEventListener("keydown", (event) => this.within(event));
    place.append(this.box);
    this.box.focus({ preventScroll: true });
  }

  /** @param {(() => void) | null} act */
  end(act) {
    if (!this.box) return;
    this.box.remove();
    this.box = null;
    this.ended(Boolean(act));
    act?.();
  }

  cancel() {
    this.end(null);
  }

  // Shows that the question is open, to somebody who went on without an answer.
  insist() {
    this.box?.animate([{ opacity: 0.3 }, { opacity: 1 }], { duration: 250, iterations: 2 });
    this.box?.focus({ preventScroll: true });
  }

  // Handles a key that answers the question, regardless of the focus. Enter, and a number typed too early, do not,
  // and are not passed on.
  /** @param {KeyboardEvent} event */
  answers({ key, repeat, ctrlKey, altKey, metaKey }) {
    if (!this.box || ctrlKey || altKey || metaKey) return false;
    const buttons = [...this.box.querySelectorAll("button")];
    const button = key === "Escape" ? buttons.at(-1) : buttons.slice(0, -1)[this.counted ? Number(key) - 1 : -1];
    if (!repeat) button?.click();
    const isEarly = !button && (key === "Enter" || NUMERAL.test(key));
    if (isEarly) {
      this.insist();
      this.refused(key);
    }
    return Boolean(button) || isEarly;
  }

  // Inside the question, Enter presses the focused button, and the arrows go from one to the next.
  /** @param {KeyboardEvent} event */
  within(event) {
    const { key, repeat, target } = event;
    const isMove = this.move(event);
    const ofButton = target instanceof HTMLButtonElement && (key === "Enter" || key === " ");
    const isAnswer = !ofButton && this.answers(event);
    if (isMove || isAnswer || ofButton) event.stopPropagation();
    if (isMove || isAnswer || (ofButton && repeat)) event.preventDefault();
  }

  // Moves the focus by an arrow key, at first to the first or last button; returns whether it was one.
  /** @param {KeyboardEvent} event */
  move({ key, target }) {
    const step = STEPS[key] ?? 0;
    const buttons = [...this.box?.querySelectorAll("button") ?? []];
    const at = buttons.findIndex((button) => button === target);
    const from = at < 0 && step < 0 ? 0 : at;
    if (step) buttons[(from + step + buttons.length) % buttons.length].focus();
    return Boolean(step);
  }

  // Moves the question beside a place in its container, and keeps it inside.
  /** @param {number} x @param {number} y @param {{ width: number, height: number }} view */
  stand(x, y, view) {
    if (!this.box) return;
    const { offsetWidth: width, offsetHeight: height } = this.box;
    Object.assign(this.box.style, { left: `${beside(x, width, view.width)}px`, top: `${beside(y, height, view.height)}px` });
  }
}

const GAP_PX = 16; // keeps the place itself visible
const EDGE_PX = 6;

// Start of a box of given size after a place, or before it, inside the room.
/** @param {number} at @param {number} size @param {number} room */
function beside(at, size, room) {
  const start = at + GAP_PX + size <= room ? at + GAP_PX : at - GAP_PX - size;
  return Math.max(Math.min(start, room - size - EDGE_PX), EDGE_PX);
}
