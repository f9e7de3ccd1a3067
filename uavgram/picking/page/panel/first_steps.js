// The first steps of a new user, ticked when done. The list disappears when all are done; help shows it again.

import { TOOLS } from "../actions/keys.js";
import { countsOfPicks, store } from "../connection/store.js";
import { fillIfNew, node } from "../elements/dom.js";

/** @import { PageState } from "../actions/page_state.js" */
/** @typedef {{ words: string, how: string, done: boolean }} Step */

const list = node("ol", {});
const title = node("summary", {});
const readings = node("details", { class: "readings" }); // of the sample's tape
const box = node("details", { class: "steps", open: true, "aria-label": "First steps" }, title, list, readings);

/** @param {PageState} state */
export function firstStepsPart(state) {
  const steps = stepsOf(state.first === "length");
  const done = steps.filter((step) => step.done).length;
  if (!store.begun || (done === steps.length && !state.showsSteps)) return null;
  fillIfNew(title, `${done} ${steps.length}`, () => [`First steps: ${done} of ${steps.length} done`]);
  fillIfNew(list, JSON.stringify(steps), () => steps.map((step) => stepItem(step, step === steps.find((one) => !one.done))));
  fillIfNew(readings, store.sample?.file ?? "", () => (store.sample ? [node("summary", {}, "What was taped on the sample's scene"), node("p", { class: "dim" }, "In ", node("code", {}, store.sample.file), ":"), node("pre", {}, store.sample.text)] : []));
  return box;
}

// Unfolds the list when help is asked for.
export const unfold = () => { box.open = true; };

// The explanation is shown beneath the next step only.
/** @param {Step} step @param {boolean} isNext */
const stepItem = ({ words, how, done }, isNext) => node("li", { class: done ? "done" : "" },
  node("span", { class: "unseen" }, done ? "Done: " : ""), node("b", {}, words), isNext ? node("span", { class: "dim" }, how) : null);

/** @param {boolean} isTaped whether the project begins with the lengths that were taped @returns {Step[]} */
function stepsOf(isTaped) {
  const several = store.photos.length > 1;
  const counts = [...countsOfPicks().values()];
  const twice = counts.filter((count) => count > 1).length;
  const measure = {
    words: "Measure what you want to know", done: store.measurements.length > 0,
    how: `Tool ${TOOLS.distance.name} (D), then click the two points; a line of ${TOOLS.length.name} does it, too, if no reading is typed. Areas, heights and more have tools of their own.`,
  };
  if (!isPlaced()) {
    return [
      { words: several ? "Mark the same six points in two photos" : "Mark four points", done: several ? twice >= 6 : counts.length >= 4, how: several ? "Click things on the ground that both photos show. Page Down shows the next photo: click the same things there in the same order; the field Label shows which one comes next." : "Click things on the ground." },
      { words: `Enter ${several ? "two" : "three"} lengths that were taped`, done: store.lines.length >= (several ? 2 : 3), how: `Tool ${TOOLS.length.name} (L): click both ends, type what the tape said. Nothing else says how large things are.` },
      measure,
    ];
  }
  const tape = {
    words: isTaped ? "Enter a length that was taped" : "Enter a length that was taped, if you have one", done: store.lines.length >= 1,
    how: `Tool ${TOOLS.length.name} (L)${isTaped ? ": click both ends, and type what the tape read" : ""}. It makes all values more exact; here the photos' places are known, so it can do without.`,
  };
  return [
    ...(isTaped ? [tape] : []),
    { words: "Mark two points", done: counts.length >= 2, how: "Click them in a photo: things on the ground, as near as the zoom allows (wheel)." },
    measure,
    ...(several ? [{ words: "Mark the same points in a second photo", done: twice >= 2, how: "Accept what the program found: that makes the values more exact, but checks no click. A wrong click shows only beside another click of yours: Click again, above the numbers, asks for the few points that need one; or click them in the next photo (Page Down), within the dashed line." }] : []),
    ...(isTaped ? [] : [tape]),
  ];
}

// Returns whether the photos are positioned without taped lengths: by a log, their tags, or known points.
const isPlaced = () => store.photos.some(({ seed }) => seed) || store.control.length >= 3 || store.controlLines.length >= 3;
