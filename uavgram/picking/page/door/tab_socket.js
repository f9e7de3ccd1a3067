// The socket of the start page: by it the program knows that a tab is open, and does not end.

import { keyed } from "../connection/key.js";

const AGAIN_AFTER_MS = 2000;

export function keepTab() {
  const socket = new WebSocket(`ws://${location.host}${keyed("/door/tab")}`);
  socket.onclose = () => { setTimeout(keepTab, AGAIN_AFTER_MS); };
}
