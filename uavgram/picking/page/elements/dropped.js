// Files dropped onto the page: the browser would leave the page to show them.

const WHAT_TO_DO = "Files dropped here are not taken. Copy them into the folder of the flight: the program then names those that it can use, and those that it cannot.";

/** @param {(words: string) => void} say */
export function refuseDrops(say) {
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => { event.preventDefault(); say(WHAT_TO_DO); });
}
