// The key of this tab. The address carries it behind the #, which is sent to no server; and unlike a cookie,
// sessionStorage is sent to no other tab, and to no server of this machine on another port.

const STORED = "uavgram-key";

if (location.hash.length > 1) {
  sessionStorage.setItem(STORED, location.hash.slice(1));
  history.replaceState(null, "", location.pathname);
}

/** Adds the key to an address of the server. @param {string} address */
export const keyed = (address) => `${address}${address.includes("?") ? "&" : "?"}tab=${sessionStorage.getItem(STORED) ?? ""}`;

// Sends a tab without a valid key to the page that explains what to do.
export async function leaveIfRefused() {
  const answer = await fetch(keyed("/key")).catch(() => null);
  if (answer?.status === 403) location.replace("/key");
}
