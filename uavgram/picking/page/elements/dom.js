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

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, Attribute>} attributes "on...": a listener; false, null and undefined: none, except for aria-...
 * @param {...Child} children
 */
export function node(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name.slice(2), value);
    else if (name.startsWith("aria-")) made.setAttribute(name, `${value}`);
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value === true ? "" : `${value}`);
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

/** @type {WeakMap<Element, string>} */
const signs = new WeakMap();

/** Fills an element if the `sign` of its content is new. @param {Element} element @param {string} sign @param {() => (Node | string)[]} make */
export function fillIfNew(element, sign, make) {
  if (signs.get(element) === sign) return;
  signs.set(element, sign);
  element.replaceChildren(...make());
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
