// Controls and rows that live parts share: all have a name, and the keyboard works as in any form.
"use strict";
{
  const element = (tag, attributes = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes))
      if (value === true) made.setAttribute(name, "");
      else if (value !== false && value !== undefined) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };

  // A control with its name in front.
  let count = 0;
  const labelled = (name, control, ...behind) => {
    control.id = `ptae-live-${++count}`;
    return element("span", {}, element("label", {for: control.id}, name), " ", control, ...behind);
  };

  // options: {value: text}, or {group: {value: text}}.
  const choice = (name, options, changed) => {
    const control = element("select", {autocomplete: "off"});
    for (const [value, text] of Object.entries(options))
      if (typeof text === "string") control.append(element("option", {value}, text));
      else {
        const group = element("optgroup", {label: value});
        for (const [inner, told] of Object.entries(text)) group.append(element("option", {value: inner}, told));
        control.append(group);
      }
    control.onchange = changed;
    return {row: labelled(name, control), control};
  };

  // Three choices that make a sentence.
  const sentence = (language, name, changed) => {
    const controls = language.kinds.map(kind => choice(kind,
      Object.fromEntries(language.classes[kind].map(word => [word, word])), changed));
    const row = element("fieldset", {}, element("legend", {}, name), ...controls.map(one => one.row));
    return {
      row,
      get text() { return controls.map(one => one.control.value).join(" "); },
      set text(words) { words.split(" ").forEach((word, i) => { controls[i].control.value = word; }); },
    };
  };

  // The clips in groups of the same two cubes.
  const clips = (all, name, changed) => {
    const groups = {};
    all.forEach((clip, i) => {
      const cubes = `${clip.colours[0]} left, ${clip.colours[1]} right`;
      (groups[cubes] ??= {})[`clip ${i}`] = `${clip.sentence}${clip.split === "test" ? ", test" : ""}`;
    });
    const made = choice(name, groups, changed);
    return {
      row: made.row, control: made.control,
      get clip() { return all[Number(made.control.value.slice(5))]; },
      set clip(clip) { made.control.value = `clip ${all.indexOf(clip)}`; },
    };
  };

  // Answers come one after another; of those asked for meanwhile only the last is made.
  const latest = make => {
    let running = null, again = false;
    return async function ask() {
      again = true;
      if (running) return running;
      running = (async () => {
        while (again) {
          again = false;
          await make();
        }
      })();
      try {
        await running;
      } finally {
        running = null;
      }
    };
  };
  PtaeLive.form = {element, labelled, choice, sentence, clips, latest};
}
