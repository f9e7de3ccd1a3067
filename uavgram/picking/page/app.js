// The page: its parts, and the connections between server, panes, panel and keys.

import { buildHelp } from "./actions/help.js";
import { listenToKeys, roving, throughRows } from "./actions/keys.js";
import { Navigation } from "./actions/navigation.js";
import { PageState } from "./actions/page_state.js";
import { ProjectActions } from "./actions/project_actions.js";
import { buildTools } from "./actions/tool_menu.js";
import { Tools } from "./actions/tools.js";
import { Link } from "./connection/socket.js";
import { keep, kept } from "./connection/tab_memory.js";
import { labels, pickKey, picksOf, receive, store } from "./connection/store.js";
import { as, byId, choose, node } from "./elements/dom.js";
import { refuseDrops } from "./elements/dropped.js";
import { icon } from "./elements/icons.js";
import { Notice } from "./elements/notice.js";
import { drop } from "./elements/table.js";
import { goOn } from "./door/server.js";
import { typedForm } from "./panel/entry.js";
import { unfold } from "./panel/first_steps.js";
import { Header } from "./panel/header.js";
import { Panel, TABS } from "./panel/panel.js";
import { SideView } from "./panel/side_view.js";
import { Filmstrip } from "./photos/filmstrip.js";
import { Panes } from "./photos/panes.js";
import { forgetTies } from "./photos/ties.js";
import { onTile } from "./photos/tiles.js";
import { onTone } from "./photos/tone.js";

/** @import { Change, ServerMessage } from "./connection/protocol.js" */
/** @import { PaneEvents } from "./photos/pane.js" */

const [MARKS, VALUES, ALL] = [1, 2, 3]; // levels of refresh
const GONE_AFTER_MS = 3000;

class App {
  constructor() {
    this.due = 0; // level of the refresh in the next frame
    this.losing = 0; // timer
    this.pictures = ""; // digests of the photos
    this.state = new PageState();
    this.header = new Header(() => { if (store.begun) this.panel.showTrust(); });
    this.notice = new Notice(byId("notice"));
    this.link = new Link((message, change) => this.received(message, change), (open) => this.connected(open), (isSilent) => this.silent(isSilent));
    const { state, link, notice } = this;
    this.panes = new Panes({
      state, link, notice, events: {
        entered: (pane) => { if (this.panes.activate(pane) && store.begun) this.panel.show(); },
        shown: () => this.shown(),
        sharpened: () => this.filmstrip.loadThumbnails(),
        clicked: (pane, u, v) => this.tools.clicked(pane, u, v),
        ahead: /** @type {PaneEvents["ahead"]} */ ((pane, at) => this.tools.clicks.ahead(pane, at)),
        doubled: () => this.navigation.doubled(),
        selected: (label) => this.tools.select(label),
        dragged: (...move) => this.tools.drag(...move),
        newStep: () => link.newStep(),
      },
    });
    const { panes } = this;
    this.filmstrip = new Filmstrip(panes);
    this.tools = new Tools({ state, link, notice, panes, rebuild: () => this.rebuild(), moved: () => this.refreshSoon(MARKS), showForms: () => this.panel.setTab("measure") });
    this.navigation = new Navigation({ state, notice, panes, tools: this.tools, newStep: () => link.newStep() });
    this.project = new ProjectActions({ state, link, notice, settle: () => this.tools.settle(), showPanel: () => this.panel.show(), written: () => { this.notice.hide(); this.panel.setTab("results"); },
      stays: () => { this.filmstrip.loadThumbnails(); for (const pane of panes.all) pane.redraw(); } });
    const side = new SideView({ state, link, notice, show: () => this.panel.show() });
    this.panel = new Panel({ state, panes, side, tools: this.tools, project: this.project });
    onTile((image) => { for (const pane of panes.all) if (pane.image === image) pane.redraw(); });
    onTone((image) => { for (const pane of panes.all) if (pane.image === image) { pane.tone.show(image); pane.redraw(); } });
    this.build();
  }

  build() {
    const { tools, panes, navigation, project, state } = this;
    const setPanes = (/** @type {number} */ count) => this.setPanes(count);
    buildTools((tool) => tools.setTool(tool));
    byId("pane-counts").append(...[1, 2, 4].map((count) => node("button", {
      role: "radio", "aria-checked": count === 1, "data-count": count, title: `${count} pane${count === 1 ? "" : "s"} (Ctrl+${count})`, onclick: () => setPanes(count),
    }, count)));
    byId("tabs").append(...TABS.map(([name, words]) => node("button", {
      role: "tab", id: `tab-button-${name}`, "aria-controls": `tab-${name}`, onclick: () => this.panel.setTab(name),
    }, words)));
    choose(byId("tabs"), (button) => button.id === `tab-button-${state.tab}`, "aria-selected");
    for (const t of /** @type {const} */ (["undo", "redo"])) {
      byId(t).append(icon(t));
      byId(t).onclick = () => tools.clicks.step(t);
    }
    byId("door").append(icon("folder"));
    byId("door").onclick = () => void project.leave("");
    byId("linked").onclick = () => panes.toggleLink();
    byId("help-button").onclick = () => navigation.help();
    for (const group of ["pane-counts", "tabs", "strip"]) roving(byId(group));
    throughRows(byId("panel"));
    byId("panel").addEventListener("input", () => this.refreshSoon(VALUES)); // what the next click does depends on a typed reading
    buildHelp(as(HTMLDialogElement, byId("help")), () => this.showSteps());
    refuseDrops((words) => this.notice.show(words));
    listenToKeys({ state, panes, tools, navigation, project, setPanes });
    for (const end of ["visibilitychange", "pagehide"]) addEventListener(end, () => this.keep()); // browsers differ in which comes last
    addEventListener("beforeunload", (event) => { if (typedForm() ?? this.link.unconfirmed.length) event.preventDefault(); }); // the browser asks
  }

  // Messages from the server.

  /** @param {ServerMessage} message @param {Change | null} answered the change answered by it */
  received(message, answered) {
    if (message.t === "closed") {
      if (!store.closing) keep({ gone: store.project });
      goOn();
    }
    if (message.t === "refused") {
      this.notice.show(message.why);
      this.refused(answered);
      if (!Number.isInteger(store.version)) this.link.reopen(); // a drag ran ahead of the server: reload the state
    }
    const moving = this.link.waiting.filter((one) => one.t === "place");
    const isNew = receive(message, new Set(moving.map((move) => pickKey(move.image, move.label))));
    if (message.t === "initial-state") this.begin();
    if (message.t === "initial-state" || message.t === "changed") this.tools.offers.changed(answered);
    if (message.t === "live") this.header.answered = performance.now();
    if (message.t === "saved") this.header.showSaved();
    else if (isNew) this.refreshSoon(message.t === "live" && message.mode === "linearised" ? VALUES : ALL);
    else this.header.showStanding();
    this.panel.showFoot();
  }

  // A connection that is soon restored needs no notice; a lasting loss is shown.
  /** @param {boolean} open */
  connected(open) {
    store.connected = open;
    if (open) {
      clearTimeout(this.losing);
      this.losing = 0;
      store.gone = false;
    } else this.losing ||= setTimeout(() => { store.gone = true; this.panel.showFoot(); }, GONE_AFTER_MS);
    this.header.showMode();
    if (store.begun) this.refreshSoon(ALL);
  }

  /** @param {boolean} isSilent */
  silent(isSilent) {
    if (store.silent === isSilent) return;
    store.silent = isSilent;
    this.panel.showFoot();
  }

  // Restores the fields, so that refused input is not shown as valid.
  /** @param {Change | null} change */
  refused(change) {
    if (change?.t === "rename") this.state.refusedName = { label: change.label, name: change.new };
    if (change?.t === "rename" || change?.t === "merge" || change?.t === "split") this.tools.select(change.label);
    for (const part of ["pick", "lengths"]) drop(part);
    this.refreshSoon(ALL);
  }

  begin() {
    const pictures = store.photos.map((photo) => photo.digest).join();
    if (this.pictures && this.pictures !== pictures) { // other photos have these numbers now
      location.reload();
      return;
    }
    this.pictures = pictures;
    this.project.showLeftOut();
    forgetTies();
    void this.navigation.bringTies();
    this.header.showProject();
    if (!this.panes.all.length) this.resume();
    else for (const pane of this.panes.all) pane.show(pane.image);
    this.sayWhatIsGone();
    const begins = store.opening.find(({ code }) => code === "table-missing" || (store.recovered && code === "pick-recovered"));
    if (begins) this.notice.show(begins.text, true);
    this.tools.suggest();
    byId("panes").dataset.ready = "true";
  }

  // Another tab, or the terminal, opened another project: says so in a tab that showed the former one.
  sayWhatIsGone() {
    const { gone = store.project } = kept();
    keep({ gone: store.project });
    if (gone !== store.project) this.notice.show(`The project ${gone} was saved and closed, as ${store.project} was opened in another tab or from the terminal. To return to ${gone}, choose its folder there.`);
  }

  keep() {
    const { pictures, panes, state: { tab, tool, drawsIn, draft } } = this;
    if (panes.all.length) keep({ tab, tool, drawsIn, draft, pictures, panes: panes.kept });
  }

  // Shows what this tab showed before its page was loaded again.
  resume() {
    const { pictures, panes, tab = this.state.tab, first = "pick", tool = store.lines.length ? "pick" : first } = kept();
    this.state.first = first;
    const isSame = pictures === this.pictures; // else other photos have these numbers
    this.setPanes(isSame && panes ? panes.views.length : 1);
    if (isSame && panes) this.panes.resume(panes);
    if (tab !== this.state.tab) this.panel.setTab(tab);
    if (tool !== this.state.tool) this.tools.setTool(tool);
    if (isSame) this.resumeDraft();
  }

  // Continues a length or measurement of which the first points were clicked.
  resumeDraft() {
    const { drawsIn = null, draft = [] } = kept();
    Object.assign(this.state, { drawsIn, draft: draft.every((label) => picksOf(label).length) ? draft : [] });
  }

  // Drawing.

  // Refreshes once a frame, even after many messages, and only the affected parts of the page.
  /** @param {number} depth */
  refreshSoon(depth) {
    if (!this.due) requestAnimationFrame(() => { const due = this.due; this.due = 0; this.refresh(due); });
    this.due = Math.max(this.due, depth);
  }

  /** @param {number} depth */
  refresh(depth) {
    this.header.showStanding();
    this.header.showMode();
    if (depth === ALL) {
      this.header.showKnownLabels();
      if (this.state.selected && !labels().includes(this.state.selected)) this.state.selected = null;
      this.filmstrip.show();
    }
    this.tools.suggest();
    this.panes.rebuild();
    if (depth >= VALUES) this.panel.show();
  }

  showSteps() {
    this.state.showsSteps = true;
    unfold();
    this.panel.setTab("measure");
  }

  rebuild() {
    this.panes.rebuild();
    this.panel.show();
  }

  /** @param {number} count */
  setPanes(count) {
    this.tools.question.cancel(); // its pane may be removed
    this.panes.setCount(count);
    this.filmstrip.show();
  }

  // Updates the page after a pane has changed its photo.
  shown() {
    const { active } = this.panes;
    this.filmstrip.show();
    if (!active) return;
    if (!this.panes.all.some(({ view, image }) => view === this.state.asked?.view && image === this.state.asked.image)) this.tools.question.cancel();
    this.filmstrip.bring(active.image);
    this.tools.leave();
    this.tools.suggest();
    this.panel.show();
    this.panes.viewed(active);
    void this.navigation.bringTies();
  }
}

new App();
