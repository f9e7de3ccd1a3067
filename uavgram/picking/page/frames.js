// The tab of frames: which photo is when, how it was matched and seeded, and what is unmatched.

import { fixed, missing, node } from "./format.js";
import { adjusted, picksIn, store } from "./store.js";
import { about, fill, keep, list, table, titled } from "./table.js";

export function showFrames(section, desk) {
  const now = adjusted();
  const facts = store.photos.map((photo, k) => ({ photo, k, picks: picksIn(k).length, found: now?.frames[k] }));
  const sign = [facts, now?.clock, store.clock, store.opening];
  fill(section, [keep("frames", sign, () => node("div", {}, clockPart(now), framesPart(facts, desk), unmatchedPart(facts), foundPart()))]);
}

function clockPart(now) {
  const { clock } = store;
  if (!clock) return titled("Clock", node("p", {}, "There is no flight log: no clock to match."));
  const offset = ({ offset: value, sigma }) => `${fixed(value, 3)} \u00b1 ${fixed(sigma, 3)} s`;
  const events = clock.events ? `: ${clock.events} camera events, ${clock.unused.length ? `${clock.unused.length} without a photo` : "each with its photo"}` : ": photos are matched by their times";
  return titled("Clock", node("p", {}, `Log: ${clock.log}${events}.`),
    node("p", {}, `Camera clock minus UTC: ${offset(clock)} before the adjustment`, now?.clock ? `, ${offset(now.clock)} after it.` : "."));
}

const most = (sigma) => (sigma?.some((one) => one !== null) ? Math.max(...sigma) : null);

function framesPart(facts, desk) {
  const rows = facts.map(({ photo, k, picks, found }) => {
    const seed = most(photo.seed?.sigma);
    const refined = found?.status === "refined" ? most(found.sigma) : null;
    const status = found?.status ?? (photo.matched ? "matched" : "unmatched");
    const utc = photo.time === null ? missing : new Date(photo.time * 1000).toISOString().slice(11, 22);
    const words = [photo.time === null ? "" : `${utc} UTC`, photo.reason, photo.event ? `event ${photo.event.status}, ${fixed(photo.event.residual, 3)} s off` : "",
      photo.seed ? `seed: ${photo.seed.up} m up, direction \u00b1 ${photo.seed.turn}\u00b0` : "", found?.moved ? `moved by ${fixed(found.moved, 2)} m` : ""];
    return node("tr", { title: words.filter(Boolean).join("; "), "data-row": `frame ${k}` },
      node("td", { class: "named ended", title: photo.name }, node("button", { class: "link", name: "show", "aria-label": `Show ${photo.name}`, onclick: () => desk.active?.show(k) }, node("bdi", {}, photo.name))),
      node("td", {}, `${picks}`), node("td", {}, status), node("td", {}, fixed(seed, 2)), node("td", { class: "value" }, fixed(refined, 2)),
      node("td", { class: "wide-only" }, utc));
  });
  const matched = facts.filter(({ photo }) => photo.matched).length;
  return titled(`Frames (${matched} of ${facts.length} matched)`, node("p", { class: "dim" }, "How well the camera's place is known, \u03c3 in metres: from the flight alone (seed), and now."),
    table("Frames", ["photo", "picks", "status", about("seed \u03c3", "before any pick, from the flight log or the given poses"), about("now", "\u03c3 in metres, with all picks and lengths"), node("span", { class: "wide-only" }, "UTC")], rows));
}

function unmatchedPart(facts) {
  const photos = facts.filter(({ photo }) => !photo.matched && photo.reason).map(({ photo }) => ({ level: "warning", text: `${photo.name}: ${photo.reason}` }));
  const count = new Map();
  for (const where of store.clock?.unused ?? []) count.set(where, (count.get(where) ?? 0) + 1);
  const events = [...count].map(([where, many]) => ({ level: "info", text: `${many} camera event${many > 1 ? "s" : ""} ${where}` }));
  const all = [...photos, ...events];
  return all.length ? titled("Unmatched", list(all)) : null;
}

const foundPart = () => (store.opening?.length ? titled("What was found out", list(store.opening)) : null);
