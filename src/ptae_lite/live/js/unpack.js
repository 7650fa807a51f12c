// Packs: pieces of letters with 15 bits each become bytes, then the parts that they hold.
"use strict";
{
  const FIRST = 0x3400, BITS = 15;
  const pieces = {}, told = {};

  // Called by each piece when it is loaded; the first also says what the pack holds, and where.
  PtaeLive.take = (name, number, letters, places) => {
    (pieces[name] ??= [])[number] = letters;
    if (places) told[name] = places;
  };

  function bytesOf(texts, count) {
    const bytes = new Uint8Array(count + 2); // a letter may reach beyond the end
    let bits = 0, have = 0, at = 0;
    for (const text of texts)
      for (let i = 0; i < text.length; i++) {
        bits = bits << BITS | text.charCodeAt(i) - FIRST; // older bits fall out at the left
        have += BITS;
        for (; have >= 8; have -= 8) bytes[at++] = bits >>> have - 8;
      }
    return bytes.subarray(0, count);
  }

  // Bytes that were stored in planes, in their order: a copy, so that no part keeps the others.
  function woven(bytes, planes) {
    const made = new Uint8Array(bytes.length);
    for (let plane = 0, at = 0; plane < planes; plane++)
      for (let i = plane; i < made.length; i += planes) made[i] = bytes[at++];
    return made;
  }

  let last; // packs are loaded one after another, so that the room for one is enough
  function load(name, loaded) {
    const before = last;
    return last = (async () => {
      await before?.catch(() => {});
      return next(name, loaded);
    })();
  }

  async function next(name, loaded) {
    if (!PtaeLive.packs[name]) throw new Error(`this site has no pack ${name}`);
    const {pieces: count, bytes} = PtaeLive.packs[name];
    await Promise.all(Array.from({length: count}, async (_, i) => {
      await PtaeLive.script(`${name}.${i}`);
      loaded(bytes / count);
    }));
    const {bytes: packed, parts: places} = told[name];
    const stream = new Blob([bytesOf(pieces[name], packed)]).stream();
    delete pieces[name];
    const whole = new Uint8Array(await new Response(
      stream.pipeThrough(new DecompressionStream("deflate"))).arrayBuffer());
    const {about, ...parts} = Object.fromEntries(Object.entries(places).map(
      ([part, [from, length, planes]]) => [part, woven(whole.subarray(from, from + length), planes)]));
    return {parts, about: JSON.parse(new TextDecoder().decode(about))};
  }

  // The packs of these names, each loaded once. show: called with the share that is loaded.
  PtaeLive.load = async (names, show = () => {}) => {
    const total = names.reduce((sum, name) => sum + (PtaeLive.packs[name]?.bytes ?? 0), 0);
    let done = 0;
    const loaded = bytes => show((done += bytes) / total);
    const found = await Promise.all(names.map(name => load[name] ??= load(name, loaded)));
    show(1);
    return found;
  };
}
