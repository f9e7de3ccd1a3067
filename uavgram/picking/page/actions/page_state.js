// State of this page alone: selection, tool, and visible layers.

/** @import { Folder, Measurement } from "../connection/protocol.js" */
/** @import { View } from "../photos/view.js" */
/** @import { ToolName } from "./keys.js" */

/** @typedef {"ellipses" | "residuals" | "predicted" | "labels" | "lines" | "ties"} ShownKind */
/** @typedef {Record<ShownKind, boolean>} Shown */
/** @typedef {"measure" | "results" | "frames" | "camera"} Tab */

/**
 * A length or measurement whose form is open; `was`: its name, if it exists already.
 * @typedef {{ t: "line", name: string, start: string, end: string, sigma_m: number, length_m?: number, adjust?: boolean, was?: string }} NewLine
 * @typedef {NewLine | Measurement & { t: "measure", was?: string }} Entry
 */

/**
 * Place in a photo that a question is about, and the callback that follows it when the view moves.
 * @typedef {{ image: number, at: [number, number], view: View, moved: (x: number, y: number, view: View) => void }} AskedPlace
 */

export class PageState {
  constructor() {
    /** @type {string | null} */
    this.selected = null; // label
    /** @type {ToolName} */
    this.first = "pick"; // the tool with which the project begins
    /** @type {ToolName} */
    this.tool = "pick";
    /** @type {string[]} */
    this.draft = []; // labels of the length or measurement that is being drawn
    /** @type {number | null} */
    this.drawsIn = null; // the photo in which the tool was used last
    /** @type {Entry | null} */
    this.entry = null;
    /** @type {Shown} */
    this.shown = { ellipses: true, residuals: true, predicted: true, labels: true, lines: true, ties: false };
    /** @type {{ image: number, places: [number, number][] } | null} */
    this.alike = null; // candidates between which a snap could not decide
    this.hidesMarks = false; // during repeated clicks: marks are hidden and take no clicks
    this.magnifies = true;
    this.spaceHeld = false; // a drag pans while it is held
    /** @type {{ label: string, name: string } | null} */
    this.refusedName = null; // as typed, to be corrected
    this.typed = false; // the label was typed since the last point was placed
    /** @type {AskedPlace | null} */
    this.asked = null;
    this.edits = false; // whether the part for merging, swapping and splitting is unfolded
    /** @type {number | null} */
    this.lastSigmaM = null; // of the last taped length entered since the page was opened
    /** @type {Tab} */
    this.tab = "measure";
    /** @type {string | null} */
    this.side = null; // name of the measurement shown in side view
    this.showsSteps = false; // even though all first steps are done
    this.exporting = false;
    /** @type {Folder[] | null} */
    this.folders = null; // folders that may hold photos of a board
  }
}
