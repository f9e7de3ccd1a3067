// The strip of small pictures: number and fit of the picks in each photo.

import { keyed } from "../connection/key.js";
import { isSuspect, proposals, store, worstOfPhotos } from "../connection/store.js";
import { fault, trustOfPhoto } from "../connection/trust.js";
import { as, byId, node } from "../elements/dom.js";

/** @import { Photo } from "../connection/protocol.js" */
/** @import { Panes } from "./panes.js" */
/** @typedef {{ count: number, found: number, worst: { w: number, status: string }, unmatched: boolean, here: boolean, first: boolean }} Shown here: in a pane; first: reached with Tab */

const SIGNS = { doubtful: " ?", contradicted: " \u2260", "": "" };
const THUMBNAILS_AFTER_MS = 4000; // at the latest, as the photo may not be displayable

/** @param {Photo} photo */
const matchOf = ({ matched, reason }) => (matched ? "placed in the flight" : `not placed in the flight: ${reason}`);

// Status of a photo; nothing if it is ok.
/** @param {number} image */
function standingOf(image) {
  const trust = trustOfPhoto(image);
  const status = fault(trust);
  return { status, words: status ? `, ${status}: ${trust?.why ?? ""}` : "" };
}

/** Counts the items of each photo. @param {Iterable<{ image: number }>} all */
function countsByImage(all) {
  /** @type {Map<number, number>} */
  const counts = new Map();
  for (const { image } of all) counts.set(image, (counts.get(image) ?? 0) + 1);
  return counts;
}

export class Filmstrip {
  /** @param {Panes} panes */
  constructor(panes) {
    this.panes = panes;
    this.box = byId("strip");
    /** Displayed content, by photo. @type {string[]} */
    this.signs = [];
  }

  show() {
    if (this.box.childElementCount !== store.photos.length) this.build();
    const [counts, found] = [store.picks.values(), proposals()].map(countsByImage);
    const worst = worstOfPhotos();
    const shown = new Set(this.panes.all.map(({ image }) => image));
    const isAnyMatched = store.photos.some(({ matched }) => matched);
    store.photos.forEach((photo, k) => this.showPhoto(photo, k, {
      count: counts.get(k) ?? 0, found: found.get(k) ?? 0, worst: worst.get(k) ?? { w: 0, status: "" },
      unmatched: isAnyMatched && !photo.matched, here: shown.has(k), first: k === (this.panes.active?.image ?? 0),
    }));
  }

  build() {
    this.signs = [];
    this.box.replaceChildren(...store.photos.map((photo, k) => node("button", { "data-image": k, onclick: () => { this.panes.active?.show(k); this.panes.active?.focus(); } },
      node("img", { "data-src": keyed(`/photo/${k}/thumbnail.jpg?${photo.digest}`), alt: "", loading: "lazy", draggable: "false" }),
      node("span", { class: "name" }, node("bdi", {}, photo.name.replace(/\.\w+$/, ""))), node("span", { class: "badge" }), node("span", { class: "unseen" }))));
    setTimeout(() => this.loadThumbnails(), THUMBNAILS_AFTER_MS);
  }

  /** @param {Photo} photo @param {number} k @param {Shown} shown */
  showPhoto(photo, k, shown) {
    // A drag comes here at each frame, and leaves most photos unchanged.
    const [standing, matched] = [standingOf(k), matchOf(photo)];
    const sign = JSON.stringify([shown, standing, matched]);
    if (this.signs[k] === sign) return;
    this.signs[k] = sign;
    const { count, found, worst, unmatched, here, first } = shown;
    const button = as(HTMLElement, this.box.children[k]);
    const isBad = isSuspect(worst.status);
    const wrong = standing.status;
    button.dataset.status = wrong;
    button.classList.toggle("unmatched", unmatched);
    button.setAttribute("aria-current", `${here}`);
    button.tabIndex = first ? 0 : -1;
    const [badge, spoken] = [...button.querySelectorAll("span")].slice(-2);
    badge.textContent = `${count || ""}${found ? ` +${found}` : ""}${isBad ? ` \u25c6 ${worst.w.toFixed(1)}` : ""}${SIGNS[wrong]}`;
    badge.hidden = !badge.textContent;
    badge.classList.toggle("bad", isBad || wrong === "contradicted");
    const words = `${matched}, ${count} point${count === 1 ? "" : "s"} marked${found ? `, ${found} more found by the program` : ""}${worst.w ? `, largest misfit ${worst.w.toFixed(1)} standard deviations` : ""}${standing.words}`;
    spoken.textContent = `, ${words}`;
    button.title = `${photo.name}: ${words}`;
  }

  // Loads the small pictures once a photo is complete, which they would have delayed.
  loadThumbnails() {
    if (store.closing) return;
    for (const picture of this.box.querySelectorAll("img")) if (!picture.hasAttribute("src")) picture.src = picture.dataset.src ?? "";
  }

  /** @param {number} image */
  bring(image) {
    this.box.children[image]?.scrollIntoView({ block: "nearest", inline: "nearest" });
  }
}
