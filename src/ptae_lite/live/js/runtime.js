// onnxruntime-web, started from a folder: its WebAssembly and its module come out of a pack.
"use strict";
{
  // weights of 16 bits become single precision once, when a network is opened, and not in each run
  const OPTIONS = {executionProviders: ["wasm"], extra: {session: {disable_quant_qdq: "1"}}};
  let started, wasm;
  async function start() {
    await PtaeLive.script("ort");
    const [{parts}] = await PtaeLive.load(["ort"]);
    const {env} = window.ort;
    env.wasm.numThreads = 1; // more threads need headers that no folder sends
    env.wasm.proxy = false;
    ({wasm} = parts);
    env.wasm.wasmBinary = wasm.buffer;
    const module = new Blob([parts.mjs], {type: "text/javascript"});
    env.wasm.wasmPaths = {mjs: URL.createObjectURL(module)};
  }

  // A network of a pack, made when it is first run. run(inputs by name) gives the outputs by name. An
  // input is an array of numbers with its shape, [numbers, ...shape], or an output of another network.
  class Network {
    constructor(bytes) {
      this.bytes = bytes;
    }
    open() {
      return this.session ??= (started ??= start()).then(async () => {
        const session = await window.ort.InferenceSession.create(this.bytes, OPTIONS);
        [this.bytes, wasm].forEach(PtaeLive.free); // the runtime has its own
        wasm = null;
        return session;
      });
    }
    async run(inputs) {
      const session = await this.open(), given = {};
      for (const name of session.inputNames) {
        const value = inputs[name];
        if (value === undefined) throw new Error(`the network needs ${name}`);
        given[name] = Array.isArray(value) ? tensor(...value) : value;
      }
      return session.run(given);
    }
  }
  const KINDS = {Float32Array: "float32", BigInt64Array: "int64", Uint8Array: "bool"};
  const tensor = (numbers, ...shape) =>
    new window.ort.Tensor(KINDS[numbers.constructor.name], numbers, shape);

  // The networks of an unpacked pack, by name. They are made once, and the pack forgets their bytes.
  PtaeLive.networks = pack => {
    pack.networks ??= Object.fromEntries(Object.entries(pack.parts).map(([name, bytes]) => [name, new Network(bytes)]));
    pack.parts = {};
    return pack.networks;
  };
}
