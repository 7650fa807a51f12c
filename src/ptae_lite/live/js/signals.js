// What a task gives the network, by the table of the book (`ptae_lite.data.signals.build`).
"use strict";
{
  const row = (rows, t, width) => rows.subarray(width * t, width * (t + 1));

  // Keys: 100 rows of features and joints, zero after the end. seen, felt: scaled clips.
  PtaeLive.movingKeys = (seen, felt) => {
    const keys = new Float32Array(PtaeLive.FRAMES * 35);
    for (let t = 0; t < seen.frames; t++) keys.set(row(seen.features, t, 30), 35 * t);
    for (let t = 0; t < felt.frames; t++) keys.set(row(felt.joints, t, 5), 35 * t + 30);
    return keys;
  };
  // The first frame, repeated for the length of the clip.
  PtaeLive.stillKeys = clip => {
    const keys = new Float32Array(PtaeLive.FRAMES * 35);
    for (let t = 0; t < clip.frames; t++) {
      keys.set(row(clip.features, 0, 30), 35 * t);
      keys.set(row(clip.joints, 0, 5), 35 * t + 30);
    }
    return keys;
  };

  // One sample with one signal.
  //   clip: scaled; sentence: tokens with tags, or null. Without extra input these are what the
  //   signal takes of them. A sentence or keys given beside are the extra input.
  PtaeLive.batch = (language, signal, clip, sentence, extra = {}) => {
    const wiring = language.wiring[signal];
    const query = extra.sentence ?? (wiring.query === "sentence" ? sentence : [0]);
    const tokens = new BigInt64Array(6), mask = new Uint8Array(6);
    [language.token(signal), ...query].forEach((token, i) => {
      tokens[i] = BigInt(token);
      mask[i] = 1;
    });
    const keys = extra.keys ?? (wiring.keys === "clip" ? PtaeLive.movingKeys(clip, clip) : PtaeLive.stillKeys(clip));
    const at = {first: 0, last: clip.frames - 1};
    const video = t => {
      const frame = at[wiring.video] ?? t;
      return frame < clip.frames ? row(clip.features, frame, 30) : new Float32Array(30);
    };
    return {tokens, mask, keys, frames: clip.frames, video, start: row(clip.joints, at[wiring.start], 5),
      query: 1 + query.length};
  };
}
