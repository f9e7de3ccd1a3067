// Edits of labels: rename, exchange, merge, split.

import { labels, pickAt, picksOf, store } from "../connection/store.js";

/** @import { Question } from "../elements/question.js" */
/** @import { Notice } from "../elements/notice.js" */
/** @import { Tools } from "./tools.js" */

export class LabelEdits {
  /** @param {{ tools: Tools, question: Question, notice: Notice }} needs */
  constructor({ tools, question, notice }) {
    this.tools = tools;
    this.question = question;
    this.notice = notice;
  }

  /** @param {string} label @param {string} name */
  rename(label, name) {
    const wanted = name.trim();
    if (!wanted || wanted === label) return;
    if (labels().includes(wanted)) {
      this.question.ask(`There is a point ${wanted} already. What is meant?`, [
        { words: `${label} and ${wanted} are one point: merge them`, act: () => this.merge(label, wanted) },
        { words: `The names are mixed up: ${label} is ${wanted}, and ${wanted} is ${label}`, act: () => this.swap(null, label, wanted) },
      ]);
      return;
    }
    const send = () => {
      this.tools.send({ t: "rename", label, new: wanted });
      this.tools.choose(wanted, true);
    };
    if (isKnown(label)) this.question.ask(`${label} has known coordinates, which stay with that name.`, [{ words: `Call it ${wanted}, a point without coordinates`, act: send }]);
    else send();
  }

  // Merges two labels into one point. A point with known coordinates keeps its name, which links it to them.
  /** @param {string} label @param {string} into */
  merge(label, into) {
    if (isKnown(label) && isKnown(into)) {
      this.notice.show(`${label} and ${into} both have known coordinates: they are two points.`);
      return;
    }
    const [gone, stays] = isKnown(label) ? [into, label] : [label, into];
    const both = picksOf(gone).flatMap(({ image }) => (pickAt(image, stays) ? [store.photos[image].name] : []));
    if (!both.length) {
      this.sendMerge(gone, stays, "");
      return;
    }
    this.question.ask(`${gone} and ${stays} are both picked in ${some(both)}. Which pick stays there?`, [
      { words: `That of ${stays}`, act: () => this.sendMerge(gone, stays, stays) },
      { words: `That of ${gone}`, act: () => this.sendMerge(gone, stays, gone) },
    ]);
  }

  /** @param {string} label @param {string} into @param {string} keep */
  sendMerge(label, into, keep) {
    this.tools.send({ t: "merge", label, into, ...(keep && { keep }) });
    this.tools.choose(into, true);
    this.notice.show(`${label} is ${into} now. Undo: Ctrl+Z.`, true);
  }

  /** Makes the picks in some photos another point. @param {string} label @param {string} name @param {number[]} images */
  split(label, name, images) {
    const wanted = name.trim();
    const why = splitFault(wanted, images);
    if (why) {
      this.notice.show(why);
      return;
    }
    this.tools.send({ t: "split", label, new: wanted, images });
    this.tools.choose(wanted, true);
    this.notice.show(`${wanted} is a point of its own now, in ${some(images.map((image) => store.photos[image].name))}. Lengths and measurements stay with ${label}. Undo: Ctrl+Z.`, true);
  }

  // Turns the last click, and the drawing in progress, into another point than it was taken for.
  /** @param {string} label @param {string} name @param {number} image */
  another(label, name, image) {
    const { state } = this.tools;
    /** @param {string} one */
    const now = (one) => (one === label ? name : one);
    state.draft = state.draft.map(now);
    if (state.entry?.t === "line") Object.assign(state.entry, { start: now(state.entry.start), end: now(state.entry.end) });
    else if (state.entry) state.entry.points = state.entry.points.map(now);
    this.split(label, name, [image]);
  }

  /** @param {number | null} image null: in all photos @param {string} label @param {string} other */
  swap(image, label, other) {
    const where = image === null ? "in all photos" : `in ${store.photos[image].name}`;
    if (image !== null && !pickAt(image, label) && !pickAt(image, other)) {
      this.notice.show(`Neither ${label} nor ${other} is picked ${where}.`);
      return;
    }
    this.tools.send({ t: "swap", image, label, other });
    this.notice.show(`${label} and ${other} are exchanged ${where}. Undo: Ctrl+Z.`, true);
  }
}

/** @param {string} label */
const isKnown = (label) => store.control.includes(label) || store.check.includes(label);

/** @param {string} name @param {number[]} images */
function splitFault(name, images) {
  if (!name) return "Type a name for the other point.";
  if (labels().includes(name)) return `There is a point ${name} already: choose another name, or merge the two afterwards.`;
  return images.length ? "" : "Choose the photos that show the other point.";
}

const MOST_NAMES = 3;

/** @param {string[]} names */
const some = (names) => `${names.slice(0, MOST_NAMES).join(", ")}${names.length > MOST_NAMES ? ` and ${names.length - MOST_NAMES} more` : ""}`;
