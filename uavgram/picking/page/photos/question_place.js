// The place that a question is about: a hollow mark, as it is no pick before the answer.

import { put, shape } from "../elements/dom.js";

/** @import { AskedPlace } from "../actions/page_state.js" */
/** @import { Part } from "./marks.js" */

const RING = "M-9 0A9 9 0 1 0 9 0A9 9 0 1 0 -9 0Z";

/** @param {AskedPlace | null} asked @param {number} image @returns {Part[]} */
export function askedParts(asked, image) {
  if (asked?.image !== image) return [];
  return [{
    key: "asked",
    sign: "",
    make: () => shape("g", { class: "questioned", "aria-hidden": "true" }, shape("path", { class: "halo wide", d: RING }), shape("path", { class: "thin", d: RING })),
    move: (group, view) => {
      const [x, y] = view.toScreen(...asked.at);
      put(group, "transform", `translate(${x} ${y})`);
      if (asked.view === view) asked.moved(x, y, view);
    },
  }];
}
