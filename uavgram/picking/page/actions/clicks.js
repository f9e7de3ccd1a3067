// A click in a photo: selects the mark there, or places the point that is expected there, or a new one; an ambiguous
// click leads to a question. The same decision says beforehand what the next click does.

import { proposalAt } from "../connection/store.js";
import { typedText } from "../elements/units.js";
import { entryMessage, formToTake } from "../panel/entry.js";
import { markOn, marksNear, SAME_PX } from "../photos/nearby_marks.js";
import { TOOLS } from "./keys.js";

/** @import { Change, SetLine, SetMeasurement } from "../connection/protocol.js" */
/** @import { Pane } from "../photos/pane.js" */
/** @import { Choice, Given, Unclear } from "./labels_by_place.js" */
/** @import { Tools } from "./tools.js" */

export class Clicks {
  /** @param {Tools} tools */
  constructor(tools) {
    this.tools = tools;
  }

  /** @param {Pane} pane @param {number} u @param {number} v @param {number | null} sigma_px */
  at(pane, u, v, sigma_px) {
    const { names, notice, question, rebuild, state } = this.tools;
    if (pane.refusal) {
      notice.show(pane.refusal);
      return;
    }
    if (this.waits() || this.tools.again.takes(pane, u, v)) return;
    this.tools.leave(true);
    const { image } = pane;
    const found = this.meant(pane, u, v);
    if (found.mark) {
      if (found.mark === "pick") this.tools.clickedMark(found.label);
      else {
        this.tools.proposals.acceptHere(pane, found.label);
        notice.show(`${found.label} is where the program measured the target: more exactly than by a click, and by itself, so that it checks your clicks elsewhere.`, true);
      }
      return;
    }
    if (!found.choices) {
      this.tell(this.take(pane, found.label, u, v, sigma_px), image, found);
      return;
    }
    /** @param {Choice} choice */
    const answer = (choice) => {
      const { label, say } = names.answered(image, choice);
      if (say) notice.show(say);
      else if (choice.mark === "pick") this.tools.clickedMark(label);
      else if (choice.mark) this.tools.proposals.acceptHere(pane, label);
      else this.take(pane, label, u, v, sigma_px);
    };
    state.asked = { image, at: [u, v], view: pane.view, moved: (x, y, view) => question.stand(x, y, view) };
    state.selected = found.about ?? state.selected;
    question.ask(found.words, found.choices.map((choice) => ({ words: choice.words, act: () => answer(choice) })), pane.box, state.tool !== "length");
    rebuild();
  }

  /** Decides what a click on a place means. @param {Pane} pane @param {number} u @param {number} v @returns {Given | Unclear} */
  meant(pane, u, v) {
    const { names, state } = this.tools;
    const { image, view: { scale } } = pane;
    const near = marksNear(pane, u, v, names.coming);
    const on = markOn(near);
    const isOtherEnd = on?.label === state.draft.at(-1) && (on?.away ?? 0) > SAME_PX; // a line's other end may be so near
    if (on && !on.hollow && !isOtherEnd) return { label: on.label, mark: "pick" };
    // An independent observation, and more exact than a click.
    if (on?.hollow && proposalAt(image, on.label)?.source === "target") return { label: on.label, mark: "target" };
    return names.beside(near, { image, u, v, scale });
  }

  // Says what the next click in a photo does; empty if it does nothing, or answers a question.
  /** @param {Pane} pane @param {[number, number] | null} at null: a place where nothing is @returns {string} */
  ahead(pane, at) {
    const { again, question, state: { draft, entry } } = this.tools;
    if ((at ? pane.refusal : pane.fault) || question.isOpen) return "";
    if (again.left.length) return `marks ${again.left[0].label} once more`;
    const form = entry && formToTake(entry);
    const { message, why } = form ? entryMessage(entry, form, (t) => this.tools.namesOf(t)) : {};
    if (why) return `marks nothing before the form at the side is corrected: ${why}`;
    const tool = TOOLS[this.tools.isElsewhere(pane) ? "pick" : this.tools.state.tool];
    const role = tool === TOOLS.pick ? "" : ` (${tool.name}, point ${draft.length + 1}${tool.most === tool.least ? ` of ${tool.least}` : ""})`;
    return [message && taken(message), this.aheadAt(pane, at, role)].filter(Boolean).join("; then ");
  }

  /** @param {Pane} pane @param {[number, number] | null} at @param {string} role of the point in the drawing */
  aheadAt(pane, at, role) {
    const { tools } = this;
    /** @type {Given | Unclear} */
    const found = at ? this.meant(pane, ...at) : { label: tools.names.inField(pane.image).name };
    if (found.choices) return "asks which point this is";
    const { label, mark } = found;
    if (mark === "target") return `takes ${label}, as the program found it${role}`;
    if (mark && !role) return `selects ${label}`;
    if (mark) return tools.isEnd(label) ? "ends the drawing" : tools.faultOf(label) ? "takes nothing: choose another point" : `takes ${label}${role}`;
    return `marks ${tools.names.isThere(label) ? `${label} here, too` : `a new point, ${label}`}${role}`;
  }

  // Undo takes back what was done last: of a click that led to a question, there is only the question.
  /** @param {"undo" | "redo"} t */
  step(t) {
    if (this.tools.question.isOpen) this.tools.question.cancel();
    else this.tools.send({ t });
  }

  // A click does nothing before a question about an earlier one is answered, or while the reading of the line drawn
  // last has a fault, and says so: neither is lost unseen, and no reading goes to another line.
  waits() {
    const { notice, question, state } = this.tools;
    this.tools.typedNumbers.stray = "";
    const isFaulty = !question.isOpen && !this.tools.settleEntry();
    if (question.isOpen) question.insist();
    else if (!isFaulty) {
      state.entry = null; // an unchanged form of an earlier line takes no later reading
      return false;
    }
    notice.show(`This click marked nothing: ${isFaulty ? "correct the form at the side first, then click again. Esc drops the form." : "answer the question first, by a click, or by an arrow key and Enter. Esc answers none."}`);
    return true;
  }

  /** @param {Pane} pane @param {string} label @param {number} u @param {number} v @param {number | null} sigma_px */
  take(pane, label, u, v, sigma_px) {
    const placed = this.tools.placeAt(pane, label, u, v, sigma_px);
    if (this.tools.state.tool !== "pick") this.tools.extend(label);
    return placed;
  }

  /** @param {Change} placed @param {number} image @param {Given} given */
  tell(placed, image, { label, say, instead, found }) {
    const { edits, notice, offers } = this.tools;
    if (say && found) offers.show(say, placed, { words: "Take the program's place instead", act: () => this.tools.proposals.acceptInstead(image, label) });
    else if (say && instead) offers.show(say, placed, { words: `No, a new point: ${instead}`, act: () => edits.another(label, instead, image) });
    else if (say) notice.show(say, true);
  }
}

/** Says what becomes of an open form. @param {SetLine | SetMeasurement} message */
function taken(message) {
  if (message.t === "line") return `takes ${typedText(message.length_m)} for ${message.name}`;
  return message.kind === "distance" ? `computes ${message.points.join(" \u2013 ")}, as no reading is typed` : `adds ${message.name}`;
}
