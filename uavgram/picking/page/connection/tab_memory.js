// What this tab shows, kept for when its page is loaded again.

/** @import { Tab } from "../actions/page_state.js" */
/** @import { ToolName } from "../actions/keys.js" */

const STORED = "uavgram-kept";

/** @typedef {{ image: number, fitted: boolean, middle: [number, number], scale: number }} KeptView */
/** @typedef {{ views: KeptView[], active: number, linked: boolean }} KeptPanes */

/** @typedef {{ settings: string[], why: string }} Doubt settings of the project that a verdict doubts, and its sentence */
/**
 * `folder`: the listed one; `doubt`: to be shown in the set-up; `gone`: the project that this tab showed last; `first`: the tool with which a new project begins; `leftOut`: photos that are being left out or taken back. Numbers of photos hold for `pictures`, their digests.
 * @typedef {{ page?: string, folder?: number | null, doubt?: Doubt, first?: ToolName, leftOut?: { names: string[], isTakenBack: boolean }, gone?: string, tab?: Tab, tool?: ToolName, pictures?: string, drawsIn?: number | null, draft?: string[], panes?: KeptPanes }} Kept
 */

/** Returns what was kept of a page; nothing if another one was shown since. @param {string} page @returns {Kept} */
export function kept(page = location.pathname) {
  /** @type {unknown} */
  const stored = JSON.parse(sessionStorage.getItem(STORED) ?? "{}");
  const all = /** @type {Kept} */ (stored);
  return all.page === page ? all : {};
}

/** @param {Kept} part @param {string} page */
export const keep = (part, page = location.pathname) => sessionStorage.setItem(STORED, JSON.stringify({ ...kept(page), ...part, page }));

export const forgetKept = () => sessionStorage.removeItem(STORED);
