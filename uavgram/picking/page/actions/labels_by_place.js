// Choice of the label for a click: that of the point expected there, else the next one that is missing in this
// photo, or a new one. A typed name is used, after a question if it does not fit.

import { adjusted, freeName, labels, namedLabels, pickAt, predictedIn, proposalAt, stale, store } from "../connection/store.js";
import { markOn } from "../photos/nearby_marks.js";
import { aside, isTelling, meant, nearness } from "../photos/regions.js";
import { TOOLS } from "./keys.js";

/** @import { Predicted } from "../connection/protocol.js" */
/** @import { Link } from "../connection/socket.js" */
/** @import { Near } from "../photos/nearby_marks.js" */
/** @import { PageState } from "./page_state.js" */

/** @typedef {{ u: number, v: number, scale: number, image: number }} Click */
/** @typedef {"again" | "new"} Order what is picked in a photo of which nothing is known: points of others, in their order, or new ones */
/** @typedef {{ label: string, words: string, isNew?: boolean, mark?: "pick" | "hollow", order?: Order }} Choice `mark`: it is one that is there */
/**
 * A label, and a message about it; `instead`: the name of a new point, which may have been meant; `found`: its
 * place as the program found it, which may have been meant; `mark`: it is the mark of a pick, or of a found target.
 * @typedef {{ label: string, say?: string, instead?: string, found?: boolean, mark?: "pick" | "target", choices?: undefined }} Given
 */
/** @typedef {{ words: string, choices: Choice[], about?: string, mark?: undefined }} Unclear `about`: the label whose place is to be seen */

const MOST_CHOICES = 4;

export class LabelsByPlace {
  /** @param {{ state: PageState, link: Link, box: HTMLInputElement }} needs */
  constructor({ state, link, box }) {
    this.state = state;
    this.link = link;
    this.box = box; // the field with the label for the next click
    this.isLeft = false; // whether the label in the field is the page's own, and not chosen for the next click
    this.last = ""; // the point that was placed last
    /** @type {Map<number, Order>} */
    this.orders = new Map(); // by photo
    box.addEventListener("input", () => { state.typed = true; this.isLeft = false; });
  }

  get inBox() {
    return this.box.value.trim();
  }

  /** Writes a label into the field. @param {string} label @param {boolean} isLeft */
  put(label, isLeft = false) {
    this.box.value = label;
    if (document.activeElement === this.box) this.box.select(); // what is typed next replaces it
    this.state.typed = false;
    this.isLeft = isLeft;
  }

  // Writes the label that comes next in a photo into the field, unless a person has chosen one.
  /** @param {number} image */
  suggest(image) {
    if (!this.inBox || (this.isLeft && !this.state.typed)) this.put(this.next(image), true);
  }

  // Remembers a placed point, and that points of other photos are picked in this one though nothing tells where.
  // During an adjustment nothing is known, and so nothing about the order.
  /** @param {number} image @param {string} label */
  placed(image, label) {
    if (this.isThere(label) && !stale() && !knowsPlace(image, label)) this.orders.set(image, "again");
    this.last = label;
  }

  // Returns the points of other photos that are missing in a photo, and were not found there, in the order that begins after one of them.
  /** @param {number} image @param {string} before */
  missing(image, before) {
    const all = [...new Set([...labels(), ...this.coming.map(({ label }) => label)])];
    const from = all.indexOf(before) + 1;
    return this.orders.get(image) === "new" ? [] : [...all.slice(from), ...all.slice(0, from)].filter((label) => !this.taken(image, label) && !proposalAt(image, label));
  }

  // Returns the point that comes next in a photo: the first that is missing and may be seen there, else a new one.
  /** @param {number} image */
  next(image) {
    const expected = new Set(predictedIn(image).map(({ label }) => label));
    return this.missing(image, this.last).find((label) => expected.has(label) || !knowsPlace(image, label)) ?? this.free(this.last || "P1");
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
    return freeName(prefix, new Set([...namedLabels(), ...[...store.lines, ...store.measurements].map(({ name }) => name), ...coming]));
  }

  // Returns the label in the field, whether it can be placed in a photo, and else another one.
  /** @param {number} image */
  inField(image) {
    const given = this.inBox;
    const taken = this.taken(image, given);
    const fits = Boolean(given) && !given.includes(";") && !taken;
    const name = fits ? given : this.free(given);
    return { given, fits, name, say: taken && this.state.typed ? `${given} is picked ${taken} already: this point is called ${name}.` : "" };
  }

  /** @param {Click} click @returns {Given | Unclear} */
  at(click) {
    const { given, fits, name, say } = this.inField(click.image);
    if (this.isApart) return { label: name, say };
    const here = this.expectedIn(click.image).map((one) => nearness(one, click.u, click.v, click.scale));
    const likely = meant(here.filter((one) => this.isThere(one.label) || isTelling(one, store.photos[click.image])));
    if (this.state.typed && fits) return this.typed(click, name, here, likely);
    const tells = here.some((one) => likely.includes(one.label) && isTelling(one, store.photos[click.image]));
    if (tells && likely.length > 1) return { words: "Which point is this? More than one is expected here.", choices: this.choices(likely) };
    if (tells) return likely[0] === given && !this.isLeft ? { label: given } : { label: likely[0], say: `This is ${likely[0]}: it was expected here.`, instead: this.free() };
    if (say) return { label: name, say };
    return fits && !this.isLeft ? this.chosen(click, name, here) : this.unnamed(click, fits ? this.last : given);
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

  // A click where no point is expected is not of the chosen point, if its place is known.
  /** @param {Click} click @param {string} name @param {ReturnType<typeof nearness>[]} here @returns {Given} */
  chosen({ image }, name, here) {
    const isExpected = here.some(({ label, inside }) => label === name && inside);
    const where = this.isThere(name) && !isExpected ? whereExpected(image, name, here) : "";
    const free = this.free(name);
    return where ? { label: free, say: `This is a new point, ${free}: ${name} was expected ${where}. To place ${name} here, type its name.` } : { label: name };
  }

  // Without a chosen point it is a new one, or the next one of which nothing tells where it is, after one question
  // in each photo.
  /** @param {Click} click @param {string} before @returns {Given | Unclear} */
  unnamed({ image }, before) {
    const label = this.missing(image, before).find((one) => !knowsPlace(image, one));
    const free = this.free(before || "P1");
    if (!label) return { label: free };
    if (this.orders.get(image) === "again") return { label, say: `This is ${label}: it comes next.`, instead: free };
    /** @type {Choice[]} */
    const choices = this.choices([label]).map((choice) => ({ ...choice, order: choice.isNew ? "new" : "again" }));
    return { words: `Is this ${label} again? The program cannot compute yet where it is in this photo, so choose. The next clicks follow in the same order.`, choices };
  }

  /** @param {Click} click @param {string} name @param {ReturnType<typeof nearness>[]} here @param {string[]} likely @returns {Given | Unclear} */
  typed({ image }, name, here, likely) {
    const region = here.find(({ label }) => label === name);
    const where = region?.inside || !(region || this.isThere(name)) ? "" : whereExpected(image, name, here);
    if (!where) return { label: name };
    const choices = [{ label: name, words: `It is ${name} all the same` }, ...this.choices(likely)];
    return { words: `${name} was expected ${where}. Which point is this?`, choices, about: name };
  }

  /** @param {string[]} likely @returns {Choice[]} */
  choices(likely) {
    const free = this.free();
    return [...likely.slice(0, MOST_CHOICES).map((label) => ({ label, words: label })), { label: free, words: `A new point, ${free}`, isNew: true }];
  }

  /** Returns the label of a late answer: the point may have been renamed meanwhile. @param {number} image @param {Choice} choice @returns {Given} */
  answered(image, { label, isNew, mark, order }) {
    if (order) this.orders.set(image, order);
    if (mark) return { label, say: (mark === "pick" ? pickAt : proposalAt)(image, label) ? "" : `${label} is no longer there. Click again.` };
    if (isNew) return { label: this.isThere(label) ? this.free(label) : label };
    return this.taken(image, label) ? { label: "", say: `${label} was picked in this photo meanwhile. Click again.` } : { label };
  }

  /** @param {string} label */
  isThere(label) {
    return labels().includes(label) || this.coming.some((one) => one.label === label);
  }

  // Returns the expected places of points that may still be picked there; one that was found surely is where it was found.
  /** @param {number} image @returns {Predicted[]} */
  expectedIn(image) {
    return predictedIn(image).filter(({ label }) => !this.taken(image, label) && !proposalAt(image, label)?.is_sure);
  }
}

/** @param {string} label @returns {Choice[]} */
const hollowChoices = (label) => [{ label, words: `${label}, where you clicked` }, { label, words: `${label}, where the program found it`, mark: "hollow" }];

// Returns where a point is expected, in words; empty if that is not known.
/** @param {number} image @param {string} label @param {ReturnType<typeof nearness>[]} here */
function whereExpected(image, label, here) {
  const region = here.find((one) => one.label === label);
  if (region) return aside(region.away);
  return knowsPlace(image, label) ? "outside this photo" : "";
}

// Returns whether the present adjustment knows where a point is in a photo, or that it is outside. A region of half the
// photo is no such knowledge; where there is one, nor is it certain that others are outside.
/** @param {number} image @param {string} label */
function knowsPlace(image, label) {
  /** @param {Predicted} one */
  const tells = (one) => isTelling(nearness(one, ...one.pixel_px, 1), store.photos[image]);
  const expected = predictedIn(image);
  const own = expected.find((one) => one.label === label);
  if (own ? !tells(own) : !expected.every(tells)) return false;
  const now = stale() || store.mode !== "adjusted" ? null : adjusted();
  const isPosed = now?.frames[image]?.status === "refined" || now?.predicted.some((one) => one.image === image);
  return Boolean(isPosed && now?.points[label]);
}
