// The picture: decodes frames (newest wins), draws them with what lies over them, measures.

/** @typedef {import('./connection.js').FrameHeader} FrameHeader */

/** Counts what happened in the last two seconds. */
class Rate {
  constructor() {
    /** @type {number[]} */
    this.times = [];
  }
  /** @param {number} now ms */
  count(now) {
    this.times.push(now);
    this.perSecond(now);
  }
  /** @param {number} now */
  perSecond(now) {
    while (this.times.length && now - this.times[0] > 2000) this.times.shift();
    if (this.times.length < 2) return 0;
    return 1000 * (this.times.length - 1) / Math.max(1, now - this.times[0]);
  }
}

export class View {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {(frameIndex: string) => void} acknowledge called for each frame that was shown or left out
   */
  constructor(canvas, acknowledge) {
    this.canvas = canvas;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d', {alpha: false}));
    this.acknowledge = acknowledge;
    /** @type {(context: CanvasRenderingContext2D, header: FrameHeader, width: number, height: number) => void} */
    this.drawOver = () => {};
    /** @type {(header: FrameHeader) => void} */
    this.onShown = () => {};
    /** @type {(header: FrameHeader) => boolean} False: this frame is not to be seen. */
    this.accepts = () => true;
    /** @type {{header: FrameHeader, image: Uint8Array|null}|null} */
    this.next = null;
    this.isDecoding = false;
    /** @type {ImageBitmap|null} */
    this.bitmap = null;
    /** @type {FrameHeader|null} */
    this.header = null;
    this.ratio = 1;  // canvas pixels for each CSS pixel
    this.shownRate = new Rate();
    this.leftOut = 0;
    /** @type {number[]} */
    this.latencies = [];  // of the last frames, ms
    this.lastStamp = 0;
    this.shown = 0;
    this.redrawAsked = false;
  }

  /** Latency from a change here to the picture that shows it: median and worst of the last ones. */
  latency() {
    const sorted = [...this.latencies].sort((a, b) => a - b);
    if (!sorted.length) return null;
    return {median: sorted[sorted.length >> 1], worst: sorted[sorted.length - 1]};
  }

  /** @param {FrameHeader} header @param {Uint8Array} image */
  take(header, image) {
    // A picture that was sent before may be the one that still waits.
    const kept = header.sameImage ? this.next?.image ?? null : image;
    if (this.next) {
      this.leftOut++;
      this.acknowledge(this.next.header.frameIndex);
    }
    this.next = {header, image: kept};
    this.decode();
  }

  async decode() {
    if (this.isDecoding || !this.next) return;
    this.isDecoding = true;
    const {header, image} = this.next;
    this.next = null;
    try {
      if (!this.accepts(header)) return;
      if (image && image.length) {
        const blob = new Blob([/** @type {BlobPart} */ (image)], {type: 'image/jpeg'});
        const bitmap = await createImageBitmap(blob);
        this.bitmap?.close();
        this.bitmap = bitmap;
      }
      this.header = header;
      this.draw();
      this.measure(header);
      this.onShown(header);
    } catch (error) {
      console.warn('a picture that cannot be decoded was left out', error);
    } finally {
      this.isDecoding = false;
      this.acknowledge(header.frameIndex);
      if (this.next) this.decode();
    }
  }

  /** @param {FrameHeader} header */
  measure(header) {
    const now = performance.now();
    this.shownRate.count(now);
    this.shown++;
    const stamp = Number(header.stamp ?? 0);
    if (stamp > this.lastStamp) {
      this.lastStamp = stamp;
      this.latencies.push(now - stamp / 1000);
      if (this.latencies.length > 60) this.latencies.shift();
    }
  }

  /** Makes the canvas as large as it is shown. @param {number} ratio */
  resize(ratio) {
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    this.ratio = ratio;
    if (this.canvas.width === width && this.canvas.height === height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this.draw();
  }

  /** Draws again soon: what lies over the picture has changed. */
  redraw() {
    if (this.redrawAsked) return;
    this.redrawAsked = true;
    requestAnimationFrame(() => {
      this.redrawAsked = false;
      this.draw();
    });
  }

  /** How the picture lies on the canvas: it covers it and keeps its shape. CSS pixels. */
  placement() {
    const width = this.canvas.width / this.ratio, height = this.canvas.height / this.ratio;
    const imageWidth = this.header?.widthPx || width, imageHeight = this.header?.heightPx || height;
    const factor = Math.max(width / imageWidth, height / imageHeight);
    return {x: (width - imageWidth * factor) / 2, y: (height - imageHeight * factor) / 2,
            width: imageWidth * factor, height: imageHeight * factor, factor};
  }

  draw() {
    const {context, canvas} = this;
    context.setTransform(1, 0, 0, 1, 0, 0);
    if (!this.bitmap || !this.header) {
      context.fillStyle = '#10161f';
      context.fillRect(0, 0, canvas.width, canvas.height);
      return;
    }
    const at = this.placement();
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.drawImage(this.bitmap, at.x, at.y, at.width, at.height);
    context.save();
    context.translate(at.x, at.y);
    this.drawOver(context, this.header, at.width, at.height);
    context.restore();
  }

  /** Forgets the picture. */
  clear() {
    this.bitmap?.close();
    this.bitmap = null;
    this.header = null;
    this.latencies = [];
    this.draw();
  }
}
