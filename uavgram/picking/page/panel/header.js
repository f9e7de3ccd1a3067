// The header: age of the numbers, state of saving, undo and redo.

import { namedLabels, stale, store } from "../connection/store.js";
import { ageOfNumbers, light } from "../connection/trust.js";
import { as, byId, fillIfNew, node } from "../elements/dom.js";

const STALE_AFTER_MS = 100; // up to this delay people perceive an answer as immediate

export class Header {
  /** @param {() => void} onAge called when the numbers become older than the picks, or current again */
  constructor(onAge) {
    this.onAge = onAge;
    this.answered = 0; // time of the last answer
    /** @type {number | null} */
    this.staleSince = null;
    this.greying = 0; // timer
  }

  showProject() {
    document.title = `${store.project} \u2013 uavgram pick`;
    byId("project").textContent = store.project;
    byId("project").title = store.project;
  }

  showStanding() {
    as(HTMLButtonElement, byId("undo")).disabled = !store.undo;
    as(HTMLButtonElement, byId("redo")).disabled = !store.redo;
    if (store.begun) document.body.dataset.version = `${store.version}`;
    document.body.dataset.liveFor = `${store.liveFor}`;
    this.showStale();
  }

  // Numbers that follow the pointer at once do not count as old, though it is always a step ahead of them.
  showStale() {
    clearTimeout(this.greying);
    this.staleSince = stale() ? this.staleSince ?? performance.now() : null;
    const left = STALE_AFTER_MS + Math.max(this.staleSince ?? 0, this.answered) - performance.now();
    const before = document.body.dataset.numbers;
    store.waits = stale() && left <= 0;
    document.body.dataset.numbers = ageOfNumbers();
    document.body.dataset.level = light().level;
    if (before !== document.body.dataset.numbers) this.onAge();
    if (stale() && left > 0) this.greying = setTimeout(() => this.showStale(), left);
  }

  showKnownLabels() {
    const known = namedLabels();
    fillIfNew(byId("known-labels"), known.join(";"), () => known.map((value) => node("option", { value })));
  }

  showMode() {
    if (!store.connected) byId("saved").textContent = ""; // unknown until the server confirms it again
    const [mode, words] = modeText();
    const box = byId("mode");
    if (box.textContent === words && box.dataset.mode === mode) return;
    box.dataset.mode = mode;
    box.textContent = words;
    box.title = mode === "linearised" ? "A first estimate: the exact numbers follow" : mode === "adjusted" ? "All marks and lengths are computed together" : words;
  }

  showSaved() {
    byId("saved").textContent = store.fault ? "not saved" : "saved";
    byId("saved").dataset.fault = `${Boolean(store.fault)}`;
  }
}

function modeText() {
  if (!store.connected) return ["none", "no connection"];
  if (store.mode === "none" && !stale()) return ["none", "nothing computed yet"];
  if (store.mode === "linearised") return ["linearised", "first estimate"];
  if (stale() || store.live?.mode !== "adjusted") return ["waiting", "computing\u2026"];
  if (store.live.stopped) return ["none", "stopped"];
  return ["adjusted", `computed in ${store.live.seconds.toFixed(2)} s`];
}
