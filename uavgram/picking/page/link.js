// The socket: one change under way at a time, and of the moves that wait the newest wins.

export class Link {
  constructor(onMessage, onState) {
    this.onMessage = onMessage;
    this.onState = onState;
    this.waiting = [];
    this.under = null;
    this.seq = 0;
    this.asked = new Map();
    this.open();
  }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/socket`);
    this.socket.onopen = () => this.onState(true);
    this.socket.onmessage = (event) => this.receive(JSON.parse(event.data));
    this.socket.onclose = () => {
      this.onState(false);
      this.under = null;
      for (const { no } of this.asked.values()) no(new Error("the connection is gone"));
      this.asked.clear();
      setTimeout(() => this.open(), 1000);
    };
  }

  // A change: its answer comes to all pages as a difference.
  change(message) {
    const last = this.waiting.at(-1);
    const replaces = last && message.t === "place" && last.t === "place" && message.step !== 0
      && last.step === message.step && last.image === message.image && last.label === message.label;
    if (replaces) this.waiting.pop();
    this.waiting.push(message);
    this.next();
  }

  // A question: its answer comes to whoever asked.
  ask(message) {
    const seq = (this.seq += 1);
    return new Promise((yes, no) => {
      if (this.socket.readyState !== WebSocket.OPEN) {
        no(new Error("no connection"));
        return;
      }
      this.asked.set(seq, { yes, no });
      this.socket.send(JSON.stringify({ ...message, seq }));
    });
  }

  next() {
    if (this.under !== null || !this.waiting.length || this.socket.readyState !== WebSocket.OPEN) return;
    const message = this.waiting.shift();
    this.sent = message;
    this.under = this.seq += 1;
    this.socket.send(JSON.stringify({ ...message, seq: this.under }));
  }

  // Changes that the server has not confirmed yet.
  get unconfirmed() {
    return this.under === null ? this.waiting : [this.sent, ...this.waiting];
  }

  get busy() {
    return this.under !== null || this.waiting.length > 0;
  }

  receive(message) {
    if (this.asked.has(message.seq)) {
      const { yes, no } = this.asked.get(message.seq);
      this.asked.delete(message.seq);
      if (message.t === "refused") no(new Error(message.why));
      else yes(message);
      return;
    }
    if (message.seq !== undefined && message.seq === this.under) this.under = null;
    this.onMessage(message);
    this.next();
  }
}
