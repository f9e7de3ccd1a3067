// A round of repeated clicks: shows the surroundings of each point without any mark, one after another. A second
// click made independently of the first checks it, and shows how exactly this person clicks.

import { pickKey, store } from "../connection/store.js";
import { spot } from "../photos/spot.js";

/** @import { Change, Pick } from "../connection/protocol.js" */
/** @import { Pane } from "../photos/pane.js" */
/** @import { Tools } from "./tools.js" */

const AWAY_PX = 120; // on the screen, at most, so that the point is off the centre of the view

const CROP_PX = 96; // of the picture of a point's surroundings
const BESIDE_PX = 6; // from the first click to the middle of that picture, at most, so that it does not show the click

/** @param {number} most */
const shifted = (most) => most * (2 * Math.random() - 1);

export class Again {
  /** @param {Tools} tools */
  constructor(tools) {
    this.tools = tools;
    /** @type {Pick[]} */
    this.left = []; // still to be clicked again
  }

  // Starts with all picks of some points that a person clicked once.
  /** @param {string[]} labels */
  begin(labels) {
    this.left = [...store.picks.values()].filter(({ image, label, source }) => labels.includes(label) && !source && !store.repeated.includes(pickKey(image, label)));
    this.next();
  }

  next() {
    const { names, notice, panes: { active }, state } = this.tools;
    const [one] = this.left;
    if (active && (one || state.hidesMarks)) names.put(one ? one.label : names.next(active.image), true);
    state.hidesMarks = Boolean(one);
    document.body.classList.toggle("again", state.hidesMarks);
    if (!one || !active) {
      notice.stay();
      return;
    }
    if (active.image !== one.image) active.show(one.image);
    active.view.center(one.u_px + shifted(AWAY_PX), one.v_px + shifted(AWAY_PX), 1);
    active.moved();
    notice.stay(spot(one.image, one.u_px + shifted(BESIDE_PX), one.v_px + shifted(BESIDE_PX), `Surroundings of ${one.label}`, CROP_PX),
      `Click ${one.label} again in the photo: it is near the middle of this small picture. ${this.left.length} left; Esc ends.`);
    this.tools.rebuild();
  }

  /** Takes a click if it belongs to the round; returns whether it does. @param {Pane} pane @param {number} u_px @param {number} v_px */
  takes({ image }, u_px, v_px) {
    const [one] = this.left;
    if (one?.image !== image) return Boolean(one);
    const away = Math.hypot(u_px - one.u_px, v_px - one.v_px);
    if (away < CROP_PX / 2) this.done({ t: "repeat", image, label: one.label, u_px, v_px });
    else {
      this.tools.question.ask(`This click is ${Math.round(away)} px from your first one on ${one.label}: take it back?`, [
        { words: "Take it back", act: () => this.next() },
        { words: `Keep it: the first click was wrong, ${one.label} is here`, act: () => this.done({ t: "place", image, label: one.label, u_px, v_px }) },
      ]);
    }
    return true;
  }

  /** @param {Change} change */
  done(change) {
    this.tools.send(change);
    this.left.shift();
    this.next();
    if (!this.left.length) this.tools.notice.show("All were clicked again. If others need it, too, the program asks for them at the side.", true);
  }

  end() {
    this.left = [];
    this.next();
  }
}
