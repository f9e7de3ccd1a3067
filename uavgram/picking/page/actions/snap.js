// Moves a pick to the exact place of a target or corner, or makes one there: the most likely one in the expected
// region of the label, else the one near the pick or the pointer.

import { pickAt, predictedIn } from "../connection/store.js";

/** @import { Answers, Target } from "../connection/protocol.js" */
/** @import { Pane } from "../photos/pane.js" */
/** @import { PageState } from "./page_state.js" */
/** @import { Tools } from "./tools.js" */

// Snaps the selected pick, or a new one under the pointer.
/** @param {Tools} tools @param {Target} target */
export async function snap(tools, target) {
  const { state, link, notice, panes: { active: pane } } = tools;
  if (!pane) return;
  const { image } = pane;
  const pick = state.selected ? pickAt(pane.image, state.selected) : null;
  const wanted = state.selected ?? tools.label;
  const expected = !pick && predictedIn(pane.image).some((one) => one.label === wanted) ? { expected: wanted } : {};
  const [u_px, v_px] = pick ? [pick.u_px, pick.v_px] : pane.inside(...pane.aim);
  showAlike(tools, null);
  try {
    const found = await link.ask({ t: "snap", image: pane.image, u_px, v_px, target, ...expected });
    if (pane.image !== image) { // the pane shows another photo by now
      notice.show("Nothing was placed, as the photo was changed meanwhile. Press the key again.");
      return;
    }
    take(tools, pane, pick?.label ?? expected.expected, wanted, found);
  } catch (fault) {
    notice.fault(fault);
  }
}

// Makes a pick of the snapped place; draws the candidates if the snap could not decide.
/** @param {Tools} tools @param {Pane} pane @param {string | undefined} label to place; none: whose point is there @param {string} wanted @param {Answers["snap"]} found */
function take(tools, pane, label, wanted, found) {
  const { notice } = tools;
  if (found.why !== undefined) {
    showAlike(tools, { image: pane.image, places: found.places_px });
    notice.show(`${wanted} is placed nowhere: ${found.why}${found.places_px.length ? " (hollow), and press the key again" : ""}.`);
  } else if (label) {
    tools.placeAt(pane, label, found.u_px, found.v_px, found.sigma_px);
    const which = found.is_sure ? "" : " that looks like it (no match with another photo says so: see whether it is)";
    notice.show(`${label} is on a ${found.what}${which}: u ${found.u_px.toFixed(2)}, v ${found.v_px.toFixed(2)} \u00b1 ${found.sigma_px.toFixed(2)} px`, true);
  } else tools.clicked(pane, found.u_px, found.v_px, found.sigma_px);
}

/** @param {Tools} tools @param {PageState["alike"]} alike */
function showAlike(tools, alike) {
  if (alike === tools.state.alike) return;
  tools.state.alike = alike;
  tools.rebuild();
}
