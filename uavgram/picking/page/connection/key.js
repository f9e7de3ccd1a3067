// The key of this tab. The address brings it behind its #, which goes to no server; and unlike a cookie, what
// sessionStorage keeps goes to no other tab, and to no server of this machine that has another port.

const STORED = "uavgram-key";

if (location.hash.length > 1) {
  sessionStorage.setItem(STORED, location.hash.slice(1));
  history.replaceState(null, "", location.pathname);
}

/** An address of the server, with the key. @param {string} address */
export const keyed = (address) => `${address}${address.includes("?") ? "&" : "?"}tab=${sessionStorage.getItem(STORED) ?? ""}`;

// A tab without the key, or with that of an earlier server, goes where it reads what helps.
export async function leaveIfRefused() {
  const answer = await fetch(keyed("/key")).catch(() => null);
  if (answer?.status === 403) location.replace("/key");
}
