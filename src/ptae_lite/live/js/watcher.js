// A policy that watches, in the page: its networks, one after another, as watching_actor.py runs them.
"use strict";
PtaeLive.Watcher = class extends PtaeLive.PTAE {
  // What a sentence asks for at the first look, and the memory to begin with. Tokens with their signal.
  async listen(tokens, seen) {
    tokens = BigInt64Array.from(tokens, BigInt);
    const keys = new Float32Array(2 * 35); // the sentence alone: empty frames
    const {code} = await this.encode({tokens, mask: new Uint8Array(6).fill(1), keys, frames: 2, query: 6});
    return this.networks.task.run({code, first: [seen, 1, 30]});
  }
  // Where the hand is to be in the next frame, in metres, and the memory. state: from `listen` or the frame before.
  async follow({task, ...memory}, seen, hand_m) {
    const after = await this.networks.follow.run({task, seen: [seen, 1, 30], hand: [Float32Array.from(hand_m), 1, 3], ...memory});
    const state = {task};
    for (const name of Object.keys(memory)) state[name] = after[`${name}_after`];
    return {wish_m: Array.from(after.wish.data), state};
  }
  // The probabilities of the words that describe what was seen and felt, frame by frame.
  async describe(language, seen, felt) {
    const count = seen.length, keys = new Float32Array(35 * count);
    seen.forEach((one, t) => {
      keys.set(one, 35 * t);
      keys.set(felt[t], 35 * t + 30);
    });
    const {code} = await this.encode({tokens: BigInt64Array.from([language.token("describe"), 0, 0, 0, 0, 0], BigInt),
      mask: Uint8Array.of(1, 1, 0, 0, 0, 0), keys, frames: count, query: 2});
    return this.probabilities(await this.networks.tell.run({code, first: [seen[0], 1, 30], count: [Float32Array.of(count), 1]}));
  }
};
