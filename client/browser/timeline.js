// The time line: a slider over the whole history that sticks to its live edge.

import {formatTime} from './overlays.js';

export class Timeline {
  /**
   * @param {HTMLElement} element role=slider, with .fill and .knob and .hover inside
   * @param {(timeUs: number) => void} seek
   */
  constructor(element, seek) {
    this.element = element;
    this.seek = seek;
    this.fill = /** @type {HTMLElement} */ (element.querySelector('.fill'));
    this.knob = /** @type {HTMLElement} */ (element.querySelector('.knob'));
    this.hover = /** @type {HTMLElement} */ (element.querySelector('.hover'));
    this.oldest = 0;
    this.newest = 0;
    this.time = 0;
    this.dragging = false;
    element.addEventListener('pointerdown', event => {
      element.setPointerCapture(event.pointerId);
      this.dragging = true;
      this.drag(event);
    });
    element.addEventListener('pointermove', event => {
      this.tell(event);
      if (this.dragging) this.drag(event);
    });
    element.addEventListener('pointerup', () => { this.dragging = false; });
    element.addEventListener('lostpointercapture', () => { this.dragging = false; });
    element.addEventListener('pointerleave', () => { this.hover.hidden = true; });
    element.addEventListener('keydown', event => {
      const step = event.shiftKey ? 10e6 : 1e6;
      const to = {ArrowLeft: this.time - step, ArrowRight: this.time + step, PageDown: this.time - 10e6,
                  PageUp: this.time + 10e6, Home: this.oldest}[event.key];
      if (to === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      this.go(to);
    });
  }

  /** @param {PointerEvent} event */
  timeAt(event) {
    const box = this.element.getBoundingClientRect();
    const t = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    return this.oldest + t * (this.newest - this.oldest);
  }

  /** @param {PointerEvent} event */
  drag(event) {
    this.go(this.timeAt(event));
  }

  /** @param {number} timeUs */
  go(timeUs) {
    this.time = Math.round(Math.min(this.newest, Math.max(this.oldest, timeUs)));
    this.show();
    this.seek(this.time);
  }

  /** @param {PointerEvent} event */
  tell(event) {
    const box = this.element.getBoundingClientRect();
    this.hover.hidden = event.pointerType === 'touch' && !this.dragging;
    this.hover.textContent = formatTime(this.timeAt(event));
    this.hover.style.left = `${Math.min(box.width, Math.max(0, event.clientX - box.left))}px`;
  }

  /** @param {number} oldest @param {number} newest @param {number} time microseconds */
  update(oldest, newest, time) {
    this.oldest = oldest;
    this.newest = newest;
    if (!this.dragging) this.time = time;
    this.show();
  }

  show() {
    const span = this.newest - this.oldest;
    const t = span > 0 ? Math.min(1, Math.max(0, (this.time - this.oldest) / span)) : 1;
    this.fill.style.width = this.knob.style.left = `${(100 * t).toFixed(2)}%`;
    this.element.setAttribute('aria-valuemin', (this.oldest / 1e6).toFixed(1));
    this.element.setAttribute('aria-valuemax', (this.newest / 1e6).toFixed(1));
    this.element.setAttribute('aria-valuenow', (this.time / 1e6).toFixed(1));
    this.element.setAttribute('aria-valuetext', formatTime(this.time));
  }
}
