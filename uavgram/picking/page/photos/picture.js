// The picture of a pane: tiles on a canvas at their exact places, coarse ones first.

import { store } from "../connection/store.js";
import { isCurrent, tile, tileKey, want } from "./tiles.js";

/** @import { Photo } from "../connection/protocol.js" */
/** @import { View } from "./view.js" */
/** @typedef {{ key: string, level: number, away: number, left: number, top: number }} Tile left, top: in the photo; away: from the middle of the pane */

const HARD_FROM = 3; // device pixels per photo pixel, from which on pixels have hard edges

/** @param {Tile} one */
const isThere = ({ key }) => Boolean(tile(key));

export class Picture {
  /** @param {number} id @param {HTMLCanvasElement} canvas @param {View} view */
  constructor(id, canvas, view) {
    this.id = id;
    this.canvas = canvas;
    this.view = view;
  }

  // Draws coarse tiles first, fine ones over them at their exact places; a seam shows the coarser picture.
  // `beneath`: tiles of the magnifier. Returns whether there is a picture, and whether it is the finest.
  /** @param {Photo} photo @param {number} image @param {boolean} rests @param {string[]} beneath */
  paint(photo, image, rests, beneath) {
    const context = this.canvas.getContext("2d", { alpha: false });
    if (!context) return { pictured: false, sharp: false };
    const grow = this.view.scale * this.view.ratio;
    context.fillStyle = "#15181c";
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    context.imageSmoothingEnabled = grow < HARD_FROM;
    const coarsest = photo.levels - 1;
    const best = Math.min(Math.max(Math.floor(Math.log2(1 / grow)), 0), coarsest);
    const base = this.visible(photo, image, coarsest);
    const fine = best === coarsest ? [] : this.visible(photo, image, best);
    const covered = fine.every(isThere);
    context.imageSmoothingQuality = covered && rests ? "high" : "low";
    for (let level = coarsest; level > best && !covered; level -= 1) {
      for (const one of this.visible(photo, image, level)) this.put(context, one, grow);
    }
    if (covered) for (const one of base) this.put(context, one, grow);
    for (const one of fine) this.put(context, one, grow);
    const missing = [...base, ...fine].filter(({ key }) => !isCurrent(key));
    const under = beneath.filter((key) => !isCurrent(key)).map((key) => ({ key, level: 0, away: 0 }));
    const wanted = [...missing, ...under].sort((a, b) => b.level - a.level || a.away - b.away);
    want(this.id, image, wanted.map(({ key }) => key), base.length + fine.length + beneath.length);
    return { pictured: covered || base.every(isThere), sharp: rests && !missing.length };
  }

  /** @param {Photo} photo @param {number} image @param {number} level @returns {Tile[]} */
  visible(photo, image, level) {
    const { view } = this;
    const size = store.tilePx * 2 ** level;
    const right = Math.min(view.left + view.width / view.scale, photo.width_px);
    const bottom = Math.min(view.top + view.height / view.scale, photo.height_px);
    const [u, v] = view.middle;
    const found = [];
    for (let row = Math.max(Math.floor(view.top / size), 0); row * size < bottom; row += 1) {
      for (let column = Math.max(Math.floor(view.left / size), 0); column * size < right; column += 1) {
        const [left, top] = [column * size, row * size];
        const away = Math.hypot(left + size / 2 - u - 0.5, top + size / 2 - v - 0.5);
        found.push({ key: tileKey(image, level, column, row), level, away, left, top });
      }
    }
    return found;
  }

  /** @param {CanvasRenderingContext2D} context @param {Tile} one @param {number} grow */
  put(context, { key, level, left, top }, grow) {
    const picture = tile(key);
    if (!picture) return;
    const step = grow * 2 ** level;
    context.drawImage(picture, (left - this.view.left) * grow, (top - this.view.top) * grow, picture.width * step, picture.height * step);
  }
}
