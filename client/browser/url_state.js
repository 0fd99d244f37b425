// What the address holds behind '#': crowd, camera, time and what is shown, so that a link brings
// back the same view.

import {OrbitCamera} from './camera.js';
import {COLOR_MAP_NAMES} from './overlays.js';

/**
 * @typedef {{crowd: string, camera: OrbitCamera|null, follow: string, timeUs: number|null,
 *   speed: number, channel: string, colorMap: string, low: number|null, high: number|null, show: string[]}} Link
 */

/** @param {number} value @param {number} digits */
const short = (value, digits) => String(Number(value.toFixed(digits)));

/** @param {Link} link @returns {string} */
export function formatLink(link) {
  const parts = [];
  if (link.crowd) parts.push(`crowd=${encodeURIComponent(link.crowd)}`);
  if (link.camera) {
    const c = link.camera;
    const numbers = [...c.target.map(v => short(v, 3)), short(c.distance, 3), short(c.yaw * 180 / Math.PI, 2),
                     short(c.pitch * 180 / Math.PI, 2)];
    parts.push(`cam=${numbers.join(',')}${c.ortho ? ',ortho' : ''}`);
  }
  if (link.follow) parts.push(`follow=${link.follow}`);
  if (link.timeUs !== null) parts.push(`t=${short(link.timeUs / 1e6, 3)}`);
  if (link.speed !== 1) parts.push(`speed=${short(link.speed, 3)}`);
  if (link.channel) {
    const range = link.low !== null && link.high !== null ? `,${short(link.low, 4)},${short(link.high, 4)}` : '';
    parts.push(`color=${encodeURIComponent(link.channel)}${range}`);
    if (link.colorMap !== COLOR_MAP_NAMES[0]) parts.push(`map=${link.colorMap}`);
  }
  if (link.show.length) parts.push(`show=${link.show.join(',')}`);
  return parts.length ? `#${parts.join('&')}` : '';
}

/** Takes what it understands and leaves the rest. @param {string} hash @returns {Link} */
export function parseLink(hash) {
  /** @type {Link} */
  const link = {crowd: '', camera: null, follow: '', timeUs: null, speed: 1, channel: '',
                colorMap: COLOR_MAP_NAMES[0], low: null, high: null, show: []};
  for (const part of hash.replace(/^#/, '').split('&')) {
    const [key, text = ''] = part.split('=', 2);
    let value = '';
    try {
      value = decodeURIComponent(text);
    } catch {
      continue;
    }
    if (key === 'crowd') link.crowd = value;
    if (key === 'follow' && /^\d{1,20}$/.test(value)) link.follow = value;
    if (key === 't' && value !== '' && Number.isFinite(Number(value))) link.timeUs = Math.round(Number(value) * 1e6);
    if (key === 'speed' && Number(value) && Math.abs(Number(value)) <= 64) link.speed = Number(value);
    if (key === 'map' && COLOR_MAP_NAMES.includes(value)) link.colorMap = value;
    if (key === 'show') link.show = value.split(',').filter(name => /^[a-z]+$/.test(name));
    if (key === 'cam') {
      const fields = value.split(',');
      const numbers = fields.slice(0, 6).map(Number);
      if (numbers.length === 6 && numbers.every(Number.isFinite) && numbers[3] > 0) {
        const camera = new OrbitCamera();
        camera.target = [numbers[0], numbers[1], numbers[2]];
        camera.distance = numbers[3];
        camera.yaw = numbers[4] * Math.PI / 180;
        camera.pitch = 0;
        camera.orbit(0, numbers[5] * Math.PI / 180);
        camera.ortho = fields[6] === 'ortho';
        link.camera = camera;
      }
    }
    if (key === 'color') {
      const at = value.split(',');
      const high = at.length > 2 ? Number(at.pop()) : NaN, low = Number.isFinite(high) ? Number(at.pop()) : NaN;
      link.channel = at.join(',');
      if (low < high) [link.low, link.high] = [low, high];
    }
  }
  return link;
}
