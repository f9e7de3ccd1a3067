// The numbers beside the photos: tabs and their foot.

import { byId, choose } from "../elements/dom.js";
import { showCamera } from "./camera.js";
import { showFrames } from "./frames.js";
import { showMeasure } from "./measure.js";
import { showOutputs, showOutside } from "./outputs.js";
import { showResults } from "./results.js";
import { showVerdict } from "./verdict.js";

/** @import { PageState, Tab } from "../actions/page_state.js" */
/** @import { ProjectActions } from "../actions/project_actions.js" */
/** @import { Tools } from "../actions/tools.js" */
/** @import { Panes } from "../photos/panes.js" */
/** @import { SideView } from "./side_view.js" */

/** @type {[Tab, string][]} */
export const TABS = [["measure", "Measure"], ["frames", "Photos"], ["camera", "Camera"], ["results", "Results"]];

export class Panel {
  /** @param {{ state: PageState, panes: Panes, side: SideView, tools: Tools, project: ProjectActions }} needs */
  constructor({ state, panes, side, tools, project }) {
    this.state = state;
    this.side = side;
    this.panes = panes;
    this.tools = tools;
    this.project = project;
  }

  show() {
    const { tab } = this.state;
    const section = byId(`tab-${tab}`);
    for (const [name] of TABS) byId(`tab-${name}`).hidden = name !== tab;
    if (tab === "measure") showMeasure(section, this.state, this.panes.active?.image, this.tools, this.side);
    else if (tab === "results") showResults(section, () => this.show());
    else if (tab === "frames") showFrames(section, (image) => this.panes.active?.show(image), this.panes.active?.image, this.project);
    else showCamera(section, this.state.folders ?? [], this.project);
    this.showTrust();
  }

  // Shows the light, and updates the button that depends on it.
  showTrust() {
    showVerdict(byId("verdict"), this.tools, this.project);
    this.showFoot();
  }

  showFoot() {
    const { tab, exporting } = this.state;
    byId("outputs").hidden = tab !== "measure" && tab !== "results";
    showOutputs(byId("outputs"), exporting, () => void this.project.exportAll(), (work) => void this.project.ask({ t: "stop-work", work }), this.tools.proposals);
    showOutside(byId("outside"), this.project);
  }

  /** @param {Tab} name */
  setTab(name) {
    this.state.tab = name;
    document.body.dataset.tab = name;
    for (const covered of ["panes", "strip"]) byId(covered).inert = name === "results"; // the results cover them
    choose(byId("tabs"), (button) => button.id === `tab-button-${name}`, "aria-selected");
    if (name === "camera" && !this.state.folders) void this.project.listFolders();
    this.show();
  }
}
