// The strip of small pictures: what is picked in each photo, and how well it fits.

import { isSuspect, picksIn, proposals, store, worstIn } from "../connection/store.js";
import { fault, trustOfPhoto } from "../connection/trust.js";
import { as, byId, node } from "../elements/dom.js";

/** @import { Photo } from "../connection/protocol.js" */
/** @import { Panes } from "./panes.js" */

const SIGNS = { doubtful: " ?", contradicted: " \u2260", "": "" };
const THUMBNAILS_AFTER_MS = 4000; // at the latest: the photo may be none that can be shown

/** @param {Photo} photo */
const matchOf = ({ matched, reason }) => (matched ? "matched" : `not matched: ${reason}`);

// What the verdict says of a photo: nothing where it is in order.
/** @param {number} image */
function standingOf(image) {
  const trust = trustOfPhoto(image);
  const status = fault(trust);
  return { status, words: status ? `, ${status}: ${trust?.why ?? ""}` : "" };
}

export class Filmstrip {
  /** @param {Panes} panes */
  constructor(panes) {
    this.panes = panes;
    this.box = byId("strip");
  }

  show() {
    if (this.box.childElementCount !== store.photos.length) this.build();
    store.photos.forEach((photo, k) => this.showPhoto(photo, k));
  }

  build() {
    this.box.replaceChildren(...store.photos.map((photo, k) => node("button", { "data-image": k, onclick: () => { this.panes.active?.show(k); this.panes.active?.focus(); } },
      node("img", { "data-src": `/photo/${k}/thumbnail.jpg?${photo.digest}`, alt: "", loading: "lazy", draggable: "false" }),
      node("span", { class: "name" }, node("bdi", {}, photo.name.replace(/\.\w+$/, ""))), node("span", { class: "badge" }), node("span", { class: "unseen" }))));
    setTimeout(() => this.loadThumbnails(), THUMBNAILS_AFTER_MS);
  }

  /** @param {Photo} photo @param {number} k */
  showPhoto(photo, k) {
    const button = as(HTMLElement, this.box.children[k]);
    const count = picksIn(k).length;
    const worst = worstIn(k);
    const isBad = isSuspect(worst.status);
    const standing = standingOf(k);
    const wrong = standing.status;
    button.dataset.status = wrong;
    const found = proposals().filter((one) => one.image === k).length;
    button.classList.toggle("unmatched", !photo.matched && store.photos.some((one) => one.matched));
    button.setAttribute("aria-current", `${this.panes.all.some((pane) => pane.image === k)}`);
    button.tabIndex = k === (this.panes.active?.image ?? 0) ? 0 : -1;
    const [badge, spoken] = [...button.querySelectorAll("span")].slice(-2);
    badge.textContent = `${count || ""}${found ? ` +${found}` : ""}${isBad ? ` \u25c6 ${worst.w.toFixed(1)}` : ""}${SIGNS[wrong]}`;
    badge.hidden = !badge.textContent;
    badge.classList.toggle("bad", isBad || wrong === "contradicted");
    const words = `${matchOf(photo)}, ${count} picks${found ? `, ${found} more found by the program` : ""}${worst.w ? `, worst w ${worst.w.toFixed(1)}` : ""}${standing.words}`;
    spoken.textContent = `, ${words}`;
    button.title = `${photo.name}: ${words}`;
  }

  // A photo is there as a whole: now its small pictures may come, which would have delayed it.
  loadThumbnails() {
    for (const picture of this.box.querySelectorAll("img")) if (!picture.hasAttribute("src")) picture.src = picture.dataset.src ?? "";
  }

  /** @param {number} image */
  bring(image) {
    this.box.children[image]?.scrollIntoView({ block: "nearest", inline: "nearest" });
  }
}
