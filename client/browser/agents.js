// Agents that come with a frame, and where they went: for what is drawn over the picture.

import {bytesOf} from './connection.js';
import {pointOf} from './camera.js';

const TRAIL_S = 6;
const MOST_POINTS = 60;

/** @typedef {{id: string, x: number, y: number, z: number, value: number}} Agent */

/** Unpacks a frame's columns. @param {import('./connection.js').AgentColumns} columns
 * @returns {Agent[]} */
export function unpackAgents(columns) {
  const ids = bytesOf(columns.ids), positions = bytesOf(columns.positions), values = bytesOf(columns.values);
  const idView = new DataView(ids.buffer), positionView = new DataView(positions.buffer);
  const valueView = new DataView(values.buffer);
  const origin = pointOf(columns.origin);
  const agents = [];
  for (let i = 0; i < ids.length / 8; i++) {
    agents.push({
      id: String(idView.getBigUint64(8 * i, true)),
      x: origin[0] + positionView.getFloat32(12 * i, true),
      y: origin[1] + positionView.getFloat32(12 * i + 4, true),
      z: origin[2] + positionView.getFloat32(12 * i + 8, true),
      value: values.length ? valueView.getFloat32(4 * i, true) : NaN,
    });
  }
  return agents;
}

/** Where each agent was in the last seconds, gathered from the frames that were seen. */
export class Trails {
  constructor() {
    /** @type {Map<string, {times: number[], points: import('./camera.js').Point[]}>} */
    this.trails = new Map();
    this.lastUs = 0;
  }

  clear() {
    this.trails.clear();
  }

  /** @param {number} timeUs @param {Agent[]} agents */
  add(timeUs, agents) {
    // Another moment: what was seen there belongs to another way here.
    if (Math.abs(timeUs - this.lastUs) > 2e6) this.clear();
    const spacing = TRAIL_S * 1e6 / MOST_POINTS;
    this.lastUs = timeUs;
    for (const agent of agents) {
      let trail = this.trails.get(agent.id);
      if (!trail) this.trails.set(agent.id, trail = {times: [], points: []});
      const last = trail.times[trail.times.length - 1];
      if (last !== undefined && last > timeUs) {  // played backwards
        while (trail.times.length && trail.times[trail.times.length - 1] > timeUs) {
          trail.times.pop();
          trail.points.pop();
        }
      } else if (last === undefined || timeUs - last >= spacing) {
        trail.times.push(timeUs);
        trail.points.push([agent.x, agent.y, agent.z + 0.03]);
      }
      while (trail.times.length && timeUs - trail.times[0] > TRAIL_S * 1e6) {
        trail.times.shift();
        trail.points.shift();
      }
    }
    for (const [id, trail] of this.trails) {
      const last = trail.times[trail.times.length - 1];
      if (last === undefined || timeUs - last > TRAIL_S * 1e6) this.trails.delete(id);
    }
  }
}
