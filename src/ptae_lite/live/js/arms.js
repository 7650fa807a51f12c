// Two arms over one table, drawn as lines from the side, with a slider over their frames.
"use strict";
{
  const NS = "http://www.w3.org/2000/svg", WIDE = 800, HIGH = 420;
  const TURN = -0.9, TILT = 0.45; // of the eye: about the vertical, and down
  const draw = (tag, attributes, ...children) => {
    const made = document.createElementNS(NS, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };
  // From the world to the drawing, in metres: to the right, down, and towards the eye.
  const seen = ([x, y, z]) => {
    const right = x * Math.sin(-TURN) - y * Math.cos(TURN), away = x * Math.cos(TURN) - y * Math.sin(TURN);
    return [right, -(z * Math.cos(TILT) + away * Math.sin(TILT)), z * Math.sin(TILT) - away * Math.cos(TILT)];
  };
  // The joints' places from shoulder to fingertips.
  const bones = ({links, fingertip_m}, joints) => {
    const poses = PtaeLive.linksAt(links, joints), places = links.map(({name}) => [3, 7, 11].map(i => poses[name][i]));
    const hand = poses[links.at(-1).name];
    return [...places, [3, 7, 11].map((i, row) => hand[i] - fingertip_m * hand[4 * row + 2])].map(seen);
  };
  const FACES = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
  const cubeFaces = (pose, edge) => {
    const corners = Array.from({length: 8}, (_, k) => [4, 2, 1].map(bit => (k & bit ? 0.5 : -0.5) * edge))
      .map(at => seen([0, 4, 8].map(row => pose[row] * at[0] + pose[row + 1] * at[1] + pose[row + 2] * at[2] + pose[row + 3])));
    return FACES.map(face => face.map(k => corners[k]))
      .sort((a, b) => a.reduce((sum, p) => sum + p[2], 0) - b.reduce((sum, p) => sum + p[2], 0)).slice(3);
  };

  // about: of the pack "scene"; cubes: poses at the start; motions: {name: rows of joints}, the first
  // is drawn dashed. Returns an element whose slider moves both.
  PtaeLive.arms = (about, cubes, colours, motions, title) => {
    const {element, labelled} = PtaeLive.form, names = Object.keys(motions);
    const tracks = names.map(name => Array.from({length: motions[name].length / 5}, (_, t) =>
      bones(about, motions[name].slice(5 * t, 5 * t + 5))));
    const z = about.table_top_m; // of the table, the part about the cubes
    const table = [[0.25, -0.15], [0.6, -0.15], [0.6, 0.38], [0.25, 0.38]].map(([x, y]) => seen([x, y, z]));
    const all = [...tracks.flat(2), ...table];
    const [low, high] = [Math.min, Math.max].map(best => [0, 1].map(i => best(...all.map(p => p[i]))));
    const size = Math.min((WIDE - 60) / (high[0] - low[0]), (HIGH - 40) / (high[1] - low[1]));
    const place = ([x, y]) => `${(30 + (x - low[0]) * size).toFixed(1)},${(20 + (y - low[1]) * size).toFixed(1)}`;
    const polygon = (points, fill) => draw("polygon", {points: points.map(place).join(" "), fill, stroke: "currentColor", "stroke-width": 1});
    const boxes = cubes.map((pose, k) => ({pose: PtaeLive.poseOf(pose), rgb: about.camera.colours[colours[k]]}));
    const lines = names.map((_, k) => draw("polyline", {fill: "none", "stroke-linecap": "round", "stroke-linejoin": "round",
      ...(k ? {stroke: "var(--ptae-live)", "stroke-width": 7} : {stroke: "currentColor", "stroke-width": 4, "stroke-dasharray": "8 8"})}));
    const svg = draw("svg", {viewBox: `0 0 ${WIDE} ${HIGH}`, role: "img", "aria-label": title, class: "ptae-live-figure"},
      polygon(table, "rgba(136, 119, 85, 0.15)"),
      ...boxes.flatMap(({pose, rgb}) => cubeFaces(pose, about.cube_edge_m).map(face =>
        polygon(face, `rgb(${rgb.map(part => Math.round(255 * part)).join(" ")})`))), ...lines);

    const last = Math.max(...tracks.map(track => track.length)) - 1;
    const slider = element("input", {type: "range", min: 0, max: last, autocomplete: "off"}), shown = element("output");
    const play = element("button", {type: "button"}, "Play");
    const show = frame => {
      tracks.forEach((track, k) => lines[k].setAttribute("points", track[Math.min(frame, track.length - 1)].map(place).join(" ")));
      slider.value = frame;
      shown.value = `${frame} of ${last}`;
      slider.setAttribute("aria-valuetext", shown.value);
    };
    let timer = 0;
    const stop = () => {
      clearInterval(timer);
      timer = 0;
      play.textContent = "Play";
    };
    slider.oninput = () => { stop(); show(Number(slider.value)); };
    play.onclick = () => {
      if (timer) return stop();
      let frame = Number(slider.value) % last;
      play.textContent = "Pause";
      timer = setInterval(() => {
        if (!svg.isConnected) return stop();
        show(++frame);
        if (frame >= last) stop();
      }, 1000 / about.frames_per_s);
    };
    show(Math.round(last / 2));
    const row = element("p", {}, play, " ", labelled("frame", slider, " "), shown, ` – dashed: ${names[0]}; solid: ${names[1]}`);
    return element("div", {}, svg, row);
  };
}
