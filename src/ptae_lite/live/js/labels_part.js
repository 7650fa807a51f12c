// Chapter 04: what PTAE says of any clip, after trainings with few labels and with all. The reader
// chooses one of them, or all side by side.
"use strict";
{
  const {element, choice, clips, latest} = PtaeLive.form;
  const EVERY = "every", percent = shares => `${shares.join(", ")} %`;

  PtaeLive.parts.labels = async (room, show) => {
    const names = Object.keys(PtaeLive.labelled), shares = Object.values(PtaeLive.labelled);
    await PtaeLive.load(PtaeLive.packsOf("labels"), show);
    const [book] = await PtaeLive.load(["book"]), models = await Promise.all(names.map(name => PtaeLive.PTAE.open(name)));
    const language = new PtaeLive.Language(book.about), all = PtaeLive.clips(book);
    const clip = clips(all, "clip", () => ask()), percents = percent(shares);
    const trained = choice("share of the labels", {[EVERY]: `${percents}, side by side`,
      ...Object.fromEntries(names.map((name, k) => [name, percent([shares[k]])]))}, () => ask());
    trained.row.hidden = names.length < 2;
    const said = element("p", {"aria-live": "polite", class: "ptae-live-said"}), answer = element("div");

    const ask = latest(async () => {
      const own = clip.clip, truth = [own.action, own.colour, own.speed], rows = [];
      for (const [k, model] of models.entries()) {
        if (![EVERY, names[k]].includes(trained.control.value)) continue;
        const {told} = await model.answer(PtaeLive.batch(language, "describe", model.scaling.clip(own)), {motion: false});
        const best = PtaeLive.best(told), words = language.decode(best).split(" ").filter(Boolean);
        const right = words.map((word, i) => (language.first_word[word] ?? word) === truth[i]);
        rows.push({share: shares[k], words, right, sure: best.map((word, i) => told[i][word]),
          done: words.length === truth.length && right.every(Boolean)});
      }
      answer.replaceChildren(table(rows));
      const good = rows.filter(one => one.done).map(one => one.share);
      said.textContent = `The clip shows “${own.sentence}”. ` + (good.length ? `Right: with ${percent(good)} of the labels.`
        : rows.length > 1 ? "None is right." : "What it says is wrong.");
      said.dataset.sentence = rows.map(one => one.words.join(" ")).join("; ");
      room.dataset.answered = Number(room.dataset.answered ?? 0) + 1;
    });

    room.append(element("div", {class: "ptae-live-controls"}, clip.row, trained.row), said, answer, element("p", {class: "ptae-live-note"},
      `These answers are made here, by the models with ${percents} of the labels. Behind each word is the probability that ` +
      "the model gives it; ≠ marks a wrong one. The table below is stored: models with other shares are not on this site."));
    clip.clip = all.find(one => one.split === "test") ?? all[0];
    await ask();
    return true; // the stored table has other shares, and stays
  };

  function table(rows) {
    const head = element("tr", {}, element("th", {scope: "col"}, "labels"), element("th", {scope: "col"}, "it says"));
    const lines = rows.map(({share, words, right, sure}) => element("tr", {}, element("th", {scope: "row"}, `${share} %`),
      element("td", {}, ...words.flatMap((word, i) => [
        element("span", {class: right[i] ? "" : "ptae-live-false"}, right[i] ? word : `≠\u00a0${word}`), ` (${(100 * sure[i]).toFixed(0)} %) `]))));
    return element("table", {class: "ptae-live-table"}, head, ...lines);
  }
}
