// The only conversion between pixels of the photo and of the screen. Pixel (0, 0) of a photo is the
// centre of its first pixel, so its left edge is at u = -0.5:  screen = (u + 0.5 - left) * scale.

const MOST_SCALE = 64;

export class View {
  constructor() {
    this.left = 0; // of the window, in photo pixels from the photo's left edge
    this.top = 0;
    this.scale = 1; // CSS pixels per photo pixel
    this.width = 1; // of the window, in CSS pixels
    this.height = 1;
    this.ratio = 1; // device pixels per CSS pixel
  }

  /** @param {number} width @param {number} height @param {number} ratio */
  resize(width, height, ratio) {
    const [u, v] = this.middle;
    Object.assign(this, { width, height, ratio });
    this.center(u, v, this.scale);
  }

  /** @param {number} u @param {number} v @returns {[number, number]} */
  toScreen(u, v) {
    return [(u + 0.5 - this.left) * this.scale, (v + 0.5 - this.top) * this.scale];
  }

  get middle() {
    return this.toPhoto(this.width / 2, this.height / 2);
  }

  // Identifier of the view.
  get sign() {
    return [this.left, this.top, this.scale, this.width, this.height].join();
  }

  /** @param {number} x @param {number} y @returns {[number, number]} */
  toPhoto(x, y) {
    return [x / this.scale + this.left - 0.5, y / this.scale + this.top - 0.5];
  }

  // Starts the window on a whole device pixel of the picture, so that drawing does not shift it and clicks
  // hit the drawn place.
  settle() {
    const step = this.scale * this.ratio;
    this.left = Math.round(this.left * step) / step;
    this.top = Math.round(this.top * step) / step;
  }

  /** @param {number} u @param {number} v @param {number} scale */
  center(u, v, scale) {
    this.scale = Math.min(Math.max(scale, 1e-3), MOST_SCALE);
    this.left = u + 0.5 - this.width / 2 / this.scale;
    this.top = v + 0.5 - this.height / 2 / this.scale;
    this.settle();
  }

  /** @param {number} x @param {number} y @param {number} factor @param {number} least */
  zoomAt(x, y, factor, least) {
    const [u, v] = this.toPhoto(x, y);
    this.scale = Math.min(Math.max(this.scale * factor, least), MOST_SCALE);
    this.left = u + 0.5 - x / this.scale;
    this.top = v + 0.5 - y / this.scale;
    this.settle();
  }

  /** @param {number} dx @param {number} dy */
  panBy(dx, dy) {
    this.left -= dx / this.scale;
    this.top -= dy / this.scale;
    this.settle();
  }

  /** @param {number} width @param {number} height */
  fitScale(width, height) {
    return Math.min(this.width / width, this.height / height);
  }

  /** @param {number} width @param {number} height */
  fit(width, height) {
    this.center((width - 1) / 2, (height - 1) / 2, this.fitScale(width, height));
  }
}
