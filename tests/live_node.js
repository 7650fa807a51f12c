// node live_node.js SCRIPTS MUJOCO < asked.json: the page's physics, camera and texts without a page.
"use strict";
const fs = require("node:fs"), path = require("node:path"), vm = require("node:vm"), {pathToFileURL} = require("node:url");
const [folder, engine] = process.argv.slice(2);
globalThis.ImageData = function (data, width, height) { Object.assign(this, {data, width, height}); };
for (const name of ["kinematics", "inverse", "physics", "acting", "camera", "robot", "snatch"])
  vm.runInThisContext(fs.readFileSync(path.join(folder, `${name}.js`), "utf8"), {filename: name});
(async () => {
  const {about, acted, seen, ended, wanted, snatched} = JSON.parse(fs.readFileSync(0, "utf8"));
  const mujoco = await (await import(pathToFileURL(engine))).default();
  const robot = new PtaeLive.Robot(mujoco, {about, parts: {cubes: new Uint8Array(8)}}), made = {};
  made.acted = [];
  for (const task of acted) {
    const episode = await PtaeLive.perform(robot.world, task, PtaeLive.replay(task.joints_rad));
    made.acted.push({...episode, ...PtaeLive.judge(about, episode, task)});
  }
  made.seen = seen.map(({joints_rad, cubes, colours}) =>
    Buffer.from(robot.look(joints_rad, cubes, colours).data).toString("base64"));
  made.ended = ended.map(({episode, meaning, colours}) =>
    robot.told({...episode, start: episode.cubes[0]}, meaning, colours));
  const inverse = new PtaeLive.Inverse(about);
  made.wanted = wanted.map(([target_m, joints_rad]) => inverse.towards(target_m, joints_rad));
  let n = 0;
  const random = () => (n += Math.SQRT2) % 1;
  made.snatched = snatched.map(({action, side, ...setting}) =>
    PtaeLive.snatch(robot, setting, action, about.sides.indexOf(side), random));
  process.stdout.write(JSON.stringify(made));
})();
