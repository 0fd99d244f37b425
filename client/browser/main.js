// Wires the page: what the viewer wants goes to the server, what comes back is shown.

import {Trails, unpackAgents} from './agents.js';
import {OrbitCamera, HIGHEST_PITCH, pointOf} from './camera.js';
import {Connection} from './connection.js';
import {Controls} from './controls.js';
import {COLOR_MAP_NAMES, drawOverlays, formatNumber, formatTime} from './overlays.js';
import {byId, people, showAgent, showCrowds, showStats, toast} from './panels.js';
import {Recorder, screenshot} from './recorder.js';
import {Timeline} from './timeline.js';
import {formatLink, parseLink} from './url_state.js';
import {View} from './view.js';

const OVERLAY_KEYS = {i: 'ids', v: 'trails', m: 'density', g: 'grid', b: 'scale', k: 'time'};
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const MOST_AGENTS = 1500;       // that overlays are drawn for
const STAMP_EVERY_MS = 500;     // how often latency is measured while nothing is touched
const LARGEST_PICTURE_PX = 1.3e6;

const canvas = /** @type {HTMLCanvasElement} */ (byId('picture'));
const connection = new Connection(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws`);
const view = new View(canvas, index => connection.send({view: {ackedFrameIndex: index}}));
const trails = new Trails();
const recorder = new Recorder(canvas);

/** What is wanted; the server is told of changes. */
const state = {
  crowd: '',
  /** @type {OrbitCamera|null} */
  camera: null,               // null: the server's overview
  /** @type {OrbitCamera|null} */
  before: null,               // the camera before looking from above
  follow: '',
  isLive: true,
  isPaused: false,
  speed: 1,
  timeUs: 0,
  channel: '',
  colorMap: COLOR_MAP_NAMES[0],
  low: 0,
  high: 2,
  /** @type {Set<string>} */
  show: new Set(),
  sharpness: 1,
};
/** @type {import('./connection.js').CrowdInfo[]} */
let crowds = [];
/** @type {import('./agents.js').Agent[]} */
let agents = [];
/** @type {any} */
let server = {limits: {}};
/** @type {any} */
let pending = null;           // options to send with the next frame of this page
let needsView = true;         // the server does not know of this view
let lastStamp = 0, lastPlaybackStamp = 0, lastFollowStamp = 0;
let rangeIsAuto = false;
let shownCamera = new OrbitCamera();
let linkTimer = 0;
let wantsLink = parseLink(location.hash);

// ---- what is wanted -> the server

/** Sends options soon; what is asked for in one go travels together.
 * @param {object} options of ViewOptions */
function ask(options) {
  if (!pending) {
    pending = {};
    if (document.hidden) queueMicrotask(flush);  // no frames are drawn there
    else requestAnimationFrame(flush);
  }
  Object.assign(pending, options);
}

function flush() {
  const options = pending;
  pending = null;
  if (!options || !state.crowd || needsView) return;  // a view that has ended is asked for anew, with all of them
  lastStamp = Math.max(lastStamp + 1, Math.round(performance.now() * 1000));
  if (options.playback) lastPlaybackStamp = lastStamp;
  if (options.followAgent) lastFollowStamp = lastStamp;
  connection.send({view: {options: {...options, stamp: String(lastStamp)}}});
}

/** Everything anew: at first and after a loss. */
function askAll() {
  needsView = false;
  const size = pictureSize();
  const playback = state.isLive ? {live: true}
                                : {sceneTimeUs: String(state.timeUs), paused: state.isPaused, speed: state.speed};
  ask({
    crowdName: state.crowd, ...size, jpegQuality: 82, maxRateHz: document.hidden ? 1 : Number(byId('rate').value),
    vertexBudget: byId('budget').value, shadows: byId('shadows').checked, playback,
    followAgent: state.follow || '0', ...cameraOptions(), ...channelOptions(), ...overlayOptions(),
  });
}

const cameraOptions = () => state.camera ? {camera: state.camera.message()} : {overview: true};

function channelOptions() {
  const known = crowds.find(crowd => crowd.name === state.crowd)?.channels ?? [];
  if (state.channel && known.length && !known.some(one => one.name === state.channel)) state.channel = '';
  const colors = {channel: state.channel, colorMap: `COLOR_MAP_${state.colorMap.toUpperCase()}`};
  return state.low < state.high ? {...colors, channelLow: state.low, channelHigh: state.high} : colors;
}

function overlayOptions() {
  const needsAgents = state.show.has('ids') || state.show.has('trails') || state.follow !== '' || rangeIsAuto;
  return {maxAgentColumns: needsAgents ? MOST_AGENTS : 0, density: state.show.has('density')};
}

/** Pixels to ask for: as many as are shown, within reason. */
function pictureSize() {
  const limits = server.limits ?? {};
  const ratio = Math.min(window.devicePixelRatio || 1, 2) * state.sharpness;
  let width = canvas.clientWidth * ratio, height = canvas.clientHeight * ratio;
  const shrink = Math.min(1, Math.sqrt(LARGEST_PICTURE_PX * Math.max(1, state.sharpness) / Math.max(1, width * height)),
                          (limits.maxWidthPx ?? 4096) / width, (limits.maxHeightPx ?? 4096) / height);
  width *= shrink;
  height *= shrink;
  return {widthPx: Math.max(16, Math.round(width / 8) * 8), heightPx: Math.max(16, Math.round(height / 8) * 8)};
}

/** The camera in the viewer's hands; taken over from the server's overview when first touched. */
function heldCamera() {
  if (!state.camera && view.header) state.camera = OrbitCamera.fromMessage(view.header.camera);
  return state.camera;
}

function cameraMoved() {
  if (!state.camera) return;
  const below = groundZ() + 0.15 - state.camera.eye[2];
  if (below > 0) state.camera.move([0, 0, below]);
  byId('top-down').setAttribute('aria-pressed', String(state.camera.ortho));
  ask({camera: state.camera.message()});
  saveLink();
}

/** Goes to another camera smoothly. @param {OrbitCamera} goal @param {() => void} [then] */
function glide(goal, then) {
  const from = heldCamera();
  if (!from) return;
  const start = from.copy(), began = performance.now(), duration = matchMedia('(prefers-reduced-motion: reduce)').matches ? 1 : 320;
  const turn = Math.atan2(Math.sin(goal.yaw - start.yaw), Math.cos(goal.yaw - start.yaw));
  const mine = from;
  const step = () => {
    if (state.camera !== mine) return;
    const t = Math.min(1, (performance.now() - began) / duration), e = t * t * (3 - 2 * t);
    mine.target = /** @type {any} */ (start.target.map((v, i) => v + (goal.target[i] - v) * e));
    mine.distance = start.distance * (goal.distance / start.distance) ** e;
    mine.yaw = start.yaw + turn * e;
    mine.pitch = start.pitch + (goal.pitch - start.pitch) * e;
    mine.ortho = t < 1 ? start.ortho && goal.ortho : goal.ortho;
    cameraMoved();
    if (t < 1) requestAnimationFrame(step);
    else if (then) then();
  };
  step();
}

// ---- frames

connection.onFrame = (header, image) => view.take(header, image);

view.accepts = header => {
  if (!state.crowd) return false;  // it was on its way when its crowd was left
  const stamp = Number(header.stamp ?? 0);
  if (!state.follow || header.followedAgent || stamp < lastPlaybackStamp || stamp < lastFollowStamp) return true;
  const gone = state.follow, wasThere = view.header?.followedAgent === gone;
  stopFollowing();
  toast(`No agent ${gone} in '${state.crowd}' at this time: nobody is followed`, true);
  return !wasThere;  // the camera would jump to where it last stood on its own
};

view.onShown = header => {
  byId('waiting').hidden = true;
  state.timeUs = Number(header.sceneTimeUs ?? 0);
  if (header.playback && Number(header.stamp ?? 0) >= lastPlaybackStamp) {
    state.isLive = header.playback.live === true;
    state.isPaused = header.playback.paused === true;
  }
  if (state.follow && header.followedAgent === state.follow && state.camera) {
    state.camera.target = pointOf(header.camera.target);
  }
  timeline.update(Number(header.oldestTimeUs ?? 0), Number(header.captureTimeUs ?? 0), state.timeUs);
  showPlayer(header);
  const count = header.stats?.agents ?? 0;
  byId('crowd-count').textContent = people(count);
  document.body.dataset.frame = header.frameIndex;
};

view.drawOver = (context, header, width, height) => {
  shownCamera = OrbitCamera.fromMessage(header.camera);
  if (header !== lastHeader) {
    lastHeader = header;
    agents = header.agents ? unpackAgents(header.agents) : [];
    if (state.show.has('trails')) trails.add(Number(header.sceneTimeUs ?? 0), agents);
    if (rangeIsAuto) fitRange();
  }
  const at = view.placement(), isNarrow = canvas.clientWidth <= 720;
  drawOverlays(context, header, shownCamera, width, height, {
    show: state.show, agents, trails, followed: state.follow, groundZ: groundZ(), crowd: state.crowd,
    channel: state.channel, unit: currentChannel()?.unit ?? '', colorMap: state.colorMap, low: state.low, high: state.high,
    isLive: state.isLive,
    window: {x: -at.x, y: -at.y, width: canvas.clientWidth, height: canvas.clientHeight},
    insets: {top: 70, bottom: isNarrow ? 124 : 78, left: isNarrow ? 10 : 14, right: isNarrow ? 10 : 14},
  });
};
/** @type {any} */
let lastHeader = null;

const currentCrowd = () => crowds.find(crowd => crowd.name === state.crowd);
const currentChannel = () => currentCrowd()?.channels?.find(one => one.name === state.channel);
const groundZ = () => currentCrowd()?.low?.z ?? 0;

/** @param {any} header */
function showPlayer(header) {
  const isPaused = state.isPaused && !state.isLive;
  byId('time').textContent = formatTime(state.timeUs);
  byId('end-time').textContent = formatTime(Number(header.captureTimeUs ?? 0));
  byId('play').querySelector('use').setAttribute('href', isPaused ? '#i-play' : '#i-pause');
  byId('play').setAttribute('aria-label', isPaused ? 'Play' : 'Pause');
  const atEdge = state.isLive;
  byId('live').setAttribute('aria-pressed', String(atEdge));
  byId('live').querySelector('.dot').className = header.live ? 'dot on' : 'dot';
  byId('live-text').textContent = header.live ? 'Live' : 'End';
}

// ---- crowds

/** @param {string} name */
function openCrowd(name) {
  const isOther = name !== state.crowd;
  byId('crowd-list').hidden = true;
  byId('crowd-button').setAttribute('aria-expanded', 'false');
  if (isOther) {
    state.crowd = name;
    const link = wantsLink.crowd === name || !wantsLink.crowd ? wantsLink : parseLink('');
    wantsLink = parseLink('');
    state.camera = link.camera;
    state.before = null;
    state.follow = link.follow;
    state.isLive = link.timeUs === null;
    state.isPaused = link.timeUs !== null;
    state.timeUs = link.timeUs ?? 0;
    state.speed = link.speed;
    state.channel = link.channel;
    state.colorMap = link.colorMap;
    rangeIsAuto = link.channel !== '' && link.low === null;
    if (link.low !== null && link.high !== null) [state.low, state.high] = [link.low, link.high];
    if (link.show.length) state.show = new Set(link.show);
    lastPlaybackStamp = 0;
    lastFollowStamp = Infinity;  // until it is sent
    trails.clear();
    view.clear();
  }
  byId('agent').hidden = true;
  byId('crowd-name').textContent = name;
  document.title = `${name} · throng`;
  byId('start').hidden = true;
  showWaiting();
  showDisplay();
  askAll();
  saveLink();
  canvas.focus({preventScroll: true});
}

async function refreshCrowds() {
  if (connection.state !== 'open') return;
  const answer = await connection.ask({listCrowds: {}});
  crowds = answer.listCrowds.crowds ?? [];
  showCrowds(byId('crowd-list'), crowds, state.crowd, openCrowd);
  showChannels();
  showWaiting();
  if (!state.crowd) {
    showStart();
  } else if (!crowds.some(crowd => crowd.name === state.crowd)) {
    needsView = true;
    showBanner(`Waiting for the crowd '${state.crowd}'…`);
  } else if (needsView) {
    askAll();
    showBanner('');
  }
}

/** @param {string} text empty: nothing is wrong */
function showBanner(text) {
  byId('banner').hidden = !text;
  byId('banner-text').textContent = text;
  byId('banner-retry').hidden = connection.state === 'open';
}

/** What the page waits for while it has no picture to show. */
function showWaiting() {
  byId('waiting').hidden = view.header !== null || !byId('start').hidden;
  byId('waiting-text').textContent = connection.state !== 'open' ? `Connecting to ${location.host}…`
      : !state.crowd ? 'Looking for crowds…'
      : !currentCrowd() || Number(currentCrowd()?.frames ?? 0) > 0 ? `Waiting for the first picture of '${state.crowd}'…`
      : `Waiting for the first agents of '${state.crowd}': its producer has sent none yet…`;
}

/** The first screen, while there is nothing to show. */
function showStart() {
  const wanted = crowds.find(crowd => crowd.name === wantsLink.crowd);
  if (wanted || crowds.length === 1 && !wantsLink.crowd) {
    openCrowd((wanted ?? crowds[0]).name);
    return;
  }
  byId('start').hidden = false;
  byId('token-form').hidden = true;
  byId('waiting').hidden = true;
  showCrowds(byId('start-list'), crowds, '', openCrowd);
  const missing = wantsLink.crowd ? `There is no crowd '${wantsLink.crowd}' here. It opens by itself when it comes` : '';
  byId('start-text').textContent = crowds.length ? (missing ? `${missing}; these are here:` : 'Choose a crowd to watch.')
      : missing ? `${missing}; no other is here.` : 'No crowd yet. Publish one and it shows here by itself:';
  const code = byId('start-code');
  code.hidden = crowds.length > 0 || missing !== '';
  code.firstElementChild.textContent = 'import throng\n\nwith throng.connect(url, "station") as pub:\n    for step in range(600):        # your simulator\n        pub.publish(t=step * 0.1, ids=ids, positions=xy)';
}

function showChannels() {
  const select = byId('channel'), channels = currentCrowd()?.channels ?? [];
  const key = JSON.stringify(channels);
  if (select.dataset.key !== key) {
    select.dataset.key = key;
    select.replaceChildren(new Option('as they are', ''), ...channels.map(one => new Option(one.unit ? `${one.name} (${one.unit})` : one.name, one.name)));
    select.value = state.channel;
  }
}

// ---- display

function showDisplay() {
  showChannels();
  byId('channel').value = state.channel;
  byId('range').hidden = byId('map-row').hidden = !state.channel;
  byId('color-map').value = state.colorMap;
  byId('low').value = formatNumber(state.low);
  byId('high').value = formatNumber(state.high);
  byId('auto-range').setAttribute('aria-pressed', String(rangeIsAuto));
  for (const box of byId('overlays').querySelectorAll('input')) box.checked = state.show.has(box.value);
  byId('speed').value = String(state.speed);
  view.redraw();
}

/** @param {string} name */
function toggleOverlay(name) {
  if (!state.show.delete(name)) state.show.add(name);
  if (name === 'trails') trails.clear();
  showDisplay();
  ask(overlayOptions());
  saveLink();
}

/** @param {string} name */
function chooseChannel(name) {
  state.channel = name;
  rangeIsAuto = name !== '';
  showDisplay();
  ask({...channelOptions(), ...overlayOptions()});
  saveLink();
}

/** The range of what is in view, rounded; it widens at once and never by a little. */
function fitRange() {
  const values = agents.map(agent => agent.value).filter(Number.isFinite);
  if (values.length < 1 || !state.channel) return;
  let low = Math.min(...values), high = Math.max(...values);
  if (low >= 0 && low < 0.5 * high) low = 0;
  const step = 10 ** Math.floor(Math.log10(Math.max(1e-9, high - low))) / 2;
  low = Math.floor(low / step) * step;
  high = Math.ceil(high / step) * step;
  if (!(low < high)) high = low + 1;
  rangeIsAuto = false;
  [state.low, state.high] = [low, high];
  showDisplay();
  ask({...channelOptions(), ...overlayOptions()});
  saveLink();
}

// ---- time

/** @param {object} playback */
function play(playback) {
  ask({playback: {...pending?.playback, ...playback}});
  lastPlaybackStamp = Infinity;  // until it is sent, no frame knows of it
}

function togglePlay() {
  if (state.isLive || !state.isPaused) {
    state.isPaused = true;
    state.isLive = false;
    play({paused: true});
  } else {
    state.isPaused = false;
    const atEnd = state.timeUs >= timeline.newest && !currentCrowd()?.live && state.speed > 0;
    play(atEnd ? {sceneTimeUs: String(timeline.oldest), paused: false} : {paused: false});
  }
  if (view.header) showPlayer(view.header);
  saveLink();
}

function goLive() {
  state.isLive = true;
  state.isPaused = false;
  state.speed = 1;
  ask({playback: {live: true}});
  lastPlaybackStamp = Infinity;
  showDisplay();
  saveLink();
}

/** @param {number} frames */
function stepFrames(frames) {
  state.isLive = false;
  state.isPaused = true;
  flush();  // each step counts
  play({stepFrames: frames});
  flush();
  saveLink();
}

/** @param {number} speed */
function chooseSpeed(speed) {
  state.speed = speed;
  if (speed !== 1) state.isLive = false;
  play({speed});
  showDisplay();
  saveLink();
}

const timeline = new Timeline(byId('timeline'), timeUs => {
  state.isLive = false;
  state.timeUs = timeUs;
  play({sceneTimeUs: String(timeUs)});
  saveLink();
});

// ---- agents

/** @param {number} x @param {number} y CSS pixels of the picture */
async function click(x, y) {
  const header = view.header;
  if (!header) return;
  const {factor} = view.placement();
  const answer = await connection.ask({pickAgent: {
    options: {crowdName: state.crowd, camera: header.camera, widthPx: header.widthPx, heightPx: header.heightPx},
    sceneTimeUs: header.sceneTimeUs ?? '0', xPx: x / factor, yPx: y / factor}});
  const agent = answer.pickAgent ?? {};
  if (!agent.found) {
    if (state.follow) stopFollowing();
    return;
  }
  showAgent(agent);
  const goal = heldCamera()?.copy();
  if (!goal) return;
  goal.target = pointOf(agent.position);
  goal.distance = Math.min(goal.distance, 12);
  goal.target[2] += goal.followHeight();
  stopFollowing(true);
  glide(goal, () => {
    state.follow = agent.id;
    lastFollowStamp = Infinity;
    ask({followAgent: agent.id, ...overlayOptions()});
    saveLink();
  });
}

/** @param {boolean} [keepsCard] */
function stopFollowing(keepsCard = false) {
  if (!keepsCard) byId('agent').hidden = true;
  if (!state.follow) return;
  state.follow = '';
  ask({followAgent: '0', ...cameraOptions(), ...overlayOptions()});
  saveLink();
}

async function refreshAgent() {
  const header = view.header;
  if (!state.follow || !header || connection.state !== 'open') return;
  const answer = await connection.ask({pickAgent: {
    options: {crowdName: state.crowd}, sceneTimeUs: header.sceneTimeUs ?? '0', id: state.follow}});
  if (answer.pickAgent?.id === state.follow) showAgent(answer.pickAgent);
}

// ---- view commands

function fit() {
  stopFollowing();
  state.before = null;
  const seen = view.header;
  if (state.camera?.ortho && seen?.overviewLow && seen.overviewHigh) {
    const goal = state.camera.copy();
    goal.fit(pointOf(seen.overviewLow), pointOf(seen.overviewHigh), canvas.clientWidth / canvas.clientHeight);
    glide(goal);
    return;
  }
  state.camera = null;
  byId('top-down').setAttribute('aria-pressed', 'false');
  ask({overview: true});
  saveLink();
}

function toggleTopDown() {
  const camera = heldCamera();
  if (!camera) return;
  if (camera.ortho) {
    const goal = (state.before ?? camera).copy();
    goal.target = [...camera.target];
    goal.distance = camera.distance;
    goal.ortho = false;
    if (!state.before) goal.pitch = 0.6;
    camera.ortho = false;
    glide(goal);
    return;
  }
  state.before = camera.copy();
  const goal = camera.copy();
  goal.pitch = HIGHEST_PITCH;
  goal.yaw = -Math.PI / 2;  // north is up
  goal.ortho = true;
  glide(goal);
}

async function saveScreenshot() {
  view.draw();
  toast(`Saved ${await screenshot(canvas, state.crowd)}`);
}

function toggleRecording() {
  if (recorder.isOn) {
    recorder.stop();
  } else {
    recorder.start(state.crowd, (name, bytes) => toast(
        bytes ? `Saved ${name}, ${(bytes / 1e6).toFixed(1)} MB` : 'Nothing recorded: no picture came in that time'));
  }
  byId('record').setAttribute('aria-pressed', String(recorder.isOn));
  showRecording();
}

function showRecording() {
  const time = () => formatTime((performance.now() - recorder.began) * 1000).slice(0, -2);
  byId('record-time').textContent = recorder.isOn ? `${time()} ${(recorder.bytes / 1e6).toFixed(1)} MB` : '';
}

/** @param {string} id */
function togglePanel(id) {
  const panel = byId(id);
  panel.hidden = !panel.hidden;
  byId(`${id}-button`).setAttribute('aria-expanded', String(!panel.hidden));
  if (!panel.hidden && canvas.clientWidth <= 720) {
    const other = id === 'display' ? 'stats' : 'display';
    byId(other).hidden = true;
    byId(`${other}-button`).setAttribute('aria-expanded', 'false');
  }
}

// ---- the address

function saveLink() {
  clearTimeout(linkTimer);
  linkTimer = window.setTimeout(() => {
    const hash = formatLink({
      crowd: state.crowd, camera: state.camera, follow: state.follow, timeUs: state.isLive ? null : state.timeUs,
      speed: state.isLive ? 1 : state.speed, channel: state.channel, colorMap: state.colorMap,
      low: state.low, high: state.high, show: [...state.show].sort(),
    });
    if (hash !== location.hash) history.replaceState(null, '', hash || location.pathname);
  }, 250);
}

window.addEventListener('hashchange', () => {
  wantsLink = parseLink(location.hash);
  state.crowd = state.crowd && wantsLink.crowd === state.crowd ? '' : state.crowd;
  if (crowds.some(crowd => crowd.name === wantsLink.crowd)) {
    openCrowd(wantsLink.crowd);
  } else {
    state.crowd = '';
    connection.send({endView: {}});
    view.clear();
    byId('crowd-name').textContent = '';
    document.title = 'throng';
    showStart();
  }
});

// ---- connection

connection.onState = async stateNow => {
  const isLost = stateNow === 'lost';
  document.body.dataset.connection = stateNow;
  showBanner(isLost ? 'The server does not answer. Trying again…' : '');
  if (stateNow === 'refused') {
    byId('start').hidden = false;
    byId('start-text').textContent = connection.token ? 'That token is not known here.' : 'This server asks for a token.';
    byId('token-form').hidden = false;
    byId('token').focus();
  }
  showWaiting();
  if (stateNow !== 'open') return;
  try {
    server = (await connection.ask({getServerInfo: {}})).getServerInfo;
    needsView = true;
    await refreshCrowds();
  } catch (error) {
    if (connection.state === 'open') toast(String(/** @type {Error} */ (error).message), true);
  }
};

connection.onError = error => {
  if (error.code === 'NOT_FOUND') {
    needsView = true;
    refreshCrowds().catch(() => {});
    return;
  }
  toast(error.message, true);
};

// ---- wiring

const controls = new Controls(canvas, {
  camera: heldCamera, moved: cameraMoved, groundZ, placement: () => view.placement(), following: () => state.follow !== '',
  click: (x, y) => { click(x, y).catch(error => toast(error.message, true)); },
});

byId('fit').onclick = fit;
byId('top-down').onclick = toggleTopDown;
byId('display-button').onclick = () => togglePanel('display');
byId('stats-button').onclick = () => togglePanel('stats');
byId('screenshot').onclick = () => { saveScreenshot().catch(error => toast(error.message, true)); };
byId('record').onclick = toggleRecording;
byId('help-button').onclick = () => byId('help').showModal();
byId('help-close').onclick = () => byId('help').close();
byId('help').onclick = (/** @type {MouseEvent} */ event) => { if (event.target === byId('help')) byId('help').close(); };
byId('play').onclick = togglePlay;
byId('step-back').onclick = () => stepFrames(-1);
byId('step-forward').onclick = () => stepFrames(1);
byId('live').onclick = goLive;
byId('speed').onchange = () => chooseSpeed(Number(byId('speed').value));
byId('agent-close').onclick = () => stopFollowing();
byId('banner-retry').onclick = () => connection.retryNow();
byId('channel').onchange = () => chooseChannel(byId('channel').value);
byId('color-map').replaceChildren(...COLOR_MAP_NAMES.map(name => new Option(name, name)));
byId('color-map').onchange = () => {
  state.colorMap = byId('color-map').value;
  ask(channelOptions());
  view.redraw();
  saveLink();
};
byId('auto-range').onclick = () => { rangeIsAuto = true; ask(overlayOptions()); };
for (const id of ['low', 'high']) {
  byId(id).onchange = () => {
    const low = Number(byId('low').value), high = Number(byId('high').value);
    if (!(low < high)) { toast('The range must go from low to high', true); return; }
    [state.low, state.high] = [low, high];
    ask(channelOptions());
    showDisplay();
    saveLink();
  };
}
byId('overlays').onchange = (/** @type {any} */ event) => toggleOverlay(event.target.value);
byId('sharpness').onchange = () => { state.sharpness = Number(byId('sharpness').value); ask(pictureSize()); };
byId('budget').onchange = () => ask({vertexBudget: byId('budget').value});
byId('rate').onchange = () => ask({maxRateHz: Number(byId('rate').value)});
// A tab that nobody sees costs the server next to nothing.
document.addEventListener('visibilitychange', () => {
  ask({maxRateHz: document.hidden && !recorder.isOn ? 1 : Number(byId('rate').value)});
});
byId('shadows').onchange = () => ask({shadows: byId('shadows').checked});
byId('token-form').onsubmit = (/** @type {Event} */ event) => {
  event.preventDefault();
  byId('start-text').textContent = 'Opening…';
  connection.openWithToken(byId('token').value.trim());
};
byId('crowd-button').onclick = () => {
  const list = byId('crowd-list');
  list.hidden = !list.hidden;
  byId('crowd-button').setAttribute('aria-expanded', String(!list.hidden));
  if (!list.hidden) {
    refreshCrowds().catch(() => {});
    list.querySelector('button')?.focus();
  }
};
document.addEventListener('pointerdown', event => {
  const list = byId('crowd-list');
  if (!list.hidden && !list.contains(/** @type {Node} */ (event.target)) && !byId('crowd-button').contains(event.target)) {
    list.hidden = true;
    byId('crowd-button').setAttribute('aria-expanded', 'false');
  }
});

/** Keys, unless something that takes text or a list has them. */
document.addEventListener('keydown', event => {
  const target = /** @type {HTMLElement} */ (event.target);
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (byId('help').open) {
    if (['Escape', '?', 'h'].includes(event.key)) {
      byId('help').close();
      event.preventDefault();
    }
    return;
  }
  if (event.key === 'Escape') {
    byId('crowd-list').hidden = true;
    stopFollowing();
    canvas.focus({preventScroll: true});
    return;
  }
  if (['INPUT', 'SELECT', 'TEXTAREA'].includes(target.tagName) && /** @type {any} */ (target).type !== 'checkbox') return;
  if (event.key === ' ' && ['BUTTON', 'INPUT'].includes(target.tagName)) return;
  if (byId('crowd-list').contains(target) && event.key.startsWith('Arrow')) {
    const next = event.key === 'ArrowDown' ? target.nextElementSibling : target.previousElementSibling;
    /** @type {HTMLElement|null} */ (next)?.focus();
    event.preventDefault();
    return;
  }
  const key = event.key.toLowerCase();
  /** @type {Record<string, () => void>} */
  const commands = {
    ' ': togglePlay, ',': () => stepFrames(-1), '.': () => stepFrames(1), l: goLive, end: goLive, f: fit, home: fit,
    t: toggleTopDown, o: () => togglePanel('display'), x: () => togglePanel('stats'), r: toggleRecording,
    p: () => { saveScreenshot().catch(error => toast(error.message, true)); },
    h: () => byId('help').showModal(), '?': () => byId('help').showModal(),
    c: () => {
      const names = ['', ...(currentCrowd()?.channels ?? []).map(one => one.name)];
      chooseChannel(names[(names.indexOf(state.channel) + 1) % names.length]);
    },
    '[': () => chooseSpeed(SPEEDS[Math.max(0, SPEEDS.indexOf(state.speed) - 1)]),
    ']': () => chooseSpeed(SPEEDS[Math.min(SPEEDS.length - 1, SPEEDS.indexOf(state.speed) + 1)]),
  };
  const overlay = /** @type {Record<string, string>} */ (OVERLAY_KEYS)[key];
  if (overlay) toggleOverlay(overlay);
  else if (commands[key]) commands[key]();
  else if (!controls.keyDown(event)) return;
  event.preventDefault();
});

new ResizeObserver(() => {
  view.resize(Math.min(window.devicePixelRatio || 1, 2));
  ask(pictureSize());
}).observe(canvas);

let bytesBefore = 0;
setInterval(() => {
  const bytes = connection.receivedBytes - bytesBefore;
  bytesBefore = connection.receivedBytes;
  if (!byId('stats').hidden) showStats(view, bytes, server.rasterizer ?? '');
  showRecording();
  refreshAgent().catch(() => {});
}, 1000);
setInterval(() => { if (state.crowd && connection.state === 'open' && !pending) ask({}); }, STAMP_EVERY_MS);
setInterval(() => { refreshCrowds().catch(() => {}); }, 2500);

// For measurements from outside.
/** @type {any} */ (window).throngView = view;
showWaiting();
connection.open();
