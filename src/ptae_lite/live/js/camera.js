// The picture of the robot's right eye, drawn as PyBullet's TinyRenderer draws it: triangles, a depth
// buffer, one light, no shadow.
"use strict";
var PtaeLive = globalThis.PtaeLive ||= {};

PtaeLive.Camera = class {
  // camera: the constants that camera.py exports; links: the arm's chain
  constructor(camera, links) {
    Object.assign(this, {camera, links});
    this.depth = new Float64Array(camera.width * camera.height);
    this.pixels = new Uint8ClampedArray(4 * camera.width * camera.height);
  }

  // What the eye sees: RGBA, row by row from the top. The array is used again for the next picture.
  image(joints_rad, cubes, colours) {
    const {shapes, cube, colours: rgb} = this.camera, links = PtaeLive.linksAt(this.links, joints_rad);
    this.depth.fill(-Infinity);
    this.pixels.fill(255);
    shapes.forEach(shape => this.draw(shape, shape.rgb, links[shape.link]));
    cubes.forEach((pose, side) => this.draw(cube, rgb[colours[side]], PtaeLive.poseOf(pose)));
    return this.pixels;
  }

  draw({corners, normals}, rgb, pose) {
    const {matrix, eye_m} = this.camera, base = rgb.map(part => Math.floor(255 * part));
    for (let first = 0; first < corners.length; first += 9) {
      const world = [0, 3, 6].map(at => PtaeLive.placed(pose, corners, first + at, 1));
      const [a, b, c] = world, u = b.map((x, i) => x - a[i]), v = c.map((x, i) => x - a[i]);
      const facing = (a[0] - eye_m[0]) * (u[1] * v[2] - u[2] * v[1])
        + (a[1] - eye_m[1]) * (u[2] * v[0] - u[0] * v[2]) + (a[2] - eye_m[2]) * (u[0] * v[1] - u[1] * v[0]);
      if (facing >= 0) continue;  // seen from behind
      const clip = world.map(p => [0, 4, 8, 12].map(row =>
        matrix[row] * p[0] + matrix[row + 1] * p[1] + matrix[row + 2] * p[2] + matrix[row + 3]));
      if (clip.some(p => p[2] < -p[3])) continue;  // reaches behind the eye
      this.fill(clip, [0, 3, 6].map(at => PtaeLive.placed(pose, normals, first + at, 0)), base);
    }
  }

  // A triangle in clip coordinates, with the normals of its corners.
  fill(clip, normals, base) {
    const {width, height} = this.camera;
    const x = clip.map(p => width / 2 * (p[0] / p[3] + 1)), y = clip.map(p => height / 2 * (p[1] / p[3] + 1));
    const area = (x[2] - x[0]) * (y[1] - y[0]) - (x[1] - x[0]) * (y[2] - y[0]);
    if (Math.abs(area) <= 0.01) return;
    const left = Math.floor(Math.max(0, Math.min(...x))), right = Math.min(width - 1, Math.max(...x));
    const low = Math.floor(Math.max(0, Math.min(...y))), high = Math.min(height - 1, Math.max(...y));
    for (let px = left; px <= right; px++)
      for (let py = low; py <= high; py++) {
        const second = ((x[2] - x[0]) * (py - y[0]) - (px - x[0]) * (y[2] - y[0])) / area;
        const third = ((px - x[0]) * (y[1] - y[0]) - (x[1] - x[0]) * (py - y[0])) / area;
        const first = 1 - second - third;
        if (first < 0 || second < 0 || third < 0) continue;
        let weights = [first / clip[0][3], second / clip[1][3], third / clip[2][3]];
        const sum = weights[0] + weights[1] + weights[2];
        weights = weights.map(w => w / sum);
        const depth = -(clip[0][2] * weights[0] + clip[1][2] * weights[1] + clip[2][2] * weights[2]);
        const at = width * (height - 1 - py) + px;  // rows go down
        if (this.depth[at] > depth) continue;
        this.depth[at] = depth;
        this.shade(4 * at, normals, weights, base);
      }
  }

  shade(at, normals, weights, base) {
    const {light, ambient, diffuse} = this.camera;
    const n = [0, 1, 2].map(i => normals[0][i] * weights[0] + normals[1][i] * weights[1] + normals[2][i] * weights[2]);
    const lit = Math.max(0, (n[0] * light[0] + n[1] * light[1] + n[2] * light[2]) / Math.hypot(...n));
    for (let i = 0; i < 3; i++) this.pixels[at + i] = Math.floor((ambient + diffuse * lit) * base[i]);
  }
};

// A point (last: 1) or a direction (last: 0) of a list, in the world. Without a pose it is there already.
PtaeLive.placed = (pose, list, at, last) => {
  const [x, y, z] = [list[at], list[at + 1], list[at + 2]];
  if (!pose) return [x, y, z];
  return [0, 4, 8].map(row => pose[row] * x + pose[row + 1] * y + pose[row + 2] * z + pose[row + 3] * last);
};
