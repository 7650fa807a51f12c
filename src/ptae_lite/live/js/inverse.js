// Inverse kinematics: robot/inverse.py for a page.
"use strict";
var PtaeLive = globalThis.PtaeLive ||= {};
{
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const minus = (a, b) => a.map((x, i) => x - b[i]);
  const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
  const clip = (x, low, high) => Math.min(Math.max(x, low), high);

  // The x of `rows` x = right: elimination with the largest pivot. Both are used up.
  function solve(rows, right) {
    const n = right.length;
    for (let k = 0; k < n; k++) {
      let best = k;
      for (let r = k + 1; r < n; r++) if (Math.abs(rows[r][k]) > Math.abs(rows[best][k])) best = r;
      [rows[k], rows[best]] = [rows[best], rows[k]];
      [right[k], right[best]] = [right[best], right[k]];
      for (let r = k + 1; r < n; r++) {
        const share = rows[r][k] / rows[k][k];
        if (share === 0) continue;
        for (let c = k; c < n; c++) rows[r][c] -= share * rows[k][c];
        right[r] -= share * right[k];
      }
    }
    for (let k = n - 1; k >= 0; k--) {
      for (let c = k + 1; c < n; c++) right[k] -= rows[k][c] * right[c];
      right[k] /= rows[k][k];
    }
    return right;
  }

  PtaeLive.Inverse = class {
    // scene: the constants that scene.py exports
    constructor({links, fingertip_m, home_rad, lower_rad, upper_rad, inverse}) {
      Object.assign(this, {links, fingertip_m, lower_rad, upper_rad, ...inverse});
      this.home_m = this.fingertip(home_rad);
    }

    // Where the fingertips are and where the hand points; of each joint its axis and its place.
    hand(joints_rad) {
      const poses = PtaeLive.linksAt(this.links, joints_rad), hand = poses[this.links.at(-1).name];
      const down = [2, 6, 10].map(i => -hand[i]), tip = [3, 7, 11].map((i, k) => hand[i] + this.fingertip_m * down[k]);
      const joints = joints_rad.map((_, j) => {
        const {name, axis} = this.links[j], pose = poses[name];
        return {axis: [0, 4, 8].map(row => dot(pose.slice(row, row + 3), axis)), place: [3, 7, 11].map(i => pose[i])};
      });
      return {tip, down, joints};
    }

    fingertip(joints_rad) {
      return this.hand(joints_rad).tip;
    }

    // How far the fingertips are from where they are at home.
    away_m(joints_rad) {
      return Math.hypot(...minus(this.fingertip(joints_rad), this.home_m));
    }

    // Angles that bring the fingertips to a point, or as near as the arm reaches.
    towards(target_m, joints_rad) {
      const now = joints_rad.map((angle, j) => clip(angle, this.lower_rad[j], this.upper_rad[j]));
      const [straight] = this.nearest([target_m], [now], this.near_enough_rad, this.near_damping);
      if (straight.miss_m <= this.tolerance_m) return straight.q;
      const start_m = this.fingertip(now), count = this.places_on_the_way;
      const places = Array.from({length: count - 1}, (_, k) =>
        start_m.map((x, i) => x + (1 - (k + 1) / count) * (target_m[i] - x)));
      const reached = this.search(places).filter(({miss_m}) => miss_m <= this.tolerance_m);
      const found = [straight.q, ...reached.map(({q}) => q), now];
      const off = found.map(q => Math.hypot(...minus(this.fingertip(q), target_m)));
      return found[off.indexOf(Math.min(...off))];
    }

    // Angles for points, found from the resting posture, and by how much each misses.
    search(targets_m) {
      return this.nearest(targets_m, targets_m.map(() => this.rest_rad), this.last_step_rad, this.damping);
    }

    nearest(targets_m, from, near_enough_rad, damping) {
      let all = from.map(q => ({q, free: q.map(() => 1), moved: 0}));
      for (let step = 0; step < this.steps; step++) {
        all = all.map((one, k) => this.nearer(one, targets_m[k], damping));
        if (Math.max(...all.map(one => one.moved)) < near_enough_rad) break;
      }
      return all.map(({q}, k) => ({q, miss_m: Math.hypot(...minus(this.fingertip(q), targets_m[k]))}));
    }

    // One step of the search. The Lagrange conditions of the linearised problem are the system.
    nearer({q, free}, target_m, damping) {
      const n = q.length, {tip, down, joints} = this.hand(q), weight = this.posture_weight ** 2;
      const ofTip = joints.map(({axis, place}, j) => cross(axis, minus(tip, place)).map(x => x * free[j]));
      const ofDown = joints.map(({axis}, j) => cross(axis, down).map(x => x * free[j]));
      const off = minus([0, 0, -1], down), far = minus(target_m, tip);
      const rows = joints.map((_, j) => [...joints.map((_, k) => dot(ofDown[j], ofDown[k]) + (j === k ? weight + damping : 0)), ...ofTip[j]]);
      for (let i = 0; i < 3; i++) rows.push([...ofTip.map(one => one[i]), ...[0, 1, 2].map(k => i === k ? -1e-9 : 0)]);
      const right = [...q.map((angle, j) => dot(ofDown[j], off) + weight * (this.rest_rad[j] - angle)), ...far];
      const step = solve(rows, right).slice(0, n);
      const share = Math.min(1, this.largest_step_rad / Math.max(1e-12, ...step.map(Math.abs)));
      const wanted = q.map((angle, j) => angle + share * step[j]);
      const after = wanted.map((angle, j) => clip(angle, this.lower_rad[j], this.upper_rad[j]));
      return {q: after, free: after.map((angle, j) => Number(angle === wanted[j])),
        moved: Math.max(...after.map((angle, j) => Math.abs(angle - q[j])))};
    }
  };
}
