// Height of a point: on the ground, stated, or free, that is, estimated from the photos.

import { heightOf, labels } from "../connection/store.js";

/** @import { Link } from "../connection/socket.js" */
/** @import { Notice } from "../elements/notice.js" */
/** @import { PageState } from "./page_state.js" */

export class Heights {
  /** @param {{ state: PageState, link: Link, notice: Notice }} needs */
  constructor({ state, link, notice }) {
    this.state = state;
    this.link = link;
    this.notice = notice;
  }

  /** Sets a stated height; null: on the ground. @param {string} label @param {number | null} height_m @param {number | null} sigma_m */
  set(label, height_m, sigma_m = null) {
    this.link.change({ t: "height", label, height_m, height_sigma_m: height_m === null ? null : sigma_m, is_free: false });
  }

  /** Frees the heights of several points in one step. @param {string[]} all */
  free(all) {
    const step = this.link.newStep();
    for (const label of all) this.link.change({ t: "height", label, height_m: null, height_sigma_m: null, is_free: true, step });
  }

  // Switches the selected point from the ground or a stated height to free, and from free to the ground.
  toggle() {
    const { selected: label } = this.state;
    if (!label || !labels().includes(label)) {
      this.notice.show("Choose the point whose height is to be found: click it, or N and B.");
    } else if (heightOf(label).is_free) {
      this.set(label, null);
      this.notice.show(`${label} is on the ground.`, true);
    } else {
      this.free([label]);
      this.notice.show(`The height of ${label} is free: its photos tell it.`, true);
    }
  }
}
