// Chapter 03: a clip and a query go in; attention, words or a motion come out.
"use strict";
{
  const {element, choice, sentence, clips, latest} = PtaeLive.form;
  const PICTURES = 8;

  // Which frame each key shows, -1 for zeros. Frames beyond the clip are its padding.
  const ORDERS = {
    "as recorded": n => range(n),
    "frozen at its first frame": n => range(n).fill(0),
    "shuffled": n => shuffled(range(n)),
    "every other frame": n => range(n).filter(t => t % 2 === 0),
    "its first half": n => range(n / 2),
  };
  const PADDING = {
    "zeros, as in training": order => [...order, ...range(PtaeLive.FRAMES - order.length).fill(-1)],
    "nothing: the keys end there": order => order,
    "its last frame, repeated": order => [...order, ...range(PtaeLive.FRAMES - order.length).fill(order.at(-1))],
  };
  const range = n => Array.from({length: n}, (_, i) => i);
  const shuffled = order => { // the same each time
    let seed = 1;
    for (let i = order.length - 1; i > 0; i--) {
      seed = seed * 48271 % 2147483647;
      const j = seed % (i + 1);
      [order[i], order[j]] = [order[j], order[i]];
    }
    return order;
  };
  const keysOf = (clip, order) => {
    const keys = new Float32Array(35 * order.length);
    order.forEach((t, k) => {
      if (t < 0) return;
      keys.set(clip.features.subarray(30 * t, 30 * t + 30), 35 * k);
      keys.set(clip.joints.subarray(5 * t, 5 * t + 5), 35 * k + 30);
    });
    return keys;
  };
  const same = names => Object.fromEntries(Object.keys(names).map(name => [name, name]));

  PtaeLive.parts.transformer = async (room, show) => {
    const [[, pack], model] = await Promise.all(
      [PtaeLive.load(PtaeLive.needs.transformer, show), PtaeLive.PTAE.open("ptae")]);
    const language = new PtaeLive.Language(pack.about), all = PtaeLive.clips(pack);
    const autoencoder = await PtaeLive.Autoencoder.open();

    const signal = choice("task", same(Object.fromEntries(Object.keys(language.wiring)
      .filter(name => name !== "repeat both").map(name => [name, 1]))), () => ask());
    const clip = clips(all, "clip", () => { words.text = clip.clip.sentence; ask(); });
    const words = sentence(language, "sentence in the query", () => ask());
    const order = choice("frames in the keys", same(ORDERS), () => ask());
    const padding = choice("after them", same(PADDING), () => ask());
    const video = choice("the decoder's video", {moving: "moving", frozen: "frozen at its first frame"}, () => ask());
    const answer = element("div"), said = element("p", {"aria-live": "polite", class: "ptae-live-said"});

    const ask = latest(async () => {
      const name = signal.control.value, wiring = language.wiring[name], own = clip.clip;
      const reads = wiring.query === "sentence", still = wiring.keys === "first";
      words.row.hidden = !reads;
      video.row.hidden = wiring.video !== "clip";
      order.row.hidden = still;
      const scaled = model.scaling.clip(own);
      const first = still ? range(own.frames).fill(0) : ORDERS[order.control.value](own.frames);
      const keys = PADDING[padding.control.value](first);
      const batch = PtaeLive.batch(language, name, scaled, reads ? language.encode(words.text) : null,
        {keys: keysOf(scaled, keys)});
      batch.frames = first.length;
      if (video.control.value === "frozen" && wiring.video === "clip") {
        const moving = batch.video;
        batch.video = () => moving(0);
      }
      const talks = wiring.words === "sentence";
      const {told, joints, attention} = await model.answer(batch, {words: talks, motion: !talks});
      const tokens = [name, ...(reads ? ["begin", ...words.text.split(" ")] : []), "end"];
      const shots = range(PICTURES).map(k => keys[Math.floor((k + 0.5) * keys.length / PICTURES)]);
      const strip = PtaeLive.figures.strip(autoencoder,
        shots.map(t => t < 0 ? null : own.features.subarray(30 * t, 30 * t + 30)),
        `${PICTURES} pictures, drawn from the features of the keys`);
      const look = PtaeLive.figures.attention(attention, tokens, keys.map(t => t >= 0));
      answer.replaceChildren(strip, look);
      if (talks) await tell(said, language, told, own);
      else move(said, answer, model, own, joints);
      room.dataset.answered = Number(room.dataset.answered ?? 0) + 1;
    });

    const controls = element("div", {class: "ptae-live-controls"},
      signal.row, clip.row, order.row, padding.row, video.row, words.row);
    room.append(controls, said, answer, element("p", {class: "ptae-live-note"},
      "The pictures are what the decoder of chapter 02 draws from the thirty numbers of a key; an empty place is zeros. " +
      "Each row of bars is scaled to its largest weight. The dotted line is the end of the frames."));
    clip.clip = all.find(one => one.split === "test" && one.speed === "fast") ?? all[0];
    words.text = clip.clip.sentence;
    await ask();
  };

  // The words, one after another, unless the reader wants no motion.
  async function tell(said, language, told, own) {
    const best = PtaeLive.best(told), sentence = language.decode(best), waits = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    const meaning = language.meaning(sentence), truth = [own.action, own.colour, own.speed];
    const right = meaning && meaning.every((word, i) => word === truth[i]);
    said.replaceChildren();
    const line = element("span", {"aria-hidden": "true"});
    said.append(element("span", {class: "ptae-live-hidden"}, `The model says: ${sentence || "nothing"}.`), line);
    line.append("The model says ");
    for (const [i, word] of best.entries()) {
      if (!word) break;
      if (waits) await new Promise(done => setTimeout(done, 180));
      line.append(element("b", {}, language.tokens[word]), ` (${(100 * told[i][word]).toFixed(0)} %) `);
    }
    said.append(right ? " – right." : ` – the clip is “${own.sentence}”.`);
    said.dataset.sentence = sentence;
  }

  function move(said, answer, model, own, joints) {
    const made = [...own.joints.subarray(0, 5), ...model.scaling.jointsBack(joints)].slice(0, 5 * own.frames);
    const squares = made.slice(5).reduce((sum, v, i) => sum + ((v - own.joints[i + 5]) / model.scaling.range[i % 5]) ** 2, 0);
    const error = 100 * Math.sqrt(squares / (made.length - 5));
    const text = `The arm moves ${error.toFixed(1)} % of its range away from the recorded clip “${own.sentence}”.`;
    said.textContent = text;
    said.dataset.sentence = "";
    answer.append(PtaeLive.figures.motions(own.joints, made, text));
  }
}
