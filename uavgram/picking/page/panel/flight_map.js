// The map of the flight: place and time of each photo, to check the camera's clock.

import { roving } from "../actions/keys.js";
import { store } from "../connection/store.js";
import { choose, node, shape } from "../elements/dom.js";
import { fixed } from "../elements/numbers.js";
import { keep, titled } from "../elements/table.js";
import { sizeText } from "../elements/units.js";
import { textAt } from "../photos/shapes.js";

/** @import { Photo } from "../connection/protocol.js" */
/** @typedef {{ photo: Photo, k: number, east: number, north: number }} Placed */
/** @typedef {{ x: (east: number) => number, y: (north: number) => number, height: number, scale: number }} Scales */

const [WIDTH, MOST_HEIGHT, LEAST_HEIGHT, EDGE, DOT] = [296, 220, 90, 16, 5];
const [LABEL_WIDTH, LABEL_HEIGHT] = [50, 12];
const UNTIMED = "time not known";

/** Time of day in UTC; empty if unknown. @param {number | null} seconds @param {number} digits of a second */
export const utcText = (seconds, digits, zone = "") => (seconds === null ? "" : `${new Date(seconds * 1000).toISOString().slice(11, digits ? 20 + digits : 19)}${zone}`);

/** @param {(image: number) => void} show @param {number | undefined} current the photo in use */
export function flightMap(show, current) {
  const placed = placedPhotos();
  const track = store.flight?.track ?? [];
  if (!placed.length) return null;
  const part = keep("flight map", [store.photos, track], () => made(placed, track, show));
  const dots = part.querySelector(".dots");
  if (dots) choose(dots, (button) => Number(button.dataset.image) === current, "aria-current");
  // At least one dot is reached with Tab.
  if (dots && !dots.querySelector("[tabindex='0']")) dots.querySelector("button")?.setAttribute("tabindex", "0");
  return part;
}

/** Positioned photos in the order of their times. @returns {Placed[]} */
function placedPhotos() {
  const placed = store.photos.flatMap((photo, k) => {
    const [east, north] = [photo.seed?.east_m ?? null, photo.seed?.north_m ?? null];
    return east === null || north === null ? [] : [{ photo, k, east, north }];
  });
  return placed.sort((a, b) => (a.photo.time_utc_s ?? 0) - (b.photo.time_utc_s ?? 0));
}

/** @param {Placed[]} placed @param {[number, number, number][]} track @param {(image: number) => void} show */
function made(placed, track, show) {
  const scales = scalesOf([...placed.map(({ east, north }) => [east, north]), ...track.map(([, east, north]) => [east, north])]);
  const { x, y, height } = scales;
  const dots = node("div", { class: "dots" }, ...placed.map(({ photo, k, east, north }) => {
    const timed = photo.event?.status === "certain" ? ", by its camera event" : "";
    const dot = node("button", { "data-image": k, class: timed ? "by-event" : "", "aria-label": `${photo.name}, ${utcText(photo.time_utc_s, 1, " UTC") || UNTIMED}`, title: `${photo.name}: ${utcText(photo.time_utc_s, 2, " UTC") || UNTIMED}${timed}${clockText(photo)}`, onclick: () => show(k) });
    Object.assign(dot.style, { left: `${(100 * x(east)) / WIDTH}%`, top: `${(100 * y(north)) / height}%` });
    return dot;
  }));
  roving(dots);
  return titled("Where each photo was taken", node("p", { class: "dim" }, wordsOf(track)),
    node("div", { class: "map" }, drawing(placed, track, scales), dots), elsewhere(placed));
}

/** Time of the camera's own clock. @param {Photo} photo */
const clockText = ({ file_time_s }) => (file_time_s === null ? "" : `; its file says ${utcText(file_time_s, 2)}`);

/** @param {[number, number, number][]} track */
function wordsOf(track) {
  if (!track.length) return "Places as the photos state them, north up.";
  const sigma = store.clock?.sigma_s ?? 0;
  const far = sigma * speedOf(track);
  const reach = far > 0.05 ? ` The camera's clock is known to \u00b1 ${fixed(sigma, 2)} s, which is \u00b1 ${sizeText(Number(far.toPrecision(2)))} along the track.` : "";
  return `Each photo stands where the flight log was at its time (UTC), north up. Does a photo show another place than that? Then the camera's clock is wrong.${reach}`;
}

/** Mean speed. @param {[number, number, number][]} track */
function speedOf(track) {
  const way = track.slice(1).reduce((sum, [, east, north], k) => sum + Math.hypot(east - track[k][1], north - track[k][2]), 0);
  const [first, last] = [track[0], track[track.length - 1]];
  return last[0] > first[0] ? way / (last[0] - first[0]) : 0;
}

// The same scale in both directions.
/** @param {number[][]} places east and north @returns {Scales} */
function scalesOf(places) {
  const [easts, norths] = [places.map(([east]) => east), places.map(([, north]) => north)];
  const [west, south] = [Math.min(...easts), Math.min(...norths)];
  const [wide, high] = [Math.max(...easts) - west, Math.max(...norths) - south];
  const scale = Math.min((WIDTH - 2 * EDGE) / Math.max(wide, 1), (MOST_HEIGHT - 2 * EDGE) / Math.max(high, 1));
  const height = Math.max(high * scale + 2 * EDGE, LEAST_HEIGHT);
  const [left, top] = [(WIDTH - wide * scale) / 2, (height - high * scale) / 2];
  return { x: (east) => left + (east - west) * scale, y: (north) => top + (south + high - north) * scale, height, scale };
}

/** @param {Placed[]} placed @param {[number, number, number][]} track @param {Scales} scales */
function drawing(placed, track, { x, y, height, scale }) {
  const path = track.map(([, east, north]) => `${x(east).toFixed(1)},${y(north).toFixed(1)}`).join(" ");
  const bar = barOf(scale);
  return shape("svg", { viewBox: `0 0 ${WIDTH} ${height}`, role: "img", "aria-label": `Map of the flight with ${placed.length} photos` },
    shape("polyline", { class: "track", points: path }), ...timeLabels(placed, x, y),
    shape("path", { class: "bar", d: `M6 ${height - 5}h${(bar * scale).toFixed(1)}` }), textAt(sizeText(bar), 6, height - 9, "start"));
}

// A round length of about a fifth of the map.
/** @param {number} scale pixels of a metre */
function barOf(scale) {
  const most = WIDTH / 5 / scale;
  const power = 10 ** Math.floor(Math.log10(most));
  return Math.max(...[1, 2, 5].map((one) => one * power).filter((one) => one <= most));
}

// Times beside the first photo, the last, and those between if there is room.
/** @param {Placed[]} placed @param {(east: number) => number} x @param {(north: number) => number} y */
function timeLabels(placed, x, y) {
  const timed = placed.filter(({ photo }) => photo.time_utc_s !== null);
  const order = timed.length > 1 ? [timed[0], timed[timed.length - 1], ...timed.slice(1, -1)] : timed;
  /** @type {[number, number][]} */
  const taken = [];
  return order.flatMap(({ photo, east, north }) => {
    const isRight = x(east) < WIDTH / 2;
    const [left, middle] = [isRight ? x(east) + DOT + 2 : x(east) - DOT - 2 - LABEL_WIDTH, y(north)];
    if (taken.some(([a, b]) => Math.abs(a - left) < LABEL_WIDTH && Math.abs(b - middle) < LABEL_HEIGHT)) return [];
    taken.push([left, middle]);
    return [textAt(utcText(photo.time_utc_s, 0), isRight ? left : left + LABEL_WIDTH, middle + 3.5, isRight ? "start" : "end")];
  });
}

/** Photos without a known place. @param {Placed[]} placed */
function elsewhere(placed) {
  const others = store.photos.filter((_, k) => !placed.some((one) => one.k === k));
  return others.length ? node("p", { class: "dim" }, `Not on the map, because nothing says where ${others.length > 1 ? "they were" : "it was"}: ${others.map(({ name }) => name).join(", ")}.`) : null;
}
