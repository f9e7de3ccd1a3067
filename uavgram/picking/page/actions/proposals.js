// Proposals of the program in other photos: accepted or refused by a person.

import { askedFor, isSearching, placeOf, predictedIn, proposalAt, proposals } from "../connection/store.js";

/** @import { Proposal, Question } from "../connection/protocol.js" */
/** @import { Link } from "../connection/socket.js" */
/** @import { Notice } from "../elements/notice.js" */
/** @import { Pane } from "../photos/pane.js" */
/** @import { Panes } from "../photos/panes.js" */
/** @import { PageState } from "./page_state.js" */
/** @import { Tools } from "./tools.js" */

const REGION_SHARE = 0.3; // of the pane, filled by the region in which a point is expected
const CONFIDENCE = 2.4477; // 95 % of a bivariate normal distribution
const LARGEST_SCALE = 4;

export class Proposals {
  /** @param {{ state: PageState, link: Link, notice: Notice, panes: Panes, tools: Tools }} needs */
  constructor({ state, link, notice, panes, tools }) {
    this.state = state;
    this.link = link;
    this.notice = notice;
    this.panes = panes;
    this.tools = tools;
  }

  // Several are accepted together only when each is compared with all others.
  /** @param {{ image: number, label: string }[]} some @returns {boolean} whether they are accepted */
  accept(some) {
    const isEarly = some.length > 1 && isSearching();
    if (isEarly) this.notice.show("The program is still looking: accept them when it has compared all that it finds.", true);
    else if (some.length) this.link.change({ t: "accept", pairs: some.map(({ image, label }) => [image, label]) });
    return some.length > 0 && !isEarly;
  }

  /** @param {[number, string][]} pairs */
  refuse(pairs) {
    const open = [...proposals(), ...askedFor()];
    const some = pairs.filter(([image, label]) => open.some((one) => one.image === image && one.label === label));
    if (some.length) this.say({ t: "refuse", pairs: some });
  }

  // Undo concerns picks only; refusals are therefore taken back with a button.
  /** All of a point. @param {string} point */
  refuseAll(point) {
    /** @type {[number, string][]} */
    const pairs = ofLabel(point).map(({ image, label }) => [image, label]);
    this.say({ t: "refuse", pairs });
    this.notice.show(`${pairs.length} refused: ${pairs.length === 1 ? "it is" : "they are"} still to be picked by hand.`, true,
      { words: "Take that back", act: () => this.say({ t: "refuse", pairs, is_taken_back: true }) });
  }

  /** @param {Extract<Question, { t: "refuse" }>} what */
  say(what) {
    void this.link.ask(what).catch((/** @type {unknown} */ fault) => this.notice.fault(fault));
  }

  /** Accepts the proposal whose mark was clicked. @param {Pane} pane @param {string} label */
  acceptHere(pane, label) {
    this.accept([{ image: pane.image, label }]);
    this.tools.clickedMark(label);
  }

  // Accepts the proposal instead of the pick that a click has just placed.
  /** @param {number} image @param {string} label */
  acceptInstead(image, label) {
    this.link.change({ t: "undo" });
    this.accept([{ image, label }]);
  }

  // Accepts the proposal whose mark has the focus.
  acceptFocused() {
    const { activeElement: at } = document;
    const label = at instanceof SVGElement ? at.dataset.proposal : undefined;
    const { active } = this.panes;
    if (!label || !active) return false;
    this.acceptHere(active, label);
    return true;
  }

  acceptSelected() {
    const { active } = this.panes;
    if (!active) return;
    const here = proposals().filter(({ image }) => image === active.image);
    const one = proposalAt(active.image, this.state.selected ?? this.tools.label) ?? (here.length === 1 ? here[0] : undefined);
    if (one) this.acceptHere(active, one.label);
    else this.notice.show(here.length ? "Several points were found in this photo: choose one, by N and B or in the table." : "No point found by the program is left to accept in this photo. To mark a point, click it.", true);
  }

  /** Accepts several, in all photos. @param {Proposal[]} some @param {string} which in words */
  acceptAll(some, which = "") {
    if (!some.length) this.notice.show(`No find of the program is left to accept${which}. To mark a point, click it.`, true);
    if (!this.accept(some)) return;
    this.notice.show("Accepted. Undo: Ctrl+Z.", true);
    this.panes.active?.focus(); // the button is gone with them, and keys are for the photo again
  }

  // Goes to the place or the expected region of a point, with the region filling part of the screen;
  // shows the whole photo if nothing predicts its place there.
  /** @param {number} image @param {string} label */
  goTo(image, label) {
    const { active: pane } = this.panes;
    if (!pane) return;
    if (pane.image !== image) pane.show(image);
    this.tools.choose(label);
    this.state.typed = !proposalAt(image, label); // a point to be picked there by hand, as if its name were typed
    this.tools.rebuild();
    const region = predictedIn(image).find((one) => one.label === label)?.spread.major_px ?? 0;
    const size = Math.min(pane.view.width, pane.view.height);
    if (placeOf(image, label)) pane.goTo(label, Math.min((REGION_SHARE * size) / Math.max(CONFIDENCE * region, 1), LARGEST_SCALE));
    else pane.fit();
    pane.focus();
  }
}

/** @param {string | null} label @returns {Proposal[]} */
export const ofLabel = (label) => proposals().filter((one) => one.label === label);

export const MOST_SHOWN = 60; // most rows that a person reads

// What one click or key may accept: all finds if each has its picture in the list, else those that need no inspection.
export function acceptable() {
  const found = proposals();
  const sure = found.filter(({ is_sure }) => is_sure);
  if (found.length > MOST_SHOWN) return { all: sure, words: `Accept the ${sure.length} found surely` };
  const unsure = found.length - sure.length;
  return { all: found, words: `Accept the ${found.length} found${unsure ? ` (${unsure} unsure)` : ""}` };
}
