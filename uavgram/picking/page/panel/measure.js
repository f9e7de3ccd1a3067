// The measurements tab: points, lengths, measurements, and remarks of the program.

import { TOOLS } from "../actions/keys.js";
import { adjusted, countsOfPicks, remarks, standsAt, store } from "../connection/store.js";
import { fault } from "../connection/trust.js";
import { linkButton, signButton } from "../elements/buttons.js";
import { as, node, sentence } from "../elements/dom.js";
import { fixed, MISFIT, SIGMA } from "../elements/numbers.js";
import { about, beneath, cell, drop, fill, folded, keep, list, remove, standingSign, table, tableRow, titled, trusted, wCell, withValues } from "../elements/table.js";
import { fieldText, fieldUnit, lengthUnit, parseLength, smallUnit } from "../elements/units.js";
import { entryPart, KINDS } from "./entry.js";
import { firstStepsPart } from "./first_steps.js";
import { plannedPart, plannedPlatesPart } from "./planned.js";
import { pointPart } from "./point.js";
import { proposalParts } from "./proposals.js";
import { placeText } from "./speed.js";

/** @import { SideView } from "./side_view.js" */
/** @import { PageState } from "../actions/page_state.js" */
/** @import { Tool } from "../actions/keys.js" */
/** @import { Tools } from "../actions/tools.js" */
/** @import { Adjusted, Fit, Line, Measured, Measurement, Trust } from "../connection/protocol.js" */
/** @typedef {{ label: string, fit: Fit | undefined, sigma: string, count: number, up: string, trust: Trust | undefined }} PointFacts */

/** @param {Element} section @param {PageState} state @param {number | undefined} image the photo in use @param {Tools} tools @param {SideView} side */
export function showMeasure(section, state, image, tools, side) {
  const steps = firstStepsPart(state);
  const measured = store.measurements.length > 0; // their values come first
  fill(section, () => [
    hintPart(state, tools), entryPart(state.entry, tools), steps && !store.picks.size ? null : missingPart(), measured ? null : steps, plannedPart(tools), plannedPlatesPart(), side.part(), pointPart(state, image, tools), measurementsPart(tools), measured ? steps : null, ...proposalParts(state, image, tools), lengthsPart(tools),
    advicePart(tools), pointsPart(state.selected, tools), knownPart(tools), linesOfPositionPart(), remarksPart(),
  ]);
}

function missingPart() {
  const { live } = store;
  const why = live?.mode === "none" ? live.why : live?.stopped;
  return why ? keep("missing", why, () => node("p", { class: "why", role: "status" }, sentence(why))) : null;
}

// What the next click in the photo does.
const hint = node("p", { class: "hint", role: "status" });
/** @param {PageState} state @param {Tools} tools */
function hintPart({ tool, draft, entry }, { clicks, panes: { active } }) {
  const next = active ? clicks.ahead(active, null) : "";
  const words = [next && `Next click: ${next}.`, ...(tool === "pick" || entry ? [] : drawingHints(TOOLS[tool], draft))].join(" ").trim();
  if (hint.textContent !== words) hint.textContent = words;
  return hint;
}

/** @param {Tool} tool @param {string[]} draft */
function drawingHints({ name, what, least, most, apart }, draft) {
  if (apart && draft.length) return [`${placeText(draft[0])}. Now show another photo (Page Down or the strip), and click where the same thing is there.`];
  if (!draft.length) return [`${name}: ${what}.`];
  return draft.length >= least && !most ? ["A click on the last point, Enter, or another tool ends it."] : draft.length >= least ? ["A click on the same point, or Enter, ends it with this one."] : [];
}

/** @param {string | null} selected @param {Tools} tools */
function pointsPart(selected, tools) {
  const counts = countsOfPicks();
  if (!counts.size) return null;
  const now = adjusted();
  /** @type {Map<string, Fit>} */
  const worst = new Map();
  for (const pick of now?.picks ?? []) {
    const before = worst.get(pick.label);
    if (pick.w !== null && Math.abs(pick.w) > Math.abs(before?.w ?? 0)) worst.set(pick.label, pick);
  }
  const facts = [...counts].map(([label, count]) => {
    const point = now?.points[label];
    const stands = standsAt(label);
    return { label, fit: worst.get(label), sigma: point?.sigma ?? "", count, up: stands ? ` \u2191${stands.height}` : "", trust: point };
  });
  const part = keep("points", [selected, facts.map(({ label, count, up, trust }) => [label, count, up, standing(trust)])], () => pointsTable(facts, selected, tools));
  return withValues(part, facts.map(({ fit, sigma, trust }) => ({ sign: [sigma, standing(trust), fit?.w, fit?.status], make: () => [[trusted(trust, sigma)], [wCell(fit?.w, fit?.status)]] })));
}

/** @param {PointFacts[]} facts @param {string | null} selected @param {Tools} tools */
function pointsTable(facts, selected, tools) {
  const rows = facts.map(({ label, count, up, trust }) => {
    const kind = store.control.includes(label) ? " control" : store.check.includes(label) ? " check" : "";
    const chosen = selected === label;
    return tableRow({ class: chosen ? "selected" : "", "data-row": `point ${label}`, "data-status": trust?.status },
      cell({ class: "named", title: label }, standingSign(trust), linkButton("select", label, () => tools.select(label), { "aria-pressed": chosen }), node("span", { class: "dim", title: up && "over the ground" }, `${kind}${up}`)),
      count, cell(), cell());
  });
  return titled(`Points (${facts.length})`, table("Points", ["label", "photos", about(`(\u00b1) ${smallUnit()}`, `of the distances to the points next to it; ${SIGMA}`), about("misfit", `of its worst mark: ${MISFIT}`)], rows));
}

/** @param {Tools} tools */
function lengthsPart(tools) {
  if (!store.lines.length) return null;
  const now = adjusted();
  const part = keep("lengths", store.lines, () => titled(`Lengths (${store.lines.length})`,
    table("Known lengths", ["name", `taped ${lengthUnit()}`, about("found", "as all marks and lengths together have it"), about("(\u00b1)", SIGMA), about("misfit", MISFIT), ""], store.lines.flatMap((line) => [lengthRow(line, tools), beneath(6, "value")]))));
  const fits = store.lines.map((line) => now?.lines[line.name]);
  const counts = countsOfPicks();
  const lost = store.lines.map(({ start, end }) => [start, end].filter((label) => !counts.has(label)));
  part.querySelectorAll("tr[data-row]").forEach((row, k) => { row.setAttribute("data-status", fits[k]?.status ?? ""); });
  return withValues(part, fits.map((fit, k) => {
    const { adjusted: length = "", sigma = "" } = fit ?? {};
    return {
      sign: [length, sigma, fit?.w, fit?.shows, standing(fit), lost[k]],
      make: () => [[trusted(fit, length)], [trusted(fit, sigma)], [wCell(fit?.w, isFault(fit) ? "suspect" : "", fit?.why)], lost[k].length ? [`Not used: ${lost[k].join(" and ")} ${lost[k].length > 1 ? "are" : "is"} marked in no photo.`] : saidBeneath(fit, fit?.shows)],
    };
  }));
}

/** Displayed part of a status. @param {Trust | undefined} trust */
const standing = (trust) => trust && [trust.status, trust.words, trust.why];

/** Word for a status that is not ok, and the detectable errors. @param {Trust | undefined} trust @param {string | undefined} shows */
function saidBeneath(trust, shows = "") {
  const sign = standingSign(trust, true);
  return sign ? [sign, shows && ": ", shows] : [shows];
}

/** @param {Trust | undefined} trust */
const isFault = (trust) => Boolean(fault(trust));

/** @param {Line} line @param {Tools} tools */
function lengthRow(line, tools) {
  /** @param {Partial<Line>} changes */
  const change = (changes) => tools.send({ t: "line", ...line, was: line.name, ...changes });
  const use = line.adjust ? [`Withhold ${line.name}: only judge it`, "Withhold: only judge it", "\u2713"] : [`Use ${line.name}`, "Use it", "\u25cb"];
  return tableRow({ "data-row": `line ${line.name}`, title: `${line.name}: ${line.start} \u2013 ${line.end}${line.adjust ? "" : ", withheld"}` },
    cell({ class: "named" }, linkButton("change", line.name, () => tools.changeLine(line), { "aria-label": `Change length ${line.name}, ${line.start} to ${line.end}` }),
      line.adjust ? null : node("span", { class: "dim" }, " check")),
    node("input", {
      name: "length", value: fieldText(line.length_m), inputmode: fieldUnit() === "m" ? "decimal" : "text", autocomplete: "off", "aria-label": `${line.name}, taped length in ${fieldUnit()}`,
      onchange: ({ target }) => {
        const input = as(HTMLInputElement, target);
        tools.number(input, (length_m) => { if (length_m !== null) change({ length_m }); }, parseLength);
        input.value = fieldText(line.length_m); // until the change is confirmed and the table made anew
      },
    }),
    cell(), cell(), cell(),
    cell({}, signButton("use", use[0], use[2], () => change({ adjust: !line.adjust }), { "aria-pressed": line.adjust, title: use[1] }),
      remove(line.name, () => tools.send({ t: "remove-line", name: line.name }))));
}

/** @param {Tools} tools */
function measurementsPart(tools) {
  if (!store.measurements.length) return null;
  const now = adjusted();
  const part = keep("measurements", store.measurements, () => titled(`Measurements (${store.measurements.length})`,
    table("Measurements", ["name", about("value (\u00b1)", SIGMA), "", ""], store.measurements.flatMap((one) => [measurementRow(one, tools), beneath(4, "value")]))));
  part.querySelectorAll("tr[data-row]").forEach((row, k) => { row.setAttribute("data-status", worstOf(store.measurements[k])?.status ?? ""); });
  return withValues(part, store.measurements.map((one) => {
    const worst = worstOf(one);
    const values = valuesOf(one, now).flatMap((value, k) => (k ? [node("br"), value] : [value]));
    const found = worst ?? now?.measurements[rowsOf(one)[0]];
    return {
      sign: [values.map((value) => (value instanceof Element ? [value.getAttribute("title"), value.textContent] : value)), standing(found), standing(worst), found?.shows],
      make: () => [[trusted(found, ...values)], [standingSign(worst) ?? ""], saidBeneath(found?.status === "not-checked" ? found : undefined, found?.shows)],
    };
  }));
}

/** A status that is not ok, of a measurement or one of its rows. @param {Measurement} measurement */
const worstOf = (measurement) => rowsOf(measurement).map((row) => adjusted()?.measurements[row]).find((found) => found?.words);

// A coordinate has two rows, with one status.
/** @param {Measurement} measurement */
const rowsOf = ({ name, kind }) => (kind === "coordinate" ? [`${name} east`, `${name} north`] : [name]);

// The lines of a measurement's value. A coordinate has several: east and north, and latitude and longitude;
// a survey that is not tied to the earth has only the first two.
/** @param {Measurement} measurement @param {Adjusted | null} now @returns {(string | Element)[]} */
function valuesOf(measurement, now) {
  const { name, kind } = measurement;
  const rows = rowsOf(measurement);
  const found = rows.flatMap((row) => now?.measurements[row] ?? []);
  if (!now || found.length < rows.length) return [""];
  if (!found[0].text) return [unmeasured(name)];
  const others = found.filter((one) => one.others).map(notUnique);
  if (kind !== "coordinate") return [`${found[0].text}${found[0].grade && ` = ${found[0].grade}`}`, ...others];
  const [east, north] = found;
  return [`E ${east.text}`, `N ${north.text}`, ...[north.earth, east.earth].filter(Boolean), ...others];
}

/** @param {Measured} found */
function notUnique(found) {
  return node("span", { class: "bad", title: "Other solutions explain what was observed as well, and give this: value and uncertainty hold only if the first one is right" }, found.others);
}

/** @param {string} name */
function unmeasured(name) {
  const why = remarks().find(({ code, text }) => code === "measurement-null" && text.includes(`'${name}'`));
  return node("span", { class: "bad", title: why?.text }, "not measured");
}

const ON_EARTH = "East and north of the survey's origin; latitude and longitude in degrees (WGS 84) where it is tied to the earth";

/** @param {Measurement} one @param {Tools} tools */
function measurementRow(one, tools) {
  const kind = KINDS[one.kind] ?? one.kind;
  const points = one.points.join(" \u2013 ");
  return tableRow({ "data-row": `measure ${one.name}`, title: `${kind}: ${points}` },
    cell({ class: "named" }, node("div", { class: "two" }, linkButton("change", one.name, () => tools.changeMeasurement(one), { "aria-label": `Change ${one.name}, ${kind} ${points}` }), node("span", { class: "dim" }, points))),
    cell({ class: "value", title: one.kind === "coordinate" ? ON_EARTH : null }), cell(), remove(one.name, () => tools.send({ t: "remove-measurement", name: one.name })));
}

/** @param {Tools} tools */
function advicePart(tools) {
  const advice = adjusted()?.advice;
  if (!advice) return null;
  return keep("advice", advice, () => titled("What a further length would bring", node("p", { class: "value" }, advice.text),
    node("button", { onclick: () => tools.askLength(advice.start, advice.end) }, "Enter it")));
}

function remarksPart() {
  const all = remarks().filter((message) => message.level === "info");
  if (!all.length) drop("remarks");
  return all.length ? keep("remarks", all, () => folded("Remarks", all.length, {}, list(all))) : null;
}

// Points with known coordinates: those that are picked, and the errors at the withheld ones.
/** @param {Tools} tools */
function knownPart(tools) {
  const known = [...store.control.map((label) => [label, "control"]), ...store.check.map((label) => [label, "check"])];
  if (!known.length) return null;
  const off = new Map((adjusted()?.checks ?? []).map((check) => [check.label, check]));
  const picked = countsOfPicks();
  const sign = [known, [...off.values()], known.map(([label]) => picked.get(label) ?? 0)];
  return keep("known", sign, () => titled("Known points", node("p", { class: "dim" }, `Control points take part; check points are withheld, and judged: ${lengthUnit() === "m" ? "metres" : "feet"} off.`),
    table("Known points", ["label", "use", "photos", "east", "north", "up"], known.map(([label, use]) => {
      const { errors, quantities } = off.get(label) ?? { errors: ["", "", ""], quantities: [] };
      return tableRow({ "data-row": `known ${label}` }, cell({ title: label }, linkButton("name", label, () => tools.name(label), { "aria-label": `Pick ${label}` })), use, picked.get(label) ?? 0,
        ...errors.map((value, k) => cell({ class: "value", title: quantities[k] ?? "" }, value)));
    }))));
}

// Lines of known position: the points picked on each, and their offset from it.
function linesOfPositionPart() {
  const lines = store.controlLines;
  if (!lines.length) return null;
  const found = adjusted()?.control_lines ?? {};
  return keep("lines-of-position", [lines, found], () => titled("Lines of known position", node("p", { class: "dim" }, `Of the points picked on each, the one farthest beside it: ${lengthUnit() === "m" ? "metres" : "feet"} off.`),
    table("Lines of known position", ["line", "points on it", "off", about("misfit", MISFIT), ""], lines.map(({ name, points }) => {
      const fit = found[name];
      return tableRow({ "data-row": `line ${name}` }, cell({ title: name }, node("span", { class: fit?.fits === false ? "bad" : null }, name)), points.join(", "),
        cell({ class: "value" }, fit?.offset), cell({ class: "value" }, fixed(fit?.w, 1)), fit?.status);
    }))));
}
