// Choice of the folder with the photos: names only, below the home and the drives of this computer.

import { shape, node } from "../elements/dom.js";

/** @import { ListedFolders, Listed } from "../connection/protocol.js" */

const FOLDER = "M1 3.5h5l1.5 2H15v8H1z";
const folderIcon = () => shape("svg", { class: "folder", viewBox: "0 0 16 16", width: 18, height: 18, "aria-hidden": "true" }, shape("path", { d: FOLDER }));

// Files are counted by their names: whether they are whole is seen when the folder is looked through.
/** @param {number} count */
const photosText = (count) => `${count} photo file${count === 1 ? "" : "s"}`;

/**
 * @param {Element} section @param {ListedFolders} shown @param {{ recent: Listed[], newest: Listed[] }} elsewhere
 * @param {Acts} act
 */
export function showFolders(section, shown, { recent, newest }, act) {
  const { number, way, photos, are_inner, is_flight, folders } = shown;
  section.replaceChildren(
    node("h2", { id: "folders-title" }, "Which folder holds the photos?"),
    node("p", { class: "dim" }, "Copy the photos from the drone's memory card to this computer first, with the flight log if there is one. Nothing here leaves the computer."),
    elsewhere("Opened before", recent, act),
    elsewhere("Newest folders with photos", newest.filter((one) => one.number !== number && !folders.some((listed) => listed.number === one.number)), act),
    node("nav", { class: "crumbs", "aria-label": "Where you are" }, crumb("This computer", number === null, () => act.list(null)),
      ...way.map((one, k) => crumb(one.name, k === way.length - 1, () => act.list(one.number)))),
    number === null ? "" : node("div", { class: "here" },
      node("span", {}, photos ? `${photosText(photos)} ${are_inner ? "in folders of this one" : "here"}` : "No photo files seen here"),
      node("button", { name: "use", class: is_flight ? "main" : "", onclick: () => act.use(number) }, is_flight ? "Use this folder" : "Look through all its folders")),
    folders.length ? node("ul", { class: "folders", "aria-label": "Folders" }, ...folders.map((one) => row(one, act))) : node("p", { class: "dim" }, "No folders in it."));
}

/** @typedef {{ list: (number: number | null) => void, use: (number: number) => void, open: (number: number) => void }} Acts */

/** @param {string} title @param {Listed[]} some @param {Acts} act */
const elsewhere = (title, some, act) => (some.length ? node("div", { class: "recent" }, node("h3", {}, title), node("ul", { class: "folders", "aria-label": title }, ...some.map((one) => row(one, act, one.inside)))) : "");

/** @param {string} words @param {boolean} isHere @param {() => void} go */
const crumb = (words, isHere, go) => node("button", { class: "link", ...(isHere ? { "aria-current": "location" } : {}), onclick: go }, words);

/** @param {Listed} one @param {Acts} act @param {string} inside */
function row({ number, name, photos, is_flight, has_project }, act, inside = "") {
  const holds = [inside && `in ${inside}`, photos ? photosText(photos) : "", has_project ? "project" : ""].filter(Boolean).join(", ");
  return node("li", {}, node("button", { class: "into", name: "into", title: name, onclick: () => act.list(number) }, folderIcon(), node("span", {}, name), node("span", { class: "dim" }, holds)),
    has_project ? node("button", { name: "open", "aria-label": `Open ${name}`, onclick: () => act.open(number) }, "Open") : is_flight ? node("button", { name: "use", "aria-label": `Use ${name}`, onclick: () => act.use(number) }, "Use") : null);
}
