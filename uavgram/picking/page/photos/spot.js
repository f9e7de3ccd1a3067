// A small picture of a place in a photo, made of the photo's own tiles, which load when it comes into view.

import { keyed } from "../connection/key.js";
import { store } from "../connection/store.js";
import { node } from "../elements/dom.js";
import { tileKey } from "./tiles.js";

const SIDE_PX = 72;

/** @param {number} image @param {number} u @param {number} v @param {string} words @param {number} [side] */
export function spot(image, u, v, words, side = SIDE_PX) {
  const reach = side / 2;
  const { digest, height_px, width_px } = store.photos[image];
  const { tilePx } = store;
  const box = node("span", { class: "spot", role: "img", "aria-label": words, title: words });
  Object.assign(box.style, { width: `${side}px`, height: `${side}px` });
  /** The tiles along one axis. @param {number} at @param {number} size */
  const numbers = (at, size) => {
    const first = Math.max(Math.floor((at + 0.5 - reach) / tilePx), 0);
    const last = Math.min(Math.floor((at + 0.5 + reach) / tilePx), Math.ceil(size / tilePx) - 1);
    return Array.from({ length: last - first + 1 }, (_, k) => first + k);
  };
  for (const row of numbers(v, height_px)) {
    for (const column of numbers(u, width_px)) {
      const tile = node("img", { alt: "", loading: "lazy", src: keyed(`/photo/${tileKey(image, 0, column, row)}.jpg?${digest}`) });
      Object.assign(tile.style, { left: `${reach + column * tilePx - u - 0.5}px`, top: `${reach + row * tilePx - v - 0.5}px` });
      box.append(tile);
    }
  }
  return box;
}
