// The desk: what is selected, which tool is in hand, and how panes, panel, keys and server meet.

import { node } from "./format.js";
import { KEYS, listenToKeys, TOOLS } from "./keys.js";
import { Link } from "./link.js";
import { Pane } from "./pane.js";
import { modeText, showCamera, showFrames, showMeasure } from "./panel.js";
import {
  fitOf, freeName, isSuspect, labels, pickAt, pickKey, picksIn, placeOf, predictedIn, receive, stale, store, worstIn,
} from "./store.js";
import { onTile } from "./tiles.js";

const byId = (id) => document.getElementById(id);
const NUDGE_REST_MS = 700; // nudges closer together than this are one step
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
    this.exported = ""; // "busy", or the folder of the outputs
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
    byId("undo").onclick = () => this.send({ t: "undo" });
    byId("redo").onclick = () => this.send({ t: "redo" });
    byId("linked").onclick = () => this.toggleLink();
    byId("help-button").onclick = () => this.help();
    byId("label").addEventListener("keydown", (event) => { if (event.key === "Enter") this.active?.svg.focus(); });
    byId("help").append(node("h2", { id: "help-title" }, "Keys"), ...KEYS.flatMap(([title, rows]) => [node("h2", {}, title),
      node("dl", {}, ...rows.flatMap(([keys, what]) => [node("dt", {}, keys), node("dd", {}, what)]))]),
    node("button", { onclick: () => byId("help").close() }, "Close"));
  }

  // From the server.

  received(message) {
    if (message.t === "refused") {
      this.notice(message.why);
      if (!Number.isInteger(store.version)) this.link.socket.close(); // a drag ran ahead: begin anew
    }
    const moves = this.link?.waiting.filter((one) => one.t === "place") ?? [];
    receive(message, new Set(moves.map((move) => pickKey(move.image, move.label))));
    if (message.t === "hello") this.begin();
    if (message.t === "saved") this.showSaved();
    else this.refreshSoon();
  }

  // Once a frame, however many messages come.
  refreshSoon() {
    if (this.refreshing) return;
    this.refreshing = true;
    requestAnimationFrame(() => { this.refreshing = false; this.refresh(); });
  }

  begin() {
    document.title = `${store.project} \u2013 uavgram pick`;
    byId("project").textContent = store.project;
    if (!this.panes.length) this.setPanes(1);
    else for (const pane of this.panes) pane.show(pane.image);
    if (store.recovered) this.notice("Recovered what the last session confirmed and could not save.", true);
    this.suggest();
    byId("panes").dataset.ready = "true";
  }

  refresh() {
    document.body.classList.toggle("stale", stale());
    byId("undo").disabled = !store.undo;
    byId("redo").disabled = !store.redo;
    this.showKnown([...new Set([...labels(), ...store.control, ...store.check])]);
    if (this.selected && !labels().includes(this.selected)) this.selected = null;
    for (const pane of this.panes) pane.rebuild();
    this.showPanel();
    this.showStrip();
    this.showMode();
    document.body.dataset.version = store.version;
    document.body.dataset.liveFor = store.liveFor;
  }

  showKnown(known) {
    const sign = known.join(";");
    if (sign === this.known) return;
    this.known = sign;
    byId("known-labels").replaceChildren(...known.map((value) => node("option", { value })));
  }

  showMode() {
    const [mode, words] = modeText();
    byId("mode").dataset.mode = mode;
    byId("mode").textContent = words;
    byId("mode").title = mode === "linearised" ? "Values to first order, sigmas and tests of the last full adjustment" : words;
  }

  showSaved() {
    byId("saved").textContent = store.fault ? `Not saved: ${store.fault}` : "saved";
    byId("saved").dataset.fault = Boolean(store.fault);
  }

  showPanel() {
    for (const name of Object.keys(TABS)) byId(`tab-${name}`).hidden = name !== this.tab;
    if (this.tab === "measure") showMeasure(byId("tab-measure"), this);
    else if (this.tab === "frames") showFrames(byId("tab-frames"));
    else showCamera(byId("tab-camera"));
  }

  setTab(name) {
    this.tab = name;
    for (const button of byId("tabs").children) button.setAttribute("aria-selected", button.id === `tab-button-${name}`);
    this.showPanel();
  }

  showStrip() {
    const strip = byId("strip");
    if (strip.childElementCount !== store.photos.length) {
      strip.replaceChildren(...store.photos.map((photo, k) => node("button", { "data-image": k, onclick: () => this.active?.show(k) },
        node("img", { src: `/photo/${k}/thumbnail.jpg`, alt: "", loading: "lazy", draggable: false }),
        node("span", { class: "name" }, photo.name), node("span", { class: "badge" }))));
    }
    store.photos.forEach((photo, k) => {
      const button = strip.children[k];
      const count = picksIn(k).length;
      const worst = worstIn(k);
      const bad = worst && isSuspect(worst.status);
      button.classList.toggle("unmatched", !photo.matched);
      button.setAttribute("aria-current", this.panes.some((pane) => pane.image === k));
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
    this.refreshSoon();
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
    for (const button of byId("pane-counts").children) button.setAttribute("aria-checked", Number(button.dataset.count) === count);
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
    for (const button of byId("tools").children) button.setAttribute("aria-checked", button.dataset.tool === tool);
    this.rebuild();
  }

  label() {
    return byId("label").value.trim();
  }

  // The label that a click places: the one in the box, or the next free one where that is taken.
  labelFor(image) {
    const given = this.label();
    if (given && !given.includes(";") && !pickAt(image, given)) return given;
    return this.freeLabel(given);
  }

  freeLabel(given) {
    const prefix = /^(.*?)\d*$/.exec(given || "P1")[1] || "P";
    return freeName(prefix, new Set(labels()));
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
      const name = freeName(tool.prefix, new Set(store.measurements.map((one) => one.name)));
      if (this.tool === "skid_speed") this.ask({ t: "measure", kind: this.tool, points, name });
      else this.send({ t: "measure", was: "", name, kind: this.tool, points });
    }
    this.rebuild();
    return true;
  }

  askLength(start, end) {
    const name = freeName("L", new Set(store.lines.map((line) => line.name)));
    this.ask({ t: "line", start, end, name, sigma: this.lastSigma });
  }

  ask(entry) {
    this.entry = entry;
    this.setTab("measure");
    byId("tab-measure").querySelector('form[data-row="entry"] input')?.focus();
  }

  entered(form) {
    const { entry } = this;
    const value = (name) => parse(form.get(name));
    const name = form.get("name").trim();
    if (entry.t === "line") {
      const [length, sigma] = [value("length"), value("sigma")];
      if (!(length > 0 && sigma > 0)) {
        this.notice("Length and sigma are numbers in metres greater than 0, such as 11.52 and 0.01.");
        return;
      }
      this.lastSigma = sigma;
      this.send({ t: "line", was: "", name, start: entry.start, end: entry.end, length, sigma, adjust: form.get("use") === "adjust" });
    } else {
      const parameters = { mu: value("mu"), mu_sigma: value("mu_sigma") };
      if (!(parameters.mu > 0 && parameters.mu_sigma >= 0)) {
        this.notice("Friction and its sigma are numbers, such as 0.7 and 0.05.");
        return;
      }
      this.send({ t: "measure", was: "", name, kind: entry.kind, points: entry.points, parameters });
    }
    this.entry = null;
    this.rebuild();
    this.active?.svg.focus({ preventScroll: true });
  }

  // A number that was typed into a field: null where it is empty, nothing where it is none.
  number(input, act) {
    const value = input.value.trim() ? parse(input.value) : null;
    if (value !== null && !Number.isFinite(value)) {
      this.notice(`${input.value} is no number`);
      return;
    }
    input.blur();
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
    if (this.entry) return false;
    if (this.tool !== "pick" && this.finish()) return true;
    if (!this.active) return false;
    const focused = document.activeElement?.dataset?.label;
    if (focused && this.tool !== "pick") {
      this.extend(focused);
      return true;
    }
    this.clicked(this.active, ...this.active.inside(...this.active.middle()));
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
    if (!pick) {
      this.active?.view.panBy(-dx * 60, -dy * 60);
      this.active?.moved();
      return true;
    }
    const now = Date.now();
    if (!this.nudgeStep || now - this.nudged > NUDGE_REST_MS || this.nudgedLabel !== this.selected) this.nudgeStep = this.newStep();
    Object.assign(this, { nudged: now, nudgedLabel: this.selected });
    const at = this.active.inside(pick.u + dx * step, pick.v + dy * step);
    this.drag(pick.image, pick.label, at, this.nudgeStep, true);
    this.active.magnify(...at, this.active.view.width / 2, this.active.view.height / 2);
    return true;
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

  async exportAll() {
    this.exported = "busy";
    this.showPanel();
    try {
      const { folder, why } = await this.link.ask({ t: "export" });
      this.exported = folder ?? "";
      if (why) this.notice(why);
    } catch (fault) {
      this.exported = "";
      this.notice(fault.message);
    }
    this.showPanel();
  }

  help() {
    byId("help").showModal();
  }
}

function parse(text) {
  return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(text.trim()) ? Number(text) : NaN;
}

new Desk();
