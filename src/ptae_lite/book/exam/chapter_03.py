"""Questions on chapter 03: attention, padding, scores and references."""

import math

from ptae_lite.book.exam.questions import ask, question


@question
def a_softmax_of_two(draw):
    a, b = draw.sample(range(1, 10), 2)
    return ask(
        f"A query has the score ln {a} with the first key and ln {b} with the second. There are no "
        "other keys. Which weight does the first value get?",
        f"{a / (a + b):.3f}",
        f"The exponentials are {a} and {b}, and they are divided by their sum.",
        (f"{a / b:.3f}", "divides by the other exponential instead of by the sum"),
        (f"{float(a > b):.3f}", "lets attention choose one key"),
        ("0.500", "takes the mean of the values, whatever the scores say"),
        a=a, b=b,
    )  # fmt: skip


@question
def zeros_behind_the_end(draw):
    valid = draw.choice((20, 25, 30, 40, 60, 70, 80))
    return ask(
        f"A clip of {valid} frames is filled up with zeros to 100. A query has the score 0 with "
        "every frame, and nothing is masked. Which part of its attention falls on the zeros?",
        f"{100 - valid} %",
        "A score of 0 is as good as any other equal score: the softmax counts the zeros as keys.",
        ("0 %", "takes zeros to count for nothing without a mask"),
        (f"{valid} %", "takes the frames that are there for those that are not"),
        ("1 %", "gives all zeros together the weight of one key"),
        valid=valid,
    )


@question
def the_width_of_scores(draw):
    d = draw.choice((16, 25, 36, 64, 100, 144, 256))
    return ask(
        f"Queries and keys have {d} independent entries with mean 0 and standard deviation 1. What "
        "is the standard deviation of their dot product, before it is scaled?",
        f"{math.isqrt(d)}",
        f"The variances of {d} products add up to {d}; its root is the factor of the scaling.",
        (f"{d}", "adds standard deviations instead of variances, or means the variance"),
        ("1", "forgets that products are summed"),
        (f"{d * d}", "squares where the root has to be taken"),
        d=d,
    )


@question
def a_head_of_several(draw):
    heads, each, keys, queries = draw.choice((2, 4, 8)), draw.choice((8, 16, 32)), 100, 5
    width = heads * each
    return ask(
        f"{queries} words are the queries, {keys} frames the keys and values. The network is "
        f"{width} wide, with {heads} heads of attention. What shape has the result of one head?",
        f"{queries} x {each}",
        f"One row for each query, and each head works on {width} / {heads} of the numbers.",
        (f"{keys} x {each}", "takes a row for each key: but keys are summed over"),
        (f"{queries} x {width}", "gives each head the whole width"),
        (f"{queries} x {keys}", "takes the weights for what they weigh"),
        heads=heads, width=width, keys=keys, queries=queries,
    )  # fmt: skip


@question
def three_words_right(draw):
    action, colour, speed = (draw.randint(70, 98) for _ in range(3))
    right = action * colour * speed / 1e4
    return ask(
        f"A model names the action right in {action} % of the clips, the colour in {colour} % and "
        f"the speed in {speed} %, independently of each other. How often is the whole sentence "
        "right?",
        f"{right:.1f} %",
        "All three words have to be right, so the shares are multiplied.",
        (f"{(action + colour + speed) / 3:.1f} %", "takes the mean"),
        (f"{min(action, colour, speed):.1f} %", "lets all errors fall on the same clips"),
        (f"{100 - right:.1f} %", "gives the share of the wrong sentences"),
        action=action, colour=colour, speed=speed,
    )  # fmt: skip


@question
def an_error_in_percent(draw):
    error, size = draw.randint(2, 9) / 2, draw.choice((40, 60, 80, 100, 120))
    return ask(
        f"The root mean square error of a joint is {error} degrees, and over the training set the "
        f"joint moves through {size} degrees. What is its error normalised to that range?",
        f"{100 * error / size:.2f} %",
        "The error is divided by the range.",
        (f"{100 * (error / size) ** 2:.2f} %", "takes the squared error"),
        (f"{200 * error / size:.2f} %", "divides by half the range"),
        (f"{error:.2f} %", "takes degrees for percent"),
        error=error, size=size,
    )  # fmt: skip
