// The scene in MuJoCo's web build: the arm, driven as PyBullet's motors drive it, and the two cubes.
"use strict";
var PtaeLive = globalThis.PtaeLive ||= {};

// The engine from the two files of its package: they need not come from a server.
PtaeLive.loadMuJoCo = async (script, wasmBinary) => {
  const url = URL.createObjectURL(new Blob([script], {type: "text/javascript"}));
  try {
    return await (await import(url)).default({wasmBinary, locateFile: name => name});
  } finally {
    URL.revokeObjectURL(url);
  }
};

PtaeLive.World = class {
  // scene: the constants that scene.py exports, with the model of the scene as text
  constructor(mujoco, scene) {
    this.mujoco = mujoco;
    this.scene = scene;
    this.inverse = new PtaeLive.Inverse(scene);
    this.model = mujoco.MjModel.from_xml_string(scene.mjcf);
    this.data = new mujoco.MjData(this.model);
    this.inertia = new mujoco.DoubleBuffer(this.model.nv ** 2);
    const bodyOf = this.model.geom_bodyid;
    const body = name => mujoco.mj_name2id(this.model, mujoco.mjtObj.mjOBJ_BODY.value, name);
    const cubes = scene.sides.map(body);
    // of each geom: the cube that it is, "arm" or "table"
    this.whose = Array.from(bodyOf, id => id === 0 ? "table" : cubes.includes(id) ? cubes.indexOf(id) : "arm");
  }

  // The arm at home, two cubes on the table; then one frame at rest, as in the recording.
  reset({places_m, yaws_rad}) {
    const {mujoco, scene, data} = this;
    mujoco.mj_resetData(this.model, data);
    data.qpos.set(scene.home_rad);
    places_m.forEach(([x, y], side) => {
      const z = scene.table_top_m + scene.cube_edge_m / 2, half = yaws_rad[side] / 2;
      data.qpos.set([x, y, z, Math.cos(half), 0, 0, Math.sin(half)], this.joints + 7 * side);
    });
    this.target_rad = scene.home_rad;
    this.drive(scene.home_rad);
  }

  get joints() { return this.scene.home_rad.length; }
  joints_rad() { return Array.from(this.data.qpos.subarray(0, this.joints)); }

  // The left and the right cube: position in metres, quaternion x y z w.
  cubes() {
    return this.scene.sides.map((_, side) => {
      const [x, y, z, w, a, b, c] = this.data.qpos.subarray(this.joints + 7 * side);
      return [x, y, z, a, b, c, w];
    });
  }

  // Puts a cube elsewhere and leaves it at rest there, as a hand would.
  shift(side, [x, y]) {
    const {qpos, qvel} = this.data, at = this.joints + 7 * side;
    qpos[at] += x;
    qpos[at + 1] += y;
    qvel.fill(0, this.joints + 6 * side, this.joints + 6 * side + 6);
  }

  // Moves the arm to target_rad in one frame of physics; returns which cubes it touched.
  // The motors follow angles that go at constant speed from the last target to this one.
  drive(target_rad) {
    const {mujoco, scene, model, data} = this, start_rad = this.target_rad, touched = [false, false];
    const speed = target_rad.map((angle, j) => (angle - start_rad[j]) * scene.frames_per_s);
    for (let step = 1; step <= scene.substeps; step++) {
      mujoco.mj_step1(model, data);
      this.push(start_rad.map((angle, j) => angle + (target_rad[j] - angle) * step / scene.substeps), speed);
      mujoco.mj_step2(model, data);
      this.notice(touched);
    }
    this.target_rad = Array.from(target_rad);
    return touched;
  }

  // PyBullet's position control: within one step, the motor reaches the speed
  //     position gain * error / step + wanted speed * velocity gain + speed now * (1 - velocity gain).
  // The torque for that is the arm's inertia times its acceleration, plus what gravity takes.
  push(wanted_rad, wanted_speed) {
    const {mujoco, scene, model, data} = this, n = model.nv, step_s = 1 / (scene.frames_per_s * scene.substeps);
    const q = data.qpos, v = data.qvel, bias = data.qfrc_bias, ctrl = data.ctrl;
    const a = wanted_rad.map((angle, j) => (scene.position_gain * (angle - q[j]) / step_s
      + scene.velocity_gain * (wanted_speed[j] - v[j])) / step_s);
    mujoco.mj_fullM(model, data, this.inertia);
    const M = this.inertia.GetView();
    a.forEach((_, j) => { ctrl[j] = a.reduce((sum, value, k) => sum + M[n * j + k] * value, bias[j]); });
  }

  notice(touched) {
    const contacts = this.data.contact;
    for (let i = 0; i < contacts.size(); i++) {
      const one = contacts.get(i), pair = [this.whose[one.geom1], this.whose[one.geom2]];
      if (pair.includes("arm")) pair.forEach(who => { if (who in touched) touched[who] = true; });
      one.delete();
    }
    contacts.delete();
  }

  delete() {
    this.inertia.delete();
    this.data.delete();
    this.model.delete();
  }
};
