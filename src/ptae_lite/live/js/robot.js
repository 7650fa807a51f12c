// The robot in the page: its physics, its eye and its constants, opened once.
"use strict";
PtaeLive.Robot = class {
  static async open(show) {
    const [engine, scene] = await PtaeLive.load(["mujoco", "scene"], show);
    this.mujoco ??= PtaeLive.loadMuJoCo(engine.parts.module, engine.parts.wasm);
    const mujoco = await this.mujoco;
    PtaeLive.free(engine.parts.wasm); // started once, for all robots of a page
    engine.parts = {};
    return new PtaeLive.Robot(mujoco, scene);
  }
  constructor(mujoco, {parts, about}) {
    this.about = about;
    this.world = new PtaeLive.World(mujoco, about);
    this.camera = new PtaeLive.Camera(about.camera, about.links);
    const cubes = new Float32Array(parts.cubes.buffer, parts.cubes.byteOffset, parts.cubes.length / 4);
    const number = (sample, cube, i) => cubes[14 * sample + 7 * cube + i];
    // the places of the cubes of a recorded sample
    this.recorded = sample => ({
      places_m: [0, 1].map(cube => [number(sample, cube, 0), number(sample, cube, 1)]),
      yaws_rad: [0, 1].map(cube => 2 * Math.atan2(number(sample, cube, 5), number(sample, cube, 6))),
    });
  }

  // Poses of cubes that stand on the table.
  placed({places_m, yaws_rad}) {
    const z = this.about.table_top_m + this.about.cube_edge_m / 2;
    return places_m.map(([x, y], k) => [x, y, z, 0, 0, Math.sin(yaws_rad[k] / 2), Math.cos(yaws_rad[k] / 2)]);
  }

  // What the eye sees, as an ImageData.
  look(joints_rad, cubes, colours) {
    const {width, height} = this.about.camera;
    return new ImageData(this.camera.image(joints_rad, cubes, colours).slice(), width, height);
  }

  // What the eye sees, as its code.
  see(joints_rad, cubes, colours, autoencoder) {
    return autoencoder.encode({data: this.camera.image(joints_rad, cubes, colours)});
  }

  // Acts a sentence; of tokens null, none. setting: colours, places_m, yaws_rad, perhaps shift.
  // Where the policy can describe its own act, the episode has `describe`.
  async act(policy, language, tokens, setting, autoencoder) {
    const look = (joints_rad, cubes) => this.see(joints_rad, cubes, setting.colours, autoencoder);
    const make = policy.about.watches ? PtaeLive.watching : PtaeLive.policy;
    const act = make(policy, language, tokens, look, this.world.inverse);
    const episode = await PtaeLive.perform(this.world, setting, act);
    return {...episode, describe: act.describe};
  }

  // The clip that an episode is for a model that describes: what the eye saw in each frame. The last
  // frame is held for as long as a recorded clip takes: this model reads the speed from the padding.
  async clip(episode, colours, autoencoder) {
    const seen = Math.min(episode.joints_rad.length, PtaeLive.FRAMES), last = seen - 1;
    const frames = seen >= this.about.rule.slow_from ? PtaeLive.FRAMES : Math.max(seen, PtaeLive.FRAMES / 2);
    const features = new Float32Array(30 * frames), joints = new Float32Array(5 * frames);
    for (let t = 0; t < frames; t++) {
      if (t < seen) features.set(await this.see(episode.joints_rad[t], episode.cubes[t], colours, autoencoder), 30 * t);
      else features.copyWithin(30 * t, 30 * last, 30 * seen);
      joints.set(episode.joints_rad[Math.min(t, last)], 5 * t);
    }
    return {frames, features, joints};
  }

  // The verdict as a sentence. meaning: action, colour, speed.
  told(episode, [action, colour, speed], colours) {
    const {texts, sides, table_top_m} = this.about, named = colours.indexOf(colour);
    const fill = (name, values) => texts[name].replace(/{(\w+)}/g, (_, key) => values[key]);
    const pace = fill("pace", {frames: episode.cubes.length, speed});
    const [first, last] = [episode.start, episode.cubes.at(-1)], mm = value => value.toFixed(0);
    const fell = k => last[k][2] < table_top_m;
    const moved = (k, far_mm) => fell(k) ? texts.fell : fill("moved", {mm: mm(far_mm)});
    if (named < 0) {
      const [left, right] = [0, 1].map(k => moved(k, 1000 * Math.hypot(last[k][0] - first[k][0], last[k][1] - first[k][1])));
      return {success: false, text: fill("absent", {colour, left, right, pace})};
    }
    const verdict = PtaeLive.judge(this.about, episode, {action, side: sides[named], speed});
    const text = fill("verdict", {
      how: verdict.success ? texts.done : fill("not_done", verdict), colour, side: sides[named], pace,
      named: fell(named) ? texts.fell : fill("went", {mm: mm(verdict.named_mm), way: texts.way[action]}),
      other: moved(1 - named, verdict.other_mm),
    });
    return {...verdict, text};
  }
};
