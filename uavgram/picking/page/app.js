// The desk: what is selected, which tool is in hand, and how panes, panel, keys and server meet.

import { boardText, showCamera } from "./camera.js";
import { entryMessage, parse } from "./entry.js";
import { node } from "./format.js";
import { showFrames } from "./frames.js";
import { KEYS, listenToKeys, roving, TOOLS } from "./keys.js";
import { Link } from "./link.js";
import { showOutputs, showOutside } from "./outputs.js";
import { Pane } from "./pane.js";
import { modeText, showMeasure } from "./panel.js";
import {
  fitOf, freeName, isSuspect, labels, pickAt, pickKey, picksIn, placeOf, predictedIn, receive, stale, store, worstIn,
} from "./store.js";
import { onTile } from "./tiles.js";

const byId = (id) => document.getElementById(id);
const THUMBNAILS_AFTER_MS = 4000; // at the latest: the photo may be none that can be shown
const [MARKS, VALUES, ALL] = [1, 2, 3]; // how much of the page is to be brought up to date
const STALE_AFTER_MS = 100; // up to this long people take an answer for immediate
const NUDGE_REST_MS = 700; // nudges closer together than this are one step
const PAN_PX = 60; // for each press of an arrow
const SAME_PLACE_PX = 4; // on the screen: a second point would hide the first
const TABS = { measure: "Measure", frames: "Frames", camera: "Camera" };

class Desk {
  constructor() {
    this.panes = [];
    this.active = null;
    this.selected = null;
    this.tool = "pick";
    this.draft = []; // labels of the length or measurement that is being clicked
    this.entry = null;
    this.shownKinds = { ellipses: true, residuals: true, predicted: true, labels: true };
    this.loupe = true;
    this.linked = false;
    this.tab = "measure";
    this.steps = Date.now(); // step numbers of several pages must not meet
    this.lastSigma = 0.01;
    this.depth = 0; // of the refresh that is due
    this.exporting = false;
    this.folders = null; // in which photos of a board could be
    this.build();
    onTile((image) => { for (const pane of this.panes) if (pane.image === image) pane.redraw(); });
    this.link = new Link((message) => this.received(message), (open) => { store.connected = open; this.showMode(); });
    listenToKeys(this);
    window.addEventListener("resize", () => { for (const pane of this.panes) pane.resize(); });
  }

  build() {
    byId("tools").append(...Object.entries(TOOLS).map(([name, { key, name: words }]) => node("button", {
      role: "radio", "aria-checked": name === this.tool, "data-tool": name, title: `${words} (${key.toUpperCase()})`, onclick: () => this.setTool(name),
    }, words)));
    byId("pane-counts").append(...[1, 2, 4].map((count) => node("button", {
      role: "radio", "aria-checked": count === 1, "data-count": count, title: `${count} panes (Ctrl+${count})`, onclick: () => this.setPanes(count),
    }, `${count}`)));
    byId("tabs").append(...Object.entries(TABS).map(([name, words]) => node("button", {
      role: "tab", id: `tab-button-${name}`, "aria-selected": name === this.tab, "aria-controls": `tab-${name}`, onclick: () => this.setTab(name),
    }, words)));
    choose(byId("tools"), (button) => button.dataset.tool === this.tool, "aria-checked");
    choose(byId("tabs"), (button) => button.id === `tab-button-${this.tab}`, "aria-selected");
    byId("undo").onclick = () => this.send({ t: "undo" });
    byId("redo").onclick = () => this.send({ t: "redo" });
    byId("linked").onclick = () => this.toggleLink();
    byId("help-button").onclick = () => this.help();
    byId("label").addEventListener("keydown", (event) => { if (event.key === "Enter") this.named(); });
    for (const group of ["tools", "pane-counts", "tabs", "strip"]) roving(byId(group));
    byId("help").append(node("h2", { id: "help-title", class: "unseen" }, "Keys"), node("div", { class: "keys" }, ...KEYS.map(([title, rows]) => node("div", {}, node("h2", {}, title),
      node("dl", {}, ...rows.flatMap(([keys, what]) => [node("dt", {}, keys), node("dd", {}, what)]))))),
    node("button", { onclick: () => byId("help").close() }, "Close"));
  }

  // From the server.

  received(message) {
    if (message.t === "refused") {
      this.notice(message.why);
      if (!Number.isInteger(store.version)) this.link.socket.close(); // a drag ran ahead: begin anew
    }
    const moves = this.link?.waiting.filter((one) => one.t === "place") ?? [];
    const isNew = receive(message, new Set(moves.map((move) => pickKey(move.image, move.label))));
    if (message.t === "hello") this.begin();
    if (message.t === "live") this.answered = performance.now();
    if (message.t === "saved") this.showSaved();
    else if (isNew) this.refreshSoon(message.mode === "linearised" ? VALUES : ALL);
    else this.showStanding();
    this.showFoot();
  }

  // Once a frame, however many messages come; and of the page no more than they change.
  refreshSoon(depth = ALL) {
    if (!this.depth) requestAnimationFrame(() => { const due = this.depth; this.depth = 0; this.refresh(due); });
    this.depth = Math.max(this.depth, depth);
  }

  begin() {
    const pictures = store.photos.map((photo) => photo.digest).join();
    if (this.pictures && this.pictures !== pictures) location.reload(); // other photos have these numbers now
    this.pictures = pictures;
    document.title = `${store.project} \u2013 uavgram pick`;
    byId("project").textContent = store.project;
    if (!this.panes.length) this.setPanes(1);
    else for (const pane of this.panes) pane.show(pane.image);
    if (store.recovered) this.notice("Recovered what the last session confirmed and could not save.", true);
    this.suggest();
    byId("panes").dataset.ready = "true";
  }

  refresh(depth = ALL) {
    this.showStanding();
    this.showMode();
    if (depth === ALL) {
      this.showKnown([...new Set([...labels(), ...store.control, ...store.check])]);
      if (this.selected && !labels().includes(this.selected)) this.selected = null;
      this.showStrip();
    }
    for (const pane of this.panes) pane.rebuild();
    if (depth >= VALUES) this.showPanel();
  }

  showStanding() {
    byId("undo").disabled = !store.undo;
    byId("redo").disabled = !store.redo;
    document.body.dataset.version = store.version;
    document.body.dataset.liveFor = store.liveFor;
    this.showStale();
  }

  // Numbers that follow the pointer are not grey, though it is always a step ahead of them.
  showStale() {
    clearTimeout(this.greying);
    this.staleSince = stale() ? this.staleSince ?? performance.now() : null;
    const left = STALE_AFTER_MS + Math.max(this.staleSince ?? 0, this.answered ?? 0) - performance.now();
    document.body.classList.toggle("stale", stale() && left <= 0);
    if (stale() && left > 0) this.greying = setTimeout(() => this.showStale(), left);
  }

  showKnown(known) {
    const sign = known.join(";");
    if (sign === this.known) return;
    this.known = sign;
    byId("known-labels").replaceChildren(...known.map((value) => node("option", { value })));
  }

  showMode() {
    const [mode, words] = modeText();
    if (byId("mode").textContent === words && byId("mode").dataset.mode === mode) return;
    byId("mode").dataset.mode = mode;
    byId("mode").textContent = words;
    byId("mode").title = mode === "linearised" ? "Values to first order, sigmas and tests of the last full adjustment" : words;
  }

  showSaved() {
    byId("saved").textContent = store.fault ? "not saved" : "saved";
    byId("saved").dataset.fault = Boolean(store.fault);
  }

  showPanel() {
    for (const name of Object.keys(TABS)) byId(`tab-${name}`).hidden = name !== this.tab;
    if (this.tab === "measure") showMeasure(byId("tab-measure"), this);
    else if (this.tab === "frames") showFrames(byId("tab-frames"), this);
    else showCamera(byId("tab-camera"), this);
    this.showFoot();
  }

  showFoot() {
    byId("outputs").hidden = this.tab !== "measure";
    showOutputs(byId("outputs"), this);
    showOutside(byId("outside"), this);
  }

  setTab(name) {
    this.tab = name;
    choose(byId("tabs"), (button) => button.id === `tab-button-${name}`, "aria-selected");
    if (name === "camera" && !this.folders) this.listFolders();
    this.showPanel();
  }

  nextTab(by) {
    const names = Object.keys(TABS);
    this.setTab(names[(names.indexOf(this.tab) + by + names.length) % names.length]);
    byId(`tab-button-${this.tab}`).focus();
  }

  showStrip() {
    const strip = byId("strip");
    if (strip.childElementCount !== store.photos.length) {
      strip.replaceChildren(...store.photos.map((photo, k) => node("button", { "data-image": k, onclick: () => { this.active?.show(k); this.backToPhoto(); } },
        node("img", { "data-src": `/photo/${k}/thumbnail.jpg?${photo.digest}`, alt: "", loading: "lazy", draggable: false }),
        node("span", { class: "name" }, node("bdi", {}, photo.name.replace(/\.\w+$/, ""))), node("span", { class: "badge" }))));
      setTimeout(() => this.sharpened(), THUMBNAILS_AFTER_MS);
    }
    store.photos.forEach((photo, k) => {
      const button = strip.children[k];
      const count = picksIn(k).length;
      const worst = worstIn(k);
      const bad = worst && isSuspect(worst.status);
      button.classList.toggle("unmatched", !photo.matched && store.photos.some((one) => one.matched));
      button.setAttribute("aria-current", this.panes.some((pane) => pane.image === k));
      button.tabIndex = k === (this.active?.image ?? 0) ? 0 : -1;
      const badge = button.lastChild;
      badge.textContent = `${count || ""}${bad ? ` \u25c6 ${Math.abs(worst.w).toFixed(1)}` : ""}`;
      badge.hidden = !count;
      badge.classList.toggle("bad", Boolean(bad));
      const state = photo.matched ? "matched" : `not matched: ${photo.reason}`;
      const fit = worst ? `, worst w ${Math.abs(worst.w).toFixed(1)}` : "";
      button.setAttribute("aria-label", `${photo.name}, ${state}, ${count} picks${fit}`);
      button.title = `${photo.name}: ${state}, ${count} picks${fit}`;
    });
  }

  // A photo is there as a whole: now its small pictures may come, which would have delayed it.
  sharpened() {
    for (const picture of byId("strip").querySelectorAll("img:not([src])")) picture.src = picture.dataset.src;
  }

  notice(words, good = false) {
    const box = byId("notice");
    box.textContent = words;
    box.classList.toggle("info", good);
    box.hidden = false;
    clearTimeout(this.noticeTimer);
    this.noticeTimer = setTimeout(() => { box.hidden = true; }, 5000);
  }

  // To the server.

  send(message) {
    this.link.change({ step: 0, ...message });
  }

  newStep() {
    return (this.steps += 1);
  }

  drag(image, label, [u, v], step, final) {
    const pick = pickAt(image, label);
    if (!pick) return;
    store.picks.set(pickKey(image, label), { ...pick, u, v });
    store.version += 0.5; // newer than what the server knows: what hangs on it is grey
    this.send({ t: "place", image, label, u, v, step, final });
    this.refreshSoon(MARKS);
  }

  // Panes.

  setPanes(count) {
    while (this.panes.length > count) this.panes.pop().remove();
    byId("panes").dataset.count = count;
    const before = this.active?.image ?? 0;
    while (this.panes.length < count) {
      const pane = new Pane(byId("panes"), this);
      this.panes.push(pane);
      pane.resize();
      pane.show((before + this.panes.length - 1) % store.photos.length);
    }
    choose(byId("pane-counts"), (button) => Number(button.dataset.count) === count, "aria-checked");
    if (!this.panes.includes(this.active)) this.activate(this.panes[0]);
    for (const pane of this.panes) pane.resize();
    this.showStrip();
    if (this.linked) this.viewed(this.active);
  }

  activate(pane) {
    if (this.active === pane) return;
    this.active = pane;
    for (const one of this.panes) one.box.classList.toggle("active", one === pane && this.panes.length > 1);
    if (store.version !== undefined) this.showPanel();
  }

  shown() {
    if (store.photos.length) this.showStrip();
    if (!this.active) return;
    this.showPanel();
    this.viewed(this.active);
  }

  viewed(pane) {
    if (!this.linked || pane !== this.active || this.panes.length < 2) return;
    this.linkPending = true;
    this.followGround();
  }

  async followGround() {
    if (this.asking || !this.linkPending) return;
    this.asking = true;
    this.linkPending = false;
    const pane = this.active;
    const [u, v] = pane.inside(...pane.middle());
    try {
      const { places } = await this.link.ask({ t: "ground", image: pane.image, u, v });
      for (const other of this.panes) {
        const found = places[other.image];
        if (other === pane) continue;
        if (other.image === pane.image) other.view.center(u, v, pane.view.scale);
        else if (found) other.view.center(found[0], found[1], pane.view.scale / found[2]);
        other.fitted = false;
        other.redraw();
      }
    } catch (fault) {
      this.notice(fault.message);
    } finally {
      this.asking = false;
      if (this.linkPending) this.followGround();
    }
  }

  toggleLink() {
    this.linked = !this.linked;
    byId("linked").setAttribute("aria-pressed", this.linked);
    if (this.linked && this.active) this.viewed(this.active);
  }

  // Tools.

  marks() {
    return { selected: this.selected, shown: this.shownKinds, draft: this.draft, tool: this.tool };
  }

  rebuild() {
    for (const pane of this.panes) pane.rebuild();
    this.showPanel();
  }

  setTool(tool) {
    this.tool = tool;
    this.draft = [];
    this.entry = null;
    choose(byId("tools"), (button) => button.dataset.tool === tool, "aria-checked");
    this.rebuild();
  }

  label() {
    return byId("label").value.trim();
  }

  // The label that a click places: the one in the box, or the next free one where that is taken.
  labelFor(image) {
    const given = this.label();
    const isTaken = pickAt(image, given) || this.coming("place").some((one) => one.image === image && one.label === given);
    if (given && !given.includes(";") && !isTaken) return given;
    return this.freeLabel(given);
  }

  freeLabel(given) {
    const prefix = /^(.*?)\d*$/.exec(given || "P1")[1] || "P";
    return freeName(prefix, new Set([...labels(), ...this.coming("place").map((one) => one.label)]));
  }

  // What was sent and is not confirmed yet: its names are taken, too.
  coming(t) {
    return this.link.unconfirmed.filter((one) => one.t === t);
  }

  freeNameOf(t, prefix, there) {
    return freeName(prefix, new Set([...there, ...this.coming(t)].map((one) => one.name)));
  }

  suggest() {
    if (!this.label()) byId("label").value = this.freeLabel("P1");
  }

  select(label) {
    if (this.selected === label) return;
    this.selected = label;
    if (label) byId("label").value = label;
    this.rebuild();
  }

  clicked(pane, u, v) {
    const label = this.labelFor(pane.image);
    this.placeAt(pane, label, u, v);
    if (this.tool !== "pick") this.extend(label);
  }

  placeAt(pane, label, u, v, sigma = null) {
    this.send({ t: "place", image: pane.image, label, u, v, sigma });
    this.selected = label;
    byId("label").value = label;
  }

  clickedMark(label) {
    this.select(label);
    if (this.tool !== "pick") this.extend(label);
  }

  extend(label) {
    const tool = TOOLS[this.tool];
    if (this.draft.at(-1) === label) return;
    if (this.tool === "area" && this.draft.length >= 3 && label === this.draft[0]) {
      this.finish();
      return;
    }
    this.draft.push(label);
    if (this.draft.length === tool.most) this.finish();
    else this.rebuild();
  }

  finish() {
    const tool = TOOLS[this.tool];
    const points = this.draft;
    if (points.length < (tool.least ?? 99)) return false;
    this.draft = [];
    if (this.tool === "length") this.askLength(points[0], points[1]);
    else {
      const name = this.freeNameOf("measure", tool.prefix, store.measurements);
      if (this.tool === "skid_speed") this.ask({ t: "measure", kind: this.tool, points, name });
      else this.send({ t: "measure", was: "", name, kind: this.tool, points });
    }
    this.rebuild();
    return true;
  }

  askLength(start, end) {
    const name = this.freeNameOf("line", "L", store.lines);
    this.ask({ t: "line", start, end, name, sigma: this.lastSigma });
  }

  ask(entry) {
    this.entry = entry;
    this.setTab("measure");
    byId("tab-measure").querySelector('form[data-row="entry"] input')?.focus();
  }

  entered(form) {
    const { message, why } = entryMessage(this.entry, form);
    if (why) {
      this.notice(why);
      return;
    }
    if (message.t === "line") this.lastSigma = message.sigma;
    this.send(message);
    this.entry = null;
    this.rebuild();
    this.backToPhoto();
  }

  // A length or measurement that is there, to be changed.
  change(t, one) {
    this.ask({ ...one, t, was: one.name });
  }

  backToPhoto() {
    this.active?.svg.focus({ preventScroll: true });
  }

  toLabel() {
    byId("label").focus();
    byId("label").select();
  }

  // The label box was left with Enter: a known label is selected, a new one is to be placed.
  named() {
    this.name(this.label());
  }

  name(label) {
    byId("label").value = label;
    this.selected = labels().includes(label) ? label : null;
    this.rebuild();
    (this.active?.markOf(this.selected) ?? this.active?.svg)?.focus({ preventScroll: true });
  }

  // A number that was typed into a field: null where it is empty, nothing where it is none.
  number(input, act) {
    const value = input.value.trim() ? parse(input.value) : null;
    if (value !== null && !Number.isFinite(value)) {
      this.notice(`${input.value} is no number`);
      return;
    }
    act(value);
  }

  rename(label, name) {
    const wanted = name.trim();
    if (!wanted || wanted === label) return;
    this.send({ t: "rename", label, new: wanted });
    this.selected = wanted;
    byId("label").value = wanted;
  }

  // Keys.

  enter() {
    const { active: pane, selected, tool } = this;
    if (this.entry || !pane) return false;
    if (tool !== "pick" && selected && this.draft.at(-1) !== selected) {
      this.extend(selected);
      return true;
    }
    if (tool !== "pick" && this.finish()) return true;
    const at = pane.inside(...pane.middle());
    const there = selected ? pickAt(pane.image, selected) : null;
    if (there && Math.hypot(there.u - at[0], there.v - at[1]) * pane.view.scale < SAME_PLACE_PX) {
      this.notice(`${selected} is here already: choose another with N or B, or move the photo with Ctrl and the arrows.`, true);
    } else this.clicked(pane, ...at);
    return true;
  }

  cancel() {
    const nothing = !this.draft.length && !this.entry;
    this.draft = [];
    this.entry = null;
    if (nothing && this.tool === "pick") this.selected = null;
    if (nothing) this.setTool("pick");
    else this.rebuild();
    this.active?.svg.focus({ preventScroll: true });
  }

  arrow(dx, dy, step) {
    const pick = this.active && this.selected ? pickAt(this.active.image, this.selected) : null;
    if (!pick) return this.pan(dx, dy);
    const now = Date.now();
    if (!this.nudgeStep || now - this.nudged > NUDGE_REST_MS || this.nudgedLabel !== this.selected) this.nudgeStep = this.newStep();
    Object.assign(this, { nudged: now, nudgedLabel: this.selected });
    const at = this.active.inside(pick.u + dx * step, pick.v + dy * step);
    this.drag(pick.image, pick.label, at, this.nudgeStep, true);
    this.active.magnify(...at, this.active.view.width / 2, this.active.view.height / 2);
    return true;
  }

  pan(dx, dy) {
    const { active: pane } = this;
    if (!pane) return false;
    pane.view.panBy(-dx * PAN_PX, -dy * PAN_PX);
    pane.moved();
    pane.magnify(...pane.middle(), pane.view.width / 2, pane.view.height / 2);
    return true;
  }

  // The parts of the page in turn, as F6 does in other programs.
  nextRegion(by) {
    const chosen = (id, attribute) => byId(id).querySelector(`[${attribute}="true"]`) ?? byId(id).firstElementChild;
    const stops = [chosen("tools", "aria-checked"), ...this.panes.map((pane) => pane.svg), chosen("tabs", "aria-selected"), chosen("strip", "aria-current")];
    const parts = [byId("tools").parentElement, ...this.panes.map((pane) => pane.box), byId("panel"), byId("strip")];
    const at = parts.findIndex((part) => part.contains(document.activeElement));
    stops[(at + by + stops.length + (at < 0 && by < 0 ? 1 : 0)) % stops.length]?.focus();
  }

  remove(everywhere) {
    if (!this.selected || !this.active) return;
    if (everywhere) this.send({ t: "forget", label: this.selected });
    else if (pickAt(this.active.image, this.selected)) this.send({ t: "unpick", image: this.active.image, label: this.selected });
  }

  beginRename() {
    this.setTab("measure");
    const field = byId("tab-measure").querySelector('[name="rename"]');
    field?.focus();
    field?.select();
  }

  doubled(label) {
    if (label && this.tool === "pick") this.beginRename();
  }

  turn(by, expected) {
    if (!this.active) return;
    const count = store.photos.length;
    for (let k = 1; k <= count; k += 1) {
      const image = (this.active.image + by * k + count * k) % count;
      if (!expected || placeOf(image, this.selected ?? this.label())) {
        this.active.show(image);
        return;
      }
    }
  }

  zoom(factor) {
    const { active } = this;
    active?.zoom(...(active.hover ?? [active.view.width / 2, active.view.height / 2]), factor);
  }

  toSelected(scale) {
    if (this.selected) this.active?.goTo(this.selected, scale);
  }

  goToPredicted() {
    const label = this.selected ?? this.label();
    const pane = this.active;
    if (!pane) return;
    const expected = predictedIn(pane.image).find((one) => one.label === label);
    if (!expected && !pickAt(pane.image, label)) this.notice(`Nothing says where ${label} is in ${pane.photo.name}.`);
    else pane.goTo(label, Math.max(pane.view.scale, 2));
  }

  step(by) {
    const all = labels();
    if (!all.length) return;
    const at = all.indexOf(this.selected);
    this.select(all[(at + by + all.length + (at < 0 && by < 0 ? 1 : 0)) % all.length]);
    this.active?.markOf(this.selected)?.focus({ preventScroll: true });
  }

  toggle(kind) {
    this.shownKinds[kind] = !this.shownKinds[kind];
    for (const pane of this.panes) { pane.rebuild(); pane.tell(); }
  }

  toggleLoupe() {
    this.loupe = !this.loupe;
    for (const pane of this.panes) pane.loupe.hide();
  }

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
  }

  // Errands: about the project as a whole.

  async errand(message) {
    try {
      const said = await this.link.ask(message);
      if (said.why) this.notice(said.why);
      return said;
    } catch (fault) {
      this.notice(fault.message);
      return null;
    }
  }

  async exportAll() {
    if (this.exporting) return;
    this.exporting = true;
    this.showFoot();
    await this.errand({ t: "export" });
    this.exporting = false;
    this.showFoot();
  }

  async listFolders() {
    const said = await this.errand({ t: "folders" });
    if (said?.folders) this.folders = said.folders;
    this.showPanel();
  }

  calibrate(form) {
    return this.errand({ t: "calibrate", folder: Number(form.get("folder")), board: boardText(form), model: form.get("model") });
  }

  async useCamera() {
    if (await this.errand({ t: "use-camera" })) this.notice("The project names this camera now, and was read again.", true);
  }

  async reload() {
    if (await this.errand({ t: "reload" })) this.notice("The project was read again from its files; undo begins anew.", true);
  }

  help() {
    byId("help").showModal();
  }
}

// Of a group one button is chosen, and that one is reached with Tab.
function choose(group, chosen, attribute) {
  for (const button of group.children) {
    button.setAttribute(attribute, chosen(button));
    button.tabIndex = chosen(button) ? 0 : -1;
  }
}

new Desk();
