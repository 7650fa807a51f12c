"""Questions on chapter 01: the arm, the language, the camera, the audit of the data."""

from ptae_lite.book.exam.questions import ask, question


@question
def spare_joints(draw):
    joints = draw.randint(7, 12)
    return ask(
        f"The fingertips of an arm with {joints} joints have to stay at a given place (x, y, z). "
        "In how many independent directions can the joints still move, in general?",
        f"{joints - 3}",
        f"The place fixes three combinations of the {joints} angles; the others are free.",
        ("0", "takes a place to fix all angles, as if there were as many equations as unknowns"),
        ("3", "counts the coordinates of the place instead of what they leave free"),
        (f"{joints}", "forgets that the fingertips have to stay"),
        joints=joints,
    )


@question
def a_chain_of_two(draw):
    upper, lower, turn = draw.randint(2, 9), draw.randint(2, 9), draw.choice((90, -90))
    sign = turn // 90
    return ask(
        f"A flat arm has an upper part of {upper} dm and a lower part of {lower} dm; stretched, it "
        f"lies along x. The first joint turns by {turn} degrees, the second by {-turn} degrees "
        "relative to the first part. Where is the tip, in dm?",
        f"({lower}, {sign * upper})",
        "The first part points along y; the second turns back, and points along x again.",
        (f"(0, {sign * (upper - lower)})", "takes the second angle as one from the x axis"),
        (f"({upper}, {sign * lower})", "applies the turns to the wrong parts: order of factors"),
        (f"(0, {sign * (upper + lower)})", "forgets the second joint"),
        upper=upper, lower=lower, turn=turn,
    )  # fmt: skip


@question
def a_small_language(draw):
    actions, colours, speeds = draw.randint(3, 5), draw.randint(4, 7), draw.randint(2, 3)
    words = draw.randint(2, 3)
    meanings = actions * colours * speeds
    return ask(
        f"A sentence names an action, a colour and a speed. There are {actions} actions, {colours} "
        f"colours and {speeds} speeds, and {words} words for each of them. How many different "
        "sentences are there?",
        f"{meanings * words**3}",
        f"{meanings} meanings, and each of the three words can be said in {words} ways.",
        (f"{meanings}", "counts meanings, not sentences"),
        (f"{meanings * words}", "lets only one of the three words have synonyms"),
        (f"{(actions + colours + speeds) * words}", "counts the words of the vocabulary"),
        actions=actions, colours=colours, speeds=speeds, words=words,
    )  # fmt: skip


@question
def patterns_of_scenes(draw):
    families, colours, acts = draw.randint(2, 3), draw.randint(3, 5), draw.choice((8, 12, 16))
    n = families * colours
    return ask(
        f"Two cubes of different colours lie on the left and on the right. Both colours are of one "
        f"of {families} families with {colours} colours each. The arm can do {acts} different "
        "things. How many patterns (scene and action) are there?",
        f"{acts * families * colours * (colours - 1)}",
        f"A family gives {colours} x {colours - 1} ordered pairs of different colours.",
        (f"{acts * families * colours * (colours - 1) // 2}",
         "takes red left and blue right for the same scene as blue left and red right"),
        (f"{acts * families * colours**2}", "allows two cubes of one colour"),
        (f"{acts * n * (n - 1)}", "mixes colours of different families"),
        families=families, colours=colours, acts=acts,
    )  # fmt: skip


@question
def copies_in_a_test(draw):
    copies, clips = draw.choice((4, 5, 6)), draw.choice((600, 720, 960))
    share = 100 * 0.5 ** (copies - 1)
    return ask(
        f"A published data set of {clips} clips has only {clips // copies} different movements, "
        f"each {copies} times. Half of the clips are drawn at random for the test. About how many "
        "of the test clips have a movement that does not occur in training?",
        f"about {share:.0f} %",
        f"All {copies - 1} other copies would have to be drawn for the test as well: "
        f"0.5 to the power {copies - 1}.",
        ("100 %", "takes different clips for different movements"),
        ("50 %", "takes the share of the test for the share of what is new in it"),
        (f"about {100 / copies:.0f} %", "takes the share of different movements for that of new"),
        copies=copies, clips=clips,
    )  # fmt: skip
