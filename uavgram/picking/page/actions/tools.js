// Tools: the effects of clicks.

import { freeName, labels, pickAt, pickKey, store } from "../connection/store.js";
import { as, byId } from "../elements/dom.js";
import { Question } from "../elements/question.js";
import { roundSmall } from "../elements/units.js";
import { entryMessage, formToTake, isUnread, noNumber, parse, showFault, typedForm } from "../panel/entry.js";
import { placeFault } from "../panel/speed.js";
import { byHand, goneWith, goneWithPoint } from "../photos/sources.js";
import { Again } from "./repeated_clicks.js";
import { Clicks } from "./clicks.js";
import { Heights } from "./heights.js";
import { Proposals } from "./proposals.js";
import { TOOLS } from "./keys.js";
import { LabelEdits } from "./label_edits.js";
import { LabelsByPlace } from "./labels_by_place.js";
import { Offers } from "./undo_notice.js";
import { showTool } from "./tool_menu.js";
import { inputIn, TypedNumbers } from "./typed_numbers.js";

/** @import { Change, Kind, Line, Measurement, SetLine, SetMeasurement } from "../connection/protocol.js" */
/** @import { Link } from "../connection/socket.js" */
/** @import { Notice } from "../elements/notice.js" */
/** @import { Pane } from "../photos/pane.js" */
/** @import { Panes } from "../photos/panes.js" */
/** @import { ToolName } from "./keys.js" */
/** @import { Entry, NewLine, PageState } from "./page_state.js" */

const ASKED = ["skid_speed", "speed", "volume"]; // kinds that need parameters besides their points

export class Tools {
  /**
   * @param {object} needs
   * @param {PageState} needs.state
   * @param {Link} needs.link
   * @param {Notice} needs.notice
   * @param {Panes} needs.panes
   * @param {() => void} needs.rebuild redraws all parts that depend on the page's state
   * @param {() => void} needs.moved redraws a moved mark with the next frame
   * @param {() => void} needs.showForms shows the tab with the forms for values that clicks cannot give
   */
  constructor({ state, link, notice, panes, rebuild, moved, showForms }) {
    this.state = state;
    this.link = link;
    this.notice = notice;
    this.panes = panes;
    this.rebuild = rebuild;
    this.moved = moved;
    this.showForms = showForms;
    this.heights = new Heights({ state, link, notice });
    this.proposals = new Proposals({ state, link, notice, panes, tools: this });
    this.box = as(HTMLInputElement, byId("label")); // the field with the label for the next click
    this.box.addEventListener("keydown", ({ key }) => { if (key === "Enter") this.name(this.label); });
    this.names = new LabelsByPlace({ state, link, box: this.box });
    this.question = new Question((isAnswered) => this.answered(isAnswered), (key) => notice.show(`${key} was not used: answer the question first, by a click, or by an arrow key and Enter.`));
    this.offers = new Offers({ link, notice });
    this.typedNumbers = new TypedNumbers(this);
    this.isRefused = false; // whether the last click could not be the next point of a drawing
    this.edits = new LabelEdits({ tools: this, question: this.question, notice });
    this.clicks = new Clicks(this);
    this.again = new Again(this);
  }

  /** @param {Change} change */
  send(change) {
    this.link.change(change);
    return change;
  }

  /** @param {ToolName} tool */
  setTool(tool) {
    this.question.cancel();
    if (!this.settle()) return; // its fault is shown
    this.isRefused = false;
    Object.assign(this.state, { tool, draft: [], entry: null, drawsIn: null });
    showTool(tool);
    this.rebuild();
  }

  get label() {
    return this.names.inBox;
  }

  get coming() {
    return this.names.coming;
  }

  /** Returns the present and pending names of lengths or measurements. @param {"line" | "measure"} t */
  namesOf(t) {
    const coming = this.link.unconfirmed.flatMap((one) => (one.t === t ? [one.name] : []));
    return [...(t === "line" ? store.lines : store.measurements).map(({ name }) => name), ...coming];
  }

  suggest() {
    if (this.panes.active) this.names.suggest(this.panes.active.image);
  }

  // Ends a tool that was used in another photo than the present one, where clicks pick points first. Points of one
  // drawing may be in several photos. An empty form stays while a person looks at other photos, until a click there.
  leave(clicks = false) {
    const { panes: { active }, state: { entry } } = this;
    if (active && this.isElsewhere(active) && (!entry || clicks || typedForm())) this.setTool("pick");
  }

  /** Whether the tool was used in another photo, and no drawing goes on. @param {Pane} pane */
  isElsewhere({ image }) {
    const { drawsIn, draft } = this.state;
    return drawsIn !== null && drawsIn !== image && !draft.length;
  }

  /** @param {string} label @param {boolean} isLeft */
  select(label, isLeft = false) {
    const isNew = this.state.selected !== label;
    this.choose(label, isLeft);
    if (isNew) this.rebuild();
  }

  /** Selects a point, which the next click places where it is missing; `isLeft`: it does not. @param {string} label @param {boolean} isLeft */
  choose(label, isLeft = false) {
    this.state.selected = label;
    this.names.put(label, isLeft);
    if (isLeft) this.suggest();
  }

  /** Handles a click on a place in a photo. @param {Pane} pane @param {number} u @param {number} v @param {number | null} sigma_px */
  clicked(pane, u, v, sigma_px = null) {
    this.clicks.at(pane, u, v, sigma_px);
  }

  // Cleans up after a question.
  /** @param {boolean} isAnswered */
  answered(isAnswered) {
    if (this.state.asked && !isAnswered) this.notice.show("The question was not answered, so nothing was marked at the ring. To mark the point, click there again.", true);
    this.state.asked = null;
    this.rebuild();
    this.panes.active?.focus();
  }

  /** @param {Pane} pane @param {string} label @param {number} u_px @param {number} v_px @param {number | null} sigma_px */
  placeAt(pane, label, u_px, v_px, sigma_px = null) {
    this.names.placed(pane.image, label);
    const placed = this.send({ t: "place", image: pane.image, label, u_px, v_px, sigma_px });
    this.state.alike = null;
    this.choose(label, true);
    return placed;
  }

  /** @param {number} image @param {string} label @param {[number, number]} at @param {number} step @param {boolean} final */
  drag(image, label, [u_px, v_px], step, final) {
    const pick = pickAt(image, label);
    if (!pick) return;
    this.say(goneWith(pick));
    store.picks.set(pickKey(image, label), { ...byHand(pick), u_px, v_px });
    store.version += 0.5; // newer than the server's state: dependent numbers are greyed
    this.send({ t: "place", image, label, u_px, v_px, step, final });
    this.moved();
  }

  /** @param {string} label */
  clickedMark(label) {
    this.question.cancel();
    this.leave(true);
    const draws = this.state.tool !== "pick"; // then it is a point of a drawing, not the next one to be placed
    this.select(label, draws);
    if (draws) this.extend(label);
  }

  // Returns why a point cannot be the next one of the drawing; empty if it can.
  /** @param {string} label */
  faultOf(label) {
    const { draft, tool } = this.state;
    if (draft.at(-1) === label) return `${label} is chosen already: choose another point.`;
    return TOOLS[tool].apart && labels().includes(label) ? placeFault(label) : "";
  }

  // Whether a point, clicked once more, ends the drawing: its last one, or the first one of a boundary.
  /** @param {string} label */
  isEnd(label) {
    const { draft, tool } = this.state;
    const isClosed = (tool === "area" || tool === "volume") && label === draft[0];
    return draft.length >= TOOLS[tool].least && (isClosed || label === draft.at(-1));
  }

  /** @param {string} label */
  extend(label) {
    if (!this.settleEntry()) return; // its fault is shown
    if (this.isEnd(label)) {
      this.finish();
      return;
    }
    const { draft, tool } = this.state;
    const { most } = TOOLS[tool];
    const why = this.faultOf(label);
    this.isRefused = Boolean(why);
    if (why) {
      this.notice.show(why);
      return;
    }
    draft.push(label);
    this.state.typed = false; // the typed name is used
    if (draft.length === most) this.finish();
    else this.rebuild();
  }

  // Takes the open form, as Enter does; returns false if it has a fault, which is shown.
  settleEntry() {
    const form = this.state.entry && formToTake(this.state.entry);
    if (form) this.entered(form);
    return !form || !this.state.entry;
  }

  // Ends what is open, before something else begins: a drawing that may have any number of points, and a form.
  settle() {
    if (!TOOLS[this.state.tool].most) this.finish();
    return this.settleEntry();
  }

  finish() {
    const { draft, tool } = this.state;
    if (tool === "pick" || draft.length < TOOLS[tool].least) return false;
    Object.assign(this.state, { draft: [], drawsIn: this.panes.active?.image ?? null });
    if (tool === "length") this.askLength(draft[0], draft[1]);
    else this.measure(tool, draft, freeName(TOOLS[tool].prefix, new Set(this.namesOf("measure"))));
    this.rebuild();
    return true;
  }

  /** @param {Kind} kind @param {string[]} points @param {string} name */
  measure(kind, points, name) {
    const there = store.measurements.find((one) => kind === "coordinate" && one.kind === kind && one.points[0] === points[0]);
    if (there) this.notice.show(`${there.name} is the coordinate of ${points[0]} already.`, true);
    else if (ASKED.includes(kind)) this.ask({ t: "measure", kind, points, name });
    else this.send({ t: "measure", was: "", name, kind, points });
    if (kind === "profile") this.state.side = name;
  }

  /** @param {string} start @param {string} end */
  askLength(start, end) {
    const name = freeName("L", new Set(this.namesOf("line")));
    this.ask({ t: "line", start, end, name, sigma_m: this.state.lastSigmaM ?? roundSmall(store.readingSigmaM) });
  }

  /** @param {Entry} entry */
  ask(entry) {
    this.state.entry = entry;
    this.showForms();
    inputIn('form[data-row="entry"] input')?.focus();
  }

  /** @param {HTMLFormElement} form */
  entered(form) {
    const { entry } = this.state;
    if (!entry) return;
    const isWanted = isUnread(entry);
    const { message, why, field } = entryMessage(entry, form, (t) => this.namesOf(t));
    if (!message) {
      showFault(form, why, field);
      return;
    }
    if (message.t === "line") this.state.lastSigmaM = message.sigma_m;
    this.send(message);
    this.state.entry = null;
    if (isWanted) this.tellWanted(message, entry);
    this.leave();
    this.rebuild();
    this.panes.active?.focus();
  }

  /** @param {SetLine | SetMeasurement} made @param {NewLine} entry */
  tellWanted(made, { start, end }) {
    const act = () => { this.send({ t: "undo" }); this.askLength(start, end); this.rebuild(); };
    this.offers.show(`No reading was typed: ${made.name}, the distance ${start} \u2013 ${end}, is computed from the photos.`, made, { words: "It was taped: enter the reading", act });
  }

  // Opens the form of an existing length or measurement.
  /** @param {Line} line */
  changeLine(line) {
    this.ask({ ...line, t: "line", was: line.name });
  }

  /** @param {Measurement} measurement */
  changeMeasurement(measurement) {
    this.state.side = measurement.name;
    this.ask({ ...measurement, t: "measure", was: measurement.name });
  }

  cancel() {
    const { state, panes } = this;
    this.notice.hide();
    this.isRefused = false;
    this.again.end();
    panes.active?.calm();
    const nothing = !state.draft.length && !state.entry;
    Object.assign(state, { draft: [], entry: null, alike: null });
    if (nothing && state.tool === "pick") Object.assign(state, { selected: null, side: null });
    if (nothing) this.setTool("pick");
    else this.rebuild();
    panes.active?.focus();
  }

  toLabel() {
    this.box.focus();
    this.box.select();
  }

  // Leaves the label field by Enter: selects a known label; a new one is placed by the next click.
  /** @param {string} label */
  name(label) {
    const { active } = this.panes;
    this.box.value = label;
    this.state.selected = labels().includes(label) ? label : null;
    this.rebuild();
    (active?.markOf(this.state.selected) ?? active?.svg)?.focus({ preventScroll: true });
  }

  // Reads a number from a field: null if it is empty; shows a fault if it is not a number.
  /** @param {HTMLInputElement} input @param {(value: number | null) => void} act @param {(text: string) => number} read */
  number(input, act, read = parse) {
    const value = input.value.trim() ? read(input.value) : null;
    if (value !== null && !Number.isFinite(value)) {
      this.notice.show(noNumber(input.value));
      input.value = input.defaultValue;
      return;
    }
    act(value);
  }

  /** @param {boolean} everywhere */
  remove(everywhere) {
    const { selected: label } = this.state;
    const { active } = this.panes;
    if (!label || !active) return;
    const pick = pickAt(active.image, label);
    if (everywhere) {
      this.say(goneWithPoint(label));
      this.send({ t: "forget", label });
    } else if (pick) {
      this.say(goneWith(pick));
      this.send({ t: "unpick", image: active.image, label });
    } else this.proposals.refuse([[active.image, label]]);
  }

  /** @param {string} words */
  say(words) {
    if (words) this.notice.show(words, true);
  }
}
