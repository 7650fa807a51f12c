// An episode to look at: the book's 3-D view, or, without WebGL, what the robot's eye sees.
"use strict";
{
  const escaped = text => text.replace(/[&<>"]/g, letter => `&#${letter.charCodeAt(0)};`);

  async function pack(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate"));
    const packed = new Uint8Array(await new Response(stream).arrayBuffer()), letters = [];
    for (let at = 0; at < packed.length; at += 8192)
      letters.push(String.fromCharCode(...packed.subarray(at, at + 8192)));
    return btoa(letters.join(""));
  }

  // Changes from frame to frame in whole units: link, entry, frame. See viewer.py.
  function steps(about, episode) {
    const {moving, unit} = about.view.scene, frames = episode.joints_rad.length;
    const made = new Int16Array(moving.length * 12 * frames), before = new Float64Array(moving.length * 12);
    episode.joints_rad.forEach((joints_rad, t) => {
      const poses = PtaeLive.linksAt(about.links, joints_rad);
      about.sides.forEach((side, k) => { poses[side] = PtaeLive.poseOf(episode.cubes[t][k]); });
      moving.forEach((path, link) => {
        const pose = poses[path.slice(path.lastIndexOf("/") + 1)];
        for (let i = 0; i < 12; i++) {
          const at = 12 * link + i, now = Math.round(pose[i] / unit);
          made[at * frames + t] = now - before[at];
          before[at] = now;
        }
      });
    });
    return made;
  }

  const hasWebGL = () => {
    const canvas = document.createElement("canvas");
    return Boolean(canvas.getContext("webgl2") ?? canvas.getContext("webgl"));
  };

  // The book's view of a scene, with this episode as its movement; it plays at once, unless the
  // reader wants no motion.
  async function view(about, episode, colours, title, caption) {
    const {page, scene, cubes} = about.view, rgb = about.camera.colours;
    const last = episode.joints_rad.length - 1;
    const commands = scene.commands.map(command => {
      const side = about.sides.findIndex(name => command.path.startsWith(`${cubes[name]}/`));
      if (side < 0 || command.type !== "set_object") return command;
      const [red, green, blue] = rgb[colours[side]].map(part => Math.round(255 * part));
      const painted = structuredClone(command);
      painted.object.materials[0].color = red << 16 | green << 8 | blue;
      return painted;
    });
    const text = JSON.stringify({...scene, commands, last, autoplay: true});
    const filled = {BASE: escaped(PtaeLive.base), SCENE: await pack(new TextEncoder().encode(text)), MOVES: await pack(steps(about, episode)),
      CAPTION: escaped(caption), TITLE: escaped(title)};
    return PtaeLive.form.element("iframe", {title, "aria-label": title, class: "ptae-live-view",
      srcdoc: Object.entries(filled).reduce((html, [name, value]) => html.replaceAll(`@${name}@`, () => value), page)});
  }

  // Pictures of the robot's eye, one a frame, with a button and a slider.
  function film(about, episode, colours, title) {
    const {element} = PtaeLive.form, camera = new PtaeLive.Camera(about.camera, about.links);
    const {width, height} = about.camera, last = episode.joints_rad.length - 1;
    const canvas = element("canvas", {width, height, role: "img", "aria-label": `${title}, seen by the robot`});
    const play = element("button", {type: "button"}, "Play");
    const slider = element("input", {type: "range", min: 0, max: last, value: 0, "aria-label": "Frame"});
    let timer = 0;
    const show = frame => {
      const pixels = camera.image(episode.joints_rad[frame], episode.cubes[frame], colours);
      canvas.getContext("2d").putImageData(new ImageData(pixels.slice(), width, height), 0, 0);
      slider.value = frame;
    };
    const stop = () => {
      clearInterval(timer);
      timer = 0;
      play.textContent = "Play";
    };
    play.onclick = () => {
      if (timer) return stop();
      let frame = Number(slider.value) % last;
      play.textContent = "Pause";
      timer = setInterval(() => {
        show(++frame);
        if (frame >= last) stop();
      }, 1000 / about.frames_per_s);
    };
    slider.oninput = () => { stop(); show(Number(slider.value)); };
    show(0);
    return element("div", {class: "ptae-live-film"}, canvas, play, slider,
      element("p", {class: "ptae-live-note"}, "This browser has no WebGL, so here is what the robot's eye sees."));
  }

  PtaeLive.stage = (about, episode, colours, title, caption) =>
    hasWebGL() ? view(about, episode, colours, title, caption) : film(about, episode, colours, title);
}
