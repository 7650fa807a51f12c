// Drawings of live parts, as SVG in the page's own colours.
"use strict";
{
  const NS = "http://www.w3.org/2000/svg";
  let narrow, WIDE; // on a phone, drawings are narrower and not smaller
  const fit = () => {
    narrow = innerWidth <= 600; // as in the style sheet
    WIDE = narrow ? 400 : 800;
  };
  const svg = (tag, attributes = {}, ...children) => {
    const made = document.createElementNS(NS, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };
  const picture = (height, says, ...children) => svg("svg",
    {viewBox: `0 0 ${WIDE} ${height}`, role: "img", "aria-label": says, class: "ptae-live-figure"}, ...children);
  const text = (x, y, said, more = {}) => svg("text", {x, y, fill: "currentColor", "font-size": narrow ? 11 : 14, ...more}, said);

  // attention: [heads][tokens][keys]; tokens: their names; inside: which keys are frames.
  const attention = (attention, tokens, inside) => {
    fit();
    const count = inside.length, left = narrow ? 110 : 150, row = 20, step = (WIDE - left - 10) / PtaeLive.FRAMES, rows = [], told = [];
    attention.forEach((head, h) => tokens.forEach((token, n) => {
      const y = rows.length * row, weights = head[n], top = Math.max(...weights);
      const bars = [...weights].map((weight, t) => weight > 0.004 * top &&
        svg("rect", {x: left + t * step, y: y + 2, width: step + 0.2, height: row - 4, "fill-opacity": (weight / top).toFixed(2)}));
      const padding = weights.reduce((sum, weight, t) => sum + (inside[t] ? 0 : weight), 0);
      if (padding > 0.5) told.push(`head ${h + 1} with ${token}: ${Math.round(100 * padding)} % on the padding`);
      rows.push(svg("g", {fill: "var(--ptae-live)"}, ...bars.filter(Boolean),
        text(left - 8, y + 15, `${narrow ? "" : "head "}${h + 1}, ${token}`, {"text-anchor": "end"})));
    }));
    const end = inside.lastIndexOf(true) + 1, height = rows.length * row;
    const edge = x => svg("line", {x1: left + x * step, x2: left + x * step, y1: 0, y2: height, stroke: "currentColor", "stroke-dasharray": "3 4"});
    const says = `Attention weights over ${count} keys, ${end} of them frames. ${told.join("; ")}`;
    return picture(height + 24, says, ...rows, edge(end), ...(count < PtaeLive.FRAMES ? [edge(count)] : []),
      text(left, height + 18, narrow ? "first" : "first key"), text(left + end * step, height + 18, end < count ? "padding" : "end", {"text-anchor": "end"}));
  };

  // Five small charts: rows of radians from the first frame on; recorded is thin, made thick.
  const motions = (recorded, made, says, names = ["recorded", "the model"]) => {
    fit();
    const wide = WIDE / 5, high = 110;
    const charts = [0, 1, 2, 3, 4].map(j => {
      const lines = [recorded, made].map(rows => Array.from({length: rows.length / 5}, (_, t) => rows[5 * t + j]));
      const all = lines.flat(), low = Math.min(...all), size = Math.max(...all) - low || 1;
      const path = line => line.map((v, t) => `${t ? "L" : "M"}${(wide * j + 8 + t * (wide - 16) / 99).toFixed(1)} ${(20 + (1 - (v - low) / size) * (high - 30)).toFixed(1)}`).join("");
      return svg("g", {fill: "none"},
        svg("path", {d: path(lines[0]), stroke: "currentColor", "stroke-width": 1.5, "stroke-dasharray": "4 3"}),
        svg("path", {d: path(lines[1]), stroke: "var(--ptae-live)", "stroke-width": 2.5}),
        text(wide * j + 8, 12, `joint ${j + 1}`));
    });
    return picture(high + 22, says, ...charts, text(8, high + 16, `dashed: ${names[0]}; solid: ${names[1]}`));
  };

  // A row of canvases for features, drawn one after another; null is a place without a picture.
  const strip = (autoencoder, features, says) => {
    const places = features.map(one => PtaeLive.form.element("canvas",
      {width: 160, height: 120, class: one ? "" : "ptae-live-empty"}));
    (async () => {
      for (const [k, one] of features.entries())
        if (one) places[k].getContext("2d").putImageData(await autoencoder.draw(one), 0, 0);
    })();
    return PtaeLive.form.element("div", {class: "ptae-live-strip", role: "img", "aria-label": says}, ...places);
  };
  PtaeLive.figures = {attention, motions, strip};
}
