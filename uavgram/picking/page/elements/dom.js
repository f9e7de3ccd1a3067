// Elements: created, found, and updated only if they differ.

/** @typedef {string | number | boolean | null | undefined | ((event: Event) => void)} Attribute */
/** @typedef {Node | string | number | null | undefined} Child */

/** Returns a value after checking its class. @template T @param {abstract new () => T} kind @param {unknown} value @returns {T} */
export function as(kind, value) {
  if (value instanceof kind) return value;
  throw new TypeError(`the page has no ${kind.name} here`);
}

/** @param {string} id */
export const byId = (id) => as(HTMLElement, document.getElementById(id));

/** Names of the listeners that elements have. @type {Set<string>} */
const listened = new Set();

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, Attribute>} attributes "on...": a listener; null and undefined: none; false: none, except for aria-...
 * @param {...Child} children
 */
export function node(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") {
      listened.add(name);
      Object.assign(made, { [name]: value });
    }
    else if (value === null || value === undefined) continue;
    else if (name.startsWith("aria-")) made.setAttribute(name, `${value}`);
    else if (value !== false) made.setAttribute(name, value === true ? "" : `${value}`);
  }
  for (const child of children) if (child !== null && child !== undefined) made.append(typeof child === "number" ? `${child}` : child);
  return made;
}

/** @template {keyof SVGElementTagNameMap} K @param {K} tag @param {Record<string, string | number>} attributes @param {...Node} children */
export function shape(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, `${value}`);
  made.append(...children);
  return made;
}

/** @type {WeakMap<Element, Record<string, string | number>>} */
const attributesPut = new WeakMap();

/** Sets an attribute if its value is new: even setting the same value costs a layout. @param {Element} element @param {string} name @param {string | number} value */
export function put(element, name, value) {
  const before = attributesPut.get(element) ?? {};
  if (before[name] === value) return;
  before[name] = value;
  attributesPut.set(element, before);
  element.setAttribute(name, `${value}`);
}

/** Signs of elements that are filled by themselves. @type {WeakMap<Node, string>} */
const signs = new WeakMap();

/** Fills an element if the `sign` of its content is new. @param {Element} element @param {string} sign @param {() => (Node | string)[]} make */
export function fillIfNew(element, sign, make) {
  if (signs.get(element) === sign) return;
  signs.set(element, sign);
  fillAlike(element, node("div", {}, ...make()));
}

/** Shows these children in an element. Those that stay are not touched. @param {Element} element @param {Node[]} wanted */
export function arrange(element, wanted) {
  for (const child of [...element.childNodes]) if (!wanted.some((one) => one === child)) child.remove();
  wanted.forEach((child, k) => { if (element.childNodes[k] !== child) element.insertBefore(child, element.childNodes[k] ?? null); });
}

// Changes a shown node to what a new one is, and returns it: what is alike stays, with its focus, scroll position
// and pictures, and under a pressed mouse button. A form is exchanged as a whole: its listeners know its fields.
/** @template {Node} N @param {N} shown @param {N} fresh @returns {N} */
export function alike(shown, fresh) {
  if (!(shown instanceof HTMLElement && fresh instanceof HTMLElement)) return shown.isEqualNode(fresh) ? shown : fresh;
  if (shown.tagName !== fresh.tagName || fresh instanceof HTMLFormElement) return fresh;
  putAlike(shown, fresh);
  if (!signs.has(shown)) fillAlike(shown, fresh);
  return shown;
}

const OWN = ["open", "style"]; // a person unfolds a part; the page's policy takes no style as text

// Attributes, style, listeners and value.
/** @param {HTMLElement} shown @param {HTMLElement} fresh */
function putAlike(shown, fresh) {
  for (const name of shown.getAttributeNames()) if (!fresh.hasAttribute(name) && !OWN.includes(name)) shown.removeAttribute(name);
  for (const { name, value } of fresh.attributes) if (shown.getAttribute(name) !== value && !OWN.includes(name)) shown.setAttribute(name, value);
  for (const name of listened) Reflect.set(shown, name, Reflect.get(fresh, name));
  if (shown.style.cssText !== fresh.style.cssText) shown.style.cssText = fresh.style.cssText;
  if (shown instanceof HTMLInputElement) shown.value = as(HTMLInputElement, fresh).value;
}

/** @param {Element} shown @param {Element} fresh */
function fillAlike(shown, fresh) {
  const before = byKey(shown);
  arrange(shown, [...byKey(fresh)].map(([key, child]) => {
    const there = before.get(key);
    return there ? alike(there, child) : child;
  }));
}

// Children by the row that they belong to, their kind, and their number among those alike. A button that does
// something else is another one: nobody shall press it unawares.
/** @param {Element} parent @returns {Map<string, Node>} */
function byKey(parent) {
  /** @type {Map<string, number>} */
  const counts = new Map();
  let row = "";
  return new Map([...parent.childNodes].map((child) => {
    if (child instanceof HTMLElement) row = child.dataset.row ?? row;
    const act = child instanceof HTMLButtonElement ? child.name + (child.value || (child.name ? "" : child.textContent)) : "";
    const kind = JSON.stringify([row, child.nodeName, act]);
    counts.set(kind, (counts.get(kind) ?? 0) + 1);
    return [`${kind}${counts.get(kind)}`, child];
  }));
}

/** Chooses one button of a group, which is then the one reached with Tab. @param {Element} group @param {(button: HTMLElement) => boolean} isChosen @param {string} attribute */
export function choose(group, isChosen, attribute) {
  for (const child of group.children) {
    const button = as(HTMLElement, child);
    button.setAttribute(attribute, `${isChosen(button)}`);
    button.tabIndex = isChosen(button) ? 0 : -1;
  }
}

/** Returns the text of a form's field. @param {FormData} form @param {string} name */
export function textIn(form, name) {
  const value = form.get(name);
  return typeof value === "string" ? value.trim() : "";
}

/** Begins a reason of the server with a capital, where it does not begin with a path. @param {string} words */
export const sentence = (words) => words.replace(/^[a-z]+ /, (word) => word[0].toUpperCase() + word.slice(1));
