// The magnifier: the photo's own pixels, hard-edged, under a cross with an open centre.

import { tile, tileKey } from "./tiles.js";

const SIDE = 168;

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

  // Around (u, v), which lies at (x, y) of the pane; steps aside from the pointer.
  show(photo, image, tilePx, u, v, scale, x, y, width) {
    const ratio = window.devicePixelRatio;
    const side = Math.round(SIDE * ratio);
    if (this.canvas.width !== side) this.canvas.width = this.canvas.height = side;
    this.canvas.hidden = false;
    this.canvas.classList.toggle("left", x > width - SIDE - 60 && y < SIDE + 60);
    const step = Math.max(8, 3 * scale) * ratio;
    const context = this.canvas.getContext("2d");
    context.fillStyle = "#15181c";
    context.fillRect(0, 0, side, side);
    context.imageSmoothingEnabled = false;
    for (let level = Math.min(photo.levels - 1, 4); level >= 0; level -= 1) {
      this.draw(context, image, tilePx, level, u, v, step, side);
    }
    this.cross(context, side, ratio);
  }

  draw(context, image, tilePx, level, u, v, step, side) {
    const size = tilePx * 2 ** level; // in pixels of the photo
    const reach = side / step / 2;
    const first = [u + 0.5 - reach, v + 0.5 - reach].map((edge) => Math.floor(edge / size));
    const last = [u + 0.5 + reach, v + 0.5 + reach].map((edge) => Math.floor(edge / size));
    for (let row = Math.max(first[1], 0); row <= last[1]; row += 1) {
      for (let column = Math.max(first[0], 0); column <= last[0]; column += 1) {
        const picture = tile(tileKey(image, level, column, row));
        if (!picture) continue;
        const grow = step * 2 ** level;
        context.drawImage(picture, side / 2 + (column * size - u - 0.5) * step,
          side / 2 + (row * size - v - 0.5) * step, picture.width * grow, picture.height * grow);
      }
    }
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
