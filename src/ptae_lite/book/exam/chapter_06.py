"""Questions on chapter 06: acting in a loop, and what counts as success."""

from ptae_lite.book.exam.questions import ask, question


@question
def an_error_that_adds_up(draw):
    error, percent, steps = draw.randint(2, 6), draw.choice((10, 20, 25, 50)), 100
    return ask(
        f"In each of {steps} frames, a policy drifts by {error} mm in the same direction, and then "
        f"sees it and corrects {percent} % of the whole deviation, before the next frame. How far "
        "off is it in the end, just after a drift?",
        f"about {100 * error / percent:.0f} mm",
        f"It settles where the correction is as large as the drift: {percent} % of the deviation "
        f"is {error} mm.",
        (f"about {error * steps} mm", "lets the errors add up as if nothing were seen"),
        (f"about {error} mm", "lets every drift be corrected completely"),
        (f"about {error * steps * (100 - percent) / 100:.0f} mm",
         "corrects the sum once, at the end"),
        error=error, percent=percent, steps=steps,
    )  # fmt: skip


@question
def late_but_right(draw):
    frames, speed = draw.choice((5, 10, 15)), draw.choice((50, 75, 100, 150))
    miss = frames * speed / 25
    return ask(
        f"An arm does the right movement {frames} frames late, at 25 frames a second. Its hand "
        f"moves at {speed} mm/s, and then stops. How far is it from where it should be, at full "
        "speed and long after the stop?",
        f"{miss:g} mm, then 0",
        "A late arm has a large error all the way, and does what it was told.",
        (f"{miss:g} mm, then {miss:g} mm", "takes being late for being in another place"),
        ("0, then 0", "takes the right path for the right place at each moment"),
        (f"{frames * speed:g} mm, then 0", "takes frames for seconds"),
        frames=frames, speed=speed,
    )  # fmt: skip


@question
def no_failure_yet(draw):
    tries = draw.choice((20, 30, 50, 80, 100))
    bound = 100 * (1 - 0.05 ** (1 / tries))
    return ask(
        f"A robot succeeded in all of {tries} tries. Up to which true rate of failure would "
        "one see no failure with a chance of at least 5 %?",
        f"about {bound:.1f} %",
        f"(1 - rate) to the power {tries} is 0.05; nearly 3 / {tries}, the rule of three.",
        ("0.0 %", "takes what was not seen for impossible"),
        (f"about {100 / tries:.1f} %", "takes the next try to be the failure"),
        (f"about {100 * 0.95 ** tries:.1f} %", "asks for the chance to see none at a rate of 5 %"),
        tries=tries,
    )  # fmt: skip
