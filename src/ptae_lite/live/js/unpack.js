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

  // The room of an array, given back at once: a browser may take seconds to notice that it is free.
  PtaeLive.free = array => { array?.buffer.transfer?.(0); };

  function bytesOf(letters) {
    const bytes = new Uint8Array(letters.length * BITS >> 3);
    for (let i = 0, bits = 0, have = 0, at = 0; i < letters.length; i++) {
      bits = bits << BITS | letters.charCodeAt(i) - FIRST; // older bits fall out at the left
      have += BITS;
      for (; have >= 8; have -= 8) bytes[at++] = bits >>> have - 8;
    }
    return bytes;
  }

  // The parts of a stream. A part lies there in planes: every byte at a first place of a number, ...
  async function partsOf(stream, places) {
    const reader = stream.getReader(), parts = {};
    let chunk = new Uint8Array(), from = 0;
    for (const [name, [, length, planes]] of Object.entries(places)) {
      const made = parts[name] = new Uint8Array(length);
      for (let plane = 0; plane < planes; plane++)
        for (let at = plane; at < length;) {
          if (from === chunk.length) {
            PtaeLive.free(chunk);
            ({value: chunk} = await reader.read());
            from = 0;
          }
          for (; at < length && from < chunk.length; at += planes) made[at] = chunk[from++];
        }
    }
    return parts;
  }

  let last; // packs are loaded one after another, so that the room for one is enough
  function load(name, loaded) {
    const before = last;
    return last = (async () => {
      await before?.catch(() => {});
      return next(name, loaded);
    })();
  }

  // Each piece is unpacked while the next one comes, and then forgotten. It is whole bytes.
  async function next(name, loaded) {
    if (!PtaeLive.packs[name]) throw new Error(`this site has no pack ${name}`);
    const {pieces: count, bytes} = PtaeLive.packs[name], piece = i => PtaeLive.script(`${name}.${i}`);
    const inflating = new DecompressionStream("deflate"), writer = inflating.writable.getWriter();
    let coming = piece(0), parts, left;
    for (let i = 0; i < count; i++) {
      await coming;
      if (i + 1 < count) (coming = piece(i + 1)).catch(() => {}); // told when it is waited for
      parts ??= partsOf(inflating.readable, told[name].parts);
      left ??= told[name].bytes;
      const unpacked = bytesOf(pieces[name][i]);
      delete pieces[name][i];
      await writer.write(unpacked.subarray(0, left)); // the last letter may reach beyond the end
      left -= unpacked.length;
      PtaeLive.free(unpacked);
      loaded(bytes / count);
    }
    await writer.close();
    const {about, ...rest} = await parts;
    return {parts: rest, about: JSON.parse(new TextDecoder().decode(about))};
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
