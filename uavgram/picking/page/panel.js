// The tab of measurements: points, lengths, what is measured, and what the program has to say.

import { entryPart, KINDS } from "./entry.js";
import { alternativesText, degrees, fixed, missing, node, valueText, withSigma } from "./format.js";
import { TOOLS } from "./keys.js";
import { placeText } from "./speed.js";
import { adjusted, labels, pickAt, picksOf, stale, store } from "./store.js";
import { about, drop, fill, keep, list, remove, table, titled, wCell, withValues } from "./table.js";

export function showMeasure(section, desk) {
  fill(section, [
    missingPart(), hintPart(desk), entryPart(desk), pickPart(desk), warningsPart(), measurementsPart(desk), lengthsPart(desk), advicePart(desk),
    pointsPart(desk), knownPart(desk), remarksPart(),
  ]);
}

function missingPart() {
  const live = store.live;
  return live?.mode === "none" ? keep("missing", live.why, () => node("p", { class: "why", role: "status" }, live.why)) : null;
}

// What the tool in hand waits for.
const hint = node("p", { class: "hint", role: "status" });
function hintPart({ tool, draft, entry }) {
  const words = tool === "pick" || entry ? "" : hintText(TOOLS[tool], draft);
  if (hint.textContent !== words) hint.textContent = words;
  return hint;
}

function hintText({ name, what, least, most, apart }, draft) {
  if (apart && draft.length) return `${name}. ${placeText(draft[0])}. Now show another photo (Page Down or the strip), and click where the same thing is there. Esc stops.`;
  const begin = `${name}: ${draft.length ? draft.join(" \u2013 ") : what}`;
  if (apart) return `${begin}. Choose where it is in this photo (click, or N B and Enter; Esc stops).`;
  const count = most === least ? least : `${least} or more`;
  const more = !draft.length ? `. Choose ${count} point${count === 1 ? "" : "s"}` : draft.length < least ? `, ${least - draft.length} more` : ", another one, or Enter to end";
  return `${begin}${more} (click, or N B and Enter; Esc stops).`;
}

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
    const sigma = point && all.length > 1 ? Math.max(...point.sigma) * 1000 : null; // within the survey: one alone has none
    return { label, fit: worst.get(label), sigma, count: count.get(label) };
  });
  const sign = [desk.selected, facts.map(({ label, fit, sigma, count: photos }) => [label, fit?.w, fit?.status, sigma, photos])];
  return keep("points", sign, () => pointsTable(facts, desk));
}

function pointsTable(facts, desk) {
  const rows = facts.map(({ label, fit, sigma, count }) => {
    const kind = store.control.includes(label) ? " control" : store.check.includes(label) ? " check" : "";
    const chosen = desk.selected === label;
    return node("tr", { class: chosen ? "selected" : "", "data-row": `point ${label}` },
      node("td", { class: "named", title: label }, node("button", { class: "link", name: "select", "aria-pressed": chosen, onclick: () => desk.select(label) }, label), node("span", { class: "dim" }, kind)),
      node("td", {}, `${count}`), node("td", { class: "value" }, fixed(sigma, sigma < 10 ? 1 : 0)), node("td", { class: "value" }, wCell(fit?.w, fit?.status)));
  });
  return titled(`Points (${facts.length})`, table("Points", ["label", "photos", about("\u03c3 mm", `within the survey; ${SIGMA}`), about("worst w", W)], rows));
}

const SIGMA = "standard deviation: the true value lies within twice as much 19 times out of 20";
const W = "how far it is off, in its own standard deviations; what is above about 3 deserves a second look";

// The point that is selected, and its pick in this photo: what a person may say of them.
function pickPart(desk) {
  const label = desk.selected;
  const [one] = label && !desk.entry ? picksOf(label) : [];
  if (!one || !desk.active) return null;
  const pick = pickAt(desk.active.image, label);
  const field = (name, caption, value, hint, act) => node("label", {}, caption, node("input", {
    name, value: value ?? "", inputmode: "decimal", placeholder: hint, autocomplete: "off", onchange: (event) => act(event.target),
  }));
  return keep("pick", [pick?.image, label, pick?.sigma, one.height], () => node("form", { class: "entry", "data-row": "pick", "aria-label": `Point ${label}`, onsubmit: (event) => { event.preventDefault(); desk.backToPhoto(); } },
    node("label", { class: "both" }, "Label", node("input", { name: "rename", value: label, maxlength: 200, autocomplete: "off", onchange: (event) => desk.rename(label, event.target.value) })),
    pick && field("sigma", "Sigma here, px", pick.sigma, `${store.sigma}`, (input) => desk.number(input, (sigma) => desk.send({ t: "sigma", image: pick.image, label, sigma }))),
    field("height", "Height over ground, m", one.height, "0", (input) => desk.number(input, (height) => desk.send({ t: "height", label, height }))),
    node("button", { type: "submit", hidden: true }, "Done"))); // without it Enter would not end the form
}

function lengthsPart(desk) {
  if (!store.lines.length) return null;
  const now = adjusted();
  const part = keep("lengths", store.lines, () => titled(`Lengths (${store.lines.length})`,
    table("Known lengths", ["name", "taped m", about("adjusted", "in metres, as all observations together have it"), about("\u03c3", SIGMA), about("w", W), ""], store.lines.map((line) => lengthRow(line, desk)))));
  const fits = store.lines.map((line) => now?.lines[line.name]);
  return withValues(part, fits.flatMap((fit) => [[fixed(fit?.adjusted, 3)], [fixed(fit?.sigma, 3)], [wCell(fit?.w, fit?.status)]]));
}

function lengthRow(line, desk) {
  const value = () => node("td", { class: "value" });
  const change = (changes) => desk.send({ t: "line", ...line, was: line.name, ...changes });
  const use = line.adjust ? [`Withhold ${line.name}: only judge it`, "Withhold: only judge it", "\u2713"] : [`Use ${line.name}`, "Use it", "\u25cb"];
  return node("tr", { "data-row": `line ${line.name}`, title: `${line.name}: ${line.start} \u2013 ${line.end}${line.adjust ? "" : ", withheld"}` },
    node("td", { class: "named" }, node("button", { class: "link", name: "change", "aria-label": `Change length ${line.name}, ${line.start} to ${line.end}`, onclick: () => desk.change("line", line) }, line.name),
      line.adjust ? null : node("span", { class: "dim" }, " check")),
    node("td", {}, node("input", {
      name: "length", value: line.length, inputmode: "decimal", autocomplete: "off", "aria-label": `${line.name}, taped length in metres`,
      onchange: ({ target }) => {
        desk.number(target, (length) => length !== null && change({ length }));
        target.value = line.length; // until it is confirmed, and the table made anew
      },
    })),
    value(), value(), value(),
    node("td", {}, node("button", { class: "small", name: "use", "aria-label": use[0], "aria-pressed": line.adjust, title: use[1], onclick: () => change({ adjust: !line.adjust }) }, use[2]),
      remove(line.name, () => desk.send({ t: "unline", name: line.name }))));
}

function measurementsPart(desk) {
  if (!store.measurements.length) return null;
  const now = adjusted();
  const part = keep("measurements", store.measurements, () => titled(`Measurements (${store.measurements.length})`,
    table("Measurements", ["name", "value \u00b1 \u03c3", ""], store.measurements.map((one) => measurementRow(one, desk)))));
  return withValues(part, store.measurements.map((one) => valuesOf(one, now).flatMap((value, k) => (k ? [node("br"), value] : [value]))));
}

// The lines of a measurement's value. A coordinate has several: east and north, and where that is on
// the earth; of a survey that nothing ties to the earth only the first two.
function valuesOf({ name, kind, points }, now) {
  const rows = kind === "coordinate" ? [`${name} east`, `${name} north`] : [name];
  const found = rows.map((row) => now?.measurements[row]);
  if (!found.every(Boolean)) return [missing];
  if (found[0].value === null) return [unmeasured(name)];
  const others = found.filter((one) => one.alternatives?.length).map(notUnique);
  if (kind !== "coordinate") return [valueText(found[0]), ...others];
  const [east, north] = found;
  const [latitude, longitude] = now.earth[points[0]] ?? [];
  return [`E ${valueText(east)}`, `N ${valueText(north)}`, ...(latitude === undefined ? [] : [`lat ${degrees(latitude, north.sigma)}`, `lon ${degrees(longitude, east.sigma)}`]), ...others];
}

function notUnique(found) {
  return node("span", { class: "bad", title: "Other solutions explain what was observed as well, and give this: value and sigma hold only if the first one is right" }, alternativesText(found));
}

function unmeasured(name) {
  const why = remarks().find(({ code, text }) => code === "measurement-null" && text.includes(`'${name}'`));
  return node("span", { class: "bad", title: why?.text }, "not measured");
}

const ON_EARTH = "East and north of the survey's origin in metres; latitude and longitude in degrees (WGS 84) where it is tied to the earth";

function measurementRow(one, desk) {
  const kind = KINDS[one.kind] ?? one.kind;
  const points = one.points.join(" \u2013 ");
  return node("tr", { "data-row": `measure ${one.name}`, title: `${kind}: ${points}` },
    node("td", { class: "named" }, node("button", { class: "link", name: "change", "aria-label": `Change ${one.name}, ${kind} ${points}`, onclick: () => desk.change("measure", one) }, one.name),
      node("span", { class: "dim" }, ` ${points}`)),
    node("td", { class: "value", title: one.kind === "coordinate" ? ON_EARTH : null }), node("td", {}, remove(one.name, () => desk.send({ t: "unmeasure", name: one.name }))));
}

function advicePart(desk) {
  const advice = adjusted()?.advice;
  if (!advice) return null;
  const text = `Tape ${advice.start} \u2013 ${advice.end} (about ${advice.length} m) next: distances between the points would be known to `
    + `${percent(advice.after)} instead of ${percent(advice.now)}. `;
  return keep("advice", advice, () => titled("What a further length would bring", node("p", { class: "value" }, text),
    node("button", { onclick: () => desk.askLength(advice.start, advice.end) }, "Enter it")));
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
  if (!all.length) drop("remarks");
  return all.length ? keep("remarks", all, () => titled("Remarks", list(all))) : null;
}

// Points with known coordinates: which are picked, and how far the withheld ones are off.
function knownPart(desk) {
  const known = [...store.control.map((label) => [label, "control"]), ...store.check.map((label) => [label, "check"])];
  if (!known.length) return null;
  const off = new Map((adjusted()?.checks ?? []).map((check) => [check.label, check]));
  const picked = new Map();
  for (const pick of store.picks.values()) picked.set(pick.label, (picked.get(pick.label) ?? 0) + 1);
  const sign = [known, [...off.values()], known.map(([label]) => picked.get(label) ?? 0)];
  return keep("known", sign, () => titled("Known points", node("p", { class: "dim" }, "Control points take part; check points are withheld, and judged: metres off."),
    table("Known points", ["label", "use", "photos", "east", "north", "up"], known.map(([label, use]) => {
      const { error, sigma } = off.get(label) ?? { error: [null, null, null], sigma: [] };
      return node("tr", { "data-row": `known ${label}` },
        node("td", { title: label }, node("button", { class: "link", name: "name", "aria-label": `Pick ${label}`, onclick: () => desk.name(label) }, label)),
        node("td", {}, use), node("td", {}, `${picked.get(label) ?? 0}`),
        ...error.map((value, k) => node("td", { class: "value", title: value === null ? "" : withSigma(value, sigma[k], "m") }, fixed(value, 3))));
    }))));
}

export function modeText() {
  if (!store.connected) return ["none", "no connection"];
  if (store.mode === "none" && !stale()) return ["none", "nothing adjusted yet"];
  if (store.mode === "linearised") return ["linearised", "to first order"];
  if (stale() || store.mode === "waiting") return ["waiting", "adjusting\u2026"];
  return ["adjusted", `adjusted in ${store.live.seconds.toFixed(2)} s`];
}
