// The strip of small pictures: what is picked in each photo, and how well it fits.

import { byId, node } from "./format.js";
import { isSuspect, picksIn, store, worstIn } from "./store.js";

const THUMBNAILS_AFTER_MS = 4000; // at the latest: the photo may be none that can be shown

export const stripActions = {
  showStrip() {
    const strip = byId("strip");
    if (strip.childElementCount !== store.photos.length) {
      strip.replaceChildren(...store.photos.map((photo, k) => node("button", { "data-image": k, onclick: () => { this.active?.show(k); this.backToPhoto(); } },
        node("img", { "data-src": `/photo/${k}/thumbnail.jpg?${photo.digest}`, alt: "", loading: "lazy", draggable: false }),
        node("span", { class: "name" }, node("bdi", {}, photo.name.replace(/\.\w+$/, ""))), node("span", { class: "badge" }))));
      setTimeout(() => this.sharpened(), THUMBNAILS_AFTER_MS);
    }
    store.photos.forEach((photo, k) => {
      const button = strip.children[k];
      const count = picksIn(k).length;
      const worst = worstIn(k);
      const bad = worst && isSuspect(worst.status);
      button.classList.toggle("unmatched", !photo.matched && store.photos.some((one) => one.matched));
      button.setAttribute("aria-current", this.panes.some((pane) => pane.image === k));
      button.tabIndex = k === (this.active?.image ?? 0) ? 0 : -1;
      const badge = button.lastChild;
      badge.textContent = `${count || ""}${bad ? ` \u25c6 ${Math.abs(worst.w).toFixed(1)}` : ""}`;
      badge.hidden = !count;
      badge.classList.toggle("bad", Boolean(bad));
      const state = photo.matched ? "matched" : `not matched: ${photo.reason}`;
      const fit = worst ? `, worst w ${Math.abs(worst.w).toFixed(1)}` : "";
      button.setAttribute("aria-label", `${photo.name}, ${state}, ${count} picks${fit}`);
      button.title = `${photo.name}: ${state}, ${count} picks${fit}`;
    });
  },

  // A photo is there as a whole: now its small pictures may come, which would have delayed it.
  sharpened() {
    for (const picture of byId("strip").querySelectorAll("img:not([src])")) picture.src = picture.dataset.src;
  },

  bringThumbnail(image) {
    byId("strip").children[image]?.scrollIntoView({ block: "nearest", inline: "nearest" });
  },
};
