// The tools: those used most as buttons, the others in a menu with explanations.

import { as, byId, choose, node } from "../elements/dom.js";
import { icon } from "../elements/icons.js";
import { roving, TOOLS } from "./keys.js";

/** @import { Tool, ToolName } from "./keys.js" */

/** @type {[ToolName, Tool][]} */
const ALL = Object.entries(TOOLS).map(([name, tool]) => [/** @type {ToolName} */ (name), tool]);

/** @param {(tool: ToolName) => void} setTool */
export function buildTools(setTool) {
  const menu = byId("more-tools");
  for (const [name, { key, name: words, what, more, use = "wanted" }] of ALL) {
    const shown = more ? [node("span", { class: "key" }, key.toUpperCase()), icon(name), node("span", {}, words), node("span", { class: "dim" }, what)] : [icon(name), words];
    (more ? menu : byId("tools")).append(node("button", { role: "radio", "data-tool": name, "data-use": use, title: `${words} (${key.toUpperCase()}): ${what}`, onclick: () => setTool(name) }, ...shown));
  }
  menu.addEventListener("toggle", () => {
    if (!menu.matches(":popover-open")) return;
    const left = Math.min(byId("more").getBoundingClientRect().left, window.innerWidth - menu.offsetWidth - 4);
    menu.style.left = `${Math.max(left, 0)}px`;
    as(HTMLElement, menu.querySelector("[aria-checked=true]") ?? menu.firstElementChild).focus();
  });
  for (const group of ["tools", "more-tools"]) roving(byId(group));
  showTool("pick");
}

/** @param {ToolName} tool */
export function showTool(tool) {
  byId("more-tools").hidePopover();
  for (const group of ["tools", "more-tools"]) choose(byId(group), (button) => button.dataset.tool === tool, "aria-checked");
  const { more, name } = TOOLS[tool];
  if (!more) as(HTMLElement, byId("more-tools").firstElementChild).tabIndex = 0;
  else as(HTMLElement, byId("tools").firstElementChild).tabIndex = 0;
  byId("more").textContent = `${more ? name : "More"} \u25be`;
  byId("more").classList.toggle("chosen", Boolean(more));
}
