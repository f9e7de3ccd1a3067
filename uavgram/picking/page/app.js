// The desk: what is selected, which tool is in hand, and how panes, panel, keys and server meet.

import { showCamera } from "./camera.js";
import { errandActions } from "./errands.js";
import { byId, choose, node } from "./format.js";
import { showFrames } from "./frames.js";
import { buildHelp } from "./help.js";
import { listenToKeys, roving, throughRows, TOOLS } from "./keys.js";
import { Link } from "./link.js";
import { moveActions } from "./moves.js";
import { showOutputs, showOutside } from "./outputs.js";
import { Pane } from "./pane.js";
import { modeText, showMeasure } from "./panel.js";
import { labels, pickAt, pickKey, receive, stale, store } from "./store.js";
import { stripActions } from "./strip.js";
import { drop } from "./table.js";
import { onTile } from "./tiles.js";
import { toolActions } from "./tools.js";

const [MARKS, VALUES, ALL] = [1, 2, 3]; // how much of the page is to be brought up to date
const GONE_AFTER_MS = 3000;
const NOTICE_MS = 8000; // what went well is told for half of it
const STALE_AFTER_MS = 100; // up to this long people take an answer for immediate
const TABS = { measure: "Measure", frames: "Frames", camera: "Camera" };

class Desk {
  constructor() {
    this.panes = [];
    this.active = null;
    this.selected = null;
    this.tool = "pick";
    this.draft = []; // labels of the length or measurement that is being clicked
    this.entry = null;
    this.shownKinds = { ellipses: true, residuals: true, predicted: true, labels: true, lines: true };
    this.typed = false; // the label was typed since the last point was placed
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
    this.link = new Link((message) => this.received(message), (open) => this.connected(open));
    listenToKeys(this);
    window.addEventListener("resize", () => { for (const pane of this.panes) pane.resize(); });
  }

  build() {
    byId("tools").append(...Object.entries(TOOLS).map(([name, { key, name: words, what }]) => node("button", {
      role: "radio", "aria-checked": name === this.tool, "data-tool": name, title: `${words} (${key.toUpperCase()}): ${what}`, onclick: () => this.setTool(name),
    }, words)));
    byId("pane-counts").append(...[1, 2, 4].map((count) => node("button", {
      role: "radio", "aria-checked": count === 1, "data-count": count, title: `${count} pane${count === 1 ? "" : "s"} (Ctrl+${count})`, onclick: () => this.setPanes(count),
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
    byId("label").addEventListener("input", () => { this.typed = true; });
    for (const group of ["tools", "pane-counts", "tabs", "strip"]) roving(byId(group));
    throughRows(byId("panel"));
    buildHelp(byId("help"));
  }

  // From the server.

  received(message) {
    if (message.t === "refused") {
      this.notice(message.why);
      this.refused(this.link.sent);
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

  // A connection that is soon back is no matter; one that stays away is said.
  connected(open) {
    store.connected = open;
    if (open) {
      clearTimeout(this.losing);
      this.losing = null;
      store.gone = false;
    } else this.losing ??= setTimeout(() => { store.gone = true; this.showFoot(); }, GONE_AFTER_MS);
    this.showMode();
    if (!open) byId("saved").textContent = ""; // nobody knows, until the server says so again
  }

  // What was typed and refused is not shown as if it held.
  refused(sent) {
    if (sent?.t === "rename") this.select(sent.label);
    for (const part of ["pick", "lengths"]) drop(part);
    this.refreshSoon();
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
    byId("project").title = store.project;
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

  notice(words, good = false) {
    const box = byId("notice");
    box.textContent = words;
    box.classList.toggle("info", good);
    box.hidden = false;
    clearTimeout(this.noticeTimer);
    this.noticeTimer = setTimeout(() => this.unnotice(), good ? NOTICE_MS / 2 : NOTICE_MS);
  }

  unnotice() {
    byId("notice").hidden = true;
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
    if (this.panes.includes(this.active)) this.showActive();
    else this.activate(this.panes[0]);
    for (const pane of this.panes) pane.resize();
    this.showStrip();
    if (this.linked) this.viewed(this.active);
  }

  activate(pane) {
    if (this.active === pane) return;
    this.active = pane;
    this.showActive();
    if (store.version !== undefined) this.showPanel();
  }

  showActive() {
    for (const one of this.panes) one.box.classList.toggle("active", one === this.active && this.panes.length > 1);
  }

  shown() {
    if (store.photos.length) this.showStrip();
    if (!this.active) return;
    this.bringThumbnail(this.active.image);
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
}

Object.assign(Desk.prototype, toolActions, moveActions, errandActions, stripActions);

new Desk();
