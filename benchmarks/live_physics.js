// Chapter 06's episodes acted again by the scripts of a page: in a page, or in Node by live_physics.py.
"use strict";
// tasks: rows of live_physics.tasks. Gives verdict, distances and milliseconds of each.
globalThis.actAgain = async (tasks, told = () => {}) => {
  const robot = await PtaeLive.Robot.open(), made = [];
  const autoencoder = await PtaeLive.Autoencoder.open(), [book] = await PtaeLive.load(["book"]);
  const language = new PtaeLive.Language(book.about);
  for (const task of tasks) {
    const policy = await PtaeLive.PTAE.open(task.policy), begun = performance.now();
    const episode = task.joints_rad
      ? await PtaeLive.perform(robot.world, task, PtaeLive.replay(task.joints_rad))
      : await robot.act(policy, language, task.sentence && language.encode(task.sentence), task, autoencoder);
    made.push({...PtaeLive.judge(robot.about, episode, task), event: episode.event, ms: performance.now() - begun});
    told(made.length);
  }
  return made;
};

// In Node: node live_physics.js FOLDER NODE_MODULES < tasks.json > verdicts.json
if (typeof process !== "undefined" && process.argv[2]) (async () => {
  const fs = require("node:fs"), path = require("node:path"), vm = require("node:vm"), {pathToFileURL} = require("node:url");
  const [folder, modules] = process.argv.slice(2), from = name => path.join(modules, name);
  globalThis.window = globalThis;
  globalThis.document = {currentScript: {src: ""}, addEventListener() {}};
  globalThis.ImageData = function (data, width, height) { Object.assign(this, {data, width, height}); };
  const run = name => {
    const bytes = fs.readFileSync(path.join(folder, `${name}.js`));
    vm.runInThisContext(bytes[0] === 0xff ? bytes.toString("utf16le", 2) : bytes.toString("utf8"), {filename: name});
  };
  for (const name of ["loader", "packs"]) run(name);
  PtaeLive.script = async name => {
    if (name === "ort") globalThis.ort = require(from("onnxruntime-web/dist/ort.wasm.min.js"));
    else run(name);
  };
  PtaeLive.scripts.filter(name => !/form|figures|stage|part/.test(name)).forEach(run);
  PtaeLive.free = () => {}; // Node still unpacks from an array that it has taken
  // Node imports no blob, and finds the modules as files
  PtaeLive.loadMuJoCo = async (script, wasmBinary) =>
    (await import(pathToFileURL(from("@mujoco/mujoco/mujoco.js")))).default({wasmBinary});
  URL.createObjectURL = () => pathToFileURL(from("onnxruntime-web/dist/ort-wasm-simd-threaded.mjs")).href;
  const tasks = JSON.parse(fs.readFileSync(0, "utf8"));
  const made = await actAgain(tasks, done => done % 24 || process.stderr.write(`${done} of ${tasks.length}\n`));
  process.stdout.write(JSON.stringify(made));
})();
