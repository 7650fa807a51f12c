"""Questions to guess before reading on. The reply explains the likely mistakes.

Each function returns HTML that works on a page without a kernel, and in JupyterLab after its cell
has run. It needs no library, and it stores and sends nothing. The replies are in attributes, so
that no reader sees them by accident, even where a page runs no scripts.
"""

from __future__ import annotations

import json
import random
from collections.abc import Mapping, Sequence
from html import escape
from itertools import count
from zlib import crc32

from ptae_lite.errors import PTAEError

_NUMBERS = count(1)  # of the guesses of a page: radio buttons belong together by their name

# What a guess does when it is made. An attribute and not a script, as in a panel: JupyterLab runs
# no scripts in the output of a cell, and attributes need no names.
_REPLY = """
const say = (right, text) => {
  const reply = this.closest('[data-ptae-embed]').querySelector('[data-reply-here]');
  reply.dataset.right = right;
  reply.innerHTML = '<b>' + right + '</b> ' + text;
};
"""
_CHOOSE = _REPLY + "say(event.target.dataset.right, event.target.dataset.reply);"
_NUMBER = (
    _REPLY
    + """
event.preventDefault();
const given = this.elements.guess.value.replace(/\\s|%/g, '').replace(',', '.');
const facts = JSON.parse(this.dataset.facts), guess = Number(given);
if (given === '' || Number.isNaN(guess)) { say('A number, please.', ''); return; }
const known = facts.replies.find(([value, within]) => Math.abs(guess - value) <= within);
const near = Math.abs(guess - facts.answer) <= facts.within;
if (near) say('Yes.', facts.why);
else say(guess < facts.answer ? 'Too low.' : 'Too high.',
         (known ? known[2] + ' ' : '') + facts.why);
"""
)
_MOVE = """
const button = event.target.closest('button[data-move]');
if (button) {
  const item = button.closest('li'), up = button.dataset.move === 'up';
  const other = up ? item.previousElementSibling : item.nextElementSibling;
  if (other) up ? other.before(item) : other.after(item);
  button.focus();
  const place = [...item.parentNode.children].indexOf(item) + 1;
  this.querySelector('[data-place]').textContent =
    item.querySelector('span').textContent + ': place ' + place;
}
"""
_ORDER = (
    _REPLY
    + """
event.preventDefault();
const facts = JSON.parse(this.dataset.facts);
const places = [...this.querySelectorAll('li')].map(item => Number(item.dataset.item));
const right = places.every((item, place) => item === place);
const first = facts.replies.find(([a, b]) => places.indexOf(b) < places.indexOf(a));
say(right ? 'Yes.' : 'Not quite.', right ? facts.why : (first ? first[2] : facts.hint));
"""
)
_STYLE = "border-left:4px solid #0072B2;padding:.5em 1em .7em;margin:.6em 0"


class Guess:
    """A question as HTML, and as text for places that show no HTML."""

    def __init__(self, html: str, text: str):
        self.html, self.text = html, text

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return self.text


def choose(question: str, replies: Mapping[str, str], right: str) -> Guess:
    """A question with several answers.

    Args:
        question: shown above the answers.
        replies: each answer, and the reply to it: why one may think so, and why it is wrong. "Yes"
            or "No" is put before it.
        right: the right answer.

    Raises:
        PTAEError: `right` is not one of two or more answers.
    """
    if right not in replies or len(replies) < 2:
        raise PTAEError(f"{right!r} must be one of two or more answers: {', '.join(replies)}")
    name = f"guess-{next(_NUMBERS)}-{crc32(question.encode())}"  # unlike another notebook's
    rows = "".join(
        f'<label style="display:block;margin:.25em 0"><input type="radio" name="{name}" '
        f'autocomplete="off" data-right="{"Yes." if answer == right else "No."}" '
        f'data-reply="{escape(escape(reply))}"> {escape(answer)}</label>'
        for answer, reply in replies.items()
    )
    text = "\n".join([f"Predict: {question}", *(f"  - {answer}" for answer in replies)])
    body = f'<div role="radiogroup" onchange="{escape(_CHOOSE)}">{rows}</div>'
    return Guess(_framed(question, body), text)


def number(
    question: str,
    answer: float,
    why: str,
    *,
    within: float,
    unit: str = "",
    replies: Mapping[float, str] | None = None,
) -> Guess:
    """A question whose answer is a number.

    Args:
        question: shown above the box.
        answer: the right number.
        why: shown after any guess; it should name the answer.
        within: the largest error that counts as right.
        unit: shown behind the box.
        replies: shown before `why` after a wrong guess within a tenth of one of these numbers.
    """
    facts = {
        "answer": float(answer), "within": float(within), "why": escape(why),
        "replies": [[float(v), abs(v) / 10 + 1e-9, escape(t)] for v, t in (replies or {}).items()],
    }  # fmt: skip
    body = (
        f'<form onsubmit="{escape(_NUMBER)}" data-facts="{escape(json.dumps(facts))}">'
        f'<label>Your guess <input name="guess" type="text" inputmode="decimal" size="7" '
        f'autocomplete="off"></label> {escape(unit)} <button type="submit">Check</button></form>'
    )
    return Guess(_framed(question, body), f"Predict: {question} ({unit or 'a number'})")


def order(
    question: str,
    items: Sequence[str],
    why: str,
    *,
    hint: str = "Look again.",
    replies: Mapping[tuple[str, str], str] | None = None,
    seed: int = 0,
) -> Guess:
    """Things to put in order.

    Args:
        question: shown above them.
        items: in the right order. They are shown in another one.
        why: shown if the order is right.
        hint: shown if it is not.
        replies: for two items (first, second): shown instead of `hint` if their order is wrong.
        seed: of the order in which they are shown.

    Raises:
        PTAEError: there are fewer than three items, or two are equal.
    """
    if len(items) < 3 or len(set(items)) < len(items):
        raise PTAEError("an order needs three or more different things")
    places = list(range(len(items)))
    draw = random.Random(seed)
    while places == sorted(places):
        draw.shuffle(places)
    facts = {
        "why": escape(why), "hint": escape(hint),
        "replies": [[items.index(a), items.index(b), escape(text)]
                    for (a, b), text in (replies or {}).items()],
    }  # fmt: skip
    button = '<button type="button" data-move="{0}" aria-label="{1} {0}">{2}</button> '
    rows = "".join(
        f'<li data-item="{i}" style="margin:.25em 0">'
        + button.format("up", escape(items[i]), "&uarr;")
        + button.format("down", escape(items[i]), "&darr;")
        + f"<span>{escape(items[i])}</span></li>"
        for i in places
    )
    body = (
        f'<form onclick="{escape(_MOVE)}" onsubmit="{escape(_ORDER)}" '
        f'data-facts="{escape(json.dumps(facts))}"><ol>{rows}</ol>'
        '<button type="submit">Check</button> <span data-place aria-live="polite" '
        'style="position:absolute;clip-path:inset(50%);width:1px;height:1px;overflow:hidden">'
        "</span></form>"
    )
    shown = "\n".join(f"  - {items[i]}" for i in places)
    return Guess(_framed(question, body), f"Predict the order: {question}\n{shown}")


def _framed(question: str, body: str) -> str:
    return (
        f'<div data-ptae-embed="guess" role="group" aria-label="{escape(question)}" '
        f'data-lm-suppress-shortcuts="true" style="{_STYLE}">'
        f'<p style="margin:0 0 .3em"><b>Predict first.</b> {escape(question)}</p>'
        f'{body}<p data-reply-here aria-live="polite" style="margin:.4em 0 0;min-height:1.4em">'
        "</p></div>"
    )
