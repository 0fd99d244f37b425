// Mouse, touch and keys that move the camera. One object holds what is pressed.

import {add, scale, sub} from './camera.js';

/**
 * @typedef {{
 *   camera: () => import('./camera.js').OrbitCamera|null,
 *   moved: () => void,
 *   click: (x: number, y: number) => void,
 *   groundZ: () => number,
 *   placement: () => {x: number, y: number, width: number, height: number},
 *   following: () => boolean,
 * }} Host  Coordinates are CSS pixels of the canvas.
 */

const CLICK_PX = 5;
const FLY_KEYS = ['w', 'a', 's', 'd', 'q', 'e'];

export class Controls {
  /** @param {HTMLElement} element @param {Host} host */
  constructor(element, host) {
    this.element = element;
    this.host = host;
    /** @type {Map<number, {x: number, y: number}>} */
    this.pointers = new Map();
    this.wasMoved = false;
    this.start = {x: 0, y: 0};
    this.action = 'orbit';
    /** @type {import('./camera.js').Point|null} */
    this.grabbed = null;
    this.pressed = new Set();
    this.isFast = false;
    this.flyingSince = 0;

    element.addEventListener('pointerdown', event => this.down(event));
    element.addEventListener('pointermove', event => this.move(event));
    element.addEventListener('pointerup', event => this.up(event));
    element.addEventListener('pointercancel', event => this.forget(event));
    element.addEventListener('lostpointercapture', event => this.forget(event));
    element.addEventListener('wheel', event => this.wheel(event), {passive: false});
    element.addEventListener('contextmenu', event => event.preventDefault());
    window.addEventListener('blur', () => this.pressed.clear());
    window.addEventListener('keyup', event => {
      this.pressed.delete(event.key.toLowerCase());
      this.isFast = event.shiftKey;
    });
  }

  /** Pixel of the picture under a pointer. @param {{clientX: number, clientY: number}} event */
  at(event) {
    const box = this.element.getBoundingClientRect(), picture = this.host.placement();
    return {x: event.clientX - box.left - picture.x, y: event.clientY - box.top - picture.y};
  }

  /** @param {PointerEvent} event */
  down(event) {
    this.element.focus({preventScroll: true});
    this.element.setPointerCapture(event.pointerId);
    const at = this.at(event);
    this.pointers.set(event.pointerId, at);
    this.action = event.button === 1 || event.button === 2 || event.shiftKey ? 'pan' : 'orbit';
    if (this.pointers.size === 1) {
      this.start = at;
      this.wasMoved = false;
      this.grabbed = null;
    } else {
      this.wasMoved = true;  // two fingers are never a click
    }
    event.preventDefault();
  }

  /** @param {PointerEvent} event */
  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const at = this.at(event);
    const camera = this.host.camera();
    if (!camera) return;
    if (!this.wasMoved && Math.hypot(at.x - this.start.x, at.y - this.start.y) < CLICK_PX) return;
    if (this.pointers.size === 1) {
      if (!this.wasMoved) this.wasMoved = true;
      if (this.action === 'pan') this.pan(camera, before, at);
      else camera.orbit((at.x - before.x) * 0.006, (at.y - before.y) * 0.006);
    } else if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1] ?? before;
      const spread = Math.hypot(before.x - other.x, before.y - other.y);
      const now = Math.hypot(at.x - other.x, at.y - other.y);
      const middle = {x: (at.x + other.x) / 2, y: (at.y + other.y) / 2};
      const middleBefore = {x: (before.x + other.x) / 2, y: (before.y + other.y) / 2};
      if (spread > 10 && now > 10) this.zoomAt(camera, spread / now, middle);
      this.pan(camera, middleBefore, middle);
    }
    this.pointers.set(event.pointerId, at);
    this.host.moved();
  }

  /** The ground under the pointer goes along with it.
   * @param {import('./camera.js').OrbitCamera} camera @param {{x: number, y: number}} from
   * @param {{x: number, y: number}} to */
  pan(camera, from, to) {
    if (this.host.following()) return;
    const {width, height} = this.host.placement();
    const a = camera.groundAt(from.x, from.y, width, height, this.host.groundZ());
    const b = camera.groundAt(to.x, to.y, width, height, this.host.groundZ());
    const by = sub(a, b), most = camera.distance * 0.5;
    const size = Math.hypot(by[0], by[1], by[2]);
    camera.move(size > most ? scale(by, most / size) : by);
  }

  /** @param {import('./camera.js').OrbitCamera} camera @param {number} factor
   * @param {{x: number, y: number}} at */
  zoomAt(camera, factor, at) {
    const {width, height} = this.host.placement();
    const z = this.host.groundZ() + camera.zoomHeight();
    const fixed = this.host.following() ? camera.target : camera.groundAt(at.x, at.y, width, height, z);
    camera.zoom(factor, fixed);
  }

  /** @param {PointerEvent} event */
  up(event) {
    if (!this.pointers.has(event.pointerId)) return;
    const at = this.at(event);
    this.pointers.delete(event.pointerId);
    if (!this.wasMoved && this.action === 'orbit' && this.pointers.size === 0) this.host.click(at.x, at.y);
  }

  /** @param {PointerEvent} event */
  forget(event) {
    this.pointers.delete(event.pointerId);
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const camera = this.host.camera();
    if (!camera) return;
    const lines = event.deltaMode === 1 ? 32 : 1;
    const delta = Math.max(-240, Math.min(240, event.deltaY * lines));
    this.zoomAt(camera, Math.exp(delta * 0.0016), this.at(event));
    this.host.moved();
  }

  /** Keys that are held to move. @param {KeyboardEvent} event @returns {boolean} taken */
  keyDown(event) {
    const key = event.key.toLowerCase();
    this.isFast = event.shiftKey;
    if (FLY_KEYS.includes(key) || key.startsWith('arrow') || key === '+' || key === '=' || key === '-') {
      if (!this.host.camera()) return false;
      const wasFlying = this.pressed.size > 0;
      this.pressed.add(key);
      if (!wasFlying) {
        this.flyingSince = performance.now();
        requestAnimationFrame(now => this.fly(now, now - 16));
      }
      return true;
    }
    return false;
  }

  /** Moves for as long as a key is held. @param {number} now @param {number} before ms */
  fly(now, before) {
    const camera = this.host.camera();
    if (!this.pressed.size || !camera) return;
    const seconds = Math.min(0.1, (now - before) / 1000);
    const fast = this.isFast ? 4 : 1;
    const has = /** @param {string} key */ key => Number(this.pressed.has(key));
    const {right} = camera.axes();
    /** @type {import('./camera.js').Point} */
    const ahead = [-Math.cos(camera.yaw), -Math.sin(camera.yaw), 0];
    // Starts gently, so that a tap is a small step.
    const eased = Math.min(1, 0.35 + (now - this.flyingSince) / 600);
    const way = Math.max(2, camera.distance * 0.7) * fast * seconds * eased;
    let by = add(scale(ahead, (has('w') - has('s')) * way), scale(right, (has('d') - has('a')) * way));
    by = add(by, [0, 0, (has('e') - has('q')) * way * 0.6]);
    if (!this.host.following()) camera.move(by);
    const turn = 1.4 * seconds * fast * eased;
    camera.orbit((has('arrowleft') - has('arrowright')) * turn, (has('arrowup') - has('arrowdown')) * turn * 0.7);
    const zoom = has('-') - Math.max(has('+'), has('='));
    if (zoom) camera.zoom(Math.exp(zoom * 1.6 * seconds * fast), camera.target);
    this.host.moved();
    requestAnimationFrame(next => this.fly(next, now));
  }
}
