// Numbers as people read them.

export const missing = "\u2013";

export function fixed(value, digits) {
  if (value === null || value === undefined) return missing;
  const words = value.toFixed(digits);
  return Number(words) === 0 ? words.replace("-", "") : words;
}

// A value with as many digits as its sigma deserves: two digits of the sigma, no more than 3 places.
export function places(sigma) {
  if (!(sigma > 0)) return 3;
  return Math.min(Math.max(1 - Math.floor(Math.log10(sigma)), 0), 3);
}

export function withSigma(value, sigma, unit = "") {
  if (value === null || value === undefined) return missing;
  const digits = places(sigma);
  const error = sigma === null || sigma === undefined ? "" : ` \u00b1 ${sigma.toFixed(digits)}`;
  return `${fixed(value, digits)}${error}${unit && ` ${unit}`}`;
}

const METRES_OF_A_DEGREE = 111_320; // of a great circle

// Latitude or longitude to the digits that its sigma in metres deserves.
export function degrees(value, sigma) {
  const digits = sigma > 0 ? 1 - Math.floor(Math.log10(sigma / METRES_OF_A_DEGREE)) : 7;
  return `${value.toFixed(Math.min(Math.max(digits, 4), 8))}\u00b0`;
}

// A measurement as the page shows it: speeds as on a speedometer.
export function valueText(found) {
  if (found.unit === "m/s" && found.value !== null) return withSigma(found.value * 3.6, found.sigma * 3.6, "km/h");
  return withSigma(found.value, found.sigma, unitText(found.unit));
}

// What other solutions, that fit as well, make of a value; empty where there is none.
export function alternativesText({ alternatives, sigma, unit }) {
  const pace = unit === "m/s" ? 3.6 : 1;
  const words = (alternatives ?? []).map((value) => fixed(pace * value, places(pace * sigma)));
  return words.length ? `or ${words.join(", ")}` : "";
}

export const unitText = (unit) => ({ m2: "m\u00b2", deg: "\u00b0" })[unit] ?? unit;

export const byId = (id) => document.getElementById(id);

export function node(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name.startsWith("aria-")) made.setAttribute(name, `${value}`);
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

const SVG = "http://www.w3.org/2000/svg";

export function shape(tag, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

// Sets an attribute where it is not what it was set to before: setting alone costs a layout.
export function put(element, name, value) {
  element.was ??= {};
  if (element.was[name] === value) return;
  element.was[name] = value;
  element.setAttribute(name, value);
}

// Of a group one button is chosen, and that one is reached with Tab.
export function choose(group, chosen, attribute) {
  for (const button of group.children) {
    button.setAttribute(attribute, chosen(button));
    button.tabIndex = chosen(button) ? 0 : -1;
  }
}
