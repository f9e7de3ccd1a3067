// The start page: a folder of this computer becomes a project, and its page opens.

import { byId, node } from "../elements/dom.js";
import { refuseDrops } from "../elements/dropped.js";
import { forgetKept, keep, kept } from "../connection/tab_memory.js";
import { begunFolder, forget } from "./unsent_settings.js";
import { showFolders } from "./folders.js";
import { keepTab } from "./tab_socket.js";
import { find, goOn, OpenAlready, OpenElsewhere, send, WrongField } from "./server.js";
import { showAtField, showDoubt, showSetup } from "./setup.js";

/** @import { Beginning, ListedFolders, Found, Listed, Wanted } from "../connection/protocol.js" */

/** @typedef {{ number: number | null, isSetup: boolean }} Place a list of folders, or the set-up of one */

function shownPlace() {
  /** @type {unknown} */
  const state = history.state;
  return /** @type {Place | null} */ (state);
}

const SECTIONS = /** @type {const} */ (["folders", "setup"]);

class Door {
  constructor() {
    /** @type {Listed[]} */
    this.recent = [];
    /** @type {Listed[]} */
    this.newest = []; // flights, wherever they are
    /** @type {number | null} */
    this.at = null; // the listed folder
    keepTab();
    refuseDrops((words) => this.trouble(words));
    addEventListener("popstate", () => void this.goBack(shownPlace()));
    void this.begin();
  }

  // The browser's Back and Forward go through the folders and set-ups that were shown.
  /** @param {Place | null} place */
  async goBack(place) {
    if (place) await this.doing("Looking\u2026", () => (place.isSetup && place.number !== null ? this.look(place.number) : this.list(place.number)));
  }

  /** @param {Place} place */
  note(place) {
    const before = shownPlace();
    if (!before) history.replaceState(place, "");
    else if (before.number !== place.number || before.isSetup !== place.isSetup) history.pushState(place, "");
  }

  async begin() {
    /** @type {number | null} */
    let opened = null; // the folder of a project that the program was started with
    await this.doing("Looking\u2026", async () => {
      const { folder, is_chosen, opens, recent, newest } = /** @type {Beginning} */ (await find("/door/beginning"));
      this.recent = recent;
      this.newest = newest;
      this.at = folder;
      const begun = begunFolder(); // from before the page was loaded again
      if (opens) opened = folder;
      else if (is_chosen && folder !== null) await this.look(folder);
      else if (begun !== null) await this.look(begun).catch(() => this.list(folder));
      else await this.list(kept().folder ?? folder).catch(() => this.list(folder));
    });
    if (opened === null) return;
    await this.open({ folder: opened });
    if (!byId("trouble").hidden && byId("folders").hidden) await this.list(null).catch(() => null);
  }

  /** @param {number | null} number */
  async list(number) {
    const shown = /** @type {ListedFolders} */ (await find(`/door/folders?folder=${number ?? ""}`));
    this.at = number;
    keep({ folder: number });
    showFolders(byId("folders"), shown, this, {
      list: (inner) => void this.doing("Looking\u2026", () => this.list(inner)),
      use: (inner) => void this.doing("Looking through the folder\u2026", () => this.look(inner)),
      open: (inner) => void this.open({ folder: inner }),
    });
    this.show("folders");
    this.note({ number, isSetup: false });
  }

  /** @param {number} number */
  async look(number) {
    const found = /** @type {Found} */ (await find(`/door/look?folder=${number}`));
    showSetup(byId("setup"), found, {
      begin: (wanted, hasLengths) => void this.open(wanted, { hasLengths }),
      again: () => void this.doing("Looking through the folder\u2026", () => this.look(number)),
      back: () => { forget(); void this.doing("Looking\u2026", () => this.list(this.at)); },
      wrong: (fault) => this.fail(fault),
    });
    this.show("setup");
    this.note({ number, isSetup: true });
    document.getElementById("setup-title")?.focus();
    const { doubt } = kept();
    if (doubt) showDoubt(byId("setup"), doubt);
    keep({ doubt: undefined });
  }

  /** `closes`: another project that is open; `hasLengths`: the next step is to enter them. @param {Wanted | { folder: number }} wanted */
  async open(wanted, { closes = false, hasLengths = false } = {}) {
    await this.doing("Reading photos and log\u2026", async () => {
      try {
        await send(`/door/begin?closes=${closes ? "yes" : "no"}`, wanted);
      } catch (fault) {
        if ("setup" in wanted && !(fault instanceof OpenElsewhere || fault instanceof OpenAlready)) await this.look(wanted.folder); // what is there now
        if (fault instanceof OpenElsewhere) this.trouble(fault.message, [["Go to it", () => { location.replace(fault.there); }]]);
        else if (!(fault instanceof OpenAlready || "setup" in wanted)) this.trouble(`This project cannot be opened. ${fault instanceof Error ? fault.message : ""}`, [["Read it again", () => void this.open(wanted)]]);
        else if (!(fault instanceof OpenAlready)) throw fault;
        else this.trouble(fault.message, [[`Go to ${fault.open}`, goOn], [`Close ${fault.open} and open ${fault.wanted}`, () => void this.open(wanted, { closes: true, hasLengths })]]);
        return;
      }
      forget();
      forgetKept();
      if (hasLengths) keep({ first: "length" }, "/");
      goOn();
    });
  }

  /** @param {typeof SECTIONS[number]} name */
  show(name) {
    for (const one of SECTIONS) byId(one).hidden = one !== name;
    for (const one of SECTIONS) byId(`at-${one === "folders" ? "folder" : one}`).ariaCurrent = one === name ? "step" : "false";
    window.scrollTo(0, 0);
  }

  // Does one thing at a time; shows slow actions and errors.
  /** @param {string} words @param {() => Promise<void>} act */
  async doing(words, act) {
    if (document.body.ariaBusy === "true") return;
    document.body.ariaBusy = "true";
    this.trouble("");
    byId("busy").textContent = words;
    byId("busy").hidden = false;
    try {
      await act();
    } catch (fault) {
      this.fail(fault);
      if (SECTIONS.every((one) => byId(one).hidden)) await this.list(null).catch(() => null);
    }
    byId("busy").hidden = true;
    document.body.ariaBusy = "false";
  }

  /** @param {unknown} fault */
  fail(fault) {
    if (!(fault instanceof WrongField && showAtField(byId("setup"), fault))) this.trouble(fault instanceof Error ? fault.message : "that failed");
  }

  /** @param {string} why @param {[string, () => void][]} ways remedies, as buttons */
  trouble(why, ways = []) {
    const box = byId("trouble");
    box.replaceChildren(node("p", {}, why), ways.length ? node("div", { class: "answers" }, ...ways.map(([words, act]) => node("button", { type: "button", onclick: act }, words))) : "");
    box.hidden = !why;
    if (why) box.scrollIntoView({ block: "nearest" });
  }
}

new Door();
