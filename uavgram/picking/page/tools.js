// Tools: what a click makes, and which names are free.

import { entryMessage, noNumber, parse, showFault } from "./entry.js";
import { byId, choose } from "./format.js";
import { TOOLS } from "./keys.js";
import { placeFault } from "./speed.js";
import { freeName, labels, pickAt, store } from "./store.js";

const ASKED = ["skid_speed", "speed"]; // kinds that take more than their points

export const toolActions = {
  setTool(tool) {
    this.tool = tool;
    this.draft = [];
    this.entry = null;
    choose(byId("tools"), (button) => button.dataset.tool === tool, "aria-checked");
    this.rebuild();
  },

  label() {
    return byId("label").value.trim();
  },

  // The label that a click places: the one in the box, or the next free one where that is taken.
  labelFor(image) {
    const given = this.label();
    const taken = this.taken(image, given);
    if (given && !given.includes(";") && !taken) return given;
    const free = this.freeLabel(given);
    if (taken && this.typed) this.notice(`${given} is picked ${taken} already: this point is called ${free}.`, true);
    return free;
  },

  // Where a label stands that cannot be placed in a photo; empty where it can. What moves is at
  // another place in each photo, so there each place has a label of its own.
  taken(image, label) {
    const apart = TOOLS[this.tool].apart;
    const coming = this.coming("place").filter((one) => one.label === label);
    if (pickAt(image, label) || coming.some((one) => one.image === image)) return "in this photo";
    return apart && (coming.length || labels().includes(label)) ? "in another photo" : "";
  },

  freeLabel(given) {
    const prefix = /^(.*?)\d*$/.exec(given || "P1")[1] || "P";
    return freeName(prefix, new Set([...labels(), ...this.coming("place").map((one) => one.label)]));
  },

  // What was sent and is not confirmed yet: its names are taken, too.
  coming(t) {
    return this.link.unconfirmed.filter((one) => one.t === t);
  },

  freeNameOf(t, prefix, there) {
    return freeName(prefix, new Set([...there, ...this.coming(t)].map((one) => one.name)));
  },

  suggest() {
    if (!this.label()) byId("label").value = this.freeLabel("P1");
  },

  select(label) {
    if (this.selected === label) return;
    this.selected = label;
    if (label) byId("label").value = label;
    this.rebuild();
  },

  clicked(pane, u, v) {
    const label = this.labelFor(pane.image);
    this.placeAt(pane, label, u, v);
    if (this.tool !== "pick") this.extend(label);
  },

  placeAt(pane, label, u, v, sigma = null) {
    this.send({ t: "place", image: pane.image, label, u, v, sigma });
    this.selected = label;
    this.typed = false;
    byId("label").value = label;
  },

  clickedMark(label) {
    this.select(label);
    if (this.tool !== "pick") this.extend(label);
  },

  extend(label) {
    const tool = TOOLS[this.tool];
    if (this.draft.at(-1) === label) return;
    const why = tool.apart && labels().includes(label) ? placeFault(label) : "";
    if (why) {
      this.notice(why);
      return;
    }
    if (this.tool === "area" && this.draft.length >= 3 && label === this.draft[0]) {
      this.finish();
      return;
    }
    this.draft.push(label);
    if (this.draft.length === tool.most) this.finish();
    else this.rebuild();
  },

  finish() {
    const tool = TOOLS[this.tool];
    const points = this.draft;
    if (points.length < (tool.least ?? 99)) return false;
    this.draft = [];
    if (this.tool === "length") this.askLength(points[0], points[1]);
    else this.measure(this.tool, points, this.freeNameOf("measure", tool.prefix, store.measurements));
    this.rebuild();
    return true;
  },

  measure(kind, points, name) {
    const there = store.measurements.find((one) => kind === "coordinate" && one.kind === kind && one.points[0] === points[0]);
    if (there) this.notice(`${there.name} is the coordinate of ${points[0]} already.`, true);
    else if (ASKED.includes(kind)) this.ask({ t: "measure", kind, points, name });
    else this.send({ t: "measure", was: "", name, kind, points });
  },

  askLength(start, end) {
    const name = this.freeNameOf("line", "L", store.lines);
    this.ask({ t: "line", start, end, name, sigma: this.lastSigma });
  },

  ask(entry) {
    this.entry = entry;
    this.setTab("measure");
    byId("tab-measure").querySelector('form[data-row="entry"] input')?.focus();
  },

  entered(form) {
    const there = this.entry.t === "line" ? store.lines : store.measurements;
    const taken = [...there, ...this.coming(this.entry.t)].map((one) => one.name);
    const { message, why, field } = entryMessage(this.entry, new FormData(form), taken);
    if (why) {
      showFault(form, why, field);
      return;
    }
    if (message.t === "line") this.lastSigma = message.sigma;
    this.send(message);
    this.entry = null;
    this.rebuild();
    this.backToPhoto();
  },

  // A length or measurement that is there, to be changed.
  change(t, one) {
    this.ask({ ...one, t, was: one.name });
  },

  toLabel() {
    byId("label").focus();
    byId("label").select();
  },

  // The label box was left with Enter: a known label is selected, a new one is to be placed.
  named() {
    this.name(this.label());
  },

  name(label) {
    byId("label").value = label;
    this.selected = labels().includes(label) ? label : null;
    this.rebuild();
    (this.active?.markOf(this.selected) ?? this.active?.svg)?.focus({ preventScroll: true });
  },

  // A number that was typed into a field: null where it is empty, nothing where it is none.
  number(input, act) {
    const value = input.value.trim() ? parse(input.value) : null;
    if (value !== null && !Number.isFinite(value)) {
      this.notice(noNumber(input.value));
      input.value = input.defaultValue;
      return;
    }
    act(value);
  },

  rename(label, name) {
    const wanted = name.trim();
    if (!wanted || wanted === label) return;
    this.send({ t: "rename", label, new: wanted });
    this.selected = wanted;
    byId("label").value = wanted;
  },

  // The selected pick, or what is under the pointer, moved to the exact place of a target.
  async snap(target) {
    const pane = this.active;
    if (!pane) return;
    const pick = this.selected ? pickAt(pane.image, this.selected) : null;
    const at = pick ? [pick.u, pick.v] : pane.inside(...(pane.hover ? pane.view.toPhoto(...pane.hover) : pane.middle()));
    try {
      const found = await this.link.ask({ t: "snap", image: pane.image, u: at[0], v: at[1], target });
      if (found.why) this.notice(found.why);
      else {
        const label = pick ? this.selected : this.labelFor(pane.image);
        this.placeAt(pane, label, found.u, found.v, found.sigma);
        this.notice(`${label}: ${target} at u ${found.u.toFixed(2)}, v ${found.v.toFixed(2)}, sigma ${found.sigma.toFixed(2)} px`, true);
      }
    } catch (fault) {
      this.notice(fault.message);
    }
  },
};
