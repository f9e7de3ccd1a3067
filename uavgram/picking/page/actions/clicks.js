// A click in a photo: places the point that is expected there, or a new one; an ambiguous click leads to a
// question.

import { proposalAt } from "../connection/store.js";
import { markOn, marksNear } from "../photos/nearby_marks.js";

/** @import { Change } from "../connection/protocol.js" */
/** @import { Pane } from "../photos/pane.js" */
/** @import { Choice, Given } from "./labels_by_place.js" */
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
    const near = marksNear(pane, u, v, names.coming);
    const on = markOn(near);
    if (on?.hollow && proposalAt(image, on.label)?.source === "target") { // an independent observation, and more exact than a click
      this.tools.proposals.acceptHere(pane, on.label);
      return;
    }
    const found = names.beside(near, { image, u, v, scale: pane.view.scale });
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

  /** Handles a click on a point's mark. @param {string} label */
  onMark(label) {
    if (!this.waits()) this.tools.clickedMark(label);
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
