// Keyboard navigation in photos, points and page.

import { labels, pickAt, placeOf, predictedIn, store } from "../connection/store.js";
import { as, byId } from "../elements/dom.js";
import { inputIn } from "./typed_numbers.js";
import { bringTies, tiesIn } from "../photos/ties.js";

/** @import { Notice } from "../elements/notice.js" */
/** @import { Panes } from "../photos/panes.js" */
/** @import { PageState, ShownKind } from "./page_state.js" */
/** @import { Tools } from "./tools.js" */

const NUDGE_REST_MS = 700; // nudges closer together than this are one step
const PAN_PX = 60; // for each press of an arrow

// Steps forward or back in a circle; without a present position to the first or the last.
/** @param {number} at @param {number} by @param {number} count */
const turned = (at, by, count) => (at + by + count + (at < 0 && by < 0 ? 1 : 0)) % count;

export class Navigation {
  /** @param {{ state: PageState, notice: Notice, panes: Panes, tools: Tools, newStep: () => number }} needs */
  constructor({ state, notice, panes, tools, newStep }) {
    this.state = state;
    this.notice = notice;
    this.panes = panes;
    this.tools = tools;
    this.newStep = newStep;
    this.nudge = { step: 0, label: "", at: 0 }; // the last nudge, and its time
  }

  /** @param {number} by */
  nextTab(by) {
    const all = [...byId("tabs").children];
    const next = as(HTMLElement, all[turned(all.findIndex((button) => button.getAttribute("aria-selected") === "true"), by, all.length)]);
    next.click();
    next.focus();
  }

  enter() {
    const { state: { selected, tool, draft, entry }, tools, panes: { active: pane } } = this;
    if (entry || !pane) return false;
    if (tool !== "pick" && selected && draft.at(-1) !== selected) {
      tools.extend(selected);
      return true;
    }
    if (tool !== "pick" && tools.finish()) return true;
    if (pane.contains(...pane.view.middle)) tools.clicked(pane, ...pane.view.middle);
    else this.notice.show("The middle of the view is beside the photo, so nothing was marked. F shows the whole photo.");
    return true;
  }

  /** @param {number} dx @param {number} dy @param {number} size */
  arrow(dx, dy, size) {
    const { active } = this.panes;
    const pick = active && this.state.selected ? pickAt(active.image, this.state.selected) : null;
    if (!active || !pick) return this.pan(dx, dy);
    const now = Date.now();
    const goesOn = now - this.nudge.at <= NUDGE_REST_MS && this.nudge.label === pick.label;
    this.nudge = { step: goesOn ? this.nudge.step : this.newStep(), label: pick.label, at: now };
    const at = active.inside(pick.u_px + dx * size, pick.v_px + dy * size);
    this.tools.drag(pick.image, pick.label, at, this.nudge.step, true);
    active.magnify(...at);
    return true;
  }

  /** @param {number} dx @param {number} dy */
  pan(dx, dy) {
    const { active: pane } = this.panes;
    if (!pane) return false;
    pane.view.panBy(-dx * PAN_PX, -dy * PAN_PX);
    pane.moved();
    pane.magnify(...pane.view.middle);
    return true;
  }

  // Goes through the parts of the page in turn, as F6 does in other programs.
  /** @param {number} by */
  nextRegion(by) {
    /** @param {string} id @param {string} attribute @returns {{ part: Element | null, stop: HTMLElement | SVGElement | null }} */
    const region = (id, attribute) => ({ part: byId(id), stop: byId(id).querySelector(`[${attribute}="true"]`) ?? byId(id).querySelector("button") });
    const regions = [
      { ...region("tools", "aria-checked"), part: byId("tools").parentElement },
      ...this.panes.all.map(({ box, svg }) => ({ part: box, stop: svg })),
      { ...region("tabs", "aria-selected"), part: byId("panel") },
      region("strip", "aria-current"),
    ];
    const at = regions.findIndex(({ part }) => part?.contains(document.activeElement));
    regions[turned(at, by, regions.length)].stop?.focus();
  }

  beginRename() {
    this.tools.showForms();
    const field = inputIn('[name="rename"]');
    field?.focus();
    field?.select();
  }

  doubled() {
    if (this.state.tool === "pick") this.beginRename();
  }

  /** @param {number} by @param {boolean} expected */
  turn(by, expected) {
    const { active } = this.panes;
    if (!active) return;
    const count = store.photos.length;
    for (let k = 1; k <= count; k += 1) {
      const image = (active.image + by * k + count * k) % count;
      if (!expected || placeOf(image, this.state.selected ?? this.tools.label)) {
        active.show(image);
        return;
      }
    }
  }

  /** @param {number} factor */
  zoom(factor) {
    const { active } = this.panes;
    if (active) active.zoom(...active.view.toScreen(...active.aim), factor);
  }

  /** @param {number} scale */
  toSelected(scale) {
    if (this.state.selected) this.panes.active?.goTo(this.state.selected, scale);
  }

  goToPredicted() {
    const label = this.state.selected ?? this.tools.label;
    const { active: pane } = this.panes;
    if (!pane) return;
    const expected = predictedIn(pane.image).find((one) => one.label === label);
    if (!expected && !pickAt(pane.image, label)) this.notice.show(`Where ${label} is in ${pane.photo.name} cannot be computed yet: click it there, or look for it in another photo.`);
    else pane.goTo(label, Math.max(pane.view.scale, 2));
  }

  /** Selects the next or the previous point. @param {number} by */
  step(by) {
    const all = labels();
    if (!all.length) return;
    const label = all[turned(all.indexOf(this.state.selected ?? ""), by, all.length)];
    this.tools.select(label);
    this.panes.active?.markOf(label)?.focus({ preventScroll: true });
  }

  /** @param {ShownKind} kind */
  toggle(kind) {
    this.state.shown[kind] = !this.state.shown[kind];
    this.panes.rebuild();
  }

  async toggleTies() {
    this.toggle("ties");
    await this.bringTies();
    const { active } = this.panes;
    const count = active && this.state.shown.ties ? tiesIn(active.image).length : 0;
    if (this.state.shown.ties) this.notice.show(count ? `${count} tie points in this photo: spots that the program found in others, too.` : "The project names no tie points in this photo. With the line ties: auto in project.yaml, and the project opened again, the program looks for them.", true);
  }

  // Loads the tie points of the shown photos if they are to be drawn.
  async bringTies() {
    if (!this.state.shown.ties) return;
    try {
      await bringTies(this.tools.link, this.panes.all.map(({ image }) => image));
      this.panes.rebuild();
    } catch (fault) {
      this.notice.fault(fault);
    }
  }

  toggleLoupe() {
    this.state.magnifies = !this.state.magnifies;
    for (const pane of this.panes.all) pane.loupe.hide();
  }

  help() {
    as(HTMLDialogElement, byId("help")).showModal();
  }
}
