"""Questions on chapter 04: few labels, which ones, and how often each is shown."""

from ptae_lite.book.exam.questions import ask, question


@question
def how_often_a_label_is_seen(draw):
    labels, updates = draw.choice((7, 13, 32, 65)), 96 * draw.randint(10, 40)
    half, clips = 9, 648
    return ask(
        f"{labels} of {clips} training clips have a label. Each batch has {2 * half} clips, and "
        f"half of each batch is labelled. How often is each label seen in {updates} updates?",
        f"{half * updates / labels:.0f}",
        f"{half} places a batch are shared by {labels} clips.",
        (f"{2 * half * updates / clips:.0f}", "takes all clips to be seen equally often"),
        (f"{2 * half * updates / labels:.0f}", "gives the whole batch to the labelled clips"),
        (f"{updates}", "takes a label to be seen once an update"),
        labels=labels, updates=updates, half=half, clips=clips,
    )  # fmt: skip


@question
def a_colour_that_is_missing(draw):
    labels, colours = draw.randint(6, 20), draw.choice((4, 5, 6, 8))
    missing = 100 * (1 - 1 / colours) ** labels
    return ask(
        f"{labels} clips are labelled at random out of very many, in which {colours} colours are "
        "equally frequent. How likely is it that none of the labels names red?",
        f"{missing:.1f} %",
        f"Each label misses red with {colours - 1} of {colours}, and all of them have to.",
        (f"{100 - missing:.1f} %", "gives the chance that red is named"),
        (f"{100 / colours:.1f} %", "forgets that there are several labels"),
        (f"{100 * (1 - 1 / colours):.1f} %", "takes one label for all of them"),
        labels=labels, colours=colours,
    )  # fmt: skip


@question
def a_label_that_leaks(draw):
    share, variations = draw.choice((5, 8, 10, 12)), draw.choice((4, 5, 6, 8))
    leaks = 100 * (1 - (1 - share / 100) ** variations)
    return ask(
        f"Each pattern was recorded in {variations} variations, and {share} % of all clips are "
        "labelled at random. Which share of the patterns has at least one labelled clip?",
        f"{leaks:.0f} %",
        f"A pattern has none if all {variations} of its clips miss, so the share is far larger "
        "than that of the labels: patterns and not clips must be kept apart.",
        (f"{share} %", "takes the share of clips for that of patterns"),
        (f"{share * variations} %", "adds chances, which counts some patterns twice"),
        (f"{100 * (share / 100) ** variations:.2g} %", "asks that all variations are labelled"),
        share=share, variations=variations,
    )  # fmt: skip


@question
def what_a_bare_sentence_teaches(draw):
    word = draw.choice(("red", "green", "violet", "cyan", "yellow"))
    shares = draw.choice((1, 2, 3, 5))
    return ask(
        f"Only {shares} % of the clips are shown together with their sentences. The other "
        "sentences are only repeated, without a clip. What does the network learn about "
        f'"{word}" from them?',
        "at which place of a sentence it stands, and with which words",
        "Repeating needs the form of sentences; no clip tells what the word looks like.",
        ("what it looks like", "takes words to bring their meaning with them"),
        ("nothing at all", "takes only labelled examples to teach"),
        ("how often cubes of that colour are moved on the table, and where they lie",
         "takes a sentence to show its scene"),
        shares=shares,
    )  # fmt: skip


@question
def supervised_iterations(draw):
    share, clips = draw.choice((1, 2, 5)), draw.choice((400, 500, 648))
    epochs = draw.choice((2000, 4000, 6000))
    return ask(
        f"In a long training of {epochs} epochs over {clips} clips, every clip has a sentence, but "
        f"only {share} % of the places in the batches use it; clips are shuffled anew in each "
        "epoch. How many different sentences has the network used in the end?",
        f"practically all {clips}",
        f"Each clip comes to a supervised place in about {share * epochs // 100} epochs: few "
        "supervised iterations are not few labels.",
        (f"about {round(share * clips / 100)}", "takes few iterations for few labelled samples"),
        (f"about {clips // 2}", "guesses a half, where each clip has thousands of chances"),
        ("none, since the share is too small", "takes rare for never"),
        share=share, clips=clips, epochs=epochs,
    )  # fmt: skip
