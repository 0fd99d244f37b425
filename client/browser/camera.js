// Where the viewer looks from. World frame: right-handed, +Z up, metres. The arithmetic is that of
// render/compute/camera.cpp, so that what is drawn over a picture lies where the picture has it.

/** @typedef {[number, number, number]} Point */

/** @param {Point} a @param {Point} b @returns {Point} */
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
/** @param {Point} a @param {Point} b @returns {Point} */
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
/** @param {Point} a @param {number} s @returns {Point} */
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
/** @param {Point} a @param {Point} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @param {Point} a @param {Point} b @returns {Point} */
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** @param {Point} a */
export const length = a => Math.hypot(a[0], a[1], a[2]);
/** @param {import('./connection.js').Vec3Message|undefined} v @returns {Point} */
export const pointOf = v => [v?.x ?? 0, v?.y ?? 0, v?.z ?? 0];
/** @param {Point} p */
const messageOf = p => ({x: p[0], y: p[1], z: p[2]});

export const LOWEST_PITCH = 0.02;
export const HIGHEST_PITCH = Math.PI / 2;
const NEAREST_M = 0.6;
const FARTHEST_M = 20000;
const NEAR_M = 0.1;

/** A camera on an orbit about a point. */
export class OrbitCamera {
  constructor() {
    /** @type {Point} */
    this.target = [0, 0, 1];
    this.distance = 20;
    this.yaw = -Math.PI / 2;  // of the eye as seen from the target, counter-clockwise from +X
    this.pitch = 0.6;         // of the eye above the target's horizon
    this.fovDeg = 45;
    this.ortho = false;
  }

  copy() {
    const other = Object.assign(new OrbitCamera(), this);
    other.target = [...this.target];
    return other;
  }

  /** From the target to the eye, unit length. @returns {Point} */
  outward() {
    const flat = Math.cos(this.pitch);
    return [flat * Math.cos(this.yaw), flat * Math.sin(this.yaw), Math.sin(this.pitch)];
  }

  /** @returns {Point} */
  get eye() {
    return add(this.target, scale(this.outward(), this.distance));
  }

  /** @returns {{right: Point, up: Point, forward: Point}} */
  axes() {
    const forward = scale(this.outward(), -1);
    /** @type {Point} */
    const right = [-Math.sin(this.yaw), Math.cos(this.yaw), 0];
    return {right, up: cross(right, forward), forward};
  }

  /** Metres from top to bottom at the target. */
  heightAtTarget() {
    return 2 * this.distance * Math.tan(this.fovDeg * Math.PI / 360);
  }

  /** @param {number} dx @param {number} dy radians */
  orbit(dx, dy) {
    this.yaw = wrap(this.yaw - dx);
    this.pitch = Math.min(HIGHEST_PITCH, Math.max(LOWEST_PITCH, this.pitch + dy));
  }

  /** Goes nearer to (factor under 1) or away from a point, which stays where it is on the screen.
   * @param {number} factor @param {Point} fixed */
  zoom(factor, fixed) {
    const distance = Math.min(FARTHEST_M, Math.max(NEAREST_M, this.distance * factor));
    const really = distance / this.distance;
    this.target = add(fixed, scale(sub(this.target, fixed), really));
    this.distance = distance;
  }

  /** Above the ground, what zooming goes to: faces where people are near, else the ground. */
  zoomHeight() {
    return 1.45 * Math.min(1, Math.max(0, (25 - this.distance) / 20));
  }

  /** Above an agent's feet, what a camera looks at that follows it, as the server has it: the
   * middle, from near the face. */
  followHeight() {
    return 1 + (this.ortho ? 0 : 0.45 * Math.min(1, Math.max(0, (4 - this.distance) / 3)));
  }

  /** @param {Point} by metres */
  move(by) {
    this.target = add(this.target, by);
  }

  /** A ray of this view. @param {number} x @param {number} y @param {number} width
   * @param {number} height pixels, from the top left @returns {{origin: Point, direction: Point}} */
  ray(x, y, width, height) {
    const {right, up, forward} = this.axes();
    const u = 2 * x / width - 1, v = 1 - 2 * y / height, aspect = width / height;
    if (this.ortho) {
      const half = this.heightAtTarget() / 2;
      return {origin: add(this.eye, add(scale(right, u * half * aspect), scale(up, v * half))), direction: forward};
    }
    const tan = Math.tan(this.fovDeg * Math.PI / 360);
    const direction = add(forward, add(scale(right, u * tan * aspect), scale(up, v * tan)));
    return {origin: this.eye, direction: scale(direction, 1 / length(direction))};
  }

  /** What of the ground lies under a pixel; where that is the sky or too far, the point at the
   * target's distance. @param {number} x @param {number} y @param {number} width
   * @param {number} height @param {number} groundZ @returns {Point} */
  groundAt(x, y, width, height, groundZ) {
    const {origin, direction} = this.ray(x, y, width, height);
    const t = (groundZ - origin[2]) / direction[2];
    if (direction[2] < -1e-3 && t > 0 && t < 6 * this.distance + 50) return add(origin, scale(direction, t));
    return add(origin, scale(direction, this.distance));
  }

  /** @returns {import('./connection.js').CameraMessage} */
  message() {
    const {up} = this.axes();
    /** @type {any} */
    const message = {eye: messageOf(this.eye), target: messageOf(this.target), up: messageOf(up)};
    if (this.ortho) message.orthoHeightM = this.heightAtTarget();
    else message.fovYDeg = this.fovDeg;
    return message;
  }

  /** Takes over a camera that a frame was drawn with.
   * @param {import('./connection.js').CameraMessage} message */
  static fromMessage(message) {
    const camera = new OrbitCamera();
    const eye = pointOf(message.eye);
    camera.target = pointOf(message.target);
    const outward = sub(eye, camera.target);
    camera.distance = Math.max(1e-6, length(outward));
    camera.pitch = Math.asin(Math.min(1, Math.max(-1, outward[2] / camera.distance)));
    if (Math.hypot(outward[0], outward[1]) > 1e-6 * camera.distance) {
      camera.yaw = Math.atan2(outward[1], outward[0]);
    } else {
      const up = pointOf(message.up);  // straight down: what is up on the screen lies ahead
      camera.yaw = Math.hypot(up[0], up[1]) > 1e-6 ? Math.atan2(-up[1], -up[0]) : -Math.PI / 2;
    }
    camera.ortho = message.orthoHeightM !== undefined;
    if (camera.ortho) {
      camera.distance = message.orthoHeightM / (2 * Math.tan(camera.fovDeg * Math.PI / 360));
    } else {
      camera.fovDeg = message.fovYDeg ?? 45;
    }
    return camera;
  }

  /** The camera that shows a box from here's direction. @param {Point} low @param {Point} high
   * @param {number} aspect */
  fit(low, high, aspect) {
    const center = scale(add(low, high), 0.5);
    const {right, up, forward} = this.axes();
    const tan = Math.tan(this.fovDeg * Math.PI / 360);
    let needed = 1;
    for (let corner = 0; corner < 8; corner++) {
      /** @type {Point} */
      const p = [corner & 1 ? high[0] : low[0], corner & 2 ? high[1] : low[1], corner & 4 ? high[2] : low[2]];
      const d = sub(p, center);
      const across = Math.max(Math.abs(dot(d, right)) / aspect, Math.abs(dot(d, up))) / tan;
      needed = Math.max(needed, this.ortho ? across : across - dot(d, forward));
    }
    this.target = center;
    this.distance = Math.min(FARTHEST_M, needed * 1.08);
  }
}

/** Turns world points into pixels of a picture. */
export class Projector {
  /** @param {OrbitCamera} camera @param {number} width @param {number} height */
  constructor(camera, width, height) {
    this.eye = camera.eye;
    Object.assign(this, camera.axes());
    this.ortho = camera.ortho;
    this.halfX = width / 2;
    this.halfY = height / 2;
    /** Pixels that a metre takes at one metre's distance, or anywhere when orthographic. */
    this.focal = camera.ortho ? height / camera.heightAtTarget()
                              : this.halfY / Math.tan(camera.fovDeg * Math.PI / 360);
  }

  /** Distance in front of the eye. @param {Point} point */
  depth(point) {
    return dot(sub(point, this.eye), /** @type {any} */ (this).forward);
  }

  /** @param {Point} point @returns {{x: number, y: number, pxPerM: number}|null} null: behind. */
  project(point) {
    const d = sub(point, this.eye);
    const self = /** @type {any} */ (this);
    const depth = dot(d, self.forward);
    if (depth < NEAR_M) return null;
    const pxPerM = this.ortho ? this.focal : this.focal / depth;
    return {x: this.halfX + dot(d, self.right) * pxPerM, y: this.halfY - dot(d, self.up) * pxPerM, pxPerM};
  }

  /** A line, cut off where it is behind the eye. @param {Point} a @param {Point} b
   * @returns {[number, number, number, number]|null} */
  line(a, b) {
    const da = this.depth(a) - NEAR_M, db = this.depth(b) - NEAR_M;
    if (da < 0 && db < 0) return null;
    if (da < 0) a = add(b, scale(sub(a, b), db / (db - da) * 0.999));
    if (db < 0) b = add(a, scale(sub(b, a), da / (da - db) * 0.999));
    const p = this.project(a), q = this.project(b);
    return p && q ? [p.x, p.y, q.x, q.y] : null;
  }
}

/** @param {number} angle radians @returns {number} within +-pi */
export function wrap(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}
