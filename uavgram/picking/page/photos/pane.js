// One photo in a window: the picture on a canvas, and the marks over it.

import { picksIn, placeOf, store } from "../connection/store.js";
import { node, shape } from "../elements/dom.js";
import { keepApart, spreadTags } from "./labels.js";
import { Loupe } from "./loupe.js";
import { buildMarks } from "./marks.js";
import { residualScale } from "./residuals.js";
import { Picture } from "./picture.js";
import { Pointer } from "./pointer.js";
import { forget, retry, tile, tileFault } from "./tiles.js";
import { askTones } from "./tone.js";
import { ToneControl } from "./tone_control.js";
import { View } from "./view.js";

/** @import { PageState } from "../actions/page_state.js" */
/** @import { Part } from "./marks.js" */

/**
 * Events of a pane, and requests by the mouse on it.
 * @typedef {object} PaneEvents
 * @property {(pane: Pane) => void} entered
 * @property {() => void} shown another photo
 * @property {() => void} sharpened
 * @property {(pane: Pane) => void} viewed the view has changed
 * @property {(pane: Pane, u: number, v: number) => void} clicked
 * @property {(pane: Pane, at: [number, number]) => string} ahead what a click there does
 * @property {(label: string) => void} doubled
 * @property {(label: string) => void} selected
 * @property {(image: number, label: string, at: [number, number], step: number, final: boolean) => void} dragged
 * @property {() => number} newStep
 */

// A moving picture is drawn fast, one at rest for so long exactly: fast smoothing rounds positions
// down to sixteenths of a pixel, which shifts the picture by 1/32 of a pixel.
const REST_MS = 100;
let panes = 0;

export class Pane {
  /** @param {Element} parent @param {PageState} state @param {PaneEvents} events */
  constructor(parent, state, events) {
    this.state = state;
    this.events = events;
    this.id = (panes += 1);
    this.view = new View();
    this.image = -1;
    /** @type {Map<Part, SVGGElement>} */
    this.parts = new Map();
    this.fitted = false;
    this.movedAt = -REST_MS;
    this.resting = 0; // timers
    this.spreading = 0;
    this.placed = ""; // the view for which marks were placed
    this.spread = ""; // the view for which labels were spread
    this.tags = ""; // text beside the marks
    this.asked = false; // whether a frame is requested
    /** @type {[number, number] | null} */
    this.pointed = null; // the place in the photo whose numbers are shown
    this.canvas = node("canvas", { class: "photo" });
    this.svg = shape("svg", { class: "marks", tabindex: 0, role: "application" });
    this.choice = node("select", { "aria-label": "Photo", onchange: () => this.show(Number(this.choice.value)) });
    this.tone = new ToneControl();
    this.readout = node("div", { class: "readout" });
    this.cue = node("div", { class: "cue", "aria-hidden": true, hidden: true }); // what a click under the pointer does
    this.cueing = false;
    this.lost = node("div", { class: "lost", role: "status", hidden: true }); // covers a photo that cannot be shown
    this.box = node("div", { class: "pane" }, this.canvas, this.svg,
      node("div", { class: "aim", "aria-hidden": true }), this.lost, node("div", { class: "choices" }, this.choice, this.tone.button), this.tone.box, this.readout, this.cue); // the aim is where Enter places a point
    parent.append(this.box);
    this.picture = new Picture(this.id, this.canvas, this.view);
    this.loupe = new Loupe(this.box);
    this.watch = new ResizeObserver(() => this.resize());
    this.watch.observe(this.box);
    this.pointer = new Pointer(this);
  }

  remove() {
    this.watch.disconnect();
    clearTimeout(this.resting);
    clearTimeout(this.spreading);
    forget(this.id);
    this.box.remove();
  }

  get photo() {
    return store.photos[this.image];
  }

  /** @param {number} image */
  show(image) {
    if (!store.photos[image]) return;
    this.image = image;
    retry(image);
    this.svg.replaceChildren();
    this.parts.clear();
    this.spread = ""; // the elements are new, even for the same photo
    this.choice.replaceChildren(...store.photos.map((photo, k) => node("option", { value: k }, photo.name)));
    this.choice.value = `${image}`;
    this.svg.setAttribute("aria-label", `${this.photo.name}: arrows pan, Enter places a point in the middle`);
    Object.assign(this.box.dataset, { image: this.photo.name, pictured: false, sharp: false }); // until it is drawn: no click is for the former one
    this.tone.show(image);
    void askTones(image);
    this.fit();
    this.rebuild();
    this.events.shown();
  }

  // Puts the canvas on whole CSS and device pixels; otherwise the browser shifts the picture.
  resize() {
    const ratio = window.devicePixelRatio;
    const { left, top, right, bottom } = this.box.getBoundingClientRect();
    const x = wholePixel(Math.ceil(left - 1e-6), ratio, 1);
    const y = wholePixel(Math.ceil(top - 1e-6), ratio, 1);
    const width = Math.max(wholePixel(Math.floor(right - x + 1e-6), ratio, -1), 1);
    const height = Math.max(wholePixel(Math.floor(bottom - y + 1e-6), ratio, -1), 1);
    for (const layer of [this.canvas, this.svg]) {
      Object.assign(layer.style, { left: `${x - left}px`, top: `${y - top}px`, width: `${width}px`, height: `${height}px` });
    }
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.svg.setAttribute("width", `${width}`);
    this.svg.setAttribute("height", `${height}`);
    this.view.resize(width, height, ratio);
    if (this.fitted && this.photo) this.view.fit(this.photo.width_px, this.photo.height_px);
    this.draw();
  }

  rebuild() {
    if (!this.photo) return;
    const before = new Map([...this.parts].map(([part, group]) => [part.key, { part, group }]));
    this.parts = new Map();
    /** @type {SVGGElement | null} */
    let last = null;
    for (const part of buildMarks(this.image, this.state)) {
      const old = before.get(part.key);
      before.delete(part.key);
      const group = old?.group ?? part.make();
      if (old && old.part.sign !== part.sign) renew(group, part.make());
      /** @type {ChildNode | null} */
      const here = last ? last.nextSibling : this.svg.firstChild;
      if (here !== group) this.svg.insertBefore(group, here);
      this.parts.set(part, group);
      last = group;
    }
    for (const { group } of before.values()) group.remove();
    const tags = [...this.parts.keys()].map(({ mark }) => mark?.label ?? "").join(";");
    if (this.tags !== tags) this.spread = "";
    this.tags = tags;
    this.moveMarks();
    this.showReadout();
    this.cueSoon();
  }

  /** @param {string | null} label */
  markOf(label) {
    return [...this.parts].find(([part]) => part.key === `pick ${label}` || part.key === `proposal ${label}`)?.[1];
  }

  moveMarks() {
    this.placed = this.view.sign;
    for (const [part, group] of this.parts) part.move(group, this.view);
    keepApart(this.parts, this.view);
    if (this.spread === this.placed) return;
    clearTimeout(this.spreading);
    this.spreading = setTimeout(() => {
      this.spread = this.view.sign;
      spreadTags(this.parts, this.view);
      keepApart(this.parts, this.view);
    }, REST_MS);
  }

  redraw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.draw(); });
  }

  draw() {
    if (!this.photo) return;
    const rests = performance.now() - this.movedAt >= REST_MS;
    const { pictured, sharp } = this.picture.paint(this.photo, this.image, rests, this.loupe.keys);
    this.loupe.draw();
    this.lost.textContent = this.fault;
    this.lost.hidden = !this.fault;
    if (this.placed !== this.view.sign) this.moveMarks(); // arriving tiles move no marks
    if (sharp && this.box.dataset.sharp !== "true") this.events.sharpened();
    const { scale, left, top } = this.view;
    Object.assign(this.box.dataset, { pictured, sharp, scale, left, top });
    this.showReadout();
    this.cueSoon();
  }

  // Says why the photo cannot be shown: nothing can be clicked in it.
  get fault() {
    const why = tileFault(this.image);
    return why && `${this.photo.name} cannot be shown, so nothing can be clicked in it. ${why} Put the file back and choose the photo again, or go on without it: press Reload at the side.`;
  }

  // Says why no click is taken: it would be on something that is not seen.
  get refusal() {
    return this.fault || (this.box.dataset.pictured === "true" ? "" : `${this.photo.name} is still being loaded: this click marked nothing.`);
  }

  // Updates the line of numbers beneath the photo.
  showReadout() {
    const [u, v] = this.pointed ?? [];
    const place = u === undefined || v === undefined ? "" : `column ${u.toFixed(1)}, row ${v.toFixed(1)} \u00b7 `;
    const scale = this.state.shown.residuals && picksIn(this.image).length ? ` \u00b7 pink: how far marks are off, ${residualScale(this.image)} times as long` : "";
    const away = !this.photo || this.contains(...this.view.middle) ? "" : " \u00b7 beside the photo: F shows it";
    this.readout.textContent = `${place}zoom \u00d7${this.view.scale.toPrecision(3)}${scale}${away}`;
  }

  /** @param {number} x @param {number} y @param {number} factor */
  zoom(x, y, factor) {
    const least = Math.min(this.view.fitScale(this.photo.width_px, this.photo.height_px) / 4, 1);
    this.view.zoomAt(x, y, factor, least);
    this.moved();
  }

  moved() {
    this.fitted = false;
    this.movedAt = performance.now();
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.redraw(), REST_MS);
    this.redraw();
    this.events.viewed(this);
  }

  // Shows beside the pointer what a click there does, once a frame.
  cueSoon() {
    if (!this.cueing) requestAnimationFrame(() => { this.cueing = false; this.showCue(); });
    this.cueing = true;
  }

  showCue() {
    const { hover, press } = this.pointer;
    const at = hover && !(press && !press.rests) ? this.view.toPhoto(...hover) : null;
    const words = at && this.photo && this.contains(...at) ? this.events.ahead(this, at) : "";
    if (this.cue.textContent !== words) this.cue.textContent = words;
    this.cue.hidden = !words;
    if (!hover) return;
    Object.assign(this.cue.style, { left: `${hover[0]}px`, top: `${hover[1]}px` });
    this.cue.classList.toggle("before", hover[0] > this.view.width / 2);
    this.cue.classList.toggle("above", hover[1] > this.view.height - 60);
  }

  // Shows the magnifier and the numbers of a place of the photo, which is at x, y; the default is the middle.
  /** @param {number} u @param {number} v @param {number} x @param {number} y */
  magnify(u, v, x = this.view.width / 2, y = this.view.height / 2) {
    this.pointed = [u, v];
    this.showReadout();
    const over = this.photo && u > -20 && v > -20 && u < this.photo.width_px + 20 && v < this.photo.height_px + 20;
    if (!this.state.magnifies || !over) {
      this.loupe.hide();
      return;
    }
    this.loupe.show({ u, v, scale: this.view.scale, aside: x > this.view.width - 230 && y < 230 }, this.photo, this.image, store.tilePx);
    if (this.loupe.keys.every((key) => tile(key))) this.loupe.drawSoon();
    else this.redraw(); // which loads the missing tiles
  }

  // The magnifier stays with the pointer; one that was shown by a key disappears when the keys are released.
  calm() {
    if (!this.pointer.hover) this.pointAway();
  }

  pointAway() {
    this.loupe.hide();
    this.pointed = null;
    this.showReadout();
  }

  /** The nearest place in the photo. @param {number} u @param {number} v @returns {[number, number]} */
  inside(u, v) {
    return [Math.min(Math.max(u, -0.5), this.photo.width_px - 0.5), Math.min(Math.max(v, -0.5), this.photo.height_px - 0.5)];
  }

  /** @param {number} u @param {number} v */
  contains(u, v) {
    return u >= -0.5 && v >= -0.5 && u <= this.photo.width_px - 0.5 && v <= this.photo.height_px - 0.5;
  }

  /** The place under the pointer, or the middle if it is elsewhere. */
  get aim() {
    return this.pointer.hover ? this.view.toPhoto(...this.pointer.hover) : this.view.middle;
  }

  /** @param {string} label @param {number} scale */
  goTo(label, scale) {
    const at = placeOf(this.image, label);
    if (!at) return;
    this.view.center(at.u, at.v, scale);
    this.moved();
    this.magnify(at.u, at.v);
  }

  fit() {
    this.loupe.hide();
    this.view.fit(this.photo.width_px, this.photo.height_px);
    this.fitted = true;
    this.redraw();
    this.events.viewed(this);
  }

  /** @param {number} scale */
  scaleTo(scale) {
    this.view.center(...this.aim, scale);
    this.moved();
  }

  focus() {
    this.svg.focus({ preventScroll: true });
  }
}

// Returns the first CSS pixel from `value` on, forwards or backwards, on a whole device pixel.
/** @param {number} value @param {number} ratio @param {1 | -1} step */
function wholePixel(value, ratio, step) {
  for (let k = 0; k < 20; k += 1) {
    const device = (value + step * k) * ratio;
    if (Math.abs(device - Math.round(device)) < 1e-3) return value + step * k;
  }
  return value;
}

// Updates a group in place, so that focused or pressed elements stay the same.
/** @param {SVGGElement} group @param {SVGGElement} fresh */
function renew(group, fresh) {
  for (const { name, value } of fresh.attributes) group.setAttribute(name, value);
  group.replaceChildren(...fresh.children);
}
