// Errands: about the project as a whole.

import { boardText } from "./camera.js";

export const errandActions = {
  async errand(message) {
    try {
      const said = await this.link.ask(message);
      if (said.why) this.notice(said.why);
      return said;
    } catch (fault) {
      this.notice(fault.message);
      return null;
    }
  },

  async exportAll() {
    if (this.exporting) return;
    this.exporting = true;
    this.showFoot();
    await this.errand({ t: "export" });
    this.exporting = false;
    this.showFoot();
  },

  async listFolders() {
    const said = await this.errand({ t: "folders" });
    if (said?.folders) this.folders = said.folders;
    this.showPanel();
  },

  calibrate(form) {
    return this.errand({ t: "calibrate", folder: Number(form.get("folder")), board: boardText(form), model: form.get("model") });
  },

  async useCamera() {
    if (await this.errand({ t: "use-camera" })) this.notice("The project names this camera now, and was read again.", true);
  },

  async takeAside() {
    const said = await this.errand({ t: "take-aside" });
    if (said?.refused) this.notice(`${said.refused} of the changes do not fit any more and were left out.`);
  },

  discardAside() {
    return this.errand({ t: "discard-aside" });
  },

  async reload() {
    if (await this.errand({ t: "reload" })) this.notice("The project was read again from its files; undo begins anew.", true);
  },
};
