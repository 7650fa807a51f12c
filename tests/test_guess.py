"""Guesses: nothing is told before the reader answers, and the reply fits the answer."""

import re

import pytest
from pages import chromium, opened

from ptae_lite.errors import PTAEError
from ptae_lite.widgets import guess

CHOICE = guess.choose(
    "How many angles?",
    {"three": "A point has three numbers, but <the arm> has more.", "five": "One for a hinge."},
    right="five",
)
NUMBER = guess.number(
    "How far?", 70, "The hand pushes 70 mm.", within=5, unit="mm", replies={700: "In mm, not cm?"}
)
ORDER = guess.order(
    "What comes first?", ["a & b", "c", "d"], "Right so.", hint="No: think of the last.",
    replies={("a & b", "c"): "The first pair."},
)  # fmt: skip
ALL = (CHOICE, NUMBER, ORDER)


@pytest.mark.parametrize("one", ALL, ids=("choose", "number", "order"))
def test_no_answer_can_be_read_before_a_guess(one):
    html = one._repr_html_()
    content = re.sub(r"<[^>]*>", " ", html)
    for told in ("One for a hinge", "has more", "70", "Right so", "think of", "Yes"):
        assert told not in content and told not in repr(one)
    assert "<script" not in html and "http" not in html
    assert repr(one).startswith("Predict")


def test_what_cannot_be_answered_is_refused():
    with pytest.raises(PTAEError, match="'four' must be one of"):
        guess.choose("How many?", {"three": "", "five": ""}, right="four")
    with pytest.raises(PTAEError, match="three or more different"):
        guess.order("Which?", ["a", "a", "b"], "so")


def test_an_order_is_never_shown_in_order():
    for seed in range(20):
        html = guess.order("Which?", ["a", "b", "c"], "so", seed=seed).html
        assert re.findall(r'data-item="(\d)"', html) != ["0", "1", "2"]


@pytest.fixture(scope="module")
def page():
    with chromium() as browser, opened(browser) as page:
        page.set_content("".join(one.html for one in ALL))
        yield page


def reply(page, number):
    return page.locator("[data-reply-here]").nth(number).inner_text()


@pytest.mark.browser
def test_a_choice_is_made_by_the_keyboard_and_answered(page):
    assert reply(page, 0) == ""
    page.get_by_label("three").focus()
    page.keyboard.press("Space")
    assert reply(page, 0) == "No. A point has three numbers, but <the arm> has more."
    page.keyboard.press("ArrowDown")
    assert reply(page, 0) == "Yes. One for a hinge."


@pytest.mark.browser
@pytest.mark.parametrize(
    ("typed", "said"),
    [("72,5", "Yes. The hand"), ("7", "Too low. The hand"), ("690", "Too high. In mm, not cm? The"),
     ("far", "A number, please."), ("", "A number, please.")],
)  # fmt: skip
def test_a_number_is_answered_by_how_far_it_is_off(page, typed, said):
    page.get_by_label("Your guess").fill(typed)
    page.keyboard.press("Enter")
    assert reply(page, 1).startswith(said)


@pytest.mark.browser
def test_an_order_is_made_by_the_keyboard_and_answered(page):
    check = page.get_by_role("button", name="Check").nth(1)
    items = ["a & b", "c", "d"]

    def shown():
        return page.locator("li span").all_inner_texts()

    def put_last(item):
        for _ in items:
            page.get_by_role("button", name=f"{item} down").focus()
            page.keyboard.press("Enter")

    for item in ("d", "c", "a & b"):
        put_last(item)
    check.click()
    assert shown() == items[::-1] and reply(page, 2) == "Not quite. The first pair."
    for item in ("a & b", "d", "c"):
        put_last(item)
    check.click()
    assert reply(page, 2) == "Not quite. No: think of the last."
    for item in items:
        put_last(item)
    check.click()
    assert shown() == items and reply(page, 2) == "Yes. Right so."
    assert page.locator("[data-place]").inner_text() == "d: place 3"


@pytest.mark.browser
def test_every_control_has_a_name(page):
    for control in page.locator("input, button").all():
        assert control.evaluate("""one => one.getAttribute('aria-label') || one.innerText.trim()
            || one.labels?.[0]?.innerText.trim()""")
