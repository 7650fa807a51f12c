// In every page: where a live part is asked for, a button; all else is loaded when it is pressed.
"use strict";
window.PtaeLive = {
  base: document.currentScript.src.replace(/[^/]*$/, ""),
  packs: {}, // names of the packs with their pieces and bytes, from packs.js
  policies: {}, // names of the models that act, by pack, from packs.js
  labelled: {}, // percent of the training clips with a label, by pack, from packs.js
  parts: {}, // name of a live part: function (room, show) that builds it; true if what is stored stays
  needs: { // the packs of each
    vision: ["ort", "book", "scene", "autoencoder"],
    transformer: ["ort", "book", "ptae", "autoencoder"],
    conflict: ["ort", "book", "scene", "ptae"],
    act: ["ort", "autoencoder", "mujoco", "scene", "book", "policy", "ptae"],
    policies: ["ort", "autoencoder", "mujoco", "scene", "book"], // and the first of `policies`
    labels: ["ort", "book"], // and the models of `labelled`
  },
  scripts: ["unpack", "runtime", "language", "clips", "signals", "ptae", "watcher", "autoencoder", "form",
    "figures", "arms", "vision_part", "transformer_part", "conflict_part", "labels_part",
    "kinematics", "inverse", "physics", "acting", "camera", "policy",
    "robot", "snatch", "stage", "act_part"],
};

// A classic script: a page in a folder may fetch nothing.
PtaeLive.script = name => PtaeLive.script[name] ??= new Promise((done, failed) => {
  const tag = document.createElement("script");
  tag.src = `${PtaeLive.base}${name}.js`;
  tag.async = false; // they run in the order in which they are asked for
  tag.onload = () => {
    tag.remove(); // its text, megabytes of letters, need not stay
    done();
  };
  tag.onerror = () => failed(new Error(`${name}.js is missing beside this page`));
  document.head.append(tag);
});

// The packs that a part loads at once.
PtaeLive.packsOf = part => {
  const models = {labels: Object.keys(PtaeLive.labelled), policies: Object.keys(PtaeLive.policies).slice(0, 1)};
  return [...PtaeLive.needs[part], ...(models[part] ?? [])];
};

// Why models cannot run here; nothing if they can.
PtaeLive.lacking = () => {
  if (typeof WebAssembly === "undefined") return "this browser has no WebAssembly";
  if (typeof DecompressionStream === "undefined") return "this browser cannot unpack the models";
  return "";
};

// The place of a live part holds the stored answers, and the size of what it would load.
PtaeLive.offer = place => {
  const stored = [...place.childNodes], bar = document.createElement("p");
  bar.className = "ptae-live-offer";
  place.prepend(bar);
  const why = PtaeLive.lacking();
  if (why) {
    bar.textContent = `Below are stored answers; the model itself cannot run here, because ${why}.`;
    return;
  }
  const button = document.createElement("button"), note = document.createElement("span");
  button.type = "button";
  button.textContent = place.dataset.offer;
  const bytes = PtaeLive.packsOf(place.dataset.ptaeLive).reduce((sum, name) => sum + PtaeLive.packs[name].bytes, 0);
  note.textContent = ` loads ${Math.round(bytes / 1e6)} MB from this site; no other address is asked`;
  bar.append(button, note);
  button.onclick = async () => {
    const progress = document.createElement("progress");
    progress.setAttribute("aria-label", "Loading the model");
    progress.max = 1;
    bar.replaceChildren(progress);
    const show = share => { progress.value = share; };
    try {
      await Promise.all(PtaeLive.scripts.map(PtaeLive.script));
      const room = document.createElement("div");
      const keeps = await PtaeLive.parts[place.dataset.ptaeLive](room, show);
      if (!keeps) stored.forEach(node => node.remove?.());
      bar.replaceWith(room);
      room.querySelector("select, input, button")?.focus();
      place.dataset.state = "ready";
    } catch (problem) {
      bar.setAttribute("role", "alert");
      bar.textContent = `The model could not start (${problem.message}); below are stored answers.`;
      place.dataset.state = "failed";
    }
  };
};

document.addEventListener("DOMContentLoaded", () => {
  document.querySelectorAll("[data-ptae-live]").forEach(PtaeLive.offer);
});
