// The photos tab: time, match and seed of each photo, and unmatched photos and events.

import { adjusted, picksIn, store } from "../connection/store.js";
import { linkButton, signButton } from "../elements/buttons.js";
import { node } from "../elements/dom.js";
import { fixed } from "../elements/numbers.js";
import { about, cell, fill, folded, keep, list, standingSign, table, tableRow, titled, trusted } from "../elements/table.js";
import { lengthUnit } from "../elements/units.js";
import { flightMap, utcText } from "./flight_map.js";
import { leaveOutButton } from "./verdict.js";

/** @import { ProjectActions } from "../actions/project_actions.js" */
/** @import { Adjusted, ClockOffset, Photo, Remark } from "../connection/protocol.js" */
/** @typedef {{ photo: Photo, k: number, picks: number, found: Adjusted["frames"][number] }} Facts of a photo */

/** @param {Element} section @param {(image: number) => void} show @param {number | undefined} current the photo in use @param {ProjectActions} project */
export function showFrames(section, show, current, project) {
  const now = adjusted();
  const facts = store.photos.map((photo, k) => ({ photo, k, picks: picksIn(k).length, found: now?.frames[k] }));
  fill(section, () => [store.damaged.length ? keep("damaged", [store.opening, store.damaged], () => damagedPart(project)) : null, store.clock ? keep("clock", [now?.clock, store.clock], () => clockPart(now)) : null, flightMap(show, current),
    keep("frames", [facts, store.clock, store.opening, store.leftOut], () => node("div", {}, framesPart(facts, show, project), leftOutPart(project), unmatchedPart(facts), foundPart()))]);
}

/** @param {Adjusted | null} now */
function clockPart(now) {
  const { clock } = store;
  if (!clock) return node("div", {});
  /** @param {ClockOffset} of */
  const offset = ({ text }) => text || "not known";
  const events = clock.events ? `: ${clock.events} camera events, ${clock.unused.length ? `${clock.unused.length} without a photo` : "each with its photo"}` : ": each photo is found in it by its time";
  return titled("Clock", node("p", {}, `Log: ${clock.log}${events}.`),
    node("p", {}, `Camera clock minus UTC: ${offset(clock)} from the flight alone`, now?.clock ? `, ${offset(now.clock)} with all marks and lengths.` : "."));
}

/** Words about a value; empty if it is unknown. @param {string} before @param {string} value @param {string} after */
const told = (before, value, after = "") => (value ? `${before} ${value}${after}` : "");

/** The match of a photo, and its pose from the flight alone. @param {Photo} photo */
const wordsOf = ({ reason, event, seed }) => [
  reason, told("its camera event in the log is", event?.status ?? ""), told("and off by", fixed(event?.residual_s, 3), " s"),
  told("by the flight", seed?.up ?? "", " up"), told("direction \u00b1", fixed(seed?.turn_sigma_deg, 2), "\u00b0"),
];

/** @type {Record<string, string | undefined>} */
const STATUS = { refined: "fitted", seeded: "flight only", rejected: "left out", matched: "placed", unmatched: "not placed" };

// Whether a flight log or positions place the photos, without any pick.
const hasFlight = () => Boolean(store.clock) || store.photos.some(({ matched }) => matched);

/** @param {Facts[]} facts @param {(image: number) => void} show @param {ProjectActions} project */
function framesPart(facts, show, project) {
  const rows = facts.map(({ photo, k, picks, found }) => {
    const refined = found?.status === "refined" ? found.sigma : "";
    const [status, trust] = found ? [found.status, found.standing] : [photo.matched ? "matched" : hasFlight() ? "unmatched" : "", undefined];
    const utc = utcText(photo.time_utc_s, 2);
    return tableRow({ title: [utc && `${utc} UTC`, ...wordsOf(photo), told("moved by", found?.moved ?? "")].filter(Boolean).join("; "), "data-row": `frame ${k}`, "data-status": trust?.status },
      cell({ class: "named ended", title: photo.name }, standingSign(trust), linkButton("show", node("bdi", {}, photo.name), () => show(k), { "aria-label": `Show ${photo.name}` })),
      picks, STATUS[status] ?? status, photo.seed?.sigma, cell({ class: "value" }, trusted(trust, refined)), cell({ class: "wide-only" }, utc),
      cell({}, facts.length > 1 ? signButton("remove", `Leave ${photo.name} out`, "\u00d7", () => void project.leaveOut([photo.name], false)) : null));
  });
  const matched = hasFlight() ? ` (${facts.filter(({ photo }) => photo.matched).length} of ${facts.length} placed in the flight)` : "";
  return titled(`Photos${matched}`, node("p", { class: "dim" }, `How well the camera's place is known (\u00b1), in ${lengthUnit() === "m" ? "metres" : "feet"}: from the flight alone, and now. Distances on the ground may be known far better.`),
    table("Photos", ["photo", "picks", "status", about("flight", "uncertainty before any pick, from the flight log or the given poses"), about("now", "uncertainty with all picks and lengths"), node("span", { class: "wide-only" }, "UTC"), ""], rows));
}

/** @param {ProjectActions} project */
const damagedPart = (project) => titled("Photos that cannot be used", list(store.opening.filter(({ code }) => code === "photo-damaged")), leaveOutButton(project));

/** @param {ProjectActions} project */
const leftOutPart = (project) => (store.leftOut.length ? titled("Left out by the project", table("Photos left out", ["photo", ""],
  store.leftOut.map((name) => tableRow({ title: name, "data-row": `left out ${name}` }, cell({ class: "named", title: name }, node("bdi", {}, name)),
    node("button", { name: "take-back", "aria-label": `Use ${name} again`, onclick: () => void project.leaveOut([name], true) }, "Use again"))))) : null);

/** @param {Facts[]} facts */
function unmatchedPart(facts) {
  /** @type {Pick<Remark, "level" | "text">[]} */
  const photos = facts.filter(({ photo }) => hasFlight() && !photo.matched && photo.reason).map(({ photo }) => ({ level: "warning", text: `${photo.name}: ${photo.reason}` }));
  /** @type {Map<string, number>} */
  const count = new Map();
  for (const where of store.clock?.unused ?? []) count.set(where, (count.get(where) ?? 0) + 1);
  /** @type {Pick<Remark, "level" | "text">[]} */
  const events = [...count].map(([where, many]) => ({ level: "info", text: `${many} camera event${many > 1 ? "s" : ""} ${where}` }));
  const all = [...photos, ...events];
  return all.length ? titled("Not placed in the flight", list(all)) : null;
}

const foundPart = () => (store.opening.length ? folded("What was found out", store.opening.length, {}, list(store.opening)) : null);
