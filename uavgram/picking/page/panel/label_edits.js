// Edits of the selected point and another one: merge them, exchange them, or split one.

import { labels, picksOf, placeOf, store } from "../connection/store.js";
import { as, node } from "../elements/dom.js";

/** @import { PageState } from "../actions/page_state.js" */
/** @import { Tools } from "../actions/tools.js" */

/** Content of the part, which is made anew when it changes. @param {string} label */
export const editsSign = (label) => [labels(), picksOf(label).map(({ image }) => image)];

/** @param {string} label @param {number} image the photo in use @param {PageState} state @param {Tools} tools */
export function editsPart(label, image, state, tools) {
  const others = labels().filter((one) => one !== label);
  const photos = picksOf(label).map((pick) => pick.image);
  const parts = [...(others.length ? [withOther(label, others, image, tools)] : []), ...(photos.length > 1 ? [splitPart(label, photos, image, tools)] : [])];
  if (!parts.length) return null;
  return node("details", { class: "both edits", open: state.edits, ontoggle: ({ target }) => { state.edits = as(HTMLDetailsElement, target).open; } },
    node("summary", {}, "Merge, swap, split"), ...parts);
}

/** @param {string} label @param {string[]} others @param {number} image @param {Tools} tools */
function withOther(label, others, image, { edits }) {
  const nearest = nearestTo(label, others, image);
  const choice = node("select", { name: "other" }, ...others.map((one) => node("option", { value: one, selected: one === nearest }, one)));
  /** @param {string} name @param {string} words @param {string} title @param {(other: string) => void} act */
  const button = (name, words, title, act) => node("button", { type: "button", name, title, onclick: () => act(choice.value) }, words);
  return node("div", { class: "edit" }, node("label", {}, `${label} and`, choice),
    button("merge", "are one point: merge", "All that is said of this point is said of the other one from now on", (other) => edits.merge(label, other)),
    button("swap-here", "are mixed up in this photo: swap", "Exchange the two labels in the photo that is shown", (other) => edits.swap(image, label, other)),
    button("swap-all", "are mixed up everywhere: swap", "Exchange the two labels in all photos; lengths and measurements stay as they are", (other) => edits.swap(null, label, other)));
}

// The nearest point is preselected, as confused points are mostly close to each other.
/** @param {string} label @param {string[]} others @param {number} image */
function nearestTo(label, others, image) {
  const here = placeOf(image, label);
  /** @param {string} other */
  const away = (other) => {
    const there = placeOf(image, other);
    return here && there ? Math.hypot(here.u - there.u, here.v - there.v) : Infinity;
  };
  return others.reduce((best, one) => (away(one) < away(best) ? one : best));
}

/** @param {string} label @param {number[]} photos @param {number} image @param {Tools} tools */
function splitPart(label, photos, image, { edits, names }) {
  const name = node("input", {
    name: "split-name", value: names.free(label), maxlength: 200, autocomplete: "off",
    onkeydown: (event) => { if (event instanceof KeyboardEvent && event.key === "Enter") { event.preventDefault(); split(); } },
  });
  const boxes = photos.map((one) => node("input", { type: "checkbox", name: `split-${one}`, value: one, checked: one === image }));
  /** @type {() => void} */
  const split = () => edits.split(label, name.value, boxes.filter(({ checked }) => checked).map(({ value }) => Number(value)));
  return node("fieldset", { class: "edit" }, node("legend", {}, `In these photos ${label} is another point:`),
    node("div", { class: "photos" }, ...photos.map((one, k) => node("label", {}, boxes[k], store.photos[one].name))),
    node("label", {}, "its name", name),
    node("button", { type: "button", name: "split", title: "Lengths and measurements stay with the point that is there", onclick: split }, "Split"));
}
