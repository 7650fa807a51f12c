// Packs: pieces of letters with 15 bits each become bytes, then the parts that they hold.
"use strict";
{
  const FIRST = 0x3400, BITS = 15;
  const pieces = {}, told = {};

  // Called by each piece when it is loaded; the first also says what the pack holds.
  PtaeLive.take = (name, number, letters, about) => {
    (pieces[name] ??= [])[number] = letters;
    if (about) told[name] = about;
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

  async function load(name, loaded) {
    if (!PtaeLive.packs[name]) throw new Error(`this site has no pack ${name}`);
    const {pieces: count, bytes} = PtaeLive.packs[name];
    await Promise.all(Array.from({length: count}, async (_, i) => {
      await PtaeLive.script(`${name}.${i}`);
      loaded(bytes / count);
    }));
    const {bytes: packed, parts, about} = told[name];
    const stream = new Blob([bytesOf(pieces[name], packed)]).stream();
    const whole = await new Response(
      stream.pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
    delete pieces[name];
    const found = {};
    for (const [part, [from, length]] of Object.entries(parts))
      found[part] = new Uint8Array(whole, from, length);
    return {parts: found, about};
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
