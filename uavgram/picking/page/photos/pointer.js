// Mouse, pen and fingers on a pane: they zoom, pan, click and drag marks.

import { Fingers } from "./two_fingers.js";
import { markOn, marksNear, NEAR_PX, ON_PX, SAME_PX } from "./nearby_marks.js";

/** @import { Near } from "./nearby_marks.js" */
/** @import { Pane } from "./pane.js" */

/**
 * A press that has not ended.
 * @typedef {object} Press
 * @property {number} x
 * @property {number} y
 * @property {[number, number]} last last position of the pointer
 * @property {boolean} far whether it moved too far for a click
 * @property {boolean} rests whether a finger rested, and now moves the magnifier
 * @property {boolean} pans whether it can only pan
 * @property {{ label: string, at: [number, number], step: number } | null} mark under the press
 */

const TAP_PX = 10; // for a finger
const REST_MS = 500; // a finger at rest for so long shows the magnifier
const FINE = 0.1; // factor of a move with Shift held
const ZOOM_PER_PX = 0.0015; // of the wheel
const LINE_PX = 16; // of a wheel that counts in lines

export class Pointer {
  /** @param {Pane} pane */
  constructor(pane) {
    this.pane = pane;
    /** @type {Press | null} */
    this.press = null;
    /** @type {[number, number] | null} */
    this.hover = null; // its position over the pane
    this.fingers = new Fingers(pane);
    this.resting = 0; // timer
    const { svg, box, events } = pane;
    svg.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    svg.addEventListener("pointerdown", (event) => this.down(event));
    svg.addEventListener("pointermove", (event) => this.move(event));
    svg.addEventListener("pointerup", (event) => this.up(event));
    svg.addEventListener("pointercancel", (event) => { this.fingers.gone(event); this.letGo(); });
    svg.addEventListener("pointerleave", () => { this.hover = null; pane.pointAway(); pane.cueSoon(); });
    svg.addEventListener("contextmenu", (event) => event.preventDefault());
    svg.addEventListener("dblclick", (event) => {
      const on = markOn(this.near(event));
      if (on && !on.hollow) events.doubled(on.label);
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

  /** The marks near an event. @param {MouseEvent} event */
  near(event) {
    return marksNear(this.pane, ...this.pane.view.toPhoto(...this.local(event)));
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? LINE_PX : 1;
    this.pane.zoom(...this.local(event), Math.exp(-event.deltaY * lines * ZOOM_PER_PX));
  }

  /** The pick under a press; a finger is less exact than a mouse. @param {Near[]} near @param {PointerEvent} event @returns {Press["mark"]} */
  held(near, { pointerType }) {
    const held = markOn(near, pointerType === "touch" ? NEAR_PX : ON_PX);
    return held && !held.hollow ? { label: held.label, at: held.at, step: this.pane.events.newStep() } : null;
  }

  /** @param {PointerEvent} event */
  down(event) {
    const { pane } = this;
    pane.events.entered(pane);
    const [x, y] = this.local(event);
    if (this.fingers.come(event, [x, y])) {
      this.letGo();
      return;
    }
    const near = this.near(event);
    const on = markOn(near);
    const pans = event.button !== 0 || pane.state.spaceHeld;
    const mark = pans ? null : this.held(near, event);
    this.press = { x, y, last: [x, y], far: false, rests: false, pans, mark };
    if (mark && mark.label === on?.label && pane.state.tool === "pick") pane.events.selected(mark.label);
    if (event.pointerType === "touch" && !mark) this.resting = setTimeout(() => this.rest(x, y), REST_MS);
    try {
      pane.svg.setPointerCapture(event.pointerId);
    } catch {
      // the pointer has already gone: there is nothing to capture
    }
    event.preventDefault();
    ((on && pane.markOf(on.label)) ?? pane.svg).focus({ preventScroll: true });
  }

  /** @param {PointerEvent} event */
  move(event) {
    const { press, pane } = this;
    const [x, y] = this.local(event);
    if (this.fingers.move(event, [x, y])) return;
    this.hover = [x, y];
    pane.cueSoon();
    if (press && !press.rests) this.follow(press, event, x, y);
    const looks = event.pointerType !== "touch" || press?.rests; // a panning finger shows no magnifier
    if (!press?.mark && looks) pane.magnify(...pane.view.toPhoto(x, y), x, y);
  }

  // Moves the pressed mark, else the photo.
  /** @param {Press} press @param {PointerEvent} event @param {number} x @param {number} y */
  follow(press, event, x, y) {
    const { pane } = this;
    press.far ||= Math.hypot(x - press.x, y - press.y) >= (event.pointerType === "touch" ? TAP_PX : SAME_PX);
    if (press.far) {
      clearTimeout(this.resting);
      if (press.mark && pane.state.tool === "pick") this.drag(press.mark, event, x - press.last[0], y - press.last[1]);
      else {
        pane.box.classList.add("moving");
        pane.view.panBy(x - press.last[0], y - press.last[1]);
        pane.moved();
      }
    }
    press.last = [x, y];
  }

  // A resting finger hides its target: the magnifier shows it, and the click is at the place where the
  // finger is lifted.
  /** @param {number} x @param {number} y */
  rest(x, y) {
    const { press, pane } = this;
    if (!press) return;
    press.rests = true;
    pane.magnify(...pane.view.toPhoto(x, y), x, y);
  }

  // Ends a press that is no click; a mark that was moved stays at its new place.
  letGo() {
    const { press, pane } = this;
    this.press = null;
    clearTimeout(this.resting);
    pane.box.classList.remove("moving");
    if (press?.far && press.mark && pane.state.tool === "pick") pane.events.dragged(pane.image, press.mark.label, press.mark.at, press.mark.step, true);
    return press;
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
    const several = this.fingers.gone(event);
    const press = this.letGo();
    const { pane } = this;
    if (event.pointerType === "touch") {
      this.hover = null;
      pane.pointAway();
    }
    if (!press || several || press.far || press.pans) return;
    const [u, v] = pane.view.toPhoto(...this.local(event));
    if (pane.contains(u, v) || markOn(this.near(event))) pane.events.clicked(pane, u, v);
  }
}
