// Poses of the arm's links and of the cubes: 4 x 4 matrices, row by row, as lists of 16 numbers.
"use strict";
var PtaeLive = globalThis.PtaeLive ||= {};

PtaeLive.multiply = (a, b) => Array.from({length: 16}, (_, i) => {
  const row = i & ~3, column = i & 3;
  return a[row] * b[column] + a[row + 1] * b[column + 4] + a[row + 2] * b[column + 8] + a[row + 3] * b[column + 12];
});

// A rotation about a unit axis by an angle, then a shift.
PtaeLive.turned = ([x, y, z], angle_rad, [px, py, pz]) => {
  const s = Math.sin(angle_rad), c = Math.cos(angle_rad), v = 1 - c;
  return [
    c + x * x * v, x * y * v - z * s, x * z * v + y * s, px,
    y * x * v + z * s, c + y * y * v, y * z * v - x * s, py,
    z * x * v - y * s, z * y * v + x * s, c + z * z * v, pz,
    0, 0, 0, 1,
  ];
};

// The pose of a cube: position in metres, quaternion x y z w.
PtaeLive.poseOf = ([px, py, pz, x, y, z, w]) => [
  1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), px,
  2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), py,
  2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), pz,
  0, 0, 0, 1,
];

// Forward kinematics: the pose of each link of the arm in the world, by name.
PtaeLive.linksAt = (links, joints_rad) => {
  const poses = {};
  let parent = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  links.forEach(({name, origin_m, axis, angle_rad}, j) => {
    parent = PtaeLive.multiply(parent, PtaeLive.turned(axis, angle_rad ?? joints_rad[j], origin_m));
    poses[name] = parent;
  });
  return poses;
};
