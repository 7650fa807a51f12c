"""Questions on chapter 07: rules for claims, and how far a few trainings can be trusted."""

import math

from ptae_lite.book.exam.questions import ask, question


@question
def a_claim_with_a_rule(draw):
    paper, margin = draw.randint(85, 95), draw.randint(1, 3)
    middle = paper + draw.choice((-9, -7, -5, 1, 2))
    ours = (middle - 4, middle, middle + 3)
    held = ours[1] >= paper - margin
    verdict, other = ("held", "not held") if held else ("not held", "held")
    return ask(
        f"A claim says {paper} %. Its rule, written beforehand: the median of our trainings is at "
        f"least that, and {margin} points less are allowed. Ours are {ours[0]}, {ours[1]} and "
        f"{ours[2]} %. What is the verdict?",
        verdict,
        f"The median is {ours[1]}, and the rule demands at least {paper - margin}.",
        (other, "judges by the best or the worst training, or forgets the margin"),
        ("it depends on which of them is reported", "chooses the result after it is known"),
        ("it cannot be judged, because the trainings differ",
         "takes spread for a reason not to judge: the rule names the median"),
        paper=paper, margin=margin, low=ours[0], median=ours[1], high=ours[2],
    )  # fmt: skip


@question
def the_best_of_several(draw):
    seeds = draw.randint(3, 8)
    return ask(
        f"Somebody trains with {seeds} seeds and reports the best. How likely is it that this "
        "result lies above the median of all possible trainings?",
        f"{100 * (1 - 0.5**seeds):.1f} %",
        f"It does not only if all {seeds} lie below, each with one half.",
        ("50.0 %", "takes the best of several for one drawn at random"),
        (f"{100 * 0.5**seeds:.1f} %", "gives the chance that all of them lie above"),
        (f"{100 * (1 - 1 / seeds):.1f} %", "counts seeds instead of chances"),
        seeds=seeds,
    )


@question
def the_noise_of_a_score(draw):
    hits, clips = draw.choice((60, 70, 80, 90, 95)), draw.choice((100, 216, 400))
    share = hits / 100
    error = 100 * math.sqrt(share * (1 - share) / clips)
    return ask(
        f"A model is right in {hits} % of {clips} independent test clips. What is the standard "
        "error of this score, in points?",
        f"{error:.1f}",
        f"The root of {share} x {1 - share:.2f} / {clips}, in percent.",
        (f"{100 * share * (1 - share) / clips:.2f}", "takes the variance"),
        (f"{100 / clips:.2f}", "takes the weight of one clip for the uncertainty"),
        (f"{100 * math.sqrt(share * (1 - share)):.1f}", "gives the spread of a single clip"),
        hits=hits, clips=clips,
    )  # fmt: skip
