// What this page alone knows: what is selected, which tool is in hand, what is shown.

/** @import { Folder, Measurement } from "../connection/protocol.js" */
/** @import { View } from "../photos/view.js" */
/** @import { ToolName } from "./keys.js" */

/** @typedef {"ellipses" | "residuals" | "predicted" | "labels" | "lines" | "ties"} ShownKind */
/** @typedef {Record<ShownKind, boolean>} Shown */
/** @typedef {"measure" | "results" | "frames" | "camera"} Tab */

/**
 * A length or measurement whose form is open; `was`: its name, where it is there already.
 * @typedef {{ t: "line", name: string, start: string, end: string, sigma_m: number, length_m?: number, adjust?: boolean, was?: string } | Measurement & { t: "measure", was?: string }} Entry
 */

/**
 * The place in a photo that a question is about, and what follows it when the view moves.
 * @typedef {{ image: number, at: [number, number], view: View, moved: (x: number, y: number, view: View) => void }} AskedPlace
 */

export class PageState {
  constructor() {
    /** @type {string | null} */
    this.selected = null; // label
    /** @type {ToolName} */
    this.tool = "pick";
    /** @type {string[]} */
    this.draft = []; // labels of the length or measurement that is being clicked
    /** @type {Entry | null} */
    this.entry = null;
    /** @type {Shown} */
    this.shown = { ellipses: true, residuals: true, predicted: true, labels: true, lines: true, ties: false };
    /** @type {{ image: number, places: [number, number][] } | null} */
    this.alike = null; // what a snap could not tell apart
    this.hidesMarks = false; // points are clicked again: no mark is shown, and none takes a click
    this.magnifies = true;
    this.spaceHeld = false; // a drag pans
    this.typed = false; // the label was typed since the last point was placed
    /** @type {AskedPlace | null} */
    this.asked = null;
    this.edits = false; // whether merging, swapping and splitting is unfolded
    /** @type {number | null} */
    this.lastSigmaM = null; // of a taped length, where one was entered since the page was opened
    /** @type {Tab} */
    this.tab = "measure";
    /** @type {string | null} */
    this.side = null; // name of the measurement that is shown from the side
    this.showsSteps = false; // though all of the first steps are done
    this.exporting = false;
    /** @type {Folder[] | null} */
    this.folders = null; // in which photos of a board could be
  }
}
