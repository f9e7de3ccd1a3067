// What the mouse does on a pane: it zooms, pans, clicks and drags marks.

import { pickAt } from "../connection/store.js";

/** @import { Pane } from "./pane.js" */

/**
 * A button that is held down, since then.
 * @typedef {object} Press
 * @property {number} x
 * @property {number} y
 * @property {[number, number]} last where the pointer was last
 * @property {boolean} far whether it moved so far that it is no click
 * @property {boolean} primary
 * @property {boolean} pans whether it can do nothing else
 * @property {string | null} offered label of the proposal that is held
 * @property {{ label: string, at: [number, number], step: number } | null} mark that is held
 */

const CLICK_PX = 3; // a press that moves less is a click
const FINE = 0.1; // of a move with Shift held
const ZOOM_PER_PX = 0.0015; // of the wheel
const LINE_PX = 16; // of a wheel that counts in lines

/** The mark of a point that an event is on. @param {Event} event */
function markAt({ target }) {
  const mark = target instanceof Element ? target.closest("[data-label]") : null;
  return mark instanceof SVGElement ? mark : null;
}

/** The mark of what the program found, that an event is on. @param {Event} event */
function offeredMark({ target }) {
  const mark = target instanceof Element ? target.closest("[data-proposal]") : null;
  return mark instanceof SVGElement ? mark : null;
}

/** @param {Event} event */
const offeredAt = (event) => offeredMark(event)?.dataset.proposal ?? null;

export class Pointer {
  /** @param {Pane} pane */
  constructor(pane) {
    this.pane = pane;
    /** @type {Press | null} */
    this.press = null;
    /** @type {[number, number] | null} */
    this.hover = null; // where it is, over the pane
    const { svg, box, events } = pane;
    svg.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    svg.addEventListener("pointerdown", (event) => this.down(event));
    svg.addEventListener("pointermove", (event) => this.move(event));
    svg.addEventListener("pointerup", (event) => this.up(event));
    svg.addEventListener("pointercancel", () => { this.press = null; });
    svg.addEventListener("pointerleave", () => { this.hover = null; pane.pointAway(); });
    svg.addEventListener("contextmenu", (event) => event.preventDefault());
    svg.addEventListener("dblclick", (event) => {
      const label = markAt(event)?.dataset.label;
      if (label) events.doubled(label);
    });
    svg.addEventListener("focusout", ({ relatedTarget }) => { if (!(relatedTarget instanceof Node && svg.contains(relatedTarget))) pane.calm(); });
    box.addEventListener("focusin", ({ target }) => {
      events.entered(pane);
      const label = target instanceof SVGElement ? target.dataset.label ?? target.dataset.proposal : undefined;
      if (label) events.selected(label);
    });
  }

  /** @param {MouseEvent} event @returns {[number, number]} */
  local(event) {
    const { left, top } = this.pane.svg.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? LINE_PX : 1;
    this.pane.zoom(...this.local(event), Math.exp(-event.deltaY * lines * ZOOM_PER_PX));
  }

  /** @param {PointerEvent} event */
  down(event) {
    const { pane } = this;
    pane.events.entered(pane);
    const [x, y] = this.local(event);
    const mark = markAt(event);
    const primary = event.button === 0;
    const pans = !primary || pane.state.spaceHeld;
    const label = mark?.dataset.label;
    const pick = label && !pans ? pickAt(pane.image, label) : null;
    this.press = {
      x, y, last: [x, y], far: false, primary, pans, offered: offeredAt(event),
      mark: pick ? { label: pick.label, at: [pick.u_px, pick.v_px], step: pane.events.newStep() } : null,
    };
    if (pick && pane.state.tool === "pick") pane.events.selected(pick.label);
    try {
      pane.svg.setPointerCapture(event.pointerId);
    } catch {
      // the pointer is gone already: there is nothing to capture
    }
    event.preventDefault();
    (mark ?? offeredMark(event) ?? pane.svg).focus({ preventScroll: true });
  }

  /** @param {PointerEvent} event */
  move(event) {
    const { press, pane } = this;
    const [x, y] = this.local(event);
    this.hover = [x, y];
    if (press) {
      press.far ||= Math.hypot(x - press.x, y - press.y) >= CLICK_PX;
      if (press.far && press.mark && pane.state.tool === "pick") this.drag(press.mark, event, x - press.last[0], y - press.last[1]);
      else if (press.far) {
        pane.box.classList.add("moving");
        pane.view.panBy(x - press.last[0], y - press.last[1]);
        pane.moved();
      }
      press.last = [x, y];
    }
    if (!press?.mark) pane.magnify(...pane.view.toPhoto(x, y), x, y);
  }

  /** @param {NonNullable<Press["mark"]>} mark @param {PointerEvent} event @param {number} dx @param {number} dy */
  drag(mark, event, dx, dy) {
    const { pane } = this;
    const pace = (event.shiftKey ? FINE : 1) / pane.view.scale;
    mark.at = pane.inside(mark.at[0] + dx * pace, mark.at[1] + dy * pace);
    pane.events.dragged(pane.image, mark.label, mark.at, mark.step, false);
    pane.magnify(...mark.at, ...this.local(event));
  }

  /** @param {PointerEvent} event */
  up(event) {
    const { press, pane } = this;
    this.press = null;
    pane.box.classList.remove("moving");
    if (!press) return;
    const { mark } = press;
    if (press.far) {
      if (mark && pane.state.tool === "pick") pane.events.dragged(pane.image, mark.label, mark.at, mark.step, true);
    } else if (mark) pane.events.clickedMark(mark.label);
    else if (press.primary && !press.pans && press.offered) pane.events.accepted(pane, press.offered);
    else if (press.primary && !press.pans) {
      const [u, v] = pane.view.toPhoto(...this.local(event));
      if (pane.contains(u, v)) pane.events.clicked(pane, u, v);
    }
  }
}
