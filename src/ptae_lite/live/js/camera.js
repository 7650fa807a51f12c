// The picture of the robot's right eye, drawn as PyBullet's TinyRenderer draws it: triangles, a depth
// buffer, one light, no shadow.
"use strict";
var PtaeLive = globalThis.PtaeLive ||= {};
{
  // A point (last: 1) or a direction (last: 0) of a list, in the world. Without a pose it is there already.
  const placed = (pose, list, at, last) => {
    const x = list[at], y = list[at + 1], z = list[at + 2];
    if (!pose) return [x, y, z];
    return [0, 4, 8].map(row => pose[row] * x + pose[row + 1] * y + pose[row + 2] * z + pose[row + 3] * last);
  };
  // Twice the area of a triangle on the screen, with its sign.
  const twice = (ax, ay, bx, by, cx, cy) => (cx - ax) * (by - ay) - (bx - ax) * (cy - ay);

  PtaeLive.Camera = class {
    // camera: the constants that camera.py exports; links: the arm's chain
    constructor(camera, links) {
      Object.assign(this, {camera, links});
      this.depth = new Float64Array(camera.width * camera.height).fill(-Infinity);
      this.pixels = new Uint8ClampedArray(4 * camera.width * camera.height).fill(255);
      const fixed = shape => shape.link === "world"; // the table never moves: it is drawn once
      camera.shapes.filter(fixed).forEach(shape => this.draw(shape, shape.rgb));
      this.moving = camera.shapes.filter(shape => !fixed(shape));
      this.empty = {depth: this.depth.slice(), pixels: this.pixels.slice()};
    }

    // What the eye sees: RGBA, row by row from the top. The array is used again for the next picture.
    image(joints_rad, cubes, colours) {
      const {cube, colours: rgb} = this.camera, links = PtaeLive.linksAt(this.links, joints_rad);
      this.depth.set(this.empty.depth);
      this.pixels.set(this.empty.pixels);
      this.moving.forEach(shape => this.draw(shape, shape.rgb, links[shape.link]));
      cubes.forEach((pose, side) => this.draw(cube, rgb[colours[side]], PtaeLive.poseOf(pose)));
      return this.pixels;
    }

    draw({corners, normals}, rgb, pose) {
      const {matrix, eye_m} = this.camera, base = rgb.map(part => Math.floor(255 * part));
      for (let first = 0; first < corners.length; first += 9) {
        const world = [0, 3, 6].map(at => placed(pose, corners, first + at, 1));
        const [a, b, c] = world, u = b.map((x, i) => x - a[i]), v = c.map((x, i) => x - a[i]);
        const facing = (a[0] - eye_m[0]) * (u[1] * v[2] - u[2] * v[1])
          + (a[1] - eye_m[1]) * (u[2] * v[0] - u[0] * v[2]) + (a[2] - eye_m[2]) * (u[0] * v[1] - u[1] * v[0]);
        if (facing >= 0) continue; // seen from behind
        const clip = world.map(p => [0, 4, 8, 12].map(row =>
          matrix[row] * p[0] + matrix[row + 1] * p[1] + matrix[row + 2] * p[2] + matrix[row + 3]));
        if (clip.some(p => p[2] < -p[3])) continue; // reaches behind the eye
        this.fill(clip, [0, 3, 6].map(at => placed(pose, normals, first + at, 0)), base);
      }
    }

    // A triangle in clip coordinates, with the normals of its corners.
    fill([a, b, c], normals, base) {
      const {width, height} = this.camera, {depth, pixels} = this;
      const [ax, bx, cx] = [a, b, c].map(p => width / 2 * (p[0] / p[3] + 1));
      const [ay, by, cy] = [a, b, c].map(p => height / 2 * (p[1] / p[3] + 1));
      const area = twice(ax, ay, bx, by, cx, cy), flat = normals.every(n => n.every((x, i) => x === normals[0][i]));
      if (Math.abs(area) <= 0.01) return;
      let colour = flat && this.shade(normals[0], base);
      const left = Math.floor(Math.max(0, Math.min(ax, bx, cx))), right = Math.min(width - 1, Math.max(ax, bx, cx));
      const low = Math.floor(Math.max(0, Math.min(ay, by, cy))), high = Math.min(height - 1, Math.max(ay, by, cy));
      for (let y = low; y <= high; y++)
        for (let x = left; x <= right; x++) {
          const ofB = twice(ax, ay, x, y, cx, cy) / area, ofC = twice(ax, ay, bx, by, x, y) / area, ofA = 1 - ofB - ofC;
          if (ofA < 0 || ofB < 0 || ofC < 0) continue;
          let wa = ofA / a[3], wb = ofB / b[3], wc = ofC / c[3]; // corrected for perspective
          const sum = wa + wb + wc, near = -(a[2] * (wa /= sum) + b[2] * (wb /= sum) + c[2] * (wc /= sum));
          const at = width * (height - 1 - y) + x; // rows go down
          if (depth[at] > near) continue;
          depth[at] = near;
          if (!flat) colour = this.shade(normals[0].map((n, i) => n * wa + normals[1][i] * wb + normals[2][i] * wc), base);
          pixels.set(colour, 4 * at);
        }
    }

    // The colour of a surface with this normal.
    shade([x, y, z], base) {
      const {light, ambient, diffuse} = this.camera;
      const lit = Math.max(0, (x * light[0] + y * light[1] + z * light[2]) / Math.hypot(x, y, z));
      return base.map(part => Math.floor((ambient + diffuse * lit) * part));
    }
  };
}
