// Plays the scene that the page around this script holds; see viewer.py for how it is packed.
"use strict";
const [pane, eye, play, slider, clock, speed] =
  ["pane", "eye", "play", "frame", "clock", "speed"].map(id => document.getElementById(id));
const root = document.documentElement;
const stored = id => document.getElementById(id).textContent;

async function unpack(id) {
  const bytes = Uint8Array.from(atob(stored(id)), letter => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

const decode = async id => new TextDecoder().decode(await unpack(id));

// The page that this one stands in, where it is one of the book's site; else nothing.
function site() {
  try {
    return parent === window ? null : parent.document.documentElement;
  } catch {
    return null;
  }
}

// meshcat's viewer, where this script did not come together with it.
async function loadLibrary() {
  if (window.MeshCat) return;
  const library = document.createElement("script");
  library.textContent = await decode("viewer");
  document.head.append(library);
}

function openViewer([x, y, z]) {
  const viewer = new MeshCat.Viewer(pane);
  const fit = viewer.set_3d_pane_size.bind(viewer);  // it would take the whole window's height
  viewer.set_3d_pane_size = () => fit(pane.clientWidth, pane.clientHeight);
  // also when a scene that was opened out of sight comes into sight, and gets its size then
  new ResizeObserver(() => {
    viewer.set_3d_pane_size();
    viewer.set_dirty();
  }).observe(pane);
  viewer.controls.target.set(x, z, -y);  // three.js has y upwards
  // the wheel scrolls the page that this one is part of, until the reader takes hold of the scene
  viewer.controls.enableZoom = false;
  pane.onpointerdown = () => { viewer.controls.enableZoom = true; };
  pane.onpointerleave = () => { viewer.controls.enableZoom = false; };
  pane.firstElementChild.style.touchAction = "pan-y";  // a finger scrolls the page, too
  return viewer;
}

// Light or dark as the site is, also when its reader changes that.
function followTheme(viewer, backgrounds) {
  const page = site();
  function paint() {
    const dark = page?.dataset.theme === "dark";
    root.classList.toggle("dark", dark);
    const [top_color, bottom_color] = backgrounds[dark ? "dark" : "light"];
    for (const [property, value] of Object.entries({top_color, bottom_color}))
      viewer.handle_command({type: "set_property", path: "/Background", property, value});
    viewer.set_dirty();
  }
  paint();
  if (page) new MutationObserver(paint).observe(page, {attributeFilter: ["data-theme"]});
}

// Each moving link's 3 x 4 pose in each frame, from steps of whole units: link, entry, frame.
function readMoves(steps, {moving, last, unit}) {
  const frames = last + 1, poses = Array.from({length: frames}, () => moving.map(() =>
    [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]));
  let next = 0;
  moving.forEach((_, link) => {
    for (let entry = 0; entry < 12; entry++)
      for (let frame = 0, sum = 0; frame < frames; frame++) {
        sum += steps[next++];  // three.js has a matrix column by column
        poses[frame][link][4 * (entry % 4) + Math.floor(entry / 4)] = sum * unit;
      }
  });
  return poses;
}

// The camera's pictures lie row by row in one sheet; shows the last one up to a frame.
async function openEye(film) {
  if (!film) return () => {};
  const sheet = new Image(), canvas = eye.querySelector("canvas");
  sheet.src = film.sheet;
  await sheet.decode();
  [canvas.width, canvas.height] = film.size;
  eye.hidden = false;
  return frame => {
    const i = film.frames.findLastIndex(shown => shown <= frame);
    const [w, h] = film.size, x = w * (i % film.columns), y = h * Math.floor(i / film.columns);
    canvas.getContext("2d").drawImage(sheet, x, y, w, h, 0, 0, w, h);
  };
}

async function start() {
  const scene = JSON.parse(await decode("scene"));
  const poses = readMoves(new Int16Array(await unpack("moves")), scene);
  const look = await openEye(scene.eye);
  await loadLibrary();
  const viewer = openViewer(scene.look_at_m);
  scene.commands.forEach(command => viewer.handle_command(command));
  followTheme(viewer, scene.backgrounds);
  const nodes = scene.moving.map(path => viewer.scene_tree.find(path.split("/").filter(Boolean)));

  let playing = false, again = false, position = 0, before = 0;  // position in frames
  function show(frame) {
    nodes.forEach((node, i) => node.set_transform(poses[frame][i]));
    viewer.set_dirty();
    look(frame);
    slider.value = frame;
    const seconds = (frame / scene.frames_per_s).toFixed(2);
    clock.value = `frame ${frame} of ${scene.last}, ${seconds} s`;
    slider.setAttribute("aria-valuetext", clock.value);
  }
  function setPlaying(now) {
    playing = now;
    play.textContent = playing ? "Pause" : "Play";
    if (position >= scene.last) position = 0;
    before = performance.now();
    if (playing) requestAnimationFrame(tick);
  }
  function tick(now) {
    if (!playing) return;
    position += Math.max(0, now - before) / 1000 * scene.frames_per_s * Number(speed.value);
    before = now;
    const rest = again ? scene.frames_per_s : 0;  // a second of rest before it begins again
    if (again && position >= scene.last + rest) position = 0;
    show(Math.min(Math.floor(position), scene.last));
    if (position < scene.last + rest) requestAnimationFrame(tick); else setPlaying(false);
  }
  play.onclick = () => {
    again = false;
    setPlaying(!playing);
  };
  slider.oninput = () => {
    position = Number(slider.value);
    playing = again = false;
    play.textContent = "Play";
    show(position);
  };
  slider.max = scene.last;
  play.disabled = slider.disabled = scene.last === 0;
  show(0);
  if (scene.autoplay && !matchMedia("(prefers-reduced-motion: reduce)").matches) {
    again = true;
    setPlaying(true);
  }
}

start().catch(problem => {
  clock.value = "";
  pane.textContent = `This browser cannot show the 3-D view: ${problem.message}`;
});
