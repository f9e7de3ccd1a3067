// Unsent settings of a folder, kept in this tab when the page is loaded again.

const STORED = "uavgram-setup";

/** @typedef {{ number: number, path: string, fields: [string, string][] }} Begun `fields`: names and contents of fields */

/** @returns {Begun | null} */
function stored() {
  /** @type {unknown} */
  const kept = JSON.parse(sessionStorage.getItem(STORED) ?? "null");
  return /** @type {Begun | null} */ (kept);
}

/** The number of the folder. */
export const begunFolder = () => stored()?.number ?? null;
export const forget = () => sessionStorage.removeItem(STORED);

/** Fills a form with the earlier settings of its folder, and keeps further ones. @param {HTMLFormElement} form @param {{ number: number, path: string }} folder */
export function keepSet(form, { number, path }) {
  const before = stored();
  if (before?.path === path) {
    for (const [name, value] of before.fields) fill(form, name, value);
    for (const one of form.querySelectorAll("input")) if (one.type === "checkbox") one.checked = before.fields.some(([name]) => name === one.name);
  }
  const keep = () => {
    const fields = [...new FormData(form)].map(([name, value]) => [name, typeof value === "string" ? value : ""]);
    sessionStorage.setItem(STORED, JSON.stringify({ number, path, fields }));
  };
  form.addEventListener("input", keep);
  keep();
}

/** @param {HTMLFormElement} form @param {string} name @param {string} value */
function fill(form, name, value) {
  const field = form.elements.namedItem(name);
  if (field instanceof HTMLInputElement || field instanceof HTMLSelectElement || field instanceof RadioNodeList) {
    field.value = value;
  }
  const one = field instanceof RadioNodeList ? form.querySelector(`[name="${CSS.escape(name)}"]:checked`) : field;
  if (one instanceof HTMLElement) one.dispatchEvent(new Event("change")); // update dependent parts
}
