// The talk with the server: requests with answers, frames, and coming back after a loss.

/**
 * @typedef {{x?: number, y?: number, z?: number}} Vec3Message
 * @typedef {{eye: Vec3Message, target: Vec3Message, up?: Vec3Message, fovYDeg?: number,
 *   orthoHeightM?: number}} CameraMessage
 * @typedef {{name: string, unit?: string}} Channel
 * @typedef {{name: string, agents?: number, live?: boolean, producer?: string, viewers?: number,
 *   oldestTimeUs?: string, newestTimeUs?: string, frames?: string, low: Vec3Message, high: Vec3Message,
 *   channels?: Channel[], runId?: string}} CrowdInfo
 * @typedef {{live?: boolean, sceneTimeUs?: string, paused?: boolean, speed?: number,
 *   stepFrames?: number}} Playback
 * @typedef {{ids?: string, positions?: string, values?: string, origin: Vec3Message,
 *   leftOut?: number}} AgentColumns
 * @typedef {{lowX?: number, lowY?: number, groundZ?: number, cellM: number, columns: number,
 *   levels: string, highest?: number}} DensityGrid
 * @typedef {{frameIndex: string, sceneTimeUs?: string, captureTimeUs?: string,
 *   oldestTimeUs?: string, widthPx: number, heightPx: number, stats: any, skippedFrames?: string,
 *   camera: CameraMessage, serverMs?: number, live?: boolean, playback: Playback, stamp?: string,
 *   followedAgent?: string, agents?: AgentColumns, density?: DensityGrid,
 *   sameImage?: boolean, overviewLow?: Vec3Message, overviewHigh?: Vec3Message}} FrameHeader
 *   Fields that are 0, false or empty are left out; 64-bit integers are strings.
 */

const RETRY_FIRST_MS = 400;
const RETRY_LONGEST_MS = 4000;

/** An answer that is an error: its code is gRPC's. */
export class RequestError extends Error {
  /** @param {string} code @param {string} message */
  constructor(code, message) {
    super(message);
    this.code = code;
  }
}

/** A WebSocket that comes back by itself. */
export class Connection {
  /** @param {string} url */
  constructor(url) {
    this.url = url;
    this.token = '';
    /** @type {'connecting'|'open'|'lost'|'refused'} */
    this.state = 'connecting';
    /** @type {(state: string) => void} */
    this.onState = () => {};
    /** @type {(header: FrameHeader, image: Uint8Array) => void} */
    this.onFrame = () => {};
    /** @type {(error: RequestError) => void} An error that answers no `ask`. */
    this.onError = () => {};
    /** @type {Map<number, {resolve: (value: any) => void, reject: (error: Error) => void}>} */
    this.waiting = new Map();
    this.lastId = 0;
    this.retryMs = RETRY_FIRST_MS;
    this.retryTimer = 0;
    this.receivedBytes = 0;
    /** @type {WebSocket|null} */
    this.socket = null;
  }

  open() {
    clearTimeout(this.retryTimer);
    const socket = new WebSocket(this.url);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    socket.onopen = () => {
      this.retryMs = RETRY_FIRST_MS;
      if (this.token) socket.send(JSON.stringify({token: this.token}));
      this.setState('open');
    };
    socket.onmessage = event => {
      if (this.socket === socket) this.receive(event.data);
    };
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.socket = null;
      for (const {reject} of this.waiting.values()) reject(new RequestError('UNAVAILABLE', 'the connection was lost'));
      this.waiting.clear();
      if (this.state === 'refused') return;
      this.setState('lost');
      this.retryTimer = window.setTimeout(() => this.open(), this.retryMs);
      this.retryMs = Math.min(RETRY_LONGEST_MS, this.retryMs * 1.6);
    };
  }

  /** Tries at once instead of when the time comes. */
  retryNow() {
    if (!this.socket) this.open();
  }

  /** Begins anew with a token. @param {string} token */
  openWithToken(token) {
    this.token = token;
    this.state = 'connecting';
    this.open();
  }

  /**
   * Asks and waits. `body` has one field of WebRequest, such as {listCrowds: {}}.
   * @param {object} body
   * @returns {Promise<any>}
   */
  ask(body) {
    return new Promise((resolve, reject) => {
      const id = ++this.lastId;
      if (!this.send({id, ...body})) {
        reject(new RequestError('UNAVAILABLE', 'not connected'));
        return;
      }
      this.waiting.set(id, {resolve, reject});
    });
  }

  /** Says and does not wait. @param {object} message @returns {boolean} false: not connected. */
  send(message) {
    if (this.state !== 'open' || !this.socket) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /** @param {string|ArrayBuffer} data */
  receive(data) {
    if (typeof data !== 'string') {
      this.receivedBytes += data.byteLength;
      const length = new DataView(data).getUint32(0, true);
      const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
      this.onFrame(header.frame, new Uint8Array(data, 4 + length));
      return;
    }
    this.receivedBytes += data.length;
    const message = JSON.parse(data);
    const waiting = this.waiting.get(message.id);
    if (waiting) this.waiting.delete(message.id);
    if (message.error) {
      const error = new RequestError(message.error.code, message.error.message);
      if (error.code === 'UNAUTHENTICATED') this.setState('refused');
      if (waiting) waiting.reject(error);
      else this.onError(error);
    } else if (waiting) {
      waiting.resolve(message);
    }
  }

  /** @param {'connecting'|'open'|'lost'|'refused'} state */
  setState(state) {
    if (this.state === state && state !== 'open') return;
    this.state = state;
    this.onState(state);
  }
}

/** Bytes of a base64 field. @param {string|undefined} text @returns {Uint8Array} */
export function bytesOf(text) {
  const binary = atob(text || '');
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}
