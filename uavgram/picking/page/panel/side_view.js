// A measurement in side view: its points along it, their heights, and the ground below.

import { adjusted, store } from "../connection/store.js";
import { signButton } from "../elements/buttons.js";
import { node, shape } from "../elements/dom.js";
import { fixed, places } from "../elements/numbers.js";
import { cell, keep, table, tableRow, titled } from "../elements/table.js";
import { inLength, lengthUnit } from "../elements/units.js";
import { textAt } from "../photos/shapes.js";
import { KINDS } from "./entry.js";

/** @import { Link } from "../connection/socket.js" */
/** @import { Measurement, SidePoint } from "../connection/protocol.js" */
/** @import { Notice } from "../elements/notice.js" */
/** @import { PageState } from "../actions/page_state.js" */

/** @typedef {{ name: string, points: SidePoint[] }} Shown */
/** @typedef {{ x: (station: number) => number, y: (height: number) => number, times: number, least: number, most: number, length: number }} Scales */

const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [296, 150, 34, 10, 16, 18];
const CONFIDENCE = 1.96; // 95 % of a normal distribution
const LEAST_HEIGHT_M = 0.02; // a flat line is not exaggerated to hills
const TIMES = [100, 50, 20, 10, 5, 2, 1];
const CHARACTER_PX = 6;

export class SideView {
  /** @param {{ state: PageState, link: Link, notice: Notice, show: () => void }} needs */
  constructor({ state, link, notice, show }) {
    this.state = state;
    this.link = link;
    this.notice = notice;
    this.show = show;
    this.asked = ""; // measurement and adjustment of the last question
    this.asking = false;
    /** @type {Shown} */
    this.shown = { name: "", points: [] };
  }

  part() {
    const one = store.measurements.find(({ name }) => name === this.state.side);
    if (!one || one.points.length < 2 || !adjusted()) return null;
    void this.ask(one);
    if (this.shown.name !== one.name || !this.shown.points.length) return null;
    return keep("side", [one, this.shown], () => titled(`${KINDS[one.kind]} ${one.name} from the side`,
      signButton("side", "Close the side view", "\u00d7", () => this.close(), { title: "Close (Esc)" }),
      drawing(one, this.shown.points), numbersPart(this.shown.points)));
  }

  close() {
    this.state.side = null;
    this.show();
  }

  // Asks once for each full adjustment, one question at a time.
  /** @param {Measurement} one */
  async ask(one) {
    const sign = JSON.stringify([one, store.liveFor]);
    if (this.asking || this.asked === sign || store.mode === "linearised") return;
    this.asked = sign;
    this.asking = true;
    try {
      const { points } = await this.link.ask({ t: "side", name: one.name });
      this.shown = { name: one.name, points };
    } catch (fault) {
      this.notice.fault(fault);
    } finally {
      this.asking = false;
    }
    this.show();
  }
}

/** @param {[number | null, number | null]} placed @returns {[number, number]} */
const known = ([value, sigma]) => [value ?? 0, sigma ?? 0];

// Heights are exaggerated if there is room, by a round factor that is shown.
/** @param {SidePoint[]} points @returns {Scales} */
function scalesOf(points) {
  const stations = points.map(({ station_m }) => known(station_m)[0]);
  const heights = points.flatMap(({ height_m, ground_m }) => {
    const [height, sigma] = known(height_m);
    return [height - CONFIDENCE * sigma, height + CONFIDENCE * sigma, known(ground_m)[0]];
  });
  const [first, last, least, most] = [Math.min(...stations), Math.max(...stations), Math.min(...heights), Math.max(...heights)];
  const [width, height] = [WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM];
  const range = Math.max(most - least, LEAST_HEIGHT_M);
  const fit = Math.min(width / Math.max(last - first, 1e-6), height / range);
  const times = TIMES.find((one) => one * fit * range <= height) ?? 1;
  const middle = (least + most) / 2;
  return {
    x: (station) => LEFT + (width - (last - first) * fit) / 2 + (station - first) * fit,
    y: (up) => TOP + height / 2 - (up - middle) * fit * times,
    times, least, most, length: last - first,
  };
}

/** @param {Measurement} one @param {SidePoint[]} points */
function drawing({ name, kind, points: order }, points) {
  const scales = scalesOf(points);
  const { x, y, times, least, most, length } = scales;
  const along = [...points].sort((a, b) => known(a.station_m)[0] - known(b.station_m)[0]);
  /** @param {SidePoint[]} some @param {"height_m" | "ground_m"} what */
  const path = (some, what) => some.map((point) => `${x(known(point.station_m)[0]).toFixed(1)},${y(known(point[what])[0]).toFixed(1)}`).join(" ");
  const drawn = kind === "profile" ? along : order.flatMap((label) => points.filter((point) => point.label === label));
  const closed = ["area", "volume"].includes(kind) ? [...drawn, drawn[0]] : drawn;
  const up = `${fixed(inLength(most - least), 2)} ${lengthUnit()} from the lowest to the highest${times > 1 ? `, heights \u00d7${times}` : ""}`;
  return shape("svg", { class: "side", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: WIDTH, height: HEIGHT, role: "img", "aria-label": `${name} from the side: ${fixed(inLength(length), 2)} ${lengthUnit()} long, ${up}` },
    shape("polyline", { class: "earth", points: path(along, "ground_m") }), shape("polyline", { class: "along", points: path(closed, "height_m") }),
    ...axis(scales, along[0].label), ...along.map((point) => pointShape(point, scales)), ...labelShapes(along, scales));
}

/** @param {Scales} scales @param {string} first */
function axis({ y, times, least, most, length }, first) {
  const digits = Math.min(Math.max(2 - Math.floor(Math.log10(Math.max(most - least, LEAST_HEIGHT_M))), 0), 3) - 1;
  const ticks = most - least > LEAST_HEIGHT_M / 2 ? [least, most] : [(least + most) / 2];
  return [
    ...ticks.map((height) => textAt(fixed(inLength(height), Math.max(digits, 1)), LEFT - 4, y(height) + 4, "end")),
    textAt(`${fixed(inLength(length), places(length / 1000))} ${lengthUnit()}`, WIDTH - RIGHT, HEIGHT - 4, "end"),
    textAt(`heights over ${first}${times > 1 ? `, drawn \u00d7${times}` : ""}; bars 95\u00a0%`, LEFT - 30, HEIGHT - 4, "start"),
  ];
}

/** @param {SidePoint} point @param {Scales} scales */
function pointShape({ station_m, height_m }, { x, y }) {
  const [station] = known(station_m);
  const [height, sigma] = known(height_m);
  const [at, top, foot] = [x(station), y(height + CONFIDENCE * sigma), y(height - CONFIDENCE * sigma)].map((value) => Number(value.toFixed(1)));
  return shape("g", {}, shape("path", { class: "bar", d: `M${at} ${top}V${foot}M${at - 3} ${top}h6M${at - 3} ${foot}h6` }), shape("circle", { class: "dot", cx: at, cy: y(height).toFixed(1), r: 2.5 }));
}

// Labels over their points, each if there is room.
/** @param {SidePoint[]} along @param {Scales} scales */
function labelShapes(along, { x, y }) {
  /** @type {[number, number, number][]} */
  const taken = [];
  return along.flatMap(({ label, station_m, height_m }) => {
    const [station] = known(station_m);
    const [height, sigma] = known(height_m);
    const half = (label.length * CHARACTER_PX) / 2;
    const at = Math.min(Math.max(x(station), half + 1), WIDTH - half - 1);
    const spots = [y(height + CONFIDENCE * sigma) - 5, y(height - CONFIDENCE * sigma) + 13];
    const line = spots.find((spot) => spot > 9 && spot < HEIGHT - BOTTOM && !taken.some(([left, right, there]) => at - half < right && at + half > left && Math.abs(there - spot) < 11));
    if (line === undefined) return [];
    taken.push([at - half, at + half, line]);
    return [textAt(label, at, line, "middle")];
  });
}

/** @param {SidePoint[]} points */
function numbersPart(points) {
  const along = [...points].sort((a, b) => known(a.station_m)[0] - known(b.station_m)[0]);
  return node("details", {}, node("summary", {}, "Numbers"), table("Points from the side", ["point", `along ${lengthUnit()}`, "height", `ground ${lengthUnit()}`], along.map(({ label, station, height, ground }) => tableRow({},
    cell({ class: "named", title: label }, label), ...[station, height, ground].map((words) => cell({ class: "value" }, words))))));
}
