// onnxruntime-web, started from a folder: its WebAssembly and its module come out of a pack.
"use strict";
{
  let started;
  async function start() {
    await PtaeLive.script("ort");
    const [{parts}] = await PtaeLive.load(["ort"]);
    const {env} = window.ort;
    env.wasm.numThreads = 1; // more threads need headers that no folder sends
    env.wasm.proxy = false;
    env.wasm.wasmBinary = parts.wasm.slice().buffer;
    const module = new Blob([parts.mjs], {type: "text/javascript"});
    env.wasm.wasmPaths = {mjs: URL.createObjectURL(module)};
  }

  // A network of a pack: run(inputs by name) gives the outputs by name. An input is an array of
  // numbers with its shape, [numbers, ...shape], or an output of another network.
  class Network {
    constructor(session) {
      this.session = session;
    }
    async run(inputs) {
      const given = {};
      for (const name of this.session.inputNames) {
        const value = inputs[name];
        if (value === undefined) throw new Error(`the network needs ${name}`);
        given[name] = Array.isArray(value) ? tensor(...value) : value;
      }
      return this.session.run(given);
    }
  }
  const KINDS = {Float32Array: "float32", BigInt64Array: "int64", Uint8Array: "bool"};
  const tensor = (numbers, ...shape) =>
    new window.ort.Tensor(KINDS[numbers.constructor.name], numbers, shape);

  // The networks of an unpacked pack, by name.
  PtaeLive.networks = async ({parts}) => {
    await (started ??= start());
    const found = {};
    for (const [name, bytes] of Object.entries(parts))
      found[name] = new Network(
        await window.ort.InferenceSession.create(bytes, {executionProviders: ["wasm"]}));
    return found;
  };
}
