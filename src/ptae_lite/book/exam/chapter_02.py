"""Questions on chapter 02: convolutions, a loss with a floor, probes, fair comparisons."""

import math

from ptae_lite.book.exam.questions import ask, question


@question
def size_after_a_convolution(draw):
    n, k = draw.choice((60, 72, 84, 96, 120)), draw.choice((4, 6, 8))
    s, p = draw.choice((2, 3)), draw.choice((2, 3))
    return ask(
        f"A side of {n} pixels passes a convolution with a window of {k}, a stride of {s} and "
        f"{p} pixels added at each border. How long is it afterwards?",
        f"{(n + 2 * p - k) // s + 1}",
        f"({n} + 2 x {p} - {k}) / {s}, rounded down, and one for the first place of the window.",
        (f"{(n + 2 * p - k) // s}", "forgets the first place of the window"),
        (f"{(n - k) // s + 1}", "forgets the pixels at the borders"),
        (f"{n + 2 * p - k + 1}", "forgets the stride"),
        n=n, k=k, s=s, p=p,
    )  # fmt: skip


@question
def weights_of_a_convolution(draw):
    into, out, k = draw.choice((3, 8, 16)), draw.choice((8, 16, 32)), draw.choice((3, 4, 5))
    return ask(
        f"How many weights, biases included, has a convolution with {into} channels in, {out} "
        f"channels out and a window of {k} x {k}, on images of 120 x 160?",
        f"{out * (into * k * k + 1)}",
        f"Each of the {out} outputs has one window over all {into} channels, and one bias.",
        (f"{out * (k * k + 1)}", "gives an output a window over one channel only"),
        (f"{into * out * k * k}", "forgets the biases"),
        (f"{out * (into * k * k + 1) * 120 * 160}", "gives each place its own weights"),
        into=into, out=out, k=k,
    )  # fmt: skip


@question
def the_floor_of_a_loss(draw):
    value = draw.choice((0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8))
    floor = -value * math.log(value) - (1 - value) * math.log(1 - value)
    return ask(
        f"All pixels of an image have the value {value}, and an autoencoder draws it perfectly. "
        "What is its binary cross-entropy (natural logarithm)?",
        f"{floor:.2f}",
        f"Both terms count: -{value} log {value} - {1 - value:.1f} log {1 - value:.1f}.",
        ("0.00", "takes a perfect copy to have no loss, as with a squared error"),
        (f"{-math.log(value):.2f}", "forgets that a shade is partly white and partly black"),
        (f"{value * (1 - value):.2f}", "takes the variance for the entropy"),
        value=value,
    )


@question
def a_probe_that_guesses(draw):
    families, colours = draw.randint(2, 3), draw.randint(3, 5)
    n = families * colours
    return ask(
        f"A probe names the colours of both cubes. There are {families} families of {colours} "
        "colours; both cubes are of one family, and never of the same colour. How often is a probe "
        "right that knows this, and otherwise guesses?",
        f"{100 / (n * (colours - 1)):.1f} %",
        f"There are {n} x {colours - 1} arrangements, all equally likely.",
        (f"{100 / n**2:.1f} %", "takes the two colours to be independent"),
        (f"{100 / n:.1f} %", "counts one cube only"),
        (f"{100 / (colours * (colours - 1)):.1f} %", "takes the family to be known"),
        families=families, colours=colours,
    )  # fmt: skip


@question
def as_many_images_seen(draw):
    steps, batch = 250 * draw.randint(4, 16), draw.choice((32, 64, 128))
    other = draw.choice((16, 24, 48, 96))
    return ask(
        f"Encoder A was trained for {steps} steps with batches of {batch} images. B takes batches "
        f"of {other}. How many steps give B as many images as A has seen?",
        f"{steps * batch / other:.0f}",
        f"A saw {steps} x {batch} images; B sees {other} in a step.",
        (f"{steps}", "compares by equal steps, so that the larger batch sees more"),
        (f"{steps * other / batch:.0f}", "has the ratio of the batches upside down"),
        (f"{steps * batch}", "counts images and calls them steps"),
        steps=steps, batch=batch, other=other,
    )  # fmt: skip
