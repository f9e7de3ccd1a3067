// The numbers beside the photos: points, lengths, measurements and what the program has to say.

import { fixed, missing, node, unitText, withSigma } from "./format.js";
import { adjusted, isSuspect, labels, pickAt, stale, store } from "./store.js";

const KINDS = {
  distance: "Distance", polyline: "Polyline", area: "Area", angle: "Angle",
  line_distance: "Distance from a line", skid_speed: "Skid speed", coordinate: "Coordinate",
};

export function showMeasure(section, desk) {
  const focus = focusIn(section);
  settle(section, [
    missingPart(), entryPart(desk), pickPart(desk), warningsPart(), measurementsPart(desk), lengthsPart(desk), advicePart(desk),
    pointsPart(desk), checksPart(), remarksPart(), outputsPart(desk),
  ].filter(Boolean));
  restore(section, focus);
}

const kept = new Map();

// A part as it was made before, where nothing of it has changed.
function keep(name, sign, make) {
  const before = kept.get(name);
  const now = JSON.stringify(sign);
  if (before?.sign === now) return before.made;
  const made = make();
  kept.set(name, { sign: now, made });
  return made;
}

// Elements that stay are not touched: what is focused in them stays focused.
function settle(section, parts) {
  for (const child of [...section.children]) if (!parts.includes(child)) child.remove();
  parts.forEach((part, k) => { if (section.children[k] !== part) section.insertBefore(part, section.children[k] ?? null); });
}

// What is being typed is left alone when numbers change around it.
function focusIn(section) {
  const at = document.activeElement;
  if (!section.contains(at) || !at.name) return null;
  return { name: at.name, row: at.closest("[data-row]")?.dataset.row, value: at.value, from: at.selectionStart };
}

function restore(section, focus) {
  if (!focus) return;
  const scope = focus.row === undefined ? section : section.querySelector(`[data-row="${CSS.escape(focus.row)}"]`);
  const at = scope?.querySelector(`[name="${focus.name}"]`);
  if (!at) return;
  at.focus({ preventScroll: true });
  if (at.tagName === "INPUT" && at.value !== focus.value) at.value = focus.value;
}

function missingPart() {
  const live = store.live;
  return live?.mode === "none" ? node("p", { class: "why", role: "status" }, live.why) : null;
}

function table(caption, heads, rows) {
  return node("table", { "aria-label": caption },
    node("thead", {}, node("tr", {}, ...heads.map((head) => node("th", { scope: "col" }, head)))),
    node("tbody", {}, ...rows));
}

const remove = (what, act) => node("button", { "aria-label": `Remove ${what}`, title: `Remove ${what}`, onclick: act }, "\u00d7");

function pointsPart(desk) {
  const all = labels();
  if (!all.length) return null;
  const now = adjusted();
  const worst = new Map();
  for (const pick of now?.picks ?? []) {
    const before = worst.get(pick.label);
    if (pick.w !== null && Math.abs(pick.w) > Math.abs(before?.w ?? 0)) worst.set(pick.label, pick);
  }
  const count = new Map();
  for (const pick of store.picks.values()) count.set(pick.label, (count.get(pick.label) ?? 0) + 1);
  const facts = all.map((label) => {
    const point = now?.points[label];
    return { label, fit: worst.get(label), sigma: point ? Math.max(...point.sigma) * 1000 : null, count: count.get(label) };
  });
  const sign = [desk.selected, facts.map(({ label, fit, sigma, count: photos }) => [label, fit?.w, fit?.status, sigma, photos])];
  return keep("points", sign, () => pointsTable(facts, desk));
}

function pointsTable(facts, desk) {
  const rows = facts.map(({ label, fit, sigma, count }) => {
    const kind = store.control.includes(label) ? " control" : store.check.includes(label) ? " check" : "";
    return node("tr", {
      class: desk.selected === label ? "selected" : "", tabindex: 0, "data-row": `point ${label}`,
      onclick: () => desk.select(label), onkeydown: (event) => event.key === "Enter" && desk.select(label),
    }, node("td", { title: label }, label, node("span", { class: "dim" }, kind)), node("td", {}, `${count}`),
    node("td", { class: "value" }, fixed(sigma, sigma < 10 ? 1 : 0)), node("td", { class: "value" }, wCell(fit?.w, fit?.status)));
  });
  return node("div", {}, node("h2", {}, `Points (${facts.length})`), table("Points", ["label", "photos", "\u03c3 mm", "worst w"], rows));
}

function wCell(w, status) {
  if (w === null || w === undefined) return missing;
  return isSuspect(status) ? node("span", { class: "bad" }, `\u25c6 ${fixed(w, 1)}`) : fixed(w, 1);
}

// The pick that is selected: what a person may say of it.
function pickPart(desk) {
  const label = desk.selected;
  const pick = label && desk.active ? pickAt(desk.active.image, label) : null;
  if (!pick) return null;
  const field = (name, caption, value, hint, act) => node("label", {}, caption, node("input", {
    name, value: value ?? "", inputmode: "decimal", placeholder: hint, onchange: (event) => act(event.target),
  }));
  return keep("pick", [pick.image, label, pick.sigma, pick.height], () => node("form", { class: "entry", "data-row": "pick", onsubmit: (event) => event.preventDefault() },
    node("label", { class: "both" }, "Label", node("input", { name: "rename", value: label, maxlength: 64, onchange: (event) => desk.rename(label, event.target.value) })),
    field("sigma", "Sigma, px", pick.sigma, `${store.sigma}`, (input) => desk.number(input, (sigma) => desk.send({ t: "sigma", image: pick.image, label, sigma }))),
    field("height", "Height over ground, m", pick.height, "0", (input) => desk.number(input, (height) => desk.send({ t: "height", label, height })))));
}

function lengthsPart(desk) {
  if (!store.lines.length) return null;
  const now = adjusted();
  const rows = store.lines.map((line) => {
    const fit = now?.lines[line.name];
    const change = (changes) => desk.send({ t: "line", ...line, was: line.name, ...changes });
    return node("tr", { "data-row": `line ${line.name}`, title: `${line.start} \u2013 ${line.end}${line.adjust ? "" : ", withheld"}` },
      node("td", {}, line.name, line.adjust ? null : node("span", { class: "dim" }, " check")),
      node("td", {}, node("input", {
        name: "length", value: line.length, inputmode: "decimal", "aria-label": `${line.name}, taped length in metres`,
        onchange: (event) => desk.number(event.target, (length) => length !== null && change({ length })),
      })),
      node("td", { class: "value" }, fixed(fit?.adjusted, 3)), node("td", { class: "value" }, fixed(fit?.sigma, 3)),
      node("td", { class: "value" }, wCell(fit?.w, fit?.status)),
      node("td", {}, node("button", {
        "aria-label": line.adjust ? `Withhold ${line.name}: only judge it` : `Use ${line.name}`, title: line.adjust ? "Withhold: only judge it" : "Use it",
        onclick: () => change({ adjust: !line.adjust }),
      }, line.adjust ? "\u2713" : "\u25cb"), remove(line.name, () => desk.send({ t: "unline", name: line.name }))));
  });
  return node("div", {}, node("h2", {}, `Lengths (${rows.length})`), table("Known lengths", ["name", "taped m", "adjusted", "\u03c3", "w", ""], rows));
}

function measurementsPart(desk) {
  if (!store.measurements.length) return null;
  const now = adjusted();
  const rows = store.measurements.map((one) => {
    const values = partsOf(one).map(([found, prefix]) => (now?.measurements[found] ? `${prefix}${valueText(now.measurements[found])}` : missing));
    return node("tr", { "data-row": `measure ${one.name}`, title: `${KINDS[one.kind] ?? one.kind}: ${one.points.join(" \u2013 ")}` },
      node("td", { class: "wrap" }, one.name), node("td", { class: "value" }, ...values.flatMap((value, k) => (k ? [node("br"), value] : [value]))),
      node("td", {}, remove(one.name, () => desk.send({ t: "unmeasure", name: one.name }))));
  });
  return node("div", {}, node("h2", {}, `Measurements (${rows.length})`), table("Measurements", ["name", "value \u00b1 \u03c3", ""], rows));
}

// A coordinate is measured as two values.
const partsOf = ({ name, kind }) => (kind === "coordinate" ? [[`${name} east`, "E "], [`${name} north`, "N "]] : [[name, ""]]);

function valueText(found) {
  if (found.unit === "m/s" && found.value !== null) {
    return `${withSigma(found.value * 3.6, found.sigma * 3.6, "km/h")}`;
  }
  return withSigma(found.value, found.sigma, unitText(found.unit));
}

function advicePart(desk) {
  const advice = adjusted()?.advice;
  if (!advice) return null;
  const text = `Tape ${advice.start} \u2013 ${advice.end} (about ${advice.length} m) next: distances between the points would be known to `
    + `${percent(advice.after)} instead of ${percent(advice.now)}.`;
  return node("div", {}, node("h2", {}, "What a further length would bring"), node("p", { class: "value" }, text,
    " ", node("button", { onclick: () => desk.askLength(advice.start, advice.end) }, "Enter it")));
}

const percent = (part) => `${(100 * part).toPrecision(2)} %`;

const remarks = () => store.live?.messages ?? store.opening ?? [];

function warningsPart() {
  const all = remarks().filter((message) => message.level !== "info");
  return keep("warnings", all, () => node("div", { role: "log", "aria-label": "Warnings" }, ...(all.length ? [node("h2", {}, `Warnings (${all.length})`), list(all.slice(0, MOST_WARNINGS)), furtherPart(all.slice(MOST_WARNINGS))] : [])));
}

const MOST_WARNINGS = 3; // the rest folds away: numbers come first

const furtherPart = (more) => (more.length ? node("details", {}, node("summary", {}, `${more.length} more`), list(more)) : "");

function remarksPart() {
  const all = remarks().filter((message) => message.level === "info");
  return all.length ? keep("remarks", all, () => node("div", {}, node("h2", {}, "Remarks"), list(all))) : null;
}

const list = (messages) => node("ul", { class: "messages" }, ...messages.map((message) => node("li", { class: message.level }, message.text)));

function outputsPart(desk) {
  return keep("outputs", [desk.exported], () => node("div", {}, node("h2", {}, "Report and exports"),
    node("p", { class: "dim" }, "Saves, runs the project and writes report, tables, maps, drawing and recording."),
    node("button", { name: "export", disabled: desk.exported === "busy", onclick: () => desk.exportAll() }, desk.exported === "busy" ? "Writing\u2026" : "Write them"),
    desk.exported && desk.exported !== "busy" ? node("p", { role: "status" }, `Written to ${desk.exported}. `,
      node("a", { href: "/report", target: "_blank", rel: "noopener" }, "Open the report"), "; the recording opens with: uavgram view ",
      node("code", {}, `${desk.exported}/recording.rrd`)) : null));
}

// Points that were surveyed and withheld: how far the result is off.
function checksPart() {
  const checks = adjusted()?.checks ?? [];
  if (!checks.length) return null;
  const rows = checks.map(({ label, error, sigma }) => node("tr", {}, node("td", {}, label),
    ...error.map((value, k) => node("td", { class: "value" }, withSigma(value, sigma[k])))));
  return node("div", {}, node("h2", {}, "Check points, m off"), table("Check points", ["label", "east", "north", "up"], rows));
}

// A form that asks for what clicks cannot say: a length's reading, a skid's friction.
function entryPart(desk) {
  const { entry } = desk;
  return entry ? keep("entry", entry, () => entryForm(entry, desk)) : (kept.delete("entry"), null);
}

function entryForm(entry, desk) {
  const field = (name, caption, value, more = {}) => node("label", {}, caption, node("input", { name, value, required: true, ...more }));
  const number = { inputmode: "decimal", autocomplete: "off" };
  const fields = entry.t === "line"
    ? [field("length", `${entry.start} \u2013 ${entry.end}, metres`, entry.length ?? "", number), field("sigma", "Sigma, metres", entry.sigma, number),
      field("name", "Name", entry.name), node("label", {}, "Use", node("select", { name: "use" },
        node("option", { value: "adjust" }, "for the adjustment"), node("option", { value: "check" }, "withheld: only judge")))]
    : [field("name", "Name", entry.name), field("mu", "Friction \u03bc", "0.7", number), field("mu_sigma", "Sigma of \u03bc", "0.05", number)];
  return node("form", { class: "entry", "data-row": "entry", onsubmit: (event) => { event.preventDefault(); desk.entered(new FormData(event.target)); } },
    ...fields, node("div", { class: "both row" }, node("button", { type: "submit" }, "Add (Enter)"),
      node("button", { type: "button", onclick: () => desk.cancel() }, "Cancel (Esc)")));
}

export function showFrames(section) {
  const frames = adjusted()?.frames ?? {};
  const rows = store.photos.map((photo, k) => {
    const picks = [...store.picks.values()].filter((pick) => pick.image === k).length;
    const status = frames[k] ?? (photo.matched ? "matched" : "unmatched");
    return node("tr", {}, node("td", { title: photo.name }, photo.name), node("td", {}, `${picks}`),
      node("td", { class: "wrap" }, photo.matched || !photo.reason ? status : photo.reason),
      node("td", {}, photo.time === null ? missing : new Date(photo.time * 1000).toISOString().slice(11, 23)));
  });
  const matched = store.photos.filter((photo) => photo.matched).length;
  section.replaceChildren(node("h2", {}, `Frames (${matched} of ${store.photos.length} matched)`),
    table("Frames", ["photo", "picks", "status", "UTC"], rows), node("h2", {}, "What was found out"),
    list(store.opening ?? []));
}

export function showCamera(section) {
  const { camera } = store;
  const rows = camera.names.map((name, k) => node("tr", {}, node("td", {}, name), node("td", {}, camera.parameters[k].toPrecision(6)),
    node("td", {}, camera.sigma[k].toPrecision(2))));
  section.replaceChildren(node("h2", {}, "Camera"), node("p", {}, `${camera.name}: ${camera.width} \u00d7 ${camera.height} px, ${camera.model} (${camera.file})`),
    table("Interior orientation", ["parameter", "value", "\u03c3"], rows));
}

export function modeText() {
  if (!store.connected) return ["none", "no connection"];
  if (store.mode === "none" && !stale()) return ["none", "nothing adjusted yet"];
  if (store.mode === "linearised") return ["linearised", "first order"];
  if (stale() || store.mode === "waiting") return ["waiting", "adjusting\u2026"];
  return ["adjusted", `adjusted in ${store.live.seconds.toFixed(2)} s`];
}
