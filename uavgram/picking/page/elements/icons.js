// Icons of the tools and of a few buttons: lines on 16 x 16, in the colour of the text beside them.

import { shape } from "./dom.js";

const DOT = "a1.2 1.2 0 1 0 2.4 0a1.2 1.2 0 1 0 -2.4 0";
/** @param {number} x @param {number} y */
const dot = (x, y) => `M${x - 1.2} ${y}${DOT}`;

const PATHS = {
  pick: "M8 1v4M8 11v4M1 8h4M11 8h4M6.2 8a1.8 1.8 0 1 0 3.6 0a1.8 1.8 0 1 0 -3.6 0",
  length: "M1 5h14v6.5H1zM4 5v3.5M7 5v2M10 5v3.5M13 5v2", // a ruler
  distance: `${dot(2.5, 12)}${dot(13.5, 4)}M3.7 11L12.3 5`,
  area: "M2.5 13L2 5l6.5-3L14 6l-2 7z",
  polyline: `${dot(2.5, 13)}${dot(6, 5)}${dot(10, 10)}${dot(13.5, 3)}M3.1 12L5.5 6M6.8 6L9.2 9M10.6 9L13 4`,
  height: "M1.5 14h13M8 12V2.5M5 5.5l3-3l3 3",
  profile: "M1 14h14M1 10l4-5l4 3.5l3-6l3 5",
  angle: "M14 13H2L11 3M8 13a6 6 0 0 0 -2 -4.4",
  line_distance: `M1.5 14h13M8 13V5.5M8 11h2v3${dot(8, 3)}`,
  plane_distance: `M1 14.5l4-5h10l-4 5zM8.5 12V5${dot(8.5, 3)}`,
  horizontal_distance: "M2 3v10M14 3v10M4 8h8M6 6L4 8l2 2M10 6l2 2l-2 2",
  vertical_distance: "M2 13.5h12M2 2.5h12M8 4.5v7M6 6.5l2-2l2 2M6 9.5l2 2l2-2",
  slope: "M1.5 13.5h13V5z",
  volume: "M1 13.5h14M2.5 13.5C5 3 11 3 13.5 13.5",
  skid_speed: "M4.5 1.5c0 5 2 7 2 13M10 1.5c0 5 2 7 2 13M7 4h1.5M8 8h1.5M8.7 12h1.5", // two tracks
  coordinate: "M8 15C5 11 3.5 8.6 3.5 6a4.5 4.5 0 0 1 9 0C12.5 8.6 11 11 8 15zM6.5 6a1.5 1.5 0 1 0 3 0a1.5 1.5 0 1 0 -3 0",
  speed: "M2.5 13a6.5 6.5 0 1 1 11 0M8 9.5l3-4", // a dial
  folder: "M1.5 13V3h4.5l1.5 2h7v8z",
  undo: "M3 6.5h7a3.5 3.5 0 0 1 0 7H6M6 3.5L3 6.5l3 3",
  redo: "M13 6.5H6a3.5 3.5 0 0 0 0 7h4M10 3.5l3 3l-3 3",
};

/** @typedef {keyof typeof PATHS} Icon */

/** @param {Icon} name */
export const icon = (name) => shape("svg", { class: "icon", viewBox: "0 0 16 16", width: 16, height: 16, "aria-hidden": "true", "data-icon": name }, shape("path", { d: PATHS[name] }));
