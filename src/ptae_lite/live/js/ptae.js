// A PTAE in the page: its networks, one after another, as `PTAE.forward` runs them.
"use strict";
PtaeLive.PTAE = class {
  // Each is opened once, however many parts ask for it.
  static open(name) {
    return (this.opened ??= {})[name] ??= this.start(name);
  }
  static async start(name) {
    const [pack] = await PtaeLive.load([name]), networks = PtaeLive.networks(pack);
    await networks.encode.open(); // starts the runtime, while other packs are unpacked
    return new (pack.about.watches ? PtaeLive.Watcher : PtaeLive.PTAE)(networks, pack.about);
  }
  constructor(networks, about) {
    this.networks = networks;
    this.about = about;
    this.scaling = new PtaeLive.Scaling(about.scaling);
  }
  // The code, and the attention weights [heads][tokens][frames].
  async encode({tokens, mask, keys, frames, query}) {
    const count = keys.length / 35;
    const {code, attention} = await this.networks.encode.run({
      tokens: [tokens, 1, 6], token_mask: [mask, 1, 6], keys: [keys, 1, count, 35],
      frames: [BigInt64Array.of(BigInt(frames)), 1]});
    const rows = (head, token) => attention.data.subarray((6 * head + token) * count, (6 * head + token + 1) * count);
    const heads = Array.from({length: attention.dims[1]}, (_, head) =>
      Array.from({length: query}, (_, token) => rows(head, token)));
    return {code, attention: heads};
  }
  // The probabilities of the words at each of four steps.
  async say(code) {
    return this.probabilities(await this.networks.say.run({code}));
  }
  probabilities({words}) {
    const size = words.dims[2];
    return Array.from({length: words.dims[1]}, (_, i) =>
      Float64Array.from(words.data.subarray(size * i, size * (i + 1)), Math.exp));
  }
  // The decoder's first states.
  start(code) {
    return this.networks.start.run({code});
  }
  // One pose: the next pose and the states after it, to be given to the next step.
  async step(code, frame, pose, states) {
    const after = await this.networks.step.run({code, frame: [frame, 1, 30], pose: [pose, 1, 5], ...states});
    const kept = {};
    for (const name of Object.keys(states)) kept[name] = after[`${name}_after`];
    return {pose: after.pose_after.data, states: kept};
  }
  // Poses 2 to steps + 1, in network units. video: a function of the step.
  async act(code, video, start, steps = PtaeLive.FRAMES - 1) {
    const poses = new Float32Array(5 * steps);
    let states = await this.start(code), pose = start;
    for (let t = 0; t < steps; t++) {
      ({pose, states} = await this.step(code, this.about.freeze_video ? video(0) : video(t), pose, states));
      poses.set(pose, 5 * t);
    }
    return poses;
  }
  // Everything that it answers to a batch.
  async answer(batch, {words = true, motion = true} = {}) {
    const {code, attention} = await this.encode(batch);
    const told = words ? await this.say(code) : null;
    const joints = motion ? await this.act(code, batch.video, batch.start) : null;
    return {code, attention, told, joints};
  }
};
PtaeLive.best = told => told.map(row => row.indexOf(Math.max(...row)));
