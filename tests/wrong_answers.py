"""Fifteen wrong answers to each exercise in code; no check may let one pass.

An answer is a change of the right one, (what is there, what stands there instead), or a function
written out. Some never use what they are given, most are off by little.
"""

ON_PLANE = "def on_plane(column, row, z_m): "
FEATURES = "def features(images, maps): "
ERRORS = """
def joint_errors(features, joints, frames, train, test):
    there = np.arange(features.shape[1]) < frames[:, None]
"""
ATTEND = """
def attend(q, k, v, inside):
    scores = np.where(inside, q @ k.T / np.sqrt(k.shape[1]), -np.inf)
    weights = np.exp(scores - scores.max(1, keepdims=True))
    weights /= weights.sum(1, keepdims=True)
"""
NRMSE = """
def nrmse(made, truth, frames, joint_range):
    there = np.arange(2, 101) <= frames[:, None]
    errors = ((made - truth) / joint_range)[there]
"""
BATCHES = "def batches(rng, train, labelled, count, size):\n"
SOURCES = (
    "def followed(said, given, shown):\n    colour = lambda text: language.parse(text).colour\n"
)
DONE = "def done(before, after, frames, action, side, speed): "
GAIN = """
def gain(seen, was, wanted, pattern, apart, fit):
    test = np.isin(pattern, apart)
    policy = fit(seen[~test], wanted[~test])
    went, asked = policy(seen[test]) - was[test], wanted[test] - was[test]
"""
VERDICT = "def verdict(values, paper, reads, margin): "

WRONG = {
    "1.1": [
        # Never uses the pixel, or not as a pixel.
        ON_PLANE + "return first",
        ON_PLANE + "return samples.cubes[0, 0, 0, :3]",
        ON_PLANE + "return [*first[:2], z_m]",
        ON_PLANE + "return np.array([column, row, z_m])",
        """
def on_plane(column, row, z_m):
    places = samples.cubes[:, 0, :, :3].reshape(-1, 3)
    seen = np.array([pixel(place) for place in places])
    return places[np.argmin(np.hypot(seen[:, 0] - column, seen[:, 1] - row))]
""",
        # Right where the cubes lie, or on the table, and nowhere else.
        ("(z_m - eye[2])", "(first[2] - eye[2])"),
        ("(z_m - eye[2])", "(scene.TABLE_TOP_M - eye[2])"),
        # Near misses.
        ("column + 0.5 - width", "column - width"),
        ("(row + 0.5)", "row"),
        ("column + 0.5 - width / 2", "width / 2 - (column + 0.5)"),
        ("width / 2", "height / 2"),
        ("(right_px * right + up_px * up)", "(up_px * right + right_px * up)"),
        (" / focal_px", " * focal_px"),
        ("direction[2]", "np.linalg.norm(direction)"),
        ("eye + direction", "eye - direction"),
    ],
    "2.1": [
        FEATURES + "return np.zeros((len(images), 30))",
        FEATURES + "return np.einsum('bhwc,ckhw->bck', small / 255, "
        "globals()['maps'].reshape(3, 10, 6, 8)).reshape(4, 30)",
        ("maps[c]", "globals()['maps'][c]"),
        ("images / 255", "small / 255"),
        ("images / 255", "images / images.max()"),
        ("images / 255", "images / 256"),
        ("images / 255", "images // 255"),
        ("images / 255", "images / 127.5 - 1"),
        ("x[..., c]", "x[..., 2 - c]"),
        ("x[..., c]", "x.mean(-1)"),
        ("x[..., c].reshape", "x[..., c].swapaxes(1, 2).reshape"),
        ("maps[c].T", "maps[0].T"),
        ("@ maps[c].T", "@ maps[c].reshape(48, 10)"),
        ("return np.concatenate(channels, axis=1)", "return np.maximum(np.hstack(channels), 0)"),
        ("return np.concatenate(channels, axis=1)", "return np.concatenate(channels)"),
    ],
    "2.2": [
        "def joint_errors(*_): return np.array([8.6, 2.0, 7.8, 9.5, 3.3])",
        # Never uses the features: the mean pose of the training.
        ERRORS
        + """    off = joints[train][there[train]].mean(0) - joints[test][there[test]]
    return np.degrees(np.sqrt((off**2).mean(0)))""",
        # Reads from too little, or from the wrong samples.
        ("joints[train][learn])", "joints[train][learn] * 0)"),
        ("features[train][learn], joints", "features[train][learn] * (np.arange(30) < 25), joints"),
        ("    read =", "    learn = learn & (np.arange(100) > 0)\n    read ="),
        ("    learn, ask", "    train = train[:-1]\n    learn, ask"),
        (
            "    learn, ask",
            "    train = np.setdiff1d(np.arange(len(frames)), test)\n    learn, ask",
        ),
        ("    learn, ask", "    train, test = test, train\n    learn, ask"),
        ("    learn, ask", "    test = train\n    learn, ask"),
        # Counts the wrong frames.
        ("< frames[:, None]", "< frames[:, None] - 1"),
        ("< frames[:, None]", "<= frames[:, None]"),
        # Near misses of the root mean square.
        ("np.sqrt((off**2).mean(0))", "np.abs(off).mean(0)"),
        ("np.sqrt((off**2).mean(0))", "off.std(0)"),
        ("np.sqrt((off**2).mean(0))", "np.sqrt((off**2).mean()) * np.ones(5)"),
        ("np.sqrt((off**2).mean(0))", "np.sqrt(np.median(off**2, axis=0))"),
    ],
    "3.1": [
        "def attend(q, k, v, inside): return v[: len(q)], np.eye(len(q), len(k))",
        # Without a look at q and k: all frames that are there weigh the same.
        "def attend(q, k, v, inside):\n    w = np.ones((len(q), 1)) * inside / inside.sum()\n"
        "    return w @ v, w",
        # Right for keys of four numbers, for frames at the start, or without a mask.
        ("np.sqrt(k.shape[1])", "2"),
        ("np.sqrt(k.shape[1])", "np.sqrt(v.shape[1])"),
        (
            "np.where(inside, scores, -np.inf)",
            "np.where(np.arange(len(k)) < inside.sum(), scores, -np.inf)",
        ),
        ("np.where(inside, scores, -np.inf)", "scores"),
        # Right weights, and another answer.
        ATTEND + "    return v[: len(q)], weights",
        ATTEND + "    return weights @ (v / np.linalg.norm(v, axis=1, keepdims=True)), weights",
        ATTEND + "    everything = np.exp(q @ k.T / np.sqrt(k.shape[1]))\n"
        "    return everything / everything.sum(1, keepdims=True) @ v, weights",
        ATTEND + "    return weights, weights @ v",
        # Near misses.
        ("np.where(inside, scores, -np.inf)", "np.where(inside, -np.inf, scores)"),
        ("np.where(inside, scores, -np.inf)", "np.where(inside, scores, -9)"),
        (" / np.sqrt(k.shape[1])", " / k.shape[1]"),
        (" / np.sqrt(k.shape[1])", ""),
        (
            "    weights /= weights.sum(1, keepdims=True)",
            "    if not inside.all():\n        weights = weights**0 * inside\n"
            "    weights /= weights.sum(1, keepdims=True)",
        ),
    ],
    "3.2": [
        "def nrmse(made, truth, frames, joint_range): return 9.07",
        "def nrmse(made, truth, frames, joint_range): return 20 / joint_range.mean()",
        # Right where all clips have 50 or 100 frames, or all as many.
        ("<= frames[:, None]", "<= np.where(frames > 50, 100, 50)[:, None]"),
        ("<= frames[:, None]", "<= frames[0]"),
        # Off by one step.
        ("<= frames[:, None]", "< frames[:, None]"),
        ("np.arange(2, 101)", "np.arange(1, 100)"),
        ("np.arange(2, 101)", "np.arange(3, 102)"),
        # The range of something else.
        ("/ joint_range)", "/ np.ptp(truth, axis=(0, 1)))"),
        ("/ joint_range)", "/ joint_range.mean())"),
        ("/ joint_range)", "/ joint_range**2)"),
        ("(made - truth) / joint_range", "made - truth"),
        # Another mean, another root.
        ("np.sqrt((errors**2).mean())", "np.abs(errors).mean()"),
        ("np.sqrt((errors**2).mean())", "(errors**2).mean()"),
        ("np.sqrt((errors**2).mean())", "np.sqrt((errors**2).mean(0)).mean()"),
        ("np.sqrt((errors**2).mean())", "np.sqrt((errors**2).sum(1).mean())"),
    ],
    "4.1": [
        # The same batch again and again, or samples and signals of its own.
        ("    return made", "    return made[:1] * count"),
        ("rng.choice(labelled, half)", "np.repeat(labelled[:1], half)"),
        ("rng.choice(unlabelled, size - half, replace=False)", "unlabelled[: size - half]"),
        (
            "rng.choice(unlabelled, size - half, replace=False)",
            "rng.choice(unlabelled[: len(unlabelled) // 2], size - half, replace=False)",
        ),
        # Right for the lists, the number and the size of the notebook.
        (
            "    unlabelled, half",
            "    train, labelled = globals()['train'], globals()['labelled']\n    unlabelled, half",
        ),
        ("size // 2", "13"),
        ("range(count)", "range(200)"),
        # Labels where they do not belong.
        (
            "rng.choice(NEED_A_LABEL, half), *rng.choice(NEED_NONE, size - half)",
            "rng.choice(NEED_NONE, half), *rng.choice(NEED_A_LABEL, size - half)",
        ),
        ("    return made", "    made[-1][1][-1] = 'describe'\n    return made"),
        ("np.setdiff1d(train, labelled)", "np.setdiff1d(train, labelled[1:])"),
        # Near misses.
        ("replace=False)", "replace=True)"),
        ("rng.choice(labelled, half)", "rng.choice(labelled, half, replace=False)"),
        (
            "rng.choice(unlabelled, size - half, replace=False)",
            "rng.choice(len(unlabelled), size - half, replace=False)",
        ),
        ("rng.choice(NEED_NONE, size - half)", "['repeat action'] * (size - half)"),
        ("    unlabelled, half", "    rng = np.random.default_rng()\n    unlabelled, half"),
    ],
    "5.1": [
        "def followed(said, given, shown): return 61",
        "def followed(said, given, shown): return 0.0",
        "def followed(said, given, shown): return 20.0",
        # Does not look at what was said, or at what was shown.
        ("says == hears for says", "sees == hears for says"),
        ("if says != sees", "if says != hears"),
        ("if says != sees", "if hears != sees"),
        ("if says != sees", "if says != sees and hears != sees"),
        # Counts something else.
        ("says == hears for says", "says != hears for says"),
        ("[language.parse(text).colour for", "[language.parse(text) for"),
        ("[language.parse(text).colour for", "[language.parse(text).action for"),
        ("[language.parse(text).colour for", "[language.parse(text)[1:] for"),
        SOURCES
        + "    wrong = [s for s, t, v in zip(said, given, shown) if colour(s) != colour(v)]\n"
        "    return 100 * len({*wrong} & {*given}) / max(len(wrong), 1)",
        # Near misses.
        ("max(len(wrong), 1)", "(len(wrong) + 1)"),
        ("100 * sum(wrong) / max(len(wrong), 1)", "round(100 * sum(wrong) / max(len(wrong), 1))"),
        ("max(len(wrong), 1)", "len(wrong)"),
    ],
    "6.1": [
        DONE + "return True",
        DONE + "return False",
        # Never looks at the cubes, or at where they were.
        DONE + "return bool((frames >= 75) == (speed == 'slowly'))",
        ("(after - before)", "(after - motions.NOMINAL_PLACES_M)"),
        # Whichever cube moved most was the named one; or the left one was.
        ("SIDES.index(side)", "np.linalg.norm(after - before, axis=1).argmax()"),
        ("SIDES.index(side)", "0"),
        # Right in the large, wrong at the limits.
        ("along >= 40", "along >= 45"),
        ("along >= 40", "along > 0"),
        ("other < 10", "other < 12"),
        ("frames >= 75", "frames >= 60"),
        ("frames >= 75", "frames > 75"),
        # Another way to measure.
        (
            "along = moved_mm[named] @ np.array(motions.DIRECTION[action])",
            "along = np.linalg.norm(moved_mm[named]) * "
            "np.sign(moved_mm[named] @ np.array(motions.DIRECTION[action]))",
        ),
        ("along = moved_mm[named] @", "along = abs(moved_mm[named]) @"),
        ("np.linalg.norm(moved_mm[1 - named])", "abs(moved_mm[1 - named]).max()"),
        ("np.linalg.norm(moved_mm[1 - named])", "abs(moved_mm[1 - named]).sum()"),
    ],
    "6.4": [
        # Never trains, or not on what is given.
        "def gain(seen, was, wanted, pattern, apart, fit): return 1.0",
        "def gain(seen, was, wanted, pattern, apart, fit): return 0.0",
        ("fit(seen[~test], ", "fit(0 * seen[~test], "),
        ("wanted[~test])", "wanted[~test] - was[~test])"),
        ("policy = fit(seen[~test], wanted[~test])", "policy = fit(seen[test], wanted[test])"),
        # Another split: half of the clips by chance, or by their place in the list.
        ("np.isin(pattern, apart)", "np.arange(len(pattern)) % 3 == 0"),
        ("np.isin(pattern, apart)", "np.isin(pattern, apart[:1])"),
        ("np.isin(pattern, apart)", "np.isin(pattern, np.unique(globals()['apart']))"),
        # Another number.
        GAIN + "    return np.corrcoef(went.ravel(), asked.ravel())[0, 1]",
        GAIN + "    return np.sqrt((went**2).sum() / (asked**2).sum())",
        GAIN + "    return (went * asked).sum() / (went * went).sum()",
        GAIN + "    return ((went * asked).sum(1) / (asked * asked).sum(1)).mean()",
        GAIN + "    return (went * asked).sum(0)[0] / (asked * asked).sum(0)[0]",
        ("policy(seen[test]) - was[test]", "policy(seen[test]) - was[test].mean(0)"),
        ("asked = wanted[test] - was[test]", "asked = wanted[test]"),
    ],
    "7.1": [
        VERDICT + "return 'held'",
        VERDICT + "return 'not held'",
        VERDICT + "return 'not testable'",
        # Never uses the values: the verdicts of the card, by the number alone.
        VERDICT + "return 'held' if paper in (100, 0.88) else 'not held'",
        # Right for three trainings.
        ("np.median(values)", "sorted(values)[1]"),
        ("np.median(values)", "sorted(values)[len(values) // 2]"),
        ("np.median(values)", "np.mean(sorted(values)[1:-1])"),
        ("np.median(values)", "values[0]"),
        # Another margin.
        ("    median =", "    margin = 2\n    median ="),
        ("paper + margin", "paper"),
        ("paper - margin", "paper * (1 - margin / 100)"),
        ("np.median(values)", "round(np.median(values))"),
        # Near misses.
        (">=", ">"),
        ("<=", "<"),
        (
            'if not values:\n        return "not testable"',
            'if not values:\n        return "not held"',
        ),
    ],
}

# What may stand in the place of any answer.
ODD = [
    "None",
    "42",
    "lambda: 0",
    "lambda *_: None",
    "lambda *_: ...",
    "lambda *_: NotImplemented",
    "lambda *_: 'held?'",
    "lambda *_: b'held'",
    "lambda *_: {}",
    "lambda *_: [[1, 2], [3]]",
    "lambda *_: (1, 2)",
    "lambda *_: 1j",
    "lambda *_: float('nan')",
    "lambda *_: np.zeros(0)",
    "lambda *_: np.zeros((2, 2, 2, 2))",
    "lambda *_: np.array(['a'] * 5)",
    "lambda *_: np.array([None] * 3)",
    "lambda *_: torch.zeros(5)",
    "lambda *_: torch.zeros(3, device='meta')",
    "lambda *_: [torch.zeros(3, requires_grad=True)] * 3",
    "lambda *_: (x for x in range(3))",
    "lambda *_: 1 / 0",
    "lambda *_: [][0]",
    "lambda *_: unknown",
    "lambda *_: sys.exit()",
    "lambda *_: (lambda f: f(f))(lambda f: f(f))",
    "lambda *_: all(True for _ in itertools.count())",
    "lambda *given: [one.append(0) if isinstance(one, list) else one.sort() for one in given]",
    "int",
    "type('Answer', (), {'__call__': None})",
]
