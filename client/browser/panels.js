// What stands around the picture: crowd list, numbers, the followed agent, messages.

import {formatNumber} from './overlays.js';

/** @param {string} id @returns {any} */
export const byId = id => document.getElementById(id);

/** @param {string} tag @param {string} className @param {string} [text] */
export function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

/** @param {number|undefined} count */
export const people = count => `${(count ?? 0).toLocaleString('en')} ${count === 1 ? 'person' : 'people'}`;

/** Fills a list of crowds. @param {HTMLElement} list
 * @param {import('./connection.js').CrowdInfo[]} crowds @param {string} chosen
 * @param {(name: string) => void} choose */
export function showCrowds(list, crowds, chosen, choose) {
  const key = JSON.stringify([crowds.map(crowd => [crowd.name, crowd.agents, crowd.live]), chosen]);
  if (list.dataset.key === key) return;  // leaves the focus where it is
  list.dataset.key = key;
  const focused = list.contains(document.activeElement) ? /** @type {HTMLElement} */ (document.activeElement).dataset.crowd : null;
  list.replaceChildren(...crowds.map(crowd => {
    const button = element('button', 'crowd');
    button.dataset.crowd = crowd.name;
    button.setAttribute('role', 'option');
    button.setAttribute('aria-selected', String(crowd.name === chosen));
    button.append(element('span', crowd.live ? 'dot on' : 'dot'), element('span', 'name', crowd.name),
                  element('span', 'dim', `${people(crowd.agents)}${crowd.live ? '' : ', ended'}`));
    button.onclick = () => choose(crowd.name);
    return button;
  }));
  if (focused) /** @type {HTMLElement|null} */ (list.querySelector(`[data-crowd="${CSS.escape(focused)}"]`))?.focus();
}

/** @param {string} text @param {boolean} [isBad] */
export function toast(text, isBad = false) {
  const toasts = byId('toasts');
  while (toasts.children.length > 2) toasts.firstChild.remove();
  const note = element('div', isBad ? 'toast bad' : 'toast', text);
  toasts.append(note);
  setTimeout(() => note.remove(), isBad ? 6000 : 2600);
}

/** @param {number} value */
const ms = value => `${value < 10 ? value.toFixed(1) : Math.round(value)} ms`;
/** @param {number} value */
const many = value => value >= 1e6 ? `${(value / 1e6).toFixed(2)} M` : value >= 1e4 ? `${Math.round(value / 1e3)} k` : String(value);

/** Rows of what there is any of.
 * @param {[string, number|undefined][]} counts @returns {[string, string][]} */
const rowsOf = counts => counts.filter(([, count]) => count).map(([name, count]) => [name, many(count ?? 0)]);

/** @param {import('./view.js').View} view @param {number} bytesPerSecond @param {string} raster */
export function showStats(view, bytesPerSecond, raster) {
  const header = view.header;
  if (!header) return;
  const stats = header.stats ?? {}, times = stats.times ?? {};
  const latency = view.latency();
  const sum = ['advanceMs', 'cullMs', 'selectMs', 'allocateMs', 'generateMs', 'rasterMs', 'resolveMs', 'readBackMs']
                  .reduce((total, name) => total + (times[name] ?? 0), 0);
  /** @type {[string, string, boolean?][]} */
  const rows = [
    ['Frames per second', view.shownRate.perSecond(performance.now()).toFixed(1)],
    ['Latency, median', latency ? ms(latency.median) : '–'],
    ['Latency, worst of 60', latency ? ms(latency.worst) : '–'],
    ['Skipped by the server', header.skippedFrames ?? '0'],
    ['Left out here', String(view.leftOut)],
    ['Data', `${(bytesPerSecond * 8 / 1e6).toFixed(1)} Mbit/s`],
    ['Drawing', stats.targetMs ? `${ms(sum)} of ${ms(stats.targetMs)}` : ms(sum), true],
    ['Encoding', ms(times.encodeMs ?? 0)],
    ['Agents', many(stats.agents ?? 0), true],
    ['In view', many(stats.visible ?? 0)],
    ['As meshes', many(stats.asMeshes ?? 0)],
    ...rowsOf([['As small figures', stats.asSpecks], ['As impostors', stats.asImpostors], ['As points', stats.asPoints],
               ['Left to others', stats.leftOut]]),
    ['Triangles', many(Number(stats.triangles ?? 0))],
    ['Vertices', `${many(Number(stats.vertices ?? 0))} of ${many(Number(stats.effectiveBudget ?? stats.vertexBudget ?? 0))}`],
    ['Detail', stats.inFull ? 'all of it' : stats.errorPx ? `to ${stats.errorPx.toPrecision(2)} px` : 'as budgeted'],
    ['Samples a pixel', stats.oversampling === 2 ? '16' : '4'],
    ['Picture', `${header.widthPx}×${header.heightPx}`, true],
    ['Rasterizer', raster.split(' ')[0] || '–'],
  ];
  byId('stats-rows').replaceChildren(...rows.map(([name, value, gap]) => {
    const row = element('tr', gap ? 'gap' : '');
    row.append(element('td', '', name), element('td', '', value));
    return row;
  }));
}

/** @param {{id: string, speedMps?: number, headingRad?: number|string, character?: string,
 *   position?: {x?: number, y?: number},
 *   values?: {channel: import('./connection.js').Channel, value?: number|string}[]}} agent */
export function showAgent(agent) {
  byId('agent').hidden = false;
  byId('agent-title').textContent = `Agent ${agent.id}`;
  const heading = Number(agent.headingRad ?? 0);
  /** @type {[string, string][]} */
  const rows = [['speed', `${(agent.speedMps ?? 0).toFixed(2)} m/s`]];
  if (Number.isFinite(heading)) rows.push(['heading', `${Math.round((heading * 180 / Math.PI + 360) % 360)}°`]);
  if (agent.position) rows.push(['position', `${(agent.position.x ?? 0).toFixed(1)}, ${(agent.position.y ?? 0).toFixed(1)} m`]);
  for (const {channel, value} of agent.values ?? []) {
    if (channel.name === 'speed') continue;  // the first row
    rows.push([channel.name, `${formatNumber(Number(value ?? 0))} ${channel.unit ?? ''}`.trim()]);
  }
  if (agent.character) rows.push(['character', agent.character]);
  byId('agent-values').replaceChildren(...rows.flatMap(([name, value]) => [element('dt', '', name), element('dd', '', value)]));
}
