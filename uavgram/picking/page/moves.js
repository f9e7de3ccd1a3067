// What the keys do: going about in photos, points and page.

import { byId } from "./format.js";
import { labels, pickAt, placeOf, predictedIn, store } from "./store.js";

const NUDGE_REST_MS = 700; // nudges closer together than this are one step
const PAN_PX = 60; // for each press of an arrow
const SAME_PLACE_PX = 4; // on the screen: a second point would hide the first

export const moveActions = {
  nextTab(by) {
    const all = [...byId("tabs").children];
    const at = all.findIndex((button) => button.getAttribute("aria-selected") === "true");
    const next = all[(at + by + all.length) % all.length];
    next.click();
    next.focus();
  },

  backToPhoto() {
    this.active?.svg.focus({ preventScroll: true });
  },

  enter() {
    const { active: pane, selected, tool } = this;
    if (this.entry || !pane) return false;
    if (tool !== "pick" && selected && this.draft.at(-1) !== selected) {
      this.extend(selected);
      return true;
    }
    if (tool !== "pick" && this.finish()) return true;
    const at = pane.inside(...pane.middle());
    const there = selected ? pickAt(pane.image, selected) : null;
    if (there && Math.hypot(there.u - at[0], there.v - at[1]) * pane.view.scale < SAME_PLACE_PX) {
      this.notice(`${selected} is here already: choose another with N or B, or move the photo with Ctrl and the arrows.`, true);
    } else this.clicked(pane, ...at);
    return true;
  },

  cancel() {
    this.unnotice();
    this.active?.calm();
    const nothing = !this.draft.length && !this.entry;
    this.draft = [];
    this.entry = null;
    if (nothing && this.tool === "pick") this.selected = null;
    if (nothing) this.setTool("pick");
    else this.rebuild();
    this.active?.svg.focus({ preventScroll: true });
  },

  arrow(dx, dy, step) {
    const pick = this.active && this.selected ? pickAt(this.active.image, this.selected) : null;
    if (!pick) return this.pan(dx, dy);
    const now = Date.now();
    if (!this.nudgeStep || now - this.nudged > NUDGE_REST_MS || this.nudgedLabel !== this.selected) this.nudgeStep = this.newStep();
    Object.assign(this, { nudged: now, nudgedLabel: this.selected });
    const at = this.active.inside(pick.u + dx * step, pick.v + dy * step);
    this.drag(pick.image, pick.label, at, this.nudgeStep, true);
    this.active.magnify(...at, this.active.view.width / 2, this.active.view.height / 2);
    return true;
  },

  pan(dx, dy) {
    const { active: pane } = this;
    if (!pane) return false;
    pane.view.panBy(-dx * PAN_PX, -dy * PAN_PX);
    pane.moved();
    pane.magnify(...pane.middle(), pane.view.width / 2, pane.view.height / 2);
    return true;
  },

  // The parts of the page in turn, as F6 does in other programs.
  nextRegion(by) {
    const chosen = (id, attribute) => byId(id).querySelector(`[${attribute}="true"]`) ?? byId(id).firstElementChild;
    const stops = [chosen("tools", "aria-checked"), ...this.panes.map((pane) => pane.svg), chosen("tabs", "aria-selected"), chosen("strip", "aria-current")];
    const parts = [byId("tools").parentElement, ...this.panes.map((pane) => pane.box), byId("panel"), byId("strip")];
    const at = parts.findIndex((part) => part.contains(document.activeElement));
    stops[(at + by + stops.length + (at < 0 && by < 0 ? 1 : 0)) % stops.length]?.focus();
  },

  remove(everywhere) {
    if (!this.selected || !this.active) return;
    if (everywhere) this.send({ t: "forget", label: this.selected });
    else if (pickAt(this.active.image, this.selected)) this.send({ t: "unpick", image: this.active.image, label: this.selected });
  },

  beginRename() {
    this.setTab("measure");
    const field = byId("tab-measure").querySelector('[name="rename"]');
    field?.focus();
    field?.select();
  },

  doubled(label) {
    if (label && this.tool === "pick") this.beginRename();
  },

  turn(by, expected) {
    if (!this.active) return;
    const count = store.photos.length;
    for (let k = 1; k <= count; k += 1) {
      const image = (this.active.image + by * k + count * k) % count;
      if (!expected || placeOf(image, this.selected ?? this.label())) {
        this.active.show(image);
        return;
      }
    }
  },

  zoom(factor) {
    const { active } = this;
    active?.zoom(...(active.hover ?? [active.view.width / 2, active.view.height / 2]), factor);
  },

  toSelected(scale) {
    if (this.selected) this.active?.goTo(this.selected, scale);
  },

  goToPredicted() {
    const label = this.selected ?? this.label();
    const pane = this.active;
    if (!pane) return;
    const expected = predictedIn(pane.image).find((one) => one.label === label);
    if (!expected && !pickAt(pane.image, label)) this.notice(`Nothing says where ${label} is in ${pane.photo.name}.`);
    else pane.goTo(label, Math.max(pane.view.scale, 2));
  },

  step(by) {
    const all = labels();
    if (!all.length) return;
    const at = all.indexOf(this.selected);
    this.select(all[(at + by + all.length + (at < 0 && by < 0 ? 1 : 0)) % all.length]);
    this.active?.markOf(this.selected)?.focus({ preventScroll: true });
  },

  toggle(kind) {
    this.shownKinds[kind] = !this.shownKinds[kind];
    for (const pane of this.panes) { pane.rebuild(); pane.tell(); }
  },

  toggleLoupe() {
    this.loupe = !this.loupe;
    for (const pane of this.panes) pane.loupe.hide();
  },

  help() {
    byId("help").showModal();
  },
};
