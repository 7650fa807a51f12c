// The front page and chapter 06: a sentence is typed, the arm looks and acts in physics, the cubes are
// pushed; then PTAE says what it saw. In chapter 06 the reader chooses who acts, and snatches the cube
// away; a policy that watches says itself what it saw.
"use strict";
{
  const {element, choice, latest} = PtaeLive.form;
  const REST_MS = 3000; // a browser takes back meanwhile what the loading took

  const LATER = "ptae"; // which describes

  PtaeLive.parts.act = (room, show) => build(room, show, "act", ["policy"]);
  PtaeLive.parts.policies = (room, show) => build(room, show, "policies", Object.keys(PtaeLive.policies));

  async function build(room, show, part, names) {
    const loading = PtaeLive.load(PtaeLive.packsOf(part).filter(name => name !== LATER), show);
    // each is opened as soon as its pack has come, so that no pack is kept for long
    const [robot, first, autoencoder, [book]] = await Promise.all([PtaeLive.Robot.open(),
      PtaeLive.PTAE.open(names[0]), PtaeLive.Autoencoder.open(), PtaeLive.load(["book"]), loading]);
    const language = new PtaeLive.Language(book.about), clips = PtaeLive.clips(book);

    const scenes = scenesOf(robot, clips), at = Object.keys(scenes)[0];
    const all = sentences(language), list = element("datalist", {id: `ptae-sentences-${document.querySelectorAll("datalist").length}`},
      ...all.map(value => element("option", {value})));
    const text = element("input", {type: "text", list: list.id, size: 32, autocomplete: "off", spellcheck: "false"});
    const cubes = choice("cubes", Object.fromEntries(Object.keys(scenes).map(name => [name, name])));
    const places = placing(robot, () => picture()), hand = shifting(robot);
    const number = element("input", {type: "number", min: 1, max: scenes[at].length, value: 1});
    const who = choice("who acts", Object.fromEntries(names.map(name => [name, PtaeLive.policies[name]])), () => explain());
    who.row.hidden = names.length < 2;
    const button = element("button", {type: "submit"}, "Act");
    const snatch = element("button", {type: "button", hidden: names.length < 2}, "Act, and snatch the cube away");
    const said = element("p", {"aria-live": "polite", class: "ptae-live-said"});
    const eye = element("canvas", {width: 160, height: 120, role: "img", "aria-label": "What the robot's eye sees before it acts", class: "ptae-live-eye"});
    const view = element("div"), note = element("p", {class: "ptae-live-note"});
    const form = element("form", {class: "ptae-live-controls"},
      element("label", {}, "sentence ", text), list, who.row, cubes.row, element("label", {}, "scene ", number), button, snatch);
    places.row.append(...hand.rows);
    room.append(form, places.row, eye, said, view, note);

    const explain = async () => {
      const name = who.control.value, model = await PtaeLive.PTAE.open(name).catch(() => null);
      if (!model || name !== who.control.value) return; // acting says why; the reader chose another
      note.textContent = `${capital(PtaeLive.policies[name])} gets the sentence and ` +
        `${model.about.freeze_video ? "this one picture" : "a new picture in each frame"}. Motors and cubes move in MuJoCo, the picture ` +
        "is drawn as the recording's camera draws it, and the verdict is that of chapter 06: " +
        `${robot.about.rule.travel_mm} mm the right way, the other cube still, the right speed, and home again.`;
    };

    const recorded = () => {
      const of = scenes[cubes.control.value], at = Math.min(Math.max(Math.round(number.valueAsNumber) || 1, 1), of.length);
      number.value = at;
      return of[at - 1];
    };
    const chosen = () => ({...recorded(), places_m: places.places_m});
    const picture = () => {
      const setting = chosen();
      eye.getContext("2d").putImageData(robot.look(robot.about.home_rad, robot.placed(setting), setting.colours), 0, 0);
    };
    const reset = () => {
      places.places_m = recorded().places_m;
      picture();
    };
    cubes.control.onchange = number.onchange = reset;

    const alert = problem => {
      said.setAttribute("role", "alert");
      said.textContent = problem;
    };
    let snatched = false; // whether the button asked for it
    const act = latest(async () => {
      const snatches = snatched;
      said.removeAttribute("role");
      let tokens;
      try {
        tokens = language.encode(text.value.toLowerCase());
      } catch (problem) {
        alert(`${problem.message}.`);
        return;
      }
      if (places.overlap) {
        alert("The two cubes are in one place; move one of them.");
        return;
      }
      const setting = chosen(), meaning = language.meaning(text.value.toLowerCase());
      const named = setting.colours.indexOf(meaning[1]);
      setting.shift = !snatches ? hand.shift(named) : named < 0 ? null : PtaeLive.snatch(robot, setting, meaning[0], named);
      if (snatches && !setting.shift) {
        alert(named < 0 ? `There is no ${meaning[1]} cube to snatch away.` : "There is no room to move that cube to.");
        return;
      }
      picture();
      said.textContent = "The arm acts …";
      let policy;
      try {
        policy = await PtaeLive.PTAE.open(who.control.value);
      } catch (problem) {
        alert(`It cannot act here: ${problem.message}.`);
        return;
      }
      const episode = await robot.act(policy, language, tokens, setting, autoencoder);
      const told = robot.told(episode, meaning, setting.colours);
      said.textContent = told.text;
      if (setting.shift) said.append(moved(setting.shift, episode.event, robot.about.sides));
      said.dataset.success = told.success;
      view.replaceChildren(await PtaeLive.stage(robot.about, episode, setting.colours,
        `The arm executes: ${text.value}`, `Left cube, as the robot sees it: ${setting.colours[0]}. Right cube: ${setting.colours[1]}.`));
      room.dataset.acted = Number(room.dataset.acted ?? 0) + 1;
      try {
        await describe(episode, setting.colours);
      } catch (problem) {
        said.append(element("br"), `It cannot be described here: ${problem.message}.`);
      }
    });
    const describe = async (episode, colours) => {
      const words = language.decode(PtaeLive.best(await (episode.describe?.() ?? watched(episode, colours))));
      said.dataset.described = words;
      said.append(element("br"), episode.describe ? "It describes what it saw itself do: " : "PTAE, which watched, describes it: ",
        element("b", {}, words), ".");
      room.dataset.answered = Number(room.dataset.answered ?? 0) + 1;
    };
    const watched = async (episode, colours) => {
      const ptae = await PtaeLive.PTAE.open(LATER), clip = ptae.scaling.clip(await robot.clip(episode, colours, autoencoder));
      return (await ptae.answer(PtaeLive.batch(language, "describe", clip, null), {motion: false})).told;
    };
    form.onsubmit = event => {
      event.preventDefault();
      snatched = false;
      act();
    };
    snatch.onclick = () => {
      snatched = true;
      act();
    };
    text.value = `push ${scenes[at][0].colours[0]} slowly`;
    reset();
    explain();
    // what comes next is made ready while the reader types; if that fails, the answer says so
    Object.values(first.networks).forEach(one => one.open().catch(() => {}));
    if (!first.about.watches) setTimeout(() => PtaeLive.PTAE.open(LATER).catch(() => {}), REST_MS);
  };

  // Sliders that put the cubes anywhere on the table.
  function placing(robot, changed) {
    const {sides, table_m: {low, high}, cube_edge_m: edge} = robot.about, sliders = [];
    const names = ["away from the robot", "to the robot's left"];
    const row = element("details", {}, element("summary", {}, "Put the cubes elsewhere, at first or meanwhile"));
    sides.forEach((side, cube) => names.forEach((name, i) => {
      const slider = element("input", {type: "range", step: 1, min: Math.ceil(1000 * (low[i] + edge / 2)), max: Math.floor(1000 * (high[i] - edge / 2))});
      const told = element("output", {});
      const tell = () => slider.setAttribute("aria-valuetext", told.value = ` ${slider.value} mm`);
      slider.oninput = () => { tell(); changed(); };
      row.append(element("label", {class: "ptae-live-place"}, `${side} cube, ${name} `, slider, told));
      sliders.push({slider, tell});
    }));
    return {
      row,
      get places_m() { return sides.map((_, cube) => [0, 1].map(i => sliders[2 * cube + i].slider.valueAsNumber / 1000)); },
      set places_m(places) {
        sliders.forEach(({slider, tell}, k) => {
          slider.value = 1000 * places[k >> 1][k & 1];
          tell();
        });
      },
      get overlap() {
        const [[a, b], [c, d]] = this.places_m;
        return Math.hypot(a - c, b - d) < edge;
      },
    };
  }

  // A hand that moves a cube while the arm acts: which one, when, and how far.
  function shifting({about: {sides, rule}}) {
    const which = choice("while the arm acts, a hand moves", Object.fromEntries(
      [["none", "no cube"], ["named", "the named cube"], ...sides.map(side => [side, `the ${side} cube`])]), () => show());
    const slide = (name, unit, range) => {
      const slider = element("input", {type: "range", autocomplete: "off", ...range}), shown = element("output");
      slider.oninput = () => show();
      return {slider, shown, unit, row: element("label", {class: "ptae-live-place"}, `${name} `, slider, shown)};
    };
    const far = {min: -100, max: 100, step: 5};
    const sliders = [slide("before frame", "", {min: 1, max: rule.limit - 30, value: 15}),
      slide("away from the robot by", " mm", {...far, value: 0}), slide("to the robot's left by", " mm", {...far, value: 30})];
    const show = () => sliders.forEach(({slider, shown, unit, row}) => {
      row.hidden = which.control.value === "none";
      shown.value = `${slider.value}${unit}`;
      slider.setAttribute("aria-valuetext", shown.value);
    });
    show();
    return {
      rows: [which.row, ...sliders.map(({row}) => row)],
      // named: the number of the named cube, below 0 if it is not there
      shift(named) {
        const of = which.control.value, moved = of === "named" ? named : sides.indexOf(of);
        if (moved < 0) return null;
        const [frame, ...by_mm] = sliders.map(({slider}) => slider.valueAsNumber);
        return {frame, by_m: sides.map((_, side) => side === moved ? by_mm.map(mm => mm / 1000) : [0, 0])};
      },
    };
  }

  // What the hand did, as a sentence.
  function moved({by_m}, event, sides) {
    if (event < 0) return " The hand came too late to move a cube.";
    const far_mm = by_m.map(([x, y]) => 1000 * Math.hypot(x, y)), side = far_mm.indexOf(Math.max(...far_mm));
    return ` In frame ${event} a hand moved the ${sides[side]} cube by ${far_mm[side].toFixed(0)} mm; that is not counted.`;
  }

  const capital = words => words[0].toUpperCase() + words.slice(1);

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
