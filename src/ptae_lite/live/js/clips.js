// Recorded clips, and the numbers that a network sees of them.
"use strict";
PtaeLive.FRAMES = 100;

// Whole numbers that were stored as differences, back to rows of numbers.
PtaeLive.dequantise = (bytes, range, columns) => {
  const steps = new Uint16Array(bytes.buffer, bytes.byteOffset, bytes.length / 2);
  const [low, step] = [0, 1].map(k => new Float64Array(range.buffer, range.byteOffset + 8 * k * columns, columns));
  const rows = steps.length / columns, numbers = new Float64Array(steps.length);
  for (let c = 0, at = 0; c < columns; c++)
    for (let r = 0, level = 0; r < rows; r++, at++) {
      level = level + steps[at] & 0xffff;
      numbers[r * columns + c] = low[c] + step[c] * level;
    }
  return numbers;
};

// A clip: its frames, and rows of features (30) and joints (5) as recorded.
PtaeLive.clips = ({parts, about}) => {
  const features = PtaeLive.dequantise(parts.features, parts.features_range, 30);
  const joints = PtaeLive.dequantise(parts.joints, parts.joints_range, 5);
  let at = 0;
  return about.clips.map(clip => {
    const from = at;
    at += clip.frames;
    const colour = clip.colours[clip.side === "left" ? 0 : 1];
    return {...clip, colour, sentence: `${clip.action} ${colour} ${clip.speed}`,
      features: features.subarray(30 * from, 30 * at), joints: joints.subarray(5 * from, 5 * at)};
  });
};

// The fixed linear maps in front of a model (`ptae_lite.data.scaling`).
PtaeLive.Scaling = class {
  constructor({joint_low, joint_high, feature_mean, feature_map}) {
    this.low = joint_low;
    this.range = joint_high.map((high, j) => high - joint_low[j]);
    this.mean = feature_mean;
    this.map = feature_map;
  }
  features(rows) {
    const n = this.mean.length, made = new Float32Array(rows.length), row = new Float64Array(n);
    for (let at = 0; at < rows.length; at += n) {
      row.fill(0);
      for (let i = 0; i < n; i++) {
        const value = rows[at + i] - this.mean[i], weights = this.map[i];
        for (let o = 0; o < n; o++) row[o] += value * weights[o];
      }
      made.set(row, at);
    }
    return made;
  }
  joints(rows) {
    return Float32Array.from(rows, (value, i) =>
      0.9 * (2 * (value - this.low[i % 5]) / this.range[i % 5] - 1));
  }
  jointsBack(rows) {
    return Float64Array.from(rows, (value, i) =>
      (value / 0.9 + 1) / 2 * this.range[i % 5] + this.low[i % 5]);
  }
  // A clip in the units of the network.
  clip(clip) {
    return {frames: clip.frames, features: this.features(clip.features), joints: this.joints(clip.joints)};
  }
};
