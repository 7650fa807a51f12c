// Chapter 05: any sentence against any clip; the answer, and whom it follows.
"use strict";
{
  const {element, choice, sentence, clips, latest} = PtaeLive.form;
  const EXTRA = {describe: "sentence", "repeat action": "sentence", execute: "clip", "repeat language": "clip"};
  const TALKS = ["describe", "repeat language"];

  // What an answer follows (`answer_source.follows`): three things each, null where nothing is said.
  PtaeLive.follows = (said, truth, distractor) => {
    if (said.every((one, i) => one === truth[i])) return "truth";
    if (said.every((one, i) => one && one === distractor[i])) return "distractor";
    return said.every((one, i) => one && (one === truth[i] || one === distractor[i])) ? "mixture" : "neither";
  };

  // The mean motion nearest to a motion from its second frame on, and its distance in percent.
  PtaeLive.nearest = ({motions, tracks, reach}, scaling, made) => {
    const far = motions.map((_, k) => {
      let sum = 0;
      for (let i = 0; i < made.length; i++) sum += ((made[i] - tracks[500 * k + 5 + i]) / scaling.range[i % 5]) ** 2;
      return 100 * Math.sqrt(sum / made.length);
    });
    const best = far.indexOf(Math.min(...far));
    return {said: far[best] <= reach ? motions[best] : [null, null, null], distance: far[best]};
  };

  PtaeLive.parts.conflict = async (room, show) => {
    const [[, pack, scene], model] = await Promise.all(
      [PtaeLive.load(PtaeLive.needs.conflict, show), PtaeLive.PTAE.open("ptae")]);
    const language = new PtaeLive.Language(pack.about), all = PtaeLive.clips(pack);
    const places = new Float32Array(scene.parts.cubes.buffer, scene.parts.cubes.byteOffset, scene.parts.cubes.length / 4);
    const bytes = pack.parts.motions, means = {...pack.about,
      tracks: new Float32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4)};

    const signal = choice("task", Object.fromEntries(Object.keys(EXTRA).map(name => [name, name])), () => ask());
    const own = clips(all, "clip", () => ask());
    const told = choice("also tell it", {nothing: "nothing", sentence: "a sentence"}, () => ask());
    const words = sentence(language, "the sentence", () => ask());
    const shown = choice("also show it", {nothing: "nothing", both: "another clip", vision: "its video alone",
      proprioception: "its joints alone", blank: "a blank: zeros"}, () => ask());
    const other = clips(all, "the other clip", () => ask());
    const said = element("p", {"aria-live": "polite", class: "ptae-live-said"}), answer = element("div");

    const ask = latest(async () => {
      const name = signal.control.value, clip = own.clip, kind = EXTRA[name], talks = TALKS.includes(name);
      const tells = kind === "sentence" && told.control.value !== "nothing";
      const shows = kind === "clip" && shown.control.value !== "nothing", blank = shown.control.value === "blank";
      told.row.hidden = kind !== "sentence";
      words.row.hidden = !tells;
      shown.row.hidden = kind !== "clip";
      other.row.hidden = !shows || blank;

      const scaled = model.scaling.clip(clip), extra = {};
      if (tells) extra.sentence = language.encode(words.text);
      if (shows) {
        const partner = model.scaling.clip(other.clip), place = shown.control.value;
        extra.keys = blank ? new Float32Array(3500)
          : PtaeLive.movingKeys(place === "proprioception" ? scaled : partner, place === "vision" ? scaled : partner);
      }
      const batch = PtaeLive.batch(language, name, scaled, language.encode(clip.sentence), extra);
      const found = await model.answer(batch, {words: talks, motion: !talks});
      answer.replaceChildren();

      const named = one => [one.action, talks ? one.colour : one.side, one.speed];
      const sides = {[clip.colours[0]]: "left", [clip.colours[1]]: "right"};
      const truth = named(clip);
      let distractor = null, says, what;
      if (tells) {
        const [action, colour, speed] = language.meaning(words.text);
        distractor = [action, talks ? colour : sides[colour] ?? null, speed];
      } else if (shows && !blank) distractor = named(other.clip);
      if (talks) {
        const text = language.decode(PtaeLive.best(found.told));
        what = language.meaning(text) ?? [null, null, null];
        says = `It says “${text}”.`;
        said.dataset.sentence = text;
      } else {
        const made = model.scaling.jointsBack(found.joints).slice(0, 5 * (clip.frames - 1));
        const near = PtaeLive.nearest(means, model.scaling, made);
        what = near.said;
        says = what[0] ? `The motion is nearest to “${what[0]} the ${what[1]} cube ${what[2]}”, ${near.distance.toFixed(1)} % away.`
          : `The motion is like no recorded one: ${near.distance.toFixed(1)} % from the nearest mean.`;
        const moved = [...clip.joints.subarray(0, 5), ...made];
        const cubes = [0, 7].map(at => places.subarray(14 * clip.sample + at, 14 * clip.sample + at + 7));
        answer.append(
          PtaeLive.arms(scene.about, cubes, clip.colours, {"the recorded arm": clip.joints, "the model's": moved},
            "Both arms over the table"),
          PtaeLive.figures.motions(clip.joints, moved, says));
        said.dataset.sentence = "";
      }
      const follows = PtaeLive.follows(what, truth, distractor ?? truth);
      const verdict = distractor ? `It follows: ${follows}.` : follows === "truth" ? "That is true." : "That is not true of the clip.";
      said.replaceChildren(element("b", {}, says), ` ${verdict}`);
      said.dataset.follows = follows;
      answer.prepend(table(truth, distractor, what, talks));
      room.dataset.answered = Number(room.dataset.answered ?? 0) + 1;
    });

    room.append(element("div", {class: "ptae-live-controls"}, signal.row, own.row, told.row, shown.row, other.row, words.row),
      said, answer);
    own.clip = all.find(one => one.split === "test") ?? all[0];
    signal.control.value = "describe"; // and a false action, in the sentence and in the other clip
    told.control.value = "sentence";
    shown.control.value = "both";
    other.clip = all.find(one => one.colours.join() === own.clip.colours.join() && one.action !== own.clip.action &&
      one.side === own.clip.side && one.speed === own.clip.speed) ?? all[1];
    words.text = other.clip.sentence;
    await ask();
  };

  // What clip, extra input and answer say, thing by thing.
  function table(truth, distractor, what, talks) {
    const cell = (tag, text, more) => element(tag, more ?? {}, text ?? "–");
    const rows = {"its own": truth, ...(distractor && {"extra input": distractor}), "the answer": what};
    const head = element("tr", {}, element("td"), ...["action", talks ? "colour" : "cube", "speed"]
      .map(name => cell("th", name, {scope: "col"})));
    const lines = Object.entries(rows).map(([name, said]) => element("tr", {}, cell("th", name, {scope: "row"}),
      ...said.map((one, i) => cell("td", one && one !== truth[i] ? `≠ ${one}` : one,
        {class: one && one !== truth[i] ? "ptae-live-false" : ""}))));
    return element("table", {class: "ptae-live-table"}, head, ...lines);
  }
}
