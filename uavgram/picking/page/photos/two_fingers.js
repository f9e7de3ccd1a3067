// Two fingers on a pane: the points under them stay under them, so they zoom and pan at once.

/** @import { Pane } from "./pane.js" */

export class Fingers {
  /** @param {Pane} pane */
  constructor(pane) {
    this.pane = pane;
    /** @type {Map<number, [number, number]>} */
    this.down = new Map(); // position of each, by the pointer's number
    this.several = false; // until the last one is lifted
    /** @type {{ u: number, v: number, scale: number, apart: number } | null} */
    this.held = null; // photo point between them when both were down
  }

  /** Adds a finger; returns whether it is not alone. @param {PointerEvent} event @param {[number, number]} at */
  come({ pointerId, pointerType }, at) {
    if (pointerType !== "touch") return false;
    this.down.set(pointerId, at);
    this.several ||= this.down.size > 1;
    this.hold();
    return this.several;
  }

  /** Moves a finger; returns whether it was one of several. @param {PointerEvent} event @param {[number, number]} at */
  move({ pointerId }, at) {
    if (!this.down.has(pointerId)) return false;
    this.down.set(pointerId, at);
    const { held, pane } = this;
    const now = this.spread();
    if (held && now) { // from the start, not step by step: roundings do not add up
      pane.zoom(now.x, now.y, (held.scale * now.apart) / held.apart / pane.view.scale);
      const [x, y] = pane.view.toScreen(held.u, held.v);
      pane.view.panBy(now.x - x, now.y - y);
    }
    return this.several;
  }

  /** Removes a finger; returns whether it was one of several. @param {PointerEvent} event */
  gone({ pointerId }) {
    const { several } = this;
    this.down.delete(pointerId);
    this.hold();
    this.several = several && this.down.size > 0;
    return several;
  }

  hold() {
    const now = this.spread();
    const [u, v] = now ? this.pane.view.toPhoto(now.x, now.y) : [0, 0];
    this.held = now && { u, v, scale: this.pane.view.scale, apart: now.apart };
  }

  // The middle of the first two, and their distance.
  spread() {
    const [a, b] = this.down.values();
    return b ? { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, apart: Math.max(Math.hypot(a[0] - b[0], a[1] - b[1]), 1) } : null;
  }
}
