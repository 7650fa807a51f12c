"""Live parts in Firefox: physics, keyboard, names, a strict server, a phone's width."""

import json

import pytest
from bidi import firefox
from pages import SITE, stale
from test_live import server
from test_live_act import act_folder, live_physics

from ptae_lite.data.samples import load_samples
from ptae_lite.live import scripts

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(bool(stale()), reason=stale() or "built"),
    pytest.mark.skipif(bool(scripts.missing()), reason="the scripts of package.json are missing"),
]
READY = """(async () => {
  const place = document.querySelector("[data-ptae-live]");
  while (!place.dataset.state) await new Promise(done => setTimeout(done, 20));
  return place.dataset.state;
})()"""
PRESS = "document.querySelector('[data-ptae-live] button').click()"
ANSWERED = """(async () => {
  const room = document.querySelector("[data-ptae-live] > div");
  while (!room.dataset.answered) await new Promise(done => setTimeout(done, 20));
  return document.querySelector(".ptae-live-said").textContent;
})()"""
NAMELESS = """[...document.querySelectorAll("[data-ptae-live] *")]
  .filter(one => one.matches("button, input, select, canvas, svg, iframe, summary"))
  .filter(one => one.checkVisibility() && !one.parentElement.closest("[role=img]"))
  .filter(one => !(one.labels?.[0]?.textContent || one.ariaLabel || one.title || one.textContent))
  .map(one => one.outerHTML.slice(0, 80))"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return act_folder(tmp_path_factory)


def test_the_arm_acts_and_verdicts_are_pybullets(folder):
    samples = load_samples("recording")
    asked = live_physics.tasks(samples, "test")[::24]
    asked += live_physics.tasks(samples, "moved", live_physics.WATCHING)[::33]
    with firefox() as page:
        page.goto((folder / "index.html").as_uri())
        page.evaluate(f"({PRESS}, 0)")
        assert page.evaluate(READY) == "ready"
        made = page.evaluate(f"actAgain({json.dumps(asked)})")
        table = live_physics.compared(asked, made)
        assert table["success"].tolist() == table["success_stored"].tolist()
        assert table.loc[table["condition"] == "test", "ms"].median() < 2000
        assert table.loc[table["condition"] == "moved", "ms"].median() < 5000


def test_the_keyboard_is_enough_and_all_have_names(folder):
    with firefox() as page:
        page.goto((folder / "policies.html").as_uri())
        page.press("Tab")
        assert page.evaluate("document.activeElement.textContent") == "Act"
        page.evaluate(f"({PRESS}, 0)")  # without a screen, Firefox presses no button by a key
        assert page.evaluate(READY) == "ready"
        assert page.evaluate("document.activeElement.type") == "text"
        page.press(*"\b" * 30, *"slide green fast", "Enter")
        said = page.evaluate(ANSWERED)
        assert "green" in said and "describes what it saw" in said
        assert page.evaluate(NAMELESS) == []
        page.size(390, 844)
        wide, screen = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide <= screen


def test_a_server_with_a_strict_policy_will_do():
    with server(SITE) as address, firefox(address) as page:
        page.goto(address + "05_incongruence.html")
        page.evaluate("""(window.refused = [], document.addEventListener("securitypolicyviolation",
          one => refused.push(one.blockedURI + " " + one.violatedDirective)), 0)""")
        page.evaluate(f"({PRESS}, 0)")
        assert page.evaluate(READY) == "ready"
        assert page.evaluate(ANSWERED)
        assert page.evaluate("refused") == []
