// Choice of the label for a click: that of the point expected there, else a new one. A typed name is
// used, after a question if it does not fit.

import { adjusted, freeName, labels, namedLabels, pickAt, predictedIn, proposalAt, stale, store } from "../connection/store.js";
import { markOn } from "../photos/near.js";
import { aside, isTelling, meant, nearness } from "../photos/regions.js";
import { TOOLS } from "./keys.js";

/** @import { Predicted } from "../connection/protocol.js" */
/** @import { Link } from "../connection/link.js" */
/** @import { Near } from "../photos/near.js" */
/** @import { PageState } from "./page_state.js" */

/** @typedef {{ u: number, v: number, scale: number, image: number }} Click */
/** @typedef {{ label: string, words: string, isNew?: boolean, mark?: "pick" | "hollow" }} Choice `mark`: it is one that is there */
/**
 * A label, and a message about it; `instead`: the name of a new point, which may have been meant; `found`: its
 * place as the program found it, which may have been meant.
 * @typedef {{ label: string, say?: string, instead?: string, found?: boolean, choices?: undefined }} Given
 */
/** @typedef {{ words: string, choices: Choice[], about?: string }} Unclear `about`: the label whose place is to be seen */

const MOST_CHOICES = 4;

export class LabelsByPlace {
  /** @param {{ state: PageState, link: Link, box: HTMLInputElement }} needs */
  constructor({ state, link, box }) {
    this.state = state;
    this.link = link;
    this.box = box; // the field with the label for the next click
    this.isLeft = false; // whether the last click left the label in the field
    box.addEventListener("input", () => { state.typed = true; this.isLeft = false; });
  }

  get inBox() {
    return this.box.value.trim();
  }

  /** Writes a label into the field. @param {string} label @param {boolean} isLeft */
  put(label, isLeft = false) {
    this.box.value = label;
    this.state.typed = false;
    this.isLeft = isLeft;
  }

  // Picks that were sent and are not confirmed yet: their labels are taken, too.
  get coming() {
    return this.link.unconfirmed.filter((one) => one.t === "place");
  }

  // Returns where a label that cannot be placed in a photo is already used; empty if it can. Moving points
  // have another place in each photo, so there each place has a label of its own.
  /** @param {number} image @param {string} label */
  taken(image, label) {
    if (pickAt(image, label) || this.coming.some((one) => one.image === image && one.label === label)) return "in this photo";
    const moves = this.isApart || store.measurements.some(({ kind, points }) => kind === "speed" && points.includes(label));
    return moves && this.isThere(label) ? "in another photo" : "";
  }

  get isApart() {
    return Boolean(TOOLS[this.state.tool].apart);
  }

  /** Returns a name that is not in use. @param {string} given */
  free(given = this.inBox) {
    const prefix = given.replace(/\d*$/, "") || "P";
    const coming = this.link.unconfirmed.flatMap((one) => (one.t === "place" ? [one.label] : one.t === "split" || one.t === "rename" ? [one.new] : []));
    return freeName(prefix, new Set([...namedLabels(), ...coming]));
  }

  /** @param {Click} click @returns {Given | Unclear} */
  at(click) {
    const given = this.inBox;
    const taken = this.taken(click.image, given);
    const name = given && !given.includes(";") && !taken ? given : this.free(given);
    const say = taken && this.state.typed ? `${given} is picked ${taken} already: this point is called ${name}.` : "";
    if (this.isApart) return { label: name, say };
    const here = this.expectedIn(click.image).map((one) => nearness(one, click.u, click.v, click.scale));
    const likely = meant(here.filter((one) => this.isThere(one.label) || isTelling(one, store.photos[click.image])));
    if (this.state.typed && name === given) return this.typed(click, name, here, likely);
    if (likely.length === 1) return likely[0] === given ? { label: given } : { label: likely[0], say: `This is ${likely[0]}: it was expected here.`, instead: this.free() };
    if (likely.length) return { words: "Which point is this? More than one is expected here.", choices: this.choices(likely) };
    return this.outside(click, name, here, say);
  }

  // A click beside marks may mean one of them, or another point, as two may be closer than a mark is wide. On a
  // hollow mark it means the point: a person's own observation, which checks the program's.
  /** @param {Near[]} near @param {Click} click @returns {Given | Unclear} */
  beside(near, click) {
    const found = this.at(click);
    const on = markOn(near);
    if (on?.hollow && !this.isApart && (!this.state.typed || this.inBox === on.label)) {
      return { label: on.label, found: true, say: `${on.label} is where you clicked, and checks what the program found.` };
    }
    const marks = near.filter(({ label }) => label !== this.state.draft.at(-1)); // no line leads from a point to itself
    if (!near.length) return found;
    /** @param {string | undefined} label @returns {Choice[]} */
    const choice = (label) => (!label ? [] : this.isThere(label) ? [{ label, words: `${label}, where you clicked` }] : [{ label, words: `A new point, ${label}`, isNew: true }]);
    const others = (found.choices ?? [...choice(found.label), ...choice(found.instead ?? this.free())]).filter(({ label }) => !marks.some((one) => one.hollow && one.label === label));
    return {
      words: `${near[0].label} is very near. Which point is this? The wheel zooms in.`,
      choices: [...marks.slice(0, MOST_CHOICES).flatMap(({ label, hollow }) => (hollow ? hollowChoices(label) : [{ label, words: label, mark: /** @type {const} */ ("pick") }])),
        ...others.filter(({ label }, k) => others.findIndex((one) => one.label === label) === k)],
    };
  }

  // A click where no point is expected is a new point; if no expected places are known, the point chosen
  // for this click is meant, and a point merely placed last leads to a question.
  /** @param {Click} click @param {string} name @param {ReturnType<typeof nearness>[]} here @param {string} say @returns {Given | Unclear} */
  outside({ image }, name, here, say) {
    if (!this.isThere(name)) return { label: name, say };
    const where = whereExpected(image, name, here);
    const free = this.free(name);
    if (where) return { label: free, say: this.isLeft ? "" : `This is a new point, ${free}: ${name} was expected ${where}. To place ${name} here, type its name.` };
    if (!this.isLeft) return { label: name };
    return { words: `Is this ${name} again? Nothing tells yet where it is in this photo.`, choices: this.choices([name]) };
  }

  /** @param {Click} click @param {string} name @param {ReturnType<typeof nearness>[]} here @param {string[]} likely @returns {Given | Unclear} */
  typed({ image }, name, here, likely) {
    const region = here.find(({ label }) => label === name);
    const where = region?.inside || !(region || this.isThere(name)) ? "" : whereExpected(image, name, here);
    if (!where) return { label: name };
    const choices = [{ label: name, words: `It is ${name} all the same` }, ...this.choices(likely)];
    return { words: `${name} was expected ${where}. Which point is this?`, choices, about: name };
  }

  /** @param {string[]} likely */
  choices(likely) {
    const free = this.free();
    return [...likely.slice(0, MOST_CHOICES).map((label) => ({ label, words: label })), { label: free, words: `A new point, ${free}`, isNew: true }];
  }

  /** Returns the label of a late answer: the point may have been renamed meanwhile. @param {number} image @param {Choice} choice @returns {Given} */
  answered(image, { label, isNew, mark }) {
    if (mark) return { label, say: (mark === "pick" ? pickAt : proposalAt)(image, label) ? "" : `${label} is no longer there. Click again.` };
    if (isNew) return { label: this.isThere(label) ? this.free(label) : label };
    return this.taken(image, label) ? { label: "", say: `${label} was picked in this photo meanwhile. Click again.` } : { label };
  }

  /** @param {string} label */
  isThere(label) {
    return labels().includes(label) || this.coming.some((one) => one.label === label);
  }

  // Returns the expected places of points that may still be picked there.
  /** @param {number} image @returns {Predicted[]} */
  expectedIn(image) {
    return predictedIn(image).filter(({ label }) => !this.taken(image, label));
  }
}

/** @param {string} label @returns {Choice[]} */
const hollowChoices = (label) => [{ label, words: `${label}, where you clicked` }, { label, words: `${label}, where the program found it`, mark: "hollow" }];

// Returns where a point is expected, in words; empty if that is not known.
/** @param {number} image @param {string} label @param {ReturnType<typeof nearness>[]} here */
function whereExpected(image, label, here) {
  const region = here.find((one) => one.label === label);
  if (region) return aside(region.away);
  const now = stale() || store.mode !== "adjusted" ? null : adjusted(); // of the present picks
  const isPosed = now?.frames[image]?.status === "refined" || now?.predicted.some((one) => one.image === image);
  return isPosed && now?.points[label] ? "outside this photo" : "";
}
