// Actions on the project as a whole: export, calibration, reloading.

import { store } from "../connection/store.js";
import { keep, kept } from "../connection/tab_memory.js";
import { goOn, send } from "../door/server.js";
import { boardText } from "../panel/camera.js";

/** @import { Doubt } from "../connection/tab_memory.js" */
/** @import { Answers, Question } from "../connection/protocol.js" */
/** @import { Link } from "../connection/socket.js" */
/** @import { Notice } from "../elements/notice.js" */
/** @import { PageState } from "./page_state.js" */

export class ProjectActions {
  /** @param {{ state: PageState, link: Link, notice: Notice, settle: () => boolean, showPanel: () => void, written: () => void, stays: () => void }} needs settle: takes the open form, as the next click does; stays: loads what was not asked for while the project was to be closed */
  constructor({ state, link, notice, settle, showPanel, written, stays }) {
    this.state = state;
    this.link = link;
    this.notice = notice;
    this.settle = settle;
    this.showPanel = showPanel;
    this.written = written;
    this.stays = stays;
  }

  // Returns the answer; undefined if it is refused or fails, which is shown.
  /** @template {Exclude<Question, { t: "snap" | "ground" | "side" | "ties" }>} Q @param {Q} question @returns {Promise<Answers[Q["t"]] | null>} */
  async ask(question) {
    try {
      const answer = await this.link.ask(question);
      if (answer.why) this.notice.show(answer.why);
      return answer;
    } catch (fault) {
      this.notice.fault(fault);
      return null;
    }
  }

  async exportAll() {
    if (this.state.exporting || !this.settle()) return;
    this.state.exporting = true;
    this.showPanel();
    await this.link.confirmed();
    const answer = await this.ask({ t: "export" });
    this.state.exporting = false;
    if (answer?.outputs) this.written();
    else this.showPanel();
  }

  // Saves and closes the project: the start page opens, to choose a folder or to set up this one.
  /** @param {"" | "setup"} to @param {Doubt} [doubt] shown there */
  async leave(to, doubt) {
    if (!this.settle()) return;
    keep({ doubt }, "/");
    await this.link.confirmed();
    store.closing = true;
    try {
      await send(`/door/close?to=${to}`, {});
      goOn();
    } catch (fault) {
      store.closing = false;
      this.notice.fault(fault);
      this.stays();
    }
  }

  async listFolders() {
    const answer = await this.ask({ t: "folders" });
    if (answer) this.state.folders = answer.folders;
    this.showPanel();
  }

  /** @param {FormData} form */
  async calibrate(form) {
    await this.ask({ t: "calibrate", folder: Number(form.get("folder")), board: boardText(form), model: form.get("model") === "fisheye" ? "fisheye" : "brown" });
  }

  async useCamera() {
    if (await this.ask({ t: "use-camera" })) this.notice.show("The project names this camera now, and was read again.", true);
  }

  async takeAside() {
    const answer = await this.ask({ t: "take-aside" });
    if (answer?.refused) this.notice.show(`${answer.refused} of the changes do not fit any more and were left out.`);
  }

  // Leaves photos out of the project, or takes them back; the server reads it again.
  /** @param {string[]} names @param {boolean} isTakenBack */
  async leaveOut(names, isTakenBack) {
    keep({ leftOut: { names, isTakenBack } }); // shown when the project begins anew: the page may be loaded again
    if (!await this.ask({ t: "leave-out", names, is_taken_back: isTakenBack })) keep({ leftOut: undefined });
  }

  // Says once which photos were left out or taken back.
  showLeftOut() {
    const { leftOut } = kept();
    if (!leftOut) return;
    keep({ leftOut: undefined });
    const { names, isTakenBack } = leftOut;
    const which = names.length === 1 ? names[0] : `${names.length} photos`;
    this.notice.show(isTakenBack ? `The project uses ${which} again.` : `The project leaves out ${which}. Under Photos it can be used again.`, true, { words: "Undo", act: () => void this.leaveOut(names, !isTakenBack) });
  }

  async useRecorded() {
    if (await this.ask({ t: "use-recorded" })) this.notice.show("The camera's direction is taken as recorded. In the set-up it can be stated again.", true);
  }

  async reload() {
    if (await this.ask({ t: "reload" })) this.notice.show("The project was read again from its files.", true);
  }
}
