// The panes side by side: their number, the active one, and showing the same ground in all.

import { mostPicked, store } from "../connection/store.js";
import { byId, choose } from "../elements/dom.js";
import { Pane } from "./pane.js";

/** @import { KeptPanes } from "../connection/tab_memory.js" */
/** @import { PageState } from "../actions/page_state.js" */
/** @import { Notice } from "../elements/notice.js" */
/** @import { Link } from "../connection/socket.js" */
/** @import { PaneEvents } from "./pane.js" */

export class Panes {
  /** @param {{ state: PageState, link: Link, notice: Notice, events: Omit<PaneEvents, "viewed"> }} needs */
  constructor({ state, link, notice, events }) {
    this.state = state;
    this.link = link;
    this.notice = notice;
    this.events = { ...events, viewed: (/** @type {Pane} */ pane) => this.viewed(pane) };
    this.box = byId("panes");
    /** @type {Pane[]} */
    this.all = [];
    /** @type {Pane | null} */
    this.active = null;
    this.linked = false;
    this.asking = false; // for the same ground
    this.askAgain = false;
    window.addEventListener("resize", () => { for (const pane of this.all) pane.resize(); });
  }

  /** @param {number} count */
  setCount(count) {
    while (this.all.length > count) this.all.pop()?.remove();
    this.box.dataset.count = `${count}`;
    const before = this.active?.image ?? mostPicked();
    while (this.all.length < count) {
      const pane = new Pane(this.box, this.state, this.events);
      this.all.push(pane);
      pane.resize();
      pane.show((before + this.all.length - 1) % store.photos.length);
    }
    choose(byId("pane-counts"), (button) => Number(button.dataset.count) === count, "aria-checked");
    if (!this.active || !this.all.includes(this.active)) this.events.entered(this.all[0]);
    this.showActive();
    for (const pane of this.all) pane.resize();
    if (this.active) this.viewed(this.active);
  }

  /** Makes a pane the active one; returns whether it was not. @param {Pane} pane */
  activate(pane) {
    if (this.active === pane) return false;
    this.active = pane;
    this.showActive();
    return true;
  }

  showActive() {
    for (const one of this.all) one.box.classList.toggle("active", one === this.active && this.all.length > 1);
  }

  /** Shows a label enlarged in a photo. @param {number} image @param {string} label */
  look(image, label) {
    const { active } = this;
    if (!active) return;
    if (active.image !== image) active.show(image);
    this.events.selected(label);
    active.goTo(label, Math.max(active.view.scale, 2));
    active.markOf(label)?.focus({ preventScroll: true });
  }

  /** @returns {KeptPanes} */
  get kept() {
    const views = this.all.map(({ image, fitted, view: { middle, scale } }) => ({ image, fitted, middle, scale }));
    return { views, active: this.all.findIndex((one) => one === this.active), linked: this.linked };
  }

  /** Shows photos and views as they were kept, in as many panes as there are. @param {KeptPanes} kept */
  resume({ views, active, linked }) {
    for (const [k, { image, fitted, middle, scale }] of views.entries()) {
      const pane = this.all[k];
      pane.show(image);
      if (fitted) continue;
      pane.view.center(...middle, scale);
      pane.moved();
    }
    this.events.entered(this.all[active]);
    if (linked) this.toggleLink();
  }

  rebuild() {
    for (const pane of this.all) pane.rebuild();
  }

  toggleLink() {
    this.linked = !this.linked;
    byId("linked").setAttribute("aria-pressed", `${this.linked}`);
    if (this.active) this.viewed(this.active);
  }

  /** @param {Pane} pane */
  viewed(pane) {
    if (!this.linked || pane !== this.active || this.all.length < 2) return;
    if (this.asking) this.askAgain = true;
    else void this.followGround(pane);
  }

  /** Moves the other panes to the ground of this one. @param {Pane} pane */
  async followGround(pane) {
    this.asking = true;
    this.askAgain = false;
    const [u, v] = pane.inside(...pane.view.middle);
    try {
      const { places } = await this.link.ask({ t: "ground", image: pane.image, u_px: u, v_px: v });
      for (const other of this.all) {
        const found = places[other.image];
        if (other === pane) continue;
        if (other.image === pane.image) other.view.center(u, v, pane.view.scale);
        else if (found) other.view.center(found[0], found[1], pane.view.scale / found[2]);
        other.fitted = false;
        other.redraw();
      }
    } catch (fault) {
      this.notice.fault(fault);
    } finally {
      this.asking = false;
      if (this.askAgain && this.active) this.viewed(this.active);
    }
  }
}
