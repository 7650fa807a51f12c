"""Questions on chapter 05: conflicts, their controls, and who is followed."""

from ptae_lite.book.exam.questions import ask, question


@question
def conflict_or_format(draw):
    usual, agrees = draw.randint(8, 20) / 10, draw.randint(25, 60) / 10
    conflict = agrees + draw.randint(10, 60) / 10
    return ask(
        f"The error of a task is {usual} % with the usual input, {agrees} % with an additional "
        f"input that agrees, and {conflict:.1f} % with one that conflicts. How much of the harm is "
        "due to the conflict itself, in points?",
        f"{conflict - agrees:.1f}",
        "An additional input is unfamiliar even where it agrees; only the rest is conflict.",
        (f"{conflict - usual:.1f}", "has no control: blames the conflict for the format as well"),
        (f"{agrees - usual:.1f}", "gives the harm of the format"),
        (f"{conflict:.1f}", "takes the whole error for harm"),
        usual=usual, agrees=agrees, conflict=round(conflict, 1),
    )  # fmt: skip


@question
def followed_by_chance(draw):
    colours = draw.choice((4, 5, 6, 8, 10))
    return ask(
        f"A false sentence names one of the {colours - 1} wrong colours. A network that attends to "
        f"nothing names one of all {colours} colours at random. How often does it seem to follow "
        "the false sentence?",
        f"{100 / colours:.1f} %",
        "One answer in all colours is the false one. Without this chance level a share followed "
        "says little.",
        ("0.0 %", "takes following to need attention"),
        ("50.0 %", "takes two inputs for two equally likely answers"),
        (f"{100 / (colours - 1):.1f} %", "leaves out the true colour, which it may name as well"),
        colours=colours,
    )


@question
def between_two_answers(draw):
    a, b, share = draw.randint(0, 20), draw.randint(40, 90), draw.choice((20, 25, 75, 80))
    mean = (share * a + (100 - share) * b) / 100
    return ask(
        f"For the same input, the right angle is {a} degrees in {share} % of the training and {b} "
        "degrees otherwise; nothing tells which. Which angle does a network learn under a squared "
        "error?",
        f"{mean:g} degrees",
        "The mean has the least squared error, although nobody ever showed it.",
        (f"{a if share > 50 else b} degrees", "takes the most frequent: that is what a choice "
         "among words would learn"),
        (f"{(a + b) / 2:g} degrees", "forgets how frequent each is"),
        (f"{a} degrees or {b} degrees, by turns", "takes a network to draw its answers"),
        a=a, b=b, share=share,
    )  # fmt: skip
