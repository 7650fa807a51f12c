// Words and sentences, from the pack "book".
"use strict";
PtaeLive.Language = class {
  constructor(about) {
    Object.assign(this, about); // tokens, words, classes, first_word, wiring
    this.kinds = Object.keys(this.classes);
  }
  token(word) {
    return this.tokens.indexOf(word);
  }
  // The words of a sentence; throws what is allowed.
  parse(text) {
    const words = text.trim().split(/\s+/);
    if (words.length !== 3)
      throw new Error(`a sentence has three words, ${this.kinds.join(" ")}; this has ${words.length}`);
    words.forEach((word, i) => {
      const allowed = this.classes[this.kinds[i]];
      if (!allowed.includes(word))
        throw new Error(`“${word}” is no ${this.kinds[i]} word; allowed here: ${allowed.join(", ")}`);
    });
    return words;
  }
  // Tokens with their tags: BOS, action, colour, speed, EOS. BOS and EOS are token 0.
  encode(text) {
    return [0, ...this.parse(text).map(word => this.token(word)), 0];
  }
  // The words up to the first end tag; one in the first place counts as the opening tag.
  decode(indices) {
    const words = indices[0] === 0 ? indices.slice(1) : indices, end = words.indexOf(0);
    return words.slice(0, end < 0 ? words.length : end).map(i => this.tokens[i]).join(" ");
  }
  // What a sentence says, as first words; nothing if it is none.
  meaning(text) {
    try {
      return this.parse(text).map(word => this.first_word[word] ?? word);
    } catch {
      return null;
    }
  }
};
