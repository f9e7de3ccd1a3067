// The magnifier: the photo's own pixels, hard-edged, under a cross with an open centre.

import { tile, tileKey } from "./tiles.js";

const SIDE = 168;
const LEAST_SCALE = 8; // screen pixels for each pixel of the photo

export class Loupe {
  constructor(parent) {
    this.canvas = document.createElement("canvas");
    this.canvas.className = "loupe";
    this.canvas.setAttribute("aria-hidden", "true");
    parent.append(this.canvas);
    this.hide();
  }

  hide() {
    this.canvas.hidden = true;
  }

  show(at) {
    this.at = at;
    this.canvas.hidden = false;
    this.canvas.classList.toggle("left", at.aside);
  }

  // The photo's own tiles beneath it; where they are not there yet, coarser ones stand in.
  tiles(photo, image, tilePx) {
    if (this.canvas.hidden) return [];
    Object.assign(this, { photo, image, tilePx });
    return this.visible(0).map(({ key }) => ({ key, level: 0, away: 0, beneath: true }));
  }

  visible(level) {
    const { u, v, scale } = this.at;
    const size = this.tilePx * 2 ** level; // in pixels of the photo
    const reach = SIDE / 2 / Math.max(LEAST_SCALE, 3 * scale);
    const place = (edge, most) => Math.min(Math.max(Math.floor(edge / size), 0), Math.ceil(most / size) - 1);
    const found = [];
    for (let row = place(v + 0.5 - reach, this.photo.height); row <= place(v + 0.5 + reach, this.photo.height); row += 1) {
      for (let column = place(u + 0.5 - reach, this.photo.width); column <= place(u + 0.5 + reach, this.photo.width); column += 1) {
        found.push({ key: tileKey(this.image, level, column, row), left: column * size, top: row * size, grow: 2 ** level });
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
    if (this.canvas.hidden || !this.photo) return;
    const ratio = window.devicePixelRatio;
    const side = Math.round(SIDE * ratio);
    if (this.canvas.width !== side) this.canvas.width = this.canvas.height = side;
    const { u, v, scale } = this.at;
    const step = Math.max(LEAST_SCALE, 3 * scale) * ratio;
    const context = this.canvas.getContext("2d");
    context.fillStyle = "#15181c";
    context.fillRect(0, 0, side, side);
    context.imageSmoothingEnabled = false;
    for (let level = this.photo.levels - 1; level >= 0; level -= 1) {
      for (const { key, left, top, grow } of this.visible(level)) {
        const picture = tile(key);
        if (picture) {
          context.drawImage(picture, side / 2 + (left - u - 0.5) * step, side / 2 + (top - v - 0.5) * step,
            picture.width * grow * step, picture.height * grow * step);
        }
      }
    }
    this.cross(context, side, ratio);
  }

  cross(context, side, ratio) {
    const middle = side / 2;
    const gap = 9 * ratio;
    for (const [color, width] of [["#000a", 3 * ratio], ["#ffd54a", ratio]]) {
      context.strokeStyle = color;
      context.lineWidth = width;
      context.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        context.moveTo(middle + dx * gap, middle + dy * gap);
        context.lineTo(middle + dx * middle, middle + dy * middle);
      }
      context.stroke();
    }
  }
}
