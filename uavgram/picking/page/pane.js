// One photo in a window: the picture on a canvas, the marks over it, and what the mouse does there.

import { node, shape } from "./format.js";
import { Loupe } from "./loupe.js";
import { buildMarks, keepApart, residualScale, spreadTags } from "./marks.js";
import { pickAt, picksIn, placeOf, store } from "./store.js";
import { forget, tile, tileKey, want } from "./tiles.js";
import { View } from "./view.js";

const CLICK_PX = 3; // a press that moves less is a click
const FINE = 0.1; // of a move with Shift held
const HARD_FROM = 3; // device pixels for each photo pixel from which on pixels have hard edges
// A picture that moves is drawn fast, one that has rested so long exactly: fast smoothing takes
// its places from sixteenths of a pixel, rounded down, which moves what is seen by 1/32 of a pixel.
const REST_MS = 100;
let panes = 0;

export class Pane {
  constructor(parent, desk) {
    this.desk = desk;
    this.id = (panes += 1);
    this.view = new View();
    this.image = -1;
    this.parts = [];
    this.fitted = false;
    this.movedAt = -REST_MS;
    this.canvas = node("canvas", { class: "photo" });
    this.svg = shape("svg", { class: "marks", tabindex: 0, role: "application" });
    this.choice = node("select", { "aria-label": "Photo", onchange: () => this.show(Number(this.choice.value)) });
    this.readout = node("div", { class: "readout" });
    this.aim = node("div", { class: "aim", "aria-hidden": true }); // where Enter places a point
    this.box = node("div", { class: "pane" }, this.canvas, this.svg, this.aim, this.choice, this.readout);
    parent.append(this.box);
    this.loupe = new Loupe(this.box);
    this.watch = new ResizeObserver(() => this.resize());
    this.watch.observe(this.box);
    this.listen();
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

  show(image) {
    if (!store.photos[image]) return;
    this.image = image;
    this.svg.replaceChildren();
    this.parts = [];
    this.choice.replaceChildren(...store.photos.map((photo, k) => node("option", { value: k }, photo.name)));
    this.choice.value = image;
    this.svg.setAttribute("aria-label", `${this.photo.name}: arrows pan, Enter places a point in the middle`);
    this.box.dataset.image = this.photo.name;
    this.view.fit(this.photo.width, this.photo.height);
    this.fitted = true;
    this.loupe.hide();
    this.rebuild();
    this.redraw();
    this.desk.shown(this);
  }

  // The canvas lies on whole CSS pixels and whole device pixels, or the browser moves the picture.
  resize() {
    const ratio = window.devicePixelRatio;
    const { left, top, right, bottom } = this.box.getBoundingClientRect();
    const inner = { x: Math.ceil(left - 1e-6), y: Math.ceil(top - 1e-6) };
    const whole = (value) => Math.abs(value * ratio - Math.round(value * ratio)) < 1e-3;
    const up = (value) => { for (let k = 0; k < 20; k += 1) if (whole(value + k)) return value + k; return value; };
    const down = (value) => { for (let k = 0; k < 20; k += 1) if (whole(value - k)) return value - k; return value; };
    const x = up(inner.x);
    const y = up(inner.y);
    const width = Math.max(down(Math.floor(right - x + 1e-6)), 1);
    const height = Math.max(down(Math.floor(bottom - y + 1e-6)), 1);
    for (const layer of [this.canvas, this.svg]) {
      Object.assign(layer.style, { left: `${x - left}px`, top: `${y - top}px`, width: `${width}px`, height: `${height}px` });
    }
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.svg.setAttribute("width", width);
    this.svg.setAttribute("height", height);
    this.view.resize(width, height, ratio);
    if (this.fitted && this.photo) this.view.fit(this.photo.width, this.photo.height);
    this.draw();
  }

  rebuild() {
    if (!this.photo) return;
    const before = new Map(this.parts.map((part) => [part.key, part]));
    const count = this.parts.length;
    this.parts = buildMarks(this.image, this.desk.marks());
    if (this.parts.length !== count) this.spread = null;
    let last = null;
    for (const part of this.parts) {
      const old = before.get(part.key);
      before.delete(part.key);
      part.group = old?.group ?? part.make();
      if (old && old.sign !== part.sign) renew(old.group, part.make());
      const here = last ? last.nextSibling : this.svg.firstChild;
      if (here !== part.group) this.svg.insertBefore(part.group, here);
      last = part.group;
    }
    for (const { group } of before.values()) group.remove();
    this.moveMarks();
    this.tell(...(this.told ?? []));
  }

  markOf(label) {
    return [...this.svg.children].find((child) => child.dataset.label === label);
  }

  moveMarks() {
    for (const part of this.parts) part.move(part.group, this.view);
    keepApart(this.parts, this.view);
    if (this.spread !== this.viewed()) this.spreadSoon();
  }

  viewed() {
    const { left, top, scale, width, height } = this.view;
    return [left, top, scale, width, height].join();
  }

  spreadSoon() {
    clearTimeout(this.spreading);
    this.spreading = setTimeout(() => {
      this.spread = this.viewed();
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
    const sharp = this.paint();
    this.moveMarks();
    if (sharp && this.box.dataset.sharp !== "true") this.desk.sharpened();
    this.box.dataset.sharp = sharp;
    Object.assign(this.box.dataset, { scale: this.view.scale, left: this.view.left, top: this.view.top });
    this.tell(...(this.told ?? []));
  }

  // Coarse tiles first, fine ones over them at their exact places; a seam shows the coarser picture.
  paint() {
    const { view, photo } = this;
    const context = this.canvas.getContext("2d", { alpha: false });
    const grow = view.scale * view.ratio;
    context.fillStyle = "#15181c";
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    context.imageSmoothingEnabled = grow < HARD_FROM;
    const best = Math.min(Math.max(Math.floor(Math.log2(1 / grow)), 0), photo.levels - 1);
    const missing = [];
    const base = this.visible(photo.levels - 1);
    missing.push(...base.filter(({ key }) => !tile(key)));
    const fine = best === photo.levels - 1 ? [] : this.visible(best);
    const covered = fine.every(({ key }) => tile(key));
    this.box.dataset.pictured = covered || base.every(({ key }) => tile(key));
    const rests = performance.now() - this.movedAt >= REST_MS;
    context.imageSmoothingQuality = covered && rests ? "high" : "low";
    for (let level = photo.levels - 1; level > best && !covered; level -= 1) {
      for (const one of this.visible(level)) this.put(context, one, grow);
    }
    if (covered) for (const one of base) this.put(context, one, grow);
    for (const one of fine) if (!this.put(context, one, grow)) missing.push(one);
    const beneath = this.loupe.tiles(photo, this.image, store.tilePx);
    missing.push(...beneath.filter(({ key }) => !tile(key)));
    missing.sort((a, b) => b.level - a.level || a.away - b.away);
    want(this.id, missing.map(({ key }) => key), base.length + fine.length + beneath.length);
    this.loupe.draw();
    return rests && missing.every(({ beneath: only }) => only);
  }

  visible(level) {
    const { view, photo } = this;
    const size = store.tilePx * 2 ** level;
    const right = Math.min(view.left + view.width / view.scale, photo.width);
    const bottom = Math.min(view.top + view.height / view.scale, photo.height);
    const found = [];
    const middle = [view.left + view.width / view.scale / 2, view.top + view.height / view.scale / 2];
    for (let row = Math.max(Math.floor(view.top / size), 0); row * size < bottom; row += 1) {
      for (let column = Math.max(Math.floor(view.left / size), 0); column * size < right; column += 1) {
        const away = Math.hypot((column + 0.5) * size - middle[0], (row + 0.5) * size - middle[1]);
        found.push({ key: tileKey(this.image, level, column, row), level, column, row, size, away });
      }
    }
    return found;
  }

  put(context, { key, level, column, row, size }, grow) {
    const picture = tile(key);
    if (!picture) return false;
    const step = grow * 2 ** level;
    context.drawImage(picture, (column * size - this.view.left) * grow, (row * size - this.view.top) * grow,
      picture.width * step, picture.height * step);
    return true;
  }

  tell(u, v) {
    this.told = u === undefined ? null : [u, v];
    const place = u === undefined ? "" : `u ${u.toFixed(2)}  v ${v.toFixed(2)} px \u00b7 `;
    const scale = this.desk.marks().shown.residuals && picksIn(this.image).length ? ` \u00b7 residuals \u00d7${residualScale(this.image)}` : "";
    const away = !this.photo || this.contains(...this.middle()) ? "" : " \u00b7 beside the photo: F shows it";
    this.readout.textContent = `${place}zoom \u00d7${this.view.scale.toPrecision(3)}${scale}${away}`;
  }

  // What the mouse does.

  local(event) {
    const { left, top } = this.svg.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  listen() {
    const { svg } = this;
    svg.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    svg.addEventListener("pointerdown", (event) => this.down(event));
    svg.addEventListener("pointermove", (event) => this.move(event));
    svg.addEventListener("pointerup", (event) => this.up(event));
    svg.addEventListener("pointercancel", () => { this.press = null; });
    svg.addEventListener("pointerleave", () => { this.hover = null; this.loupe.hide(); this.tell(); });
    svg.addEventListener("contextmenu", (event) => event.preventDefault());
    svg.addEventListener("dblclick", (event) => this.desk.doubled(event.target.closest?.("[data-label]")?.dataset.label));
    svg.addEventListener("focusout", (event) => { if (!svg.contains(event.relatedTarget)) this.calm(); });
    this.box.addEventListener("focusin", (event) => {
      this.desk.activate(this);
      const label = event.target.dataset?.label;
      if (label) this.desk.select(label);
    });
  }

  wheel(event) {
    event.preventDefault();
    const [x, y] = this.local(event);
    const lines = event.deltaMode === 1 ? 16 : 1;
    this.zoom(x, y, Math.exp(-event.deltaY * lines * 0.0015));
  }

  zoom(x, y, factor) {
    const least = Math.min(this.view.fitScale(this.photo.width, this.photo.height) / 4, 1);
    this.view.zoomAt(x, y, factor, least);
    this.moved();
  }

  moved() {
    this.fitted = false;
    this.movedAt = performance.now();
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.redraw(), REST_MS);
    this.redraw();
    this.desk.viewed(this);
  }

  down(event) {
    this.desk.activate(this);
    const [x, y] = this.local(event);
    const label = event.target.closest?.("[data-label]")?.dataset.label;
    const pans = event.button !== 0 || this.desk.spaceHeld;
    this.press = { x, y, label: pans ? undefined : label, pans, far: false, button: event.button, last: [x, y] };
    if (this.press.label) {
      const pick = pickAt(this.image, label);
      this.press.step = this.desk.newStep();
      this.press.at = [pick.u, pick.v];
      if (this.desk.marks().tool === "pick") this.desk.select(label);
    }
    svgCapture(this.svg, event.pointerId);
    event.preventDefault();
    (event.target.closest?.("[data-label]") ?? this.svg).focus({ preventScroll: true });
  }

  move(event) {
    const [x, y] = this.local(event);
    const { press } = this;
    this.hover = [x, y];
    if (press) {
      press.far ||= Math.hypot(x - press.x, y - press.y) >= CLICK_PX;
      if (press.far && press.label && this.desk.marks().tool === "pick") this.drag(event, x, y);
      else if (press.far) this.pan(x, y);
      press.last = [x, y];
    }
    if (!press?.label) {
      const [u, v] = this.view.toPhoto(x, y);
      this.magnify(u, v, x, y);
    }
  }

  magnify(u, v, x, y) {
    this.tell(u, v);
    const over = this.photo && u > -20 && v > -20 && u < this.photo.width + 20 && v < this.photo.height + 20;
    if (!this.desk.loupe || !over) {
      this.loupe.hide();
      return;
    }
    this.loupe.show({ u, v, scale: this.view.scale, aside: x > this.view.width - 230 && y < 230 });
    if (this.loupe.tiles(this.photo, this.image, store.tilePx).every(({ key }) => tile(key))) this.loupe.drawSoon();
    else this.redraw(); // which asks for them
  }

  pan(x, y) {
    const [lastX, lastY] = this.press.last;
    this.box.classList.add("moving");
    this.view.panBy(x - lastX, y - lastY);
    this.moved();
  }

  drag(event, x, y) {
    const { press } = this;
    const pace = (event.shiftKey ? FINE : 1) / this.view.scale;
    press.at = this.inside(press.at[0] + (x - press.last[0]) * pace, press.at[1] + (y - press.last[1]) * pace);
    this.desk.drag(this.image, press.label, press.at, press.step, false);
    this.magnify(...press.at, x, y);
  }

  // The magnifier stays with the pointer; where the keys brought it, it goes when they are done.
  calm() {
    if (this.hover) return;
    this.loupe.hide();
    this.tell();
  }

  inside(u, v) {
    const clamp = (value, most) => Math.min(Math.max(value, -0.5), most - 0.5);
    return [clamp(u, this.photo.width), clamp(v, this.photo.height)];
  }

  up(event) {
    const { press } = this;
    this.press = null;
    this.box.classList.remove("moving");
    if (!press) return;
    if (press.far) {
      if (press.label && this.desk.marks().tool === "pick") this.desk.drag(this.image, press.label, press.at, press.step, true);
      return;
    }
    if (press.pans || press.button !== 0) return;
    if (press.label) {
      this.desk.clickedMark(press.label);
      return;
    }
    const [u, v] = this.view.toPhoto(...this.local(event));
    if (this.contains(u, v)) this.desk.clicked(this, u, v);
  }

  contains(u, v) {
    return u >= -0.5 && v >= -0.5 && u <= this.photo.width - 0.5 && v <= this.photo.height - 0.5;
  }

  // What the keys do.

  middle() {
    return this.view.toPhoto(this.view.width / 2, this.view.height / 2);
  }

  goTo(label, scale) {
    const at = placeOf(this.image, label);
    if (!at) return false;
    this.view.center(at.u, at.v, scale ?? this.view.scale);
    this.moved();
    this.magnify(at.u, at.v, this.view.width / 2, this.view.height / 2);
    return true;
  }

  fit() {
    this.loupe.hide();
    this.view.fit(this.photo.width, this.photo.height);
    this.redraw();
    this.desk.viewed(this);
    this.fitted = true;
  }

  scaleTo(scale) {
    const [u, v] = this.hover ? this.view.toPhoto(...this.hover) : this.middle();
    this.view.center(u, v, scale);
    this.moved();
  }
}

// What is focused or pressed stays the same element.
function renew(group, fresh) {
  for (const { name, value } of fresh.attributes) group.setAttribute(name, value);
  group.replaceChildren(...fresh.children);
}

function svgCapture(svg, pointer) {
  try {
    svg.setPointerCapture(pointer);
  } catch {
    // the pointer is gone already: there is nothing to capture
  }
}
