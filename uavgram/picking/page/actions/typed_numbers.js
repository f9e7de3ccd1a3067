// Keys while no field has the focus: an open form takes what may be of its number, and holds up other letters; else they
// act as shortcuts, unless they may be the length of a line.

import { byId } from "../elements/dom.js";
import { NUMERAL } from "../elements/numbers.js";
import { mayBecomeLength } from "../elements/units.js";
import { TOOLS } from "./keys.js";

/** @import { Tools } from "./tools.js" */

const HELD = /^([a-z.]|Delete|Arrow\w+|.*\+Arrow\w+)$/i; // keys that may be meant for the number of a form
const LETTER = /^[a-z]$/i;
const EDITING = ["Backspace", "Delete", "ArrowLeft", "ArrowRight"]; // keys that change a typed number

export class TypedNumbers {
  /** @param {Tools} tools */
  constructor(tools) {
    this.tools = tools;
    this.stray = ""; // what was typed of a length for which there is no field
  }

  // Takes a key without Ctrl, Alt or Meta that belongs to a length: of an open form, which gets the focus and then
  // the key itself; or of none, and then it does nothing. Returns where it went.
  /** @param {KeyboardEvent} event @returns {"form" | "nowhere" | ""} */
  takes({ key, ctrlKey, altKey, metaKey }) {
    if (key === "Shift" || ctrlKey || altKey || metaKey) return "";
    return this.toForm(key) ? "form" : this.keep(key) ? "nowhere" : "";
  }

  // Moves the focus to the number that an open form waits for, if the key belongs to it.
  /** @param {string} key */
  toForm(key) {
    const field = inputIn('form[data-row="entry"] label:not([hidden]) > input[inputmode]');
    if (!field || !this.tools.state.entry) return false;
    const isUnit = LETTER.test(key) && /\d/.test(field.value) && mayBecomeLength(field.value + key);
    if (!isUnit && !NUMERAL.test(key) && !EDITING.includes(key)) return false;
    this.tools.showForms(); // bring its tab to the front
    field.focus();
    return true;
  }

  // Returns whether a key does nothing now, and says what waits: a round of repeated clicks, a question, or the number
  // of a form, which only the key of a tool ends. The view changes all the same, but not by a letter beside a form.
  /** @param {string} key @param {boolean} isView */
  holdsUp(key, isView) {
    const { again, notice, question, state: { entry } } = this.tools;
    if (!isView && again.left.length) return true; // its notice stays
    if (!isView && question.isOpen) {
      question.insist();
      question.refused(key);
      return true;
    }
    const holds = entry !== null && (isView ? LETTER : HELD).test(key) && !Object.values(TOOLS).some((tool) => tool.key === key.toLowerCase());
    if (holds) notice.show(`${key.toUpperCase()} was not used: the form at the side waits for its number. Type it and press Enter; Esc drops the form.`);
    return holds;
  }

  // Keeps a length, its unit and Enter after it from acting as shortcuts: with the tool for taped lengths, after a drawn
  // line, and after a click that was refused. Returns whether the key is a part of one.
  /** @param {string} key */
  keep(key) {
    const { isRefused, notice, state: { tool, draft, drawsIn } } = this.tools;
    const isEnd = key === "Enter";
    const isPart = this.stray ? isEnd || (key.length === 1 && mayBecomeLength(this.stray + key)) : NUMERAL.test(key);
    const isReading = isPart && (tool === "length" || isRefused || (drawsIn !== null && !draft.length));
    const text = isReading ? this.stray + (isEnd ? "" : key) : "";
    this.stray = isEnd ? "" : text;
    if (text) notice.show(`${text} was not used: no line waits for a reading. ${tool === "length" ? "Click both ends of the taped length, then type it" : `To enter a taped length, choose ${TOOLS.length.name} (${TOOLS.length.key.toUpperCase()}) and click its ends`}; for a shortcut, leave ${TOOLS[tool].name} by Esc first.`);
    return isReading;
  }
}

/** @param {string} selector @returns {HTMLInputElement | null} */
export const inputIn = (selector) => byId("tab-measure").querySelector(selector);
