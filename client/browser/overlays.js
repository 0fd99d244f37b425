// What is drawn over the picture: grid, density, trails, ids, scale bar, time stamp, legend. All in
// CSS pixels of the picture; a screenshot or recording has it too.

import {Projector} from './camera.js';
import {bytesOf} from './connection.js';

/** As the server colours agents, at steps of 1/16; render/raster/element/color.hpp says whose they are.
 * @type {Record<string, string>} */
const COLOR_MAPS = {
  viridis: '440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 3fbc73 5ec962 84d44b addc30 d8e219 fde725',
  plasma: '0d0887 310596 4c02a1 6600a7 7e03a8 9511a2 a92396 bb3587 cb4778 d9596a e66c5c f07f4f f89441 fdab33 fdc328 f9dd25 f0f921',
  inferno: '000004 0b0724 210c4a 3c0965 57106d 70196e 89226a a32b61 bb3755 d14644 e35932 f1711e f98d0a fcab0f f9ca32 f2e865 fcffa4',
  magma: '000004 0a0822 1d1146 36106a 50127c 691c81 822681 9c2e7f b63779 cf4170 e65163 f5695c fb8761 fea571 fec387 fde0a2 fcfdbf',
  cividis: '00224e 002e6a 1a386f 32436d 434e6c 52596d 61656f 6f7073 7c7b78 8b8778 9b9376 aba072 bbad6c ccba64 ddc958 efd748 fee838',
};
export const COLOR_MAP_NAMES = Object.keys(COLOR_MAPS);
const FONT = '-apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif';

/** Density in the usual service levels' range: quiet blue to red. @param {number} level 0 to 1 */
function heat(level) {
  const stops = [[70, 130, 220, 0], [70, 180, 220, 0.34], [110, 205, 120, 0.46], [250, 205, 70, 0.56], [235, 80, 50, 0.68]];
  const at = Math.min(0.9999, Math.max(0, level)) * (stops.length - 1), low = Math.floor(at), t = at - low;
  const mix = stops[low].map((v, i) => v + (stops[low + 1][i] - v) * t);
  return `rgba(${mix.slice(0, 3).map(Math.round).join(',')},${mix[3].toFixed(3)})`;
}

/** The largest of 1, 2, 5 times a power of ten that is not over `value`. @param {number} value */
export function niceBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  const lead = value / power;
  return (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * power;
}

/** @param {number} us @returns {string} 1:02:03.4 */
export function formatTime(us) {
  const sign = us < 0 ? '-' : '';
  const tenths = Math.round(Math.abs(us) / 1e5);
  const s = Math.floor(tenths / 10), minutes = Math.floor(s / 60) % 60, hours = Math.floor(s / 3600);
  const tail = `${String(s % 60).padStart(2, '0')}.${tenths % 10}`;
  return hours ? `${sign}${hours}:${String(minutes).padStart(2, '0')}:${tail}` : `${sign}${minutes}:${tail}`;
}

/** @param {number} value */
export function formatNumber(value) {
  if (!Number.isFinite(value)) return '–';
  if (value !== 0 && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3)) return value.toExponential(1);
  return String(Number(value.toPrecision(3)));
}

/** @param {number} meters */
const formatMeters = meters => meters >= 1000 ? `${meters / 1000} km` : meters < 1 ? `${Math.round(meters * 100)} cm` : `${meters} m`;

/**
 * @typedef {{
 *   show: Set<string>, agents: import('./agents.js').Agent[], trails: import('./agents.js').Trails,
 *   channel: string, colorMap: string, unit: string, low: number, high: number, followed: string,
 *   crowd: string, insets: {top: number, right: number, bottom: number, left: number},
 *   window: {x: number, y: number, width: number, height: number}, groundZ: number,
 *   isLive: boolean,
 * }} Scene  `window`: the part of the picture that is seen; `insets`: what panels cover of it.
 */

/**
 * @param {CanvasRenderingContext2D} context
 * @param {import('./connection.js').FrameHeader} header
 * @param {import('./camera.js').OrbitCamera} camera that the frame was drawn with
 * @param {number} width @param {number} height of the picture
 * @param {Scene} scene
 */
export function drawOverlays(context, header, camera, width, height, scene) {
  const projector = new Projector(camera, width, height);
  if (scene.show.has('density') && header.density) drawDensity(context, projector, header.density);
  if (scene.show.has('grid')) drawGrid(context, projector, camera, width, height, scene);
  if (scene.show.has('trails')) drawTrails(context, projector, scene);
  if (scene.followed) drawFollowed(context, projector, scene);
  if (scene.show.has('ids')) drawIds(context, projector, scene, width, height);
  const {x, y, width: w, height: h} = scene.window;
  context.save();
  context.translate(x, y);
  let bottom = h - scene.insets.bottom;
  if (scene.show.has('scale')) bottom = drawScale(context, projector, camera, scene, bottom);
  if (scene.show.has('time')) drawTime(context, header, scene, bottom);
  let right = bottomRight(w, h, scene);
  const colors = COLOR_MAPS[scene.colorMap].split(' ');
  if (scene.channel) right = drawLegend(context, right, scene.channel, scene.unit, scene.low, scene.high,
                                        t => `#${colors[Math.min(16, Math.floor(t * 17))]}`);
  if (scene.show.has('density') && header.density) {
    drawLegend(context, right, 'density', 'people / m²', 0, densityTop(header.density), heat);
  }
  context.restore();
}

/** @param {number} w @param {number} h @param {Scene} scene */
const bottomRight = (w, h, scene) => ({x: w - scene.insets.right, y: h - scene.insets.bottom});

/** The range that the heat map spans: it rests while the densest spot changes a little.
 * @param {import('./connection.js').DensityGrid} grid */
function densityTop(grid) {
  return Math.max(1, Math.ceil(grid.highest ?? 0));
}

/** @param {CanvasRenderingContext2D} context @param {Projector} projector
 * @param {import('./connection.js').DensityGrid} grid */
function drawDensity(context, projector, grid) {
  const levels = bytesOf(grid.levels);
  const rows = Math.floor(levels.length / grid.columns);
  const scale = (grid.highest ?? 0) / 255 / densityTop(grid);
  const z = (grid.groundZ ?? 0) + 0.02;
  const x0 = (grid.lowX ?? 0) - grid.cellM / 2, y0 = (grid.lowY ?? 0) - grid.cellM / 2;
  // Corners once; each belongs to four cells.
  const corners = [];
  for (let row = 0; row <= rows; row++) {
    for (let column = 0; column <= grid.columns; column++) {
      corners.push(projector.project([x0 + column * grid.cellM, y0 + row * grid.cellM, z]));
    }
  }
  const stride = grid.columns + 1;
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < grid.columns; column++) {
      const level = levels[row * grid.columns + column] * scale;
      if (level < 0.02) continue;
      const at = row * stride + column;
      const a = corners[at], b = corners[at + 1], c = corners[at + stride + 1], d = corners[at + stride];
      if (!a || !b || !c || !d) continue;
      context.fillStyle = heat(level);
      context.beginPath();
      context.moveTo(a.x, a.y);
      context.lineTo(b.x, b.y);
      context.lineTo(c.x, c.y);
      context.lineTo(d.x, d.y);
      context.fill();
    }
  }
}

/** @param {CanvasRenderingContext2D} context @param {Projector} projector
 * @param {import('./camera.js').OrbitCamera} camera @param {number} width @param {number} height
 * @param {Scene} scene */
function drawGrid(context, projector, camera, width, height, scene) {
  const step = niceBelow(Math.max(0.5, camera.heightAtTarget() / 5));
  const lines = 14, z = scene.groundZ + 0.01;
  const middleX = Math.round(camera.target[0] / step), middleY = Math.round(camera.target[1] / step);
  const from = [(middleX - lines) * step, (middleY - lines) * step];
  const to = [(middleX + lines) * step, (middleY + lines) * step];
  context.font = `500 11px ${FONT}`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  for (let i = -lines; i <= lines; i++) {
    const x = (middleX + i) * step, y = (middleY + i) * step;
    const fade = 1 - Math.abs(i) / (lines + 1);
    /** @type {[number, any, string][]} */
    const both = [[x, projector.line([x, from[1], z], [x, to[1], z]), 'x'],
                  [y, projector.line([from[0], y, z], [to[0], y, z]), 'y']];
    for (const [value, line, axis] of both) {
      if (!line) continue;
      const isAxis = Math.abs(value) < step / 2;
      context.strokeStyle = isAxis ? `rgba(120,225,205,${0.9 * fade})` : `rgba(255,255,255,${0.42 * fade})`;
      context.lineWidth = isAxis ? 1.6 : 1;
      context.beginPath();
      context.moveTo(line[0], line[1]);
      context.lineTo(line[2], line[3]);
      context.stroke();
      if (i % 2 !== 0 && !isAxis) continue;
      const at = axis === 'x' ? projector.project([value, camera.target[1], z]) : projector.project([camera.target[0], value, z]);
      if (!at || at.x < 0 || at.x > width || at.y < 0 || at.y > height || at.pxPerM * step < 34) continue;
      label(context, `${axis} ${Number(value.toFixed(2))}`, at.x, at.y, `rgba(235,245,250,${Math.max(0.5, fade)})`);
    }
  }
}

/** Text with a soft dark edge. @param {CanvasRenderingContext2D} context @param {string} text
 * @param {number} x @param {number} y @param {string} color */
function label(context, text, x, y, color = '#f4f8fb') {
  context.lineWidth = 3;
  context.lineJoin = 'round';
  context.strokeStyle = 'rgba(10,16,24,0.72)';
  context.strokeText(text, x, y);
  context.fillStyle = color;
  context.fillText(text, x, y);
}

/** @param {CanvasRenderingContext2D} context @param {Projector} projector @param {Scene} scene */
function drawTrails(context, projector, scene) {
  context.lineCap = 'round';
  for (const agent of scene.agents) {
    const trail = scene.trails.trails.get(agent.id);
    if (!trail || !trail.points.length) continue;
    /** @type {import('./camera.js').Point[]} */
    const points = [...trail.points, [agent.x, agent.y, agent.z + 0.03]];
    const strong = agent.id === scene.followed;
    for (let i = 1; i < points.length; i++) {
      const a = points[i - 1], b = points[i];
      if (Math.hypot(a[0] - b[0], a[1] - b[1]) > 3) continue;  // a jump is no way
      const line = projector.line(a, b);
      if (!line) continue;
      const age = i / points.length;
      context.strokeStyle = strong ? `rgba(255,205,110,${0.15 + 0.8 * age})` : `rgba(110,230,205,${0.05 + 0.6 * age})`;
      context.lineWidth = (strong ? 3 : 1.8) * (0.4 + 0.6 * age);
      context.beginPath();
      context.moveTo(line[0], line[1]);
      context.lineTo(line[2], line[3]);
      context.stroke();
    }
  }
}

/** A ring on the ground. @param {CanvasRenderingContext2D} context @param {Projector} projector
 * @param {Scene} scene */
function drawFollowed(context, projector, scene) {
  const agent = scene.agents.find(one => one.id === scene.followed);
  if (!agent) return;
  for (const [style, lineWidth] of /** @type {[string, number][]} */ ([['rgba(10,16,24,0.55)', 5], ['#ffcd6e', 2.5]])) {
    context.strokeStyle = style;
    context.lineWidth = lineWidth;
    context.beginPath();
    for (let i = 0; i <= 32; i++) {
      const angle = i / 16 * Math.PI;
      const at = projector.project([agent.x + 0.42 * Math.cos(angle), agent.y + 0.42 * Math.sin(angle), agent.z + 0.02]);
      if (!at) return;
      if (i) context.lineTo(at.x, at.y);
      else context.moveTo(at.x, at.y);
    }
    context.stroke();
  }
}

/** Labels that do not cover each other, nearest first. @param {CanvasRenderingContext2D} context
 * @param {Projector} projector @param {Scene} scene @param {number} width @param {number} height */
function drawIds(context, projector, scene, width, height) {
  const placed = [];
  for (const agent of scene.agents) {
    const at = projector.project([agent.x, agent.y, agent.z + 2.0]);
    if (at && at.x > 0 && at.x < width && at.y > 0 && at.y < height) placed.push({agent, at});
  }
  placed.sort((a, b) => Number(b.agent.id === scene.followed) - Number(a.agent.id === scene.followed) ||
                        b.at.pxPerM - a.at.pxPerM);
  context.font = `600 11px ${FONT}`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  const cell = 16;
  const taken = new Set();
  for (const {agent, at} of placed) {
    const text = agent.id.length > 8 ? `…${agent.id.slice(-6)}` : agent.id;
    const half = text.length * 3.4 + 3;
    const row = Math.round(at.y / cell), cells = [];
    for (let c = Math.floor((at.x - half) / cell); c <= Math.floor((at.x + half) / cell); c++) cells.push(`${c},${row}`);
    if (cells.some(key => taken.has(key))) continue;
    for (const key of cells) taken.add(key);
    label(context, text, at.x, at.y, agent.id === scene.followed ? '#ffcd6e' : '#f4f8fb');
  }
}

/** @param {CanvasRenderingContext2D} context @param {number} x @param {number} y
 * @param {number} w @param {number} h */
function plate(context, x, y, w, h) {
  context.fillStyle = 'rgba(15,22,32,0.62)';
  context.beginPath();
  context.roundRect(x, y, w, h, 8);
  context.fill();
}

/** How long a metre is at the middle of the view. @param {CanvasRenderingContext2D} context
 * @param {Projector} projector @param {import('./camera.js').OrbitCamera} camera
 * @param {Scene} scene @param {number} bottom @returns {number} what is left above */
function drawScale(context, projector, camera, scene, bottom) {
  const at = projector.project(camera.target);
  if (!at) return bottom;
  const meters = niceBelow(Math.min(140, scene.window.width / 4) / at.pxPerM), px = meters * at.pxPerM;
  const x = scene.insets.left, y = bottom - 34;
  plate(context, x, y, px + 24, 34);
  context.font = `600 12px ${FONT}`;
  context.textAlign = 'center';
  context.textBaseline = 'alphabetic';
  context.fillStyle = '#f4f8fb';
  context.fillText(formatMeters(meters), x + 12 + px / 2, y + 16);
  context.strokeStyle = '#f4f8fb';
  context.lineWidth = 1.6;
  context.beginPath();
  context.moveTo(x + 12, y + 20);
  context.lineTo(x + 12, y + 26);
  context.lineTo(x + 12 + px, y + 26);
  context.lineTo(x + 12 + px, y + 20);
  context.stroke();
  return y - 8;
}

/** @param {CanvasRenderingContext2D} context @param {import('./connection.js').FrameHeader} header
 * @param {Scene} scene @param {number} bottom */
function drawTime(context, header, scene, bottom) {
  context.font = `600 15px ${FONT}`;
  context.textAlign = 'left';
  context.textBaseline = 'middle';
  const text = `${formatTime(Number(header.sceneTimeUs ?? 0))}`;
  const detail = scene.crowd.length > 24 ? `${scene.crowd.slice(0, 23)}…` : scene.crowd;
  const wide = context.measureText(text).width;
  context.font = `500 12px ${FONT}`;
  const wider = context.measureText(detail).width;
  const x = scene.insets.left, y = bottom - 30;
  plate(context, x, y, wide + wider + 34, 30);
  context.fillStyle = '#b9c6d3';
  context.fillText(detail, x + 22 + wide, y + 15.5);
  context.font = `600 15px ${FONT}`;
  context.fillStyle = '#f4f8fb';
  context.fillText(text, x + 12, y + 15.5);
}

/** @param {CanvasRenderingContext2D} context @param {{x: number, y: number}} corner bottom right
 * @param {string} name @param {string} unit @param {number} low @param {number} high
 * @param {(t: number) => string} colorAt @returns {{x: number, y: number}} where the next one ends */
function drawLegend(context, corner, name, unit, low, high, colorAt) {
  const w = 168, h = 54, x = corner.x - w, y = corner.y - h;
  plate(context, x, y, w, h);
  context.font = `600 12px ${FONT}`;
  context.textBaseline = 'alphabetic';
  context.textAlign = 'left';
  context.fillStyle = '#f4f8fb';
  context.fillText(unit ? `${name} (${unit})` : name, x + 12, y + 17, w - 24);
  for (let i = 0; i < w - 24; i++) {
    context.fillStyle = colorAt(i / (w - 24));
    context.fillRect(x + 12 + i, y + 24, 1.5, 10);
  }
  context.font = `500 11px ${FONT}`;
  context.fillStyle = '#cfd9e2';
  context.fillText(formatNumber(low), x + 12, y + 47);
  context.textAlign = 'center';
  context.fillText(formatNumber((low + high) / 2), x + w / 2, y + 47);
  context.textAlign = 'right';
  context.fillText(formatNumber(high), x + w - 12, y + 47);
  return {x: corner.x, y: y - 8};
}
