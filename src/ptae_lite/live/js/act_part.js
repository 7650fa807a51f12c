// The front page and chapter 06: a sentence is typed, the arm looks and acts in physics, the cubes are
// pushed; then PTAE says what it saw.
"use strict";
{
  const {element, choice, latest} = PtaeLive.form;

  PtaeLive.parts.act = async (room, show) => {
    await PtaeLive.load(PtaeLive.needs.act, show);
    const [book] = await PtaeLive.load(["book"]);
    const language = new PtaeLive.Language(book.about), clips = PtaeLive.clips(book);
    const [robot, policy, ptae, autoencoder] = await Promise.all([PtaeLive.Robot.open(),
      PtaeLive.PTAE.open("policy"), PtaeLive.PTAE.open("ptae"), PtaeLive.Autoencoder.open()]);

    const scenes = scenesOf(robot, clips), first = Object.keys(scenes)[0];
    const all = sentences(language), list = element("datalist", {id: `ptae-sentences-${document.querySelectorAll("datalist").length}`},
      ...all.map(value => element("option", {value})));
    const text = element("input", {type: "text", list: list.id, size: 32, autocomplete: "off", spellcheck: "false"});
    const cubes = choice("cubes", Object.fromEntries(Object.keys(scenes).map(name => [name, name])), () => picture());
    const number = element("input", {type: "number", min: 1, max: scenes[first].length, value: 1});
    const button = element("button", {type: "submit"}, "Act");
    const said = element("p", {"aria-live": "polite", class: "ptae-live-said"});
    const eye = element("canvas", {width: 160, height: 120, role: "img", "aria-label": "What the robot's eye sees before it acts", class: "ptae-live-eye"});
    const view = element("div");
    const form = element("form", {class: "ptae-live-controls"},
      element("label", {}, "sentence ", text), list, cubes.row, element("label", {}, "scene ", number), button);
    room.append(form, eye, said, view, element("p", {class: "ptae-live-note"},
      "The policy of chapter 06 gets the sentence and this one picture. Motors and cubes move in MuJoCo, the picture is drawn " +
      "as the recording's camera draws it, and the verdict is that of chapter 06: " +
      `${robot.about.rule.travel_mm} mm the right way, the other cube still, the right speed, and home again.`));

    const chosen = () => {
      const of = scenes[cubes.control.value], at = Math.min(Math.max(Math.round(number.valueAsNumber) || 1, 1), of.length);
      number.value = at;
      return of[at - 1];
    };
    const picture = () => {
      const {colours, places_m, yaws_rad} = chosen();
      robot.world.reset({places_m, yaws_rad});
      eye.getContext("2d").putImageData(robot.look(robot.world.joints_rad(), robot.world.cubes(), colours), 0, 0);
    };
    number.onchange = picture;

    const act = latest(async () => {
      said.removeAttribute("role");
      let tokens;
      try {
        tokens = language.encode(text.value.toLowerCase());
      } catch (problem) {
        said.setAttribute("role", "alert");
        said.textContent = `${problem.message}.`;
        return;
      }
      const setting = chosen(), meaning = language.meaning(text.value.toLowerCase());
      picture();
      said.textContent = "The arm acts …";
      const episode = await robot.act(policy, language, tokens, setting, autoencoder);
      const told = robot.told(episode, meaning, setting.colours);
      said.textContent = told.text;
      said.dataset.success = told.success;
      view.replaceChildren(await PtaeLive.stage(robot.about, episode, setting.colours,
        `The arm executes: ${text.value}`, `Left cube: ${setting.colours[0]}. Right cube: ${setting.colours[1]}.`));
      room.dataset.acted = Number(room.dataset.acted ?? 0) + 1;
      await describe(episode, setting.colours);
    });
    const describe = async (episode, colours) => {
      const clip = ptae.scaling.clip(await robot.clip(episode, colours, autoencoder));
      const {told} = await ptae.answer(PtaeLive.batch(language, "describe", clip, null), {motion: false});
      const words = language.decode(PtaeLive.best(told));
      said.dataset.described = words;
      said.append(element("br"), "PTAE, which watched, describes it: ", element("b", {}, words), ".");
      room.dataset.answered = Number(room.dataset.answered ?? 0) + 1;
    };
    form.onsubmit = event => {
      event.preventDefault();
      act();
    };
    text.value = `push ${scenes[first][0].colours[0]} slowly`;
    picture();
  };

  // Recorded scenes by their two cubes.
  function scenesOf(robot, clips) {
    const colours = new Map(), found = {};
    clips.forEach(clip => colours.set(robot.about.recorded[clip.sample][0], clip.colours));
    robot.about.recorded.forEach(([pattern], sample) => {
      const two = colours.get(pattern);
      (found[`${two[0]} left, ${two[1]} right`] ??= []).push({colours: two, ...robot.recorded(sample)});
    });
    return found;
  }

  const sentences = language => language.kinds.reduce(
    (made, kind) => made.flatMap(start => language.classes[kind].map(word => [...start, word])), [[]])
    .map(words => words.join(" "));
}
