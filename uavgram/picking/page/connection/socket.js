// The socket: one change under way at a time; of the waiting moves only the newest is sent.

/** @import { Answers, Change, Question, ServerMessage } from "./protocol.js" */

import { keyed, leaveIfRefused } from "./key.js";

const AGAIN_AFTER_MS = 1000;
const SILENT_AFTER_MS = 4000;

export class Link {
  /** @param {(message: ServerMessage, answered: Change | null) => void} onMessage @param {(open: boolean) => void} onState @param {(isSilent: boolean) => void} onSilence called when a change has been unanswered for long, and when it is answered */
  constructor(onMessage, onState, onSilence) {
    this.onMessage = onMessage;
    this.onState = onState;
    this.onSilence = onSilence;
    this.silence = 0; // timer
    /** @type {Change[]} */
    this.waiting = [];
    /** @type {{ seq: number, change: Change } | null} */
    this.under = null; // the change that awaits its confirmation
    this.seq = 0;
    this.steps = Date.now(); // makes step numbers of several pages differ
    /** @type {Map<number, { yes: (answer: ServerMessage) => void, no: (fault: Error) => void }>} */
    this.asked = new Map();
    /** @type {((_: null) => void)[]} */
    this.waiters = []; // for the answers to all changes
    this.wasOpen = false;
    this.socket = this.open();
  }

  open() {
    const socket = new WebSocket(`ws://${location.host}${keyed("/socket")}`);
    socket.onopen = () => {
      this.wasOpen = true;
      this.onState(true);
    };
    socket.onmessage = ({ data }) => {
      /** @type {unknown} */
      const message = JSON.parse(`${data}`);
      this.receive(/** @type {ServerMessage} */ (message));
    };
    socket.onclose = () => {
      this.onState(false);
      if (!this.wasOpen) void leaveIfRefused();
      this.under = null;
      this.listen();
      for (const { no } of this.asked.values()) no(new Error("the connection is gone"));
      this.asked.clear();
      this.wake();
      setTimeout(() => { this.socket = this.open(); }, AGAIN_AFTER_MS);
    };
    return socket;
  }

  // Reconnects and reloads the state, as the page has changes unknown to the server.
  reopen() {
    this.socket.close();
  }

  wake() {
    for (const then of this.waiters.splice(0)) then(null);
  }

  newStep() {
    return (this.steps += 1);
  }

  // Sends a change; the answer goes to all pages as a difference.
  /** @param {Change} change */
  change(change) {
    const last = this.waiting.at(-1);
    const replaces = last?.t === "place" && change.t === "place" && change.step
      && last.step === change.step && last.image === change.image && last.label === change.label;
    if (replaces) this.waiting.pop();
    this.waiting.push(change);
    this.next();
  }

  // Sends a question; the answer goes to this page only.
  /** @template {Question} Q @param {Q} question @returns {Promise<Answers[Q["t"]]>} */
  ask(question) {
    const seq = (this.seq += 1);
    return new Promise((yes, no) => {
      if (this.socket.readyState !== WebSocket.OPEN) {
        no(new Error("no connection"));
        return;
      }
      this.asked.set(seq, { yes: (answer) => yes(/** @type {Answers[Q["t"]]} */ (answer)), no });
      this.socket.send(JSON.stringify({ ...question, seq }));
    });
  }

  next() {
    if (this.under || this.socket.readyState !== WebSocket.OPEN) return;
    const change = this.waiting.shift();
    if (!change) return;
    this.under = { seq: (this.seq += 1), change };
    this.socket.send(JSON.stringify({ ...change, seq: this.under.seq }));
    this.listen();
  }

  // Notices when the server leaves a change unanswered.
  listen() {
    clearTimeout(this.silence);
    this.onSilence(false);
    if (this.under) this.silence = setTimeout(() => this.onSilence(true), SILENT_AFTER_MS);
  }

  // Waits until the server has answered all changes, or can no longer do so: a question would overtake them.
  async confirmed() {
    while (this.unconfirmed.length && this.socket.readyState === WebSocket.OPEN) await new Promise((then) => this.waiters.push(then));
  }

  // Changes that the server has not confirmed yet.
  get unconfirmed() {
    return this.under ? [this.under.change, ...this.waiting] : this.waiting;
  }

  /** @param {ServerMessage} message */
  receive(message) {
    const seq = message.seq ?? -1;
    const asked = this.asked.get(seq);
    if (asked) {
      this.asked.delete(seq);
      if (message.t === "refused") asked.no(new Error(message.why));
      else asked.yes(message);
      return;
    }
    const answered = seq === this.under?.seq ? this.under.change : null;
    if (answered) this.under = null;
    this.listen();
    this.onMessage(message, answered);
    this.next();
    this.wake();
  }
}
