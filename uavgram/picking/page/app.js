// The desk: what is selected, which tool is in hand, and how panes, panel, keys and server meet.

import { showCamera } from "./camera.js";
import { errandActions } from "./errands.js";
import { byId, choose, node } from "./format.js";
import { showFrames } from "./frames.js";
import { KEYS, listenToKeys, roving, TOOLS } from "./keys.js";
import { Link } from "./link.js";
import { moveActions } from "./moves.js";
import { showOutputs, showOutside } from "./outputs.js";
import { Pane } from "./pane.js";
import { modeText, showMeasure } from "./panel.js";
import { isSuspect, labels, pickAt, pickKey, picksIn, receive, stale, store, worstIn } from "./store.js";
import { onTile } from "./tiles.js";
import { toolActions } from "./tools.js";

const THUMBNAILS_AFTER_MS = 4000; // at the latest: the photo may be none that can be shown
const [MARKS, VALUES, ALL] = [1, 2, 3]; // how much of the page is to be brought up to date
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
}

Object.assign(Desk.prototype, toolActions, moveActions, errandActions);

new Desk();
