// The magnifier: the photo's own pixels, hard-edged, under a cross with an open centre.

import { node } from "../elements/dom.js";
import { tile, tileKey } from "./tiles.js";

/** @import { Photo } from "../connection/protocol.js" */
/** @typedef {{ u: number, v: number, scale: number, aside: boolean }} LoupePlace aside: whether it would be in the way at its usual place */

const SIDE = 168;
const LEAST_SCALE = 8; // screen pixels for each pixel of the photo

export class Loupe {
  /** @param {Element} parent */
  constructor(parent) {
    this.canvas = node("canvas", { class: "loupe", "aria-hidden": true, hidden: true });
    this.asked = false;
    /** @type {{ at: LoupePlace, photo: Photo, image: number, tilePx: number } | null} */
    this.shows = null;
    parent.append(this.canvas);
  }

  hide() {
    this.shows = null;
    this.canvas.hidden = true;
  }

  /** @param {LoupePlace} at @param {Photo} photo @param {number} image @param {number} tilePx */
  show(at, photo, image, tilePx) {
    this.shows = { at, photo, image, tilePx };
    this.canvas.hidden = false;
    this.canvas.classList.toggle("left", at.aside);
  }

  // The finest tiles beneath it; coarser ones replace those not yet loaded.
  get keys() {
    return this.visible(0).map(({ key }) => key);
  }

  /** @param {number} level */
  visible(level) {
    if (!this.shows) return [];
    const { at: { u, v, scale }, photo, image, tilePx } = this.shows;
    const size = tilePx * 2 ** level; // in pixels of the photo
    const reach = SIDE / 2 / Math.max(LEAST_SCALE, 3 * scale);
    /** @param {number} edge @param {number} most */
    const place = (edge, most) => Math.min(Math.max(Math.floor(edge / size), 0), Math.ceil(most / size) - 1);
    const found = [];
    for (let row = place(v + 0.5 - reach, photo.height_px); row <= place(v + 0.5 + reach, photo.height_px); row += 1) {
      for (let column = place(u + 0.5 - reach, photo.width_px); column <= place(u + 0.5 + reach, photo.width_px); column += 1) {
        found.push({ key: tileKey(image, level, column, row), left: column * size, top: row * size, grow: 2 ** level });
      }
    }
    return found;
  }

  drawSoon() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.draw(); });
  }

  draw() {
    const context = this.canvas.getContext("2d");
    if (!this.shows || !context) return;
    const ratio = window.devicePixelRatio;
    const side = Math.round(SIDE * ratio);
    if (this.canvas.width !== side) this.canvas.width = this.canvas.height = side;
    const { at: { u, v, scale }, photo } = this.shows;
    const step = Math.max(LEAST_SCALE, 3 * scale) * ratio;
    context.fillStyle = "#15181c";
    context.fillRect(0, 0, side, side);
    context.imageSmoothingEnabled = false;
    for (let level = photo.levels - 1; level >= 0; level -= 1) {
      for (const { key, left, top, grow } of this.visible(level)) {
        const picture = tile(key);
        if (picture) {
          context.drawImage(picture, side / 2 + (left - u - 0.5) * step, side / 2 + (top - v - 0.5) * step,
            picture.width * grow * step, picture.height * grow * step);
        }
      }
    }
    drawCross(context, side, ratio);
  }
}

/** @param {CanvasRenderingContext2D} context @param {number} side @param {number} ratio */
function drawCross(context, side, ratio) {
  const middle = side / 2;
  const gap = 9 * ratio;
  for (const { color, width } of [{ color: "#000a", width: 3 * ratio }, { color: "#ffd54a", width: ratio }]) {
    context.strokeStyle = color;
    context.lineWidth = width;
    context.beginPath();
    for (const [dx, dy] of /** @type {const} */ ([[1, 0], [-1, 0], [0, 1], [0, -1]])) {
      context.moveTo(middle + dx * gap, middle + dy * gap);
      context.lineTo(middle + dx * middle, middle + dy * middle);
    }
    context.stroke();
  }
}
