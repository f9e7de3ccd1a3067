// Forms that ask for what clicks cannot say: a length's reading, a skid's friction, a name.

import { node } from "./format.js";
import { drop, keep } from "./table.js";

export function entryPart(desk) {
  const { entry } = desk;
  if (!entry) drop("entry");
  return entry ? keep("entry", entry, () => entryForm(entry, desk)) : null;
}

function entryForm(entry, desk) {
  const field = (name, caption, value, more = {}) => node("label", {}, caption, node("input", { name, value, required: true, autocomplete: "off", ...more }));
  const number = { inputmode: "decimal" };
  const name = field("name", "Name", entry.name, { maxlength: 64 });
  const fields = entry.t === "line" ? [
    field("length", `${entry.start} \u2013 ${entry.end}, metres`, entry.length ?? "", number), field("sigma", "Sigma, metres", entry.sigma, number), name,
    node("label", {}, "Use", node("select", { name: "use" }, node("option", { value: "adjust", selected: entry.adjust !== false }, "for the adjustment"),
      node("option", { value: "check", selected: entry.adjust === false }, "withheld: only judge"))),
  ] : [name, ...(entry.kind === "skid_speed" ? [
    field("mu", "Friction \u03bc", entry.parameters?.mu ?? "0.7", number), field("mu_sigma", "Sigma of \u03bc", entry.parameters?.mu_sigma ?? "0.05", number),
  ] : [])];
  const what = entry.t === "line" ? `length ${entry.start} to ${entry.end}` : entry.name;
  return node("form", {
    class: "entry", "data-row": "entry", "aria-label": `${entry.was ? "Change" : "New"} ${what}`,
    onsubmit: (event) => { event.preventDefault(); desk.entered(new FormData(event.target)); },
  }, ...fields, node("div", { class: "both row" }, node("button", { type: "submit" }, entry.was ? "Change (Enter)" : "Add (Enter)"),
    node("button", { type: "button", onclick: () => desk.cancel() }, "Cancel (Esc)")));
}

export function parse(text) {
  return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(text.trim()) ? Number(text) : NaN;
}

// The message that a filled-in form makes, or why it makes none.
export function entryMessage(entry, form) {
  const value = (name) => parse(form.get(name));
  const name = form.get("name").trim();
  const was = entry.was ?? "";
  if (entry.t === "line") {
    const [length, sigma] = [value("length"), value("sigma")];
    if (!(length > 0 && sigma > 0)) return { why: "Length and sigma are numbers in metres greater than 0, such as 11.52 and 0.01." };
    return { message: { t: "line", was, name, start: entry.start, end: entry.end, length, sigma, adjust: form.get("use") === "adjust" } };
  }
  const message = { t: "measure", was, name, kind: entry.kind, points: entry.points };
  if (entry.kind !== "skid_speed") return { message };
  const parameters = { mu: value("mu"), mu_sigma: value("mu_sigma") };
  if (!(parameters.mu > 0 && parameters.mu_sigma >= 0)) return { why: "Friction and its sigma are numbers, such as 0.7 and 0.05." };
  return { message: { ...message, parameters } };
}
