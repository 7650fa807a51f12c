// Chapter 02: paint on what the camera sees, recolour a cube, move one of the thirty numbers, and see
// what the decoder makes of them.
"use strict";
{
  const {element, labelled, choice, clips, latest} = PtaeLive.form;
  const WIDE = 160, HIGH = 120, SHOWN = ["red", "green", "blue"];

  PtaeLive.parts.vision = async (room, show) => {
    const [, pack, scene] = await PtaeLive.load(PtaeLive.needs.vision, show);
    const all = PtaeLive.clips(pack), autoencoder = await PtaeLive.Autoencoder.open();
    const {about, parts} = scene, camera = new PtaeLive.Camera(about.camera, about.links);
    const places = new Float32Array(parts.cubes.buffer, parts.cubes.byteOffset, parts.cubes.length / 4);
    const spread = spreadOf(all), colours = Object.keys(about.camera.colours);

    const names = Object.fromEntries(colours.map(name => [name, name]));
    const scenes = clips(all, "scene", () => { paintScene(); ask(); });
    const cubes = about.sides.map(side => choice(`${side} cube`, names, () => { paintScene(false); ask(); }));
    const canvas = element("canvas", {width: WIDE, height: HIGH, tabindex: 0, role: "img",
      "aria-label": "What the camera sees. Paint with the pointer, or move the brush by the arrow keys and paint by the space bar."});
    const pen = canvas.getContext("2d", {willReadFrequently: true});
    const colour = element("input", {type: "color", value: "#f2191a"});
    const clean = element("button", {type: "button"}, "Take the paint away");
    const numbers = Object.fromEntries([["none", "none"], ...SHOWN.flatMap((name, c) =>
      Array.from({length: 10}, (_, i) => [`number ${10 * c + i}`, `${name} ${i + 1}`]))]);
    const number = choice("number to move", numbers, () => { by.value = 0; ask(); });
    const by = element("input", {type: "range", min: -3, max: 3, step: 0.25, value: 0, autocomplete: "off"}), told = element("output");
    by.oninput = () => ask();
    const drawn = element("canvas", {width: WIDE, height: HIGH, role: "img", "aria-label": "What the decoder draws from the thirty numbers"});
    const bars = element("div"), said = element("p", {"aria-live": "polite", class: "ptae-live-said"});

    function paintScene(own = true) {
      const clip = scenes.clip;
      if (own) cubes.forEach((one, k) => { one.control.value = clip.colours[k]; });
      const poses = [0, 7].map(at => places.subarray(14 * clip.sample + at, 14 * clip.sample + at + 7));
      const pixels = camera.image([...clip.joints.subarray(0, 5)], poses, cubes.map(one => one.control.value));
      pen.putImageData(new ImageData(pixels.slice(), WIDE, HIGH), 0, 0);
    }
    const ask = latest(async () => {
      const image = pen.getImageData(0, 0, WIDE, HIGH), code = Float32Array.from(await autoencoder.encode(image));
      const moves = number.control.value !== "none", which = moves ? Number(number.control.value.slice(7)) : -1;
      by.disabled = !moves;
      const shift = moves ? Number(by.value) : 0;
      told.value = `${shift} standard deviations`;
      by.setAttribute("aria-valuetext", told.value);
      if (moves) code[which] += shift * spread.size[which];
      const back = await autoencoder.draw(code);
      drawn.getContext("2d").putImageData(back, 0, 0);
      bars.replaceChildren(chart(code, spread, which));
      let sum = 0;
      for (let i = 0; i < image.data.length; i++) if (i % 4 < 3) sum += Math.abs(image.data[i] - back.data[i]);
      said.textContent = `First ${(3 * WIDE * HIGH).toLocaleString("en")} numbers, then what thirty keep of them. A value is ${(sum / (3 * WIDE * HIGH) / 2.55).toFixed(1)} % off in the mean.`;
      room.dataset.answered = Number(room.dataset.answered ?? 0) + 1;
    });

    brush(canvas, pen, colour, ask);
    clean.onclick = () => { paintScene(false); ask(); };
    room.append(
      element("div", {class: "ptae-live-controls"}, scenes.row, ...cubes.map(one => one.row),
        labelled("paint", colour), clean, number.row, labelled("by", by, " ", told)),
      said, element("div", {class: "ptae-live-pair"}, canvas, drawn), bars);
    scenes.clip = all.find(one => one.split === "test") ?? all[0];
    paintScene();
    await ask();
  };

  // The mean and the spread of each number over all frames of the clips.
  function spreadOf(all) {
    const sum = new Float64Array(30), square = new Float64Array(30);
    let count = 0;
    for (const {features} of all) {
      for (let i = 0; i < features.length; i++) {
        sum[i % 30] += features[i];
        square[i % 30] += features[i] ** 2;
      }
      count += features.length / 30;
    }
    const mean = sum.map(v => v / count);
    return {mean, size: square.map((v, i) => Math.sqrt(v / count - mean[i] ** 2))};
  }

  // Thirty bars in three groups: how far each number is from its mean, in standard deviations.
  function chart(code, {mean, size}, moved) {
    const values = [...code].map((v, i) => Math.max(-4, Math.min(4, (v - mean[i]) / size[i])));
    const bars = element("div", {class: "ptae-live-bars", role: "img",
      "aria-label": `Thirty numbers, in standard deviations from their means: ${values.map(v => v.toFixed(1)).join(", ")}`});
    values.forEach((value, i) => {
      const bar = element("span", {class: i === moved ? "ptae-live-moved" : ""});
      bar.style.setProperty("--value", value);
      bar.style.setProperty("--paint", ["#c00", "#080", "#06c"][Math.floor(i / 10)]);
      bars.append(bar);
    });
    return bars;
  }

  // Painting by the pointer, or by the keyboard.
  function brush(canvas, pen, colour, changed) {
    const SIZE = 8;
    let down = false, at = [80, 60];
    const dab = () => {
      pen.fillStyle = colour.value;
      pen.fillRect(at[0] - SIZE / 2, at[1] - SIZE / 2, SIZE, SIZE);
      changed();
    };
    const follow = event => {
      const box = canvas.getBoundingClientRect();
      at = [(event.clientX - box.left) / box.width * WIDE, (event.clientY - box.top) / box.height * HIGH];
      dab();
    };
    canvas.onpointerdown = event => {
      canvas.setPointerCapture(event.pointerId);
      down = true;
      follow(event);
    };
    canvas.onpointermove = event => { if (down) follow(event); };
    canvas.onpointerup = canvas.onpointercancel = () => { down = false; };
    const moves = {ArrowLeft: [-4, 0], ArrowRight: [4, 0], ArrowUp: [0, -4], ArrowDown: [0, 4], " ": [0, 0]};
    canvas.onkeydown = event => {
      const move = moves[event.key];
      if (!move) return;
      event.preventDefault();
      at = [Math.max(0, Math.min(WIDE, at[0] + move[0])), Math.max(0, Math.min(HIGH, at[1] + move[1]))];
      if (event.key === " " || event.shiftKey) dab();
    };
  }
}
