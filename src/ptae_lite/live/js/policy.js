// A PTAE that acts: it gets a sentence, looks once, and then says where the joints are to go next.
"use strict";
// model: a PtaeLive.PTAE; tokens: of the sentence with its tags, or null for EOS in all places;
// look: what the eye sees now, as a promise of thirty numbers. A new one for each episode.
PtaeLive.policy = (model, language, tokens, look) => {
  let seen, code, states;
  const listen = pose => {
    const keys = new Float32Array(PtaeLive.FRAMES * 35);  // the clip's length is not known: the
    for (let t = 0; t < PtaeLive.FRAMES; t++) {           // first frame fills all places
      keys.set(seen, 35 * t);
      keys.set(pose, 35 * t + 30);
    }
    const query = [language.token("execute"), ...(tokens ?? [0, 0, 0, 0, 0])];
    return model.encode({tokens: BigInt64Array.from(query, BigInt), mask: new Uint8Array(6).fill(1), keys,
      frames: PtaeLive.FRAMES, query: query.length});
  };
  return async ({joints_rad, cubes}) => {
    const now = model.scaling.joints(joints_rad);
    if (!seen || !model.about.freeze_video) seen = model.scaling.features(await look(joints_rad, cubes));
    if (!states) {
      ({code} = await listen(now));
      states = await model.start(code);
    }
    const after = await model.step(code, seen, now, states);
    states = after.states;
    return model.scaling.jointsBack(after.pose);
  };
};

// A policy that watches: it understands the sentence once, and looks in each frame. inverse: of the arm.
// Afterwards it can describe what it saw itself do.
PtaeLive.watching = (model, language, tokens, look, inverse) => {
  const seen = [], felt = [];
  let state;
  const act = async ({joints_rad, cubes}) => {
    seen.push(model.scaling.features(await look(joints_rad, cubes)));
    felt.push(model.scaling.joints(joints_rad));
    state ??= await model.listen([language.token("execute"), ...tokens], seen[0]);
    let wish_m;
    ({wish_m, state} = await model.follow(state, seen.at(-1), inverse.fingertip(joints_rad)));
    return inverse.towards(wish_m, joints_rad);
  };
  act.describe = () => model.describe(language, seen, felt);
  return act;
};
