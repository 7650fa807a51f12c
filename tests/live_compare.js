// In a page: the models' answers beside those of PyTorch, which are in the pack "answers".
// change: a pack with networks that take the place of those of a model, such as ["ptae", "swapped_gates"].
"use strict";
async function compare(clips = Infinity, change = null) {
  await Promise.all(PtaeLive.scripts.map(PtaeLive.script));
  const changed = change && await PtaeLive.networks((await PtaeLive.load([change[1]]))[0]);
  const put = (name, model) => {
    if (change?.[0] === name) Object.assign(model.networks, changed);
    return model;
  };
  const [pack] = await PtaeLive.load(["book"]), [{parts, about}] = await PtaeLive.load(["answers"]);
  const floats = name => new Float32Array(parts[name].buffer, parts[name].byteOffset, parts[name].length / 4);
  const worst = {}, times = {};
  const gap = (name, mine, theirs) => {
    for (let i = 0; i < theirs.length; i++) {
      const off = Math.abs(mine[i] - theirs[i]);
      if (!(off <= (worst[name] ?? 0))) worst[name] = Number.isNaN(off) ? Infinity : off;
    }
    worst[name] ??= 0;
  };
  const clock = async (name, work) => {
    const begun = performance.now(), made = await work();
    (times[name] ??= []).push(performance.now() - begun);
    return made;
  };
  const language = new PtaeLive.Language(pack.about), book = new Map(PtaeLive.clips(pack).map(clip => [clip.sample, clip]));
  const features = floats("features"), joints = floats("joints");
  let at = 0;
  const test = about.frames.map(frames => {
    const from = at;
    at += frames;
    return {frames, features: features.subarray(30 * from, 30 * at), joints: joints.subarray(5 * from, 5 * at)};
  });
  const models = {ptae: put("ptae", await PtaeLive.PTAE.open("ptae")), policy: await PtaeLive.PTAE.open("policy")};
  const theirs = (name, k, size) => floats(name).subarray(size * k, size * (k + 1));
  let same = 0;
  const few = all => [...all.entries()].slice(0, clips);
  for (const [k, clip] of few(test)) {
    const own = models.ptae.scaling.clip(clip);
    const {told, code, attention} = await clock("describe", () => models.ptae.answer(
      PtaeLive.batch(language, "describe", own), {motion: false}));
    gap("words", told.flatMap(row => [...row]), theirs("words", k, 92));
    gap("attention", attention.flatMap(head => head.flatMap(row => [...row])), theirs("attention", k, 800));
    same += language.decode(PtaeLive.best(told)) === about.said[k];
    for (const [name, model] of Object.entries(models)) {
      const batch = PtaeLive.batch(language, "execute", model.scaling.clip(clip), language.encode(about.sentences[k]));
      const made = await clock(`execute ${name}`, () => model.answer(batch, {words: false}));
      gap(`${name} code`, made.code.data, theirs(`${name}_code`, k, 256));
      gap(`${name} joints`, made.joints, theirs(`${name}_execute`, k, 495));
    }
  }
  const labelled = {};
  for (const [name, said] of Object.entries(about.labelled)) {
    const model = await PtaeLive.PTAE.open(name);
    labelled[name] = 0;
    for (const [k, clip] of few(test)) {
      const {told} = await model.answer(PtaeLive.batch(language, "describe", model.scaling.clip(clip)), {motion: false});
      labelled[name] += language.decode(PtaeLive.best(told)) === said[k];
    }
  }
  let agree = 0;
  for (const [k, row] of few(about.conflicts)) {
    const own = models.ptae.scaling.clip(book.get(row.sample)), extra = {};
    if (row.place === "blank") extra.keys = new Float32Array(3500);
    else if (typeof row.extra === "string") extra.sentence = row.place === "none" ? undefined : language.encode(row.extra);
    else if (row.place !== "none") {
      const other = models.ptae.scaling.clip(book.get(row.extra));
      extra.keys = PtaeLive.movingKeys(row.place === "proprioception" ? own : other, row.place === "vision" ? own : other);
    }
    const {told, joints} = await models.ptae.answer(
      PtaeLive.batch(language, row.signal, own, language.encode(row.sentence), extra));
    agree += language.decode(PtaeLive.best(told)) === row.said;
    gap("conflict words", told.flatMap(one => [...one]), theirs("conflict_words", k, 92));
    gap("conflict joints", joints, theirs("conflict_joints", k, 495));
  }
  const watching = put("watching", await PtaeLive.PTAE.open("watching")), [{about: scene}] = await PtaeLive.load(["scene"]);
  const inverse = new PtaeLive.Inverse(scene);
  let alike = 0, from = 0;
  for (const [k, {clip, other, frames, jump, said}] of about.watched.entries()) {
    const frame = t => test[t < jump ? clip : other].features.subarray(30 * t, 30 * (t + 1));
    let t = 0;
    const act = PtaeLive.watching(watching, language, language.encode(about.sentences[clip]), () => frame(t), inverse);
    const made = new Float32Array(5 * frames);
    for (; t < frames; t++) {
      const joints_rad = Array.from(test[clip].joints.subarray(5 * t, 5 * t + 5));
      const target = await clock("watch", () => act({joints_rad}));
      made.set(watching.scaling.joints(target), 5 * t);
    }
    gap("watching joints", made, floats("watching_joints").subarray(5 * from, 5 * (from + frames)));
    from += frames;
    const words = await clock("describe own act", () => act.describe());
    gap("watching words", words.flatMap(row => [...row]), theirs("watching_words", k, 92));
    alike += language.decode(PtaeLive.best(words)) === said;
  }
  const autoencoder = put("autoencoder", await PtaeLive.Autoencoder.open());
  for (let k = 0; k < parts.images.length / 57600; k++) {
    const image = new ImageData(160, 120);
    for (let i = 0; i < 19200; i++)
      for (let c = 0; c < 3; c++) image.data[4 * i + c] = parts.images[57600 * k + 3 * i + c];
    const code = await clock("image", () => autoencoder.encode(image));
    const drawn = await clock("image back", () => autoencoder.decode(theirs("image_codes", k, 30)));
    gap("image code", code, theirs("image_codes", k, 30));
    gap("pixels", drawn, theirs("drawn", k, 57600));
  }
  const median = all => all.sort((a, b) => a - b)[all.length >> 1];
  return {worst, same, of: few(test).length, agree, conflicts: few(about.conflicts).length, labelled,
    watched: about.watched.length, alike,
    ms: Object.fromEntries(Object.entries(times).map(([name, all]) => [name, median(all)]))};
}
