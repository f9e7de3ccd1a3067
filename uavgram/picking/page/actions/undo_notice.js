// A notice of a change, with a button that undoes or modifies it. The button belongs to that change alone: it
// disappears when anything else is changed, here or by another page.

/** @import { Change } from "../connection/protocol.js" */
/** @import { Link } from "../connection/socket.js" */
/** @import { Instead, Notice } from "../elements/notice.js" */

export class Offers {
  /** @param {{ link: Link, notice: Notice }} needs */
  constructor({ link, notice }) {
    this.link = link;
    this.notice = notice;
    /** @type {Change | null} */
    this.about = null;
  }

  /** @param {string} words @param {Change} change that was sent @param {Instead} offer */
  show(words, change, { words: button, act }) {
    this.about = change;
    this.notice.show(words, true, { words: button, act: () => { if (this.isLast(change)) act(); } });
  }

  /** Returns whether no later change is under way. @param {Change} change */
  isLast(change) {
    return (this.link.unconfirmed.at(-1) ?? change) === change;
  }

  /** Withdraws the button after another change. @param {Change | null} answered null: by another page */
  changed(answered) {
    const { about } = this;
    if (!about || answered === about || this.link.unconfirmed.includes(about)) return;
    this.about = null;
    this.notice.withdraw();
  }
}
