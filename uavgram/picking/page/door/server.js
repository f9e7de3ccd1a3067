// Requests to the server; refusals become errors with their text.

import { keyed, leaveIfRefused } from "../connection/key.js";

/** Another project is open; holds its name, and that of the folder to be opened. */
export class OpenAlready extends Error {
  /** @param {string} why @param {string} open @param {string} wanted */
  constructor(why, open, wanted) {
    super(why);
    this.name = "OpenAlready";
    this.open = open;
    this.wanted = wanted;
  }
}

/** The project is open in another page of the program; holds an address of it. */
export class OpenElsewhere extends Error {
  /** @param {string} why @param {string} there */
  constructor(why, there) {
    super(why);
    this.name = "OpenElsewhere";
    this.there = there;
  }
}

/** What was entered in a field cannot be used; holds the field's name. */
export class WrongField extends Error {
  /** @param {string} why @param {string} field */
  constructor(why, field) {
    super(why);
    this.name = "WrongField";
    this.field = field;
  }
}

const GONE = "The program does not answer: it has ended. Start uavgram again, as before; everything is saved.";

/** Loads the page that the server chooses: the start page, or that of the open project. */
export const goOn = () => { location.replace("/"); };

/** @template T @param {string} address @returns {Promise<T>} */
export const find = (address) => answered(fetch(keyed(address)));

/** @param {string} address @param {unknown} body */
export const send = (address, body) => answered(fetch(keyed(address), { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) }));

/** @template T @param {Promise<Response>} asked @returns {Promise<T>} */
async function answered(asked) {
  const answer = await asked.catch(() => { throw new Error(GONE); });
  if (answer.status === 403) await leaveIfRefused();
  /** @type {unknown} */
  const said = await answer.json().catch(() => ({}));
  if (!answer.ok) {
    const { why = "The program failed; its window says where.", open, wanted = "", there, field } = /** @type {{ why?: string, open?: string, wanted?: string, there?: string, field?: string }} */ (said);
    if (field) throw new WrongField(why, field);
    if (there !== undefined) throw new OpenElsewhere(why, there);
    throw open === undefined ? new Error(why) : new OpenAlready(why, open, wanted);
  }
  return /** @type {T} */ (said);
}
