import base64
import gzip
import json
import re
import shlex
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import tyro
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from aframe_env.config import TaskConfig
from aframe_env.scenario import ScenarioDistribution
from agents.policy import Knowledge
from agents.registry import PolicySpec, choose, choose_all
from agents.rollout import Episodes, held_out_scenarios
from train.demo.__main__ import Options as DemoOptions
from train.evaluate.one_episode import begin
from train.evaluate.report.data import content, numbers, worst
from train.evaluate.report.html import figure, percent, write_report
from train.evaluate.report.remarks import Field, intact, remarks
from train.evaluate.run import Comparison, HeldOut, run_all
from train.evaluate.statistics import Entry, Interval

STEPS, DURATION, CONTROL_PERIOD = 600, 60.0, 0.1
TIME = CONTROL_PERIOD * np.arange(STEPS + 1)
COMMAND = "python -m train.evaluate --policies 'my_module:<b>&law'"


def episodes(error, **changes):
    error = np.atleast_2d(error)
    count = len(error)
    made = Episodes(
        omega1=DURATION * np.mean(error**2, axis=1),
        omega2=abs(error).max(axis=1),
        duration=DURATION,
        slack_events=np.zeros(count, dtype=np.int64),
        peak_tension=np.full(count, 1e6),
        drum_travel=np.zeros(count),
        peak_power=np.zeros(count),
        time_outside=np.zeros(count),
        parted=np.zeros(count, dtype=bool),
        landings=np.zeros(count, dtype=np.int64),
        lift_offs=np.zeros(count, dtype=np.int64),
        landing_speed=np.zeros(count),
        error=error.astype(np.float32),
        drum_speed=np.zeros((count, STEPS + 1), dtype=np.float32),
        tension=np.full((count, STEPS + 1), 1e6, dtype=np.float32),
    )
    return replace(made, **changes)


def compared(still, *others):
    """The drum still, and policies with their knowledge and errors (fewer, STEPS + 1)."""
    entries = [Entry("drum still", Knowledge.NOTHING, still)]
    entries += [Entry(f"policy {i}", knows, policy) for i, (knows, policy) in enumerate(others, 1)]
    scenarios = held_out_scenarios(ScenarioDistribution(), len(still.omega1))
    return Comparison(tuple(entries), tuple(scenarios), TaskConfig())


@pytest.fixture(scope="module")
def random_comparison():
    """Thirty scenarios; a policy that ran in all of them and a privileged one that ran in the first seven."""
    rng = np.random.default_rng(3)

    def noise(count, scale):
        return scale * rng.lognormal(sigma=0.7, size=(count, 1)) * rng.normal(size=(count, STEPS + 1))

    return compared(
        episodes(noise(30, 1.0)),
        (Knowledge.SENSORS, episodes(noise(30, 0.05))),
        (Knowledge.FUTURE, episodes(noise(7, 0.01))),
    )


# ---- what the report shows


def test_profiles_are_the_share_of_scenarios(random_comparison):
    still, policy = (entry.episodes.rms for entry in random_comparison.entries[:2])
    profile = content(random_comparison).subsets[0].profiles[1]
    for left, share in zip(profile.x, profile.y, strict=True):
        assert share == pytest.approx(np.mean(policy / still <= left * 1.0005), abs=0.04)
    assert profile.y[-1] == 1.0


def test_where_counts_differ_all_are_also_shown_on_the_scenarios_in_common(random_comparison):
    shown = content(random_comparison)
    own, shared = shown.subsets
    assert [row.scenarios for row in own.figures] == [30, 30, 7]
    assert [row.scenarios for row in shared.figures] == [7, 7, 7]
    first = [entry.episodes.rms[:7] for entry in random_comparison.entries]
    assert shared.figures[1].reduction == Interval.of(1.0 - first[1] / first[0])
    assert shared.figures[2] == own.figures[2]
    assert len(content(compared(*(e.episodes for e in random_comparison.entries[:1]))).subsets) == 1


def test_pairs_are_over_the_same_scenarios_and_mirror_each_other(random_comparison):
    still, policy, privileged = (entry.episodes.rms for entry in random_comparison.entries)
    pairs = content(random_comparison).pairs
    pair, mirrored = pairs[1][2], pairs[2][1]
    assert pair.scenarios == mirrored.scenarios == 7
    assert pair.difference.value == pytest.approx(np.median((policy[:7] - privileged) / still[:7]))
    assert pair.ratio.value == pytest.approx(np.median(privileged / policy[:7]))
    assert pair.better == np.mean(privileged < policy[:7])
    assert pair.ratio.low <= pair.ratio.value <= pair.ratio.high
    assert mirrored.difference.low == -pair.difference.high
    assert mirrored.ratio.high == pytest.approx(1.0 / pair.ratio.low)
    assert mirrored.spread == pytest.approx(tuple(1.0 / v for v in reversed(pair.spread)))
    assert pairs[1][1] is None


def test_a_spectrum_holds_the_variance_where_the_oscillation_is():
    oscillation = 0.3 * np.sin(2.0 * np.pi * 0.2 * TIME)
    spectrum = content(compared(episodes(np.tile(oscillation, (3, 1))))).subsets[0].spectra[0]
    frequency, density = np.array(spectrum.x), np.array(spectrum.y)
    assert np.sum(density) * (frequency[1] - frequency[0]) == pytest.approx(0.5 * 0.3**2, rel=0.03)
    assert frequency[np.argmax(density)] == pytest.approx(0.2, abs=0.02)


def test_dependence_shows_each_scenario_with_its_own_trait(random_comparison):
    shown = content(random_comparison)
    masses = [1e-3 * scenario.load_mass for scenario in random_comparison.scenarios]
    assert shown.dependences[2].x == pytest.approx(masses, rel=1e-3)
    still, policy = (entry.episodes.rms for entry in random_comparison.entries[:2])
    assert shown.clouds[1].left == pytest.approx((policy / still).tolist(), rel=1e-3)
    assert shown.clouds[2].scenarios == list(range(7))
    # Over all bins together, as many medians lie above the middle of all as below it.
    assert np.median(shown.dependences[0].median[1].y) == pytest.approx(np.median(policy / still), rel=0.35)


def test_examples_begin_with_the_median_and_have_the_worst(random_comparison):
    shown = content(random_comparison)
    assert shown.policies[shown.reference].name == "policy 1"
    still, policy = (entry.episodes.rms for entry in random_comparison.entries[:2])
    left = policy / still
    by_label = {example.label: example.scenario for example in shown.examples}
    assert shown.examples[0].label == "median"
    assert left[by_label["median"]] == np.median(left[:7])
    assert by_label["worst of all"] == np.argmax(left)
    assert max(Counter(example.scenario for example in shown.examples).values()) == 1
    for example in shown.examples:
        assert [history.policy for history in example.histories] == ([0, 1, 2] if example.scenario < 7 else [0, 1])
        error = random_comparison.entries[1].episodes.error[example.scenario]
        assert example.histories[1].error == pytest.approx(error.tolist(), abs=1e-3 * float(abs(error).max()))


@given(st.lists(st.floats(0.0, 10.0), min_size=1, max_size=500))
def test_the_worst_are_the_worst_hundredth(left):
    found = worst(np.array(left))
    rest = [value for i, value in enumerate(left) if i not in found]
    assert len(found) == len(set(found)) == min(len(left), max(2, -(-len(left) // 100)), 10)
    assert [left[i] for i in found] == sorted((left[i] for i in found), reverse=True)
    assert not rest or left[found[-1]] >= max(rest)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=50))
def test_rounding_keeps_four_digits_of_the_largest(values):
    top = max(abs(value) for value in values)
    assert numbers(values) == pytest.approx(values, abs=max(0.5001e-3 * top, 1e-15))


# ---- what happened in an episode


def said(policy, still=None, index=0):
    still = np.tile(np.sin(0.6 * TIME), (40, 1)) * np.linspace(1.0, 3.0, 40)[:, None] if still is None else still
    comparison = compared(episodes(still), (Knowledge.SENSORS, policy))
    return " ".join(remarks(comparison, Field.of(comparison), policy, index)).replace("\u00a0", " ")


def rms(values):
    return np.sqrt(np.mean(values**2))


def swinging(period, amplitude=0.1, count=40):
    return np.tile(amplitude * np.sin(2.0 * np.pi * TIME / period), (count, 1))


MIDDLE = 20
"""A scenario that is neither among the roughest nor among the calmest."""


def test_an_ordinary_episode_has_nothing_said_of_it():
    assert said(episodes(swinging(9.0)), index=MIDDLE) == "Nothing out of the ordinary."


def test_a_slack_rope_is_counted():
    slack = np.zeros(40, dtype=np.int64)
    slack[MIDDLE] = 3
    assert "The rope went slack 3 times." in said(episodes(swinging(9.0), slack_events=slack), index=MIDDLE)


def test_a_parted_rope_ends_what_there_is_to_see():
    tension = np.full((40, STEPS + 1), 1e6, dtype=np.float32)
    tension[MIDDLE, 200:] = 0.0
    tension[MIDDLE, 100] = 0.0
    parted = np.arange(40) == MIDDLE
    error = swinging(9.0)
    error[MIDDLE, 200:] = -1e4
    policy = episodes(error, tension=tension, parted=parted)
    assert intact(policy, MIDDLE) == 200
    assert intact(policy, 0) == STEPS + 1
    words = said(policy, index=MIDDLE)
    assert "parted at 20.0 s" in words
    assert "standing" not in words
    comparison = compared(episodes(swinging(9.0, 1.0)), (Knowledge.SENSORS, policy))
    episode = content(comparison).worst[1][0]
    assert (episode.scenario, len(episode.error)) == (MIDDLE, 200)


@pytest.mark.parametrize("limit", ["speed", "acceleration"])
def test_a_winch_at_its_limits_is_timed(limit):
    winch = ScenarioDistribution().crane.winch
    speed = np.zeros((40, STEPS + 1), dtype=np.float32)
    if limit == "speed":
        speed[:, 100:250] = -winch.max_speed
    else:
        ramp = winch.max_acceleration * CONTROL_PERIOD * np.arange(1, 11)
        speed[:, 100:220] = np.tile(np.concatenate([ramp, ramp[::-1]]), 6)
    words = said(episodes(swinging(9.0), drum_speed=speed), index=MIDDLE)
    assert re.search(rf"at its {limit} limit \(\d m/s²?\) for (\d+) % of the time", words)
    share = int(re.search(rf"{limit} limit .* for (\d+) %", words)[1])
    assert share == (25 if limit == "speed" else pytest.approx(19, abs=1))


def test_extremes_among_the_scenarios_are_named():
    policy = episodes(swinging(9.0))
    unit = rms(np.sin(0.6 * TIME))
    assert f"5 % smallest motions: {100 * unit:.1f} cm RMS" in said(policy, index=0)
    assert f"5 % largest motions: {3 * unit:.2f} m RMS" in said(policy, index=39)
    scenarios = held_out_scenarios(ScenarioDistribution(), 40)
    shortest = int(np.argmin([s.rope_length for s in scenarios]))
    lightest = int(np.argmin([s.load_mass for s in scenarios]))
    assert f"5 % shortest ropes: {scenarios[shortest].rope_length:.0f} m" in said(policy, index=shortest)
    assert f"5 % lightest loads: {scenarios[lightest].load_mass / 1e3:.0f} t" in said(policy, index=lightest)


def test_what_is_left_is_described():
    assert "+20.0 cm in the mean" in said(episodes(swinging(10.0, 0.05) + 0.2), index=MIDDLE)
    start = swinging(9.0) * np.where(TIME < 8.0, 1.0, 0.01)
    assert "% of Ω1 comes from the first 10 s" in said(episodes(start), index=MIDDLE)
    scenario = held_out_scenarios(ScenarioDistribution(), 40)[MIDDLE]
    period = 2.0 * np.pi / scenario.rope_frequency
    assert f"own period on its rope ({period:.1f} s)" in said(episodes(swinging(1.05 * period)), index=MIDDLE)
    assert "own period" not in said(episodes(swinging(1.6 * period)), index=MIDDLE)


# ---- the page


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.000253, "0.000253"), (39.51, "39.5"), (1234.5, "1,230"), (-2.0, "−2.00"), (-5.51e-5, "−5.51·10⁻⁵")],
)
def test_figures_have_three_digits(value, text):
    assert figure(value) == text


def test_per_cent_has_more_digits_near_all():
    assert [percent(s).replace("\u00a0", " ") for s in (0.988, 0.9971, 1.0, -0.49, -6.526)] == [
        "98.8 %",
        "99.71 %",
        "100.0 %",
        "−49.0 %",
        "−653 %",
    ]


@pytest.fixture(scope="module")
def comparison():
    """Eight scenarios: the drum still, a feedback law, and inverse dynamics, which ran in the first three."""
    floor = PolicySpec("inverse <dynamics>", choose("inverse dynamics").build, for_each_scenario=True)
    return run_all(
        [*choose_all(["feed-forward + feedback (state)"]), floor],
        HeldOut(scenarios=8, privileged=3),
        Console(quiet=True),
    )


@pytest.fixture(scope="module")
def page(comparison, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, comparison, COMMAND)
    return path


def test_the_page_needs_nothing_else_and_says_what_made_it(page, comparison, tmp_path):
    text = page.read_text(encoding="utf-8")
    assert not re.findall(r"""(?:src|href)=["'](?!#|data:)[^"']*["']|@import|url\(""", text)
    assert "--policies &#39;my_module:&lt;b&gt;&amp;law&#39;" in text
    assert "inverse &lt;dynamics&gt;" in text
    assert "simplified (rigid frame)" in text
    assert "gymnasium 1" in text
    assert len(text) < 3e6
    data = json.loads(gzip.decompress(base64.b64decode(re.search(r'id="data">([^<]*)<', text)[1])))
    assert data["subsets"][0]["figures"][1]["rms"]["value"] == comparison.rows[1].rms.value
    again = tmp_path / "again.html"
    write_report(again, comparison, COMMAND)
    assert again.read_bytes() == page.read_bytes()


class Browser:
    """The page as a person has it before him: what was asked of the network, and what went wrong."""

    def __init__(self, context, path):
        self.page, self.wrong, self.asked = context.new_page(), [], []
        self.page.on("console", lambda message: self.wrong.append(message.text))
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("html[data-ready]", timeout=60_000)

    def drawn(self, section):
        """The figures and texts of a section, as they are drawn; without the marks of the pointer."""
        return self.page.evaluate(
            """(id) => [...document.querySelectorAll(`#${id} .plot .main-svg, #${id} tbody:not([hidden]),
                #${id} .traits, #${id} .episode h3`)].map((element) => element.innerHTML).join()""",
            section,
        )

    def changes(self, section, act):
        """Whether an act changes what is drawn."""
        before = self.drawn(section)
        act()
        return self.drawn(section) != before


@pytest.fixture(scope="module")
def browser(chromium, page):
    context = chromium.new_context(offline=True, viewport={"width": 1280, "height": 900}, color_scheme="light")
    yield Browser(context, page)
    context.close()


def test_the_page_loads_without_an_error_or_the_network(browser, page):
    assert browser.wrong == []
    assert browser.asked == [page.as_uri()]
    assert browser.page.locator("#failure").is_hidden()
    figures = browser.page.locator(".plot").count()
    assert figures == 4 + 4 + 2
    assert browser.page.locator(".plot .main-svg").count() >= figures


def test_the_table_sets_the_privileged_apart(browser):
    groups = browser.page.locator("#table tbody:not([hidden])")
    assert groups.locator("tr:not(.group) > th").all_inner_texts() == [
        "feed-forward + feedback (state)",
        "drum still",
        "inverse <dynamics>",
    ]
    assert groups.last.get_attribute("class") == "privileged"
    assert "privileged" in groups.last.locator("tr").first.inner_text()


@pytest.mark.parametrize("section", ["table", "profiles", "spectra"])
def test_the_scenarios_can_be_those_in_common(browser, section):
    picker = browser.page.locator(f"#{section} select.subset")
    for option in ("1", "0"):
        assert browser.changes(section, lambda option=option: picker.select_option(option))
        assert {s.input_value() for s in browser.page.locator("select.subset").all()} == {option}


@pytest.mark.parametrize("section", ["profiles", "dependence", "histories", "spectra"])
def test_every_policy_can_be_ticked_for_all_pictures_at_once(browser, section):
    summary, chips = browser.page.locator("#policies summary"), browser.page.locator("#policies .chip")
    assert chips.count() == 3
    summary.click()
    for i in range(3):
        for _ in range(2):
            assert browser.changes(section, chips.nth(i).click)
    for word in ("none", "all"):
        assert browser.changes(section, browser.page.locator("#policies .chips button", has_text=word).click)
    summary.click()
    names = ["drum still", "feed-forward + feedback (state)", "inverse <dynamics>"]
    assert browser.page.locator("#shown > span").all_inner_texts() == names


def test_every_reference_can_be_picked(browser):
    picker = browser.page.locator("#reference")
    assert picker.input_value() == "1"
    for option in ("0", "2", "1"):
        assert browser.changes("pairs", lambda option=option: picker.select_option(option))
        rows = browser.page.locator("#pair-table tbody tr")
        assert rows.count() == 2
        assert rows.first.locator("td").first.inner_text() == {"0": "8", "1": "8", "2": "3"}[option]


def test_every_scenario_can_be_picked(browser, comparison):
    picker, examples = browser.page.locator("#scenario"), content(comparison).examples
    assert picker.locator("option").count() == len(examples) >= 4
    for i in [*range(1, len(examples)), 0]:
        assert browser.changes("histories", lambda i=i: picker.select_option(str(i)))
        assert f"Scenario {examples[i].scenario}:" in browser.page.locator("#scenario-traits").inner_text()
        here = {history.policy for history in examples[i].histories}
        words = browser.page.locator("#histories .legend small").all_inner_texts()
        assert len([word for word in words if word != "did not run"]) == len(here)


def test_every_policys_worst_can_be_picked(browser, comparison):
    picker, shown = browser.page.locator("#worst-policy"), content(comparison)
    assert picker.locator("option").all_inner_texts() == [
        "feed-forward + feedback (state)",
        "inverse <dynamics> (privileged)",
    ]
    for policy in (2, 1):
        assert browser.changes("worst", lambda policy=policy: picker.select_option(str(policy)))
        titles = browser.page.locator(".episode h3").all_inner_texts()
        assert [int(title.split()[2].rstrip(":")) for title in titles] == [e.scenario for e in shown.worst[policy]]
        remarks_shown = browser.page.locator(".episode").first.locator("li").all_inner_texts()
        assert remarks_shown == shown.worst[policy][0].what


def test_light_and_dark(browser):
    def ground():
        return browser.page.evaluate("getComputedStyle(document.body).backgroundColor")

    light = ground()
    assert browser.changes("profiles", browser.page.locator("#theme").click)
    assert ground() != light
    browser.page.locator("#theme").click()
    assert ground() == light


def test_after_all_that_nothing_went_wrong(browser, page):
    assert browser.wrong == []
    assert browser.asked == [page.as_uri()]


def test_the_page_says_how_to_watch_an_episode(browser, comparison):
    """The command, for a policy that was chosen by its name, where the demo's default is another one."""
    said = browser.page.locator("#episodes code").first.inner_text()
    name, *arguments = said.split("--record ")
    assert name == "python -m train.demo "
    options = tyro.cli(DemoOptions, args=["--record", *shlex.split(arguments[0])])
    assert (options.policy, options.start, options.seconds) == ("feed-forward + feedback (state)", 0.0, 60.0)
    title = browser.page.locator("#episodes h3").first.inner_text()
    assert f"Scenario {options.scenario}:" in title
    error = comparison.entries[1].episodes.error[options.scenario]
    episode = begin(options)
    episode.advance_to(10.0)
    np.testing.assert_allclose(episode.history()[:, 1], error[:101], atol=1e-5)


@pytest.fixture(scope="module")
def seeds():
    """Two seeds of an agent, which leave a tenth and two tenths of the heave, beside a law that leaves a half."""
    still = episodes(np.outer(np.linspace(1.0, 2.0, 40), np.sin(TIME)))
    found = compared(still, *((Knowledge.SENSORS, episodes(share * still.error)) for share in (0.1, 0.5, 0.2)))
    names = ("drum still", "agent, seed 0", "law", "agent, seed 1")
    entries = [replace(entry, policy=name) for entry, name in zip(found.entries, names, strict=True)]
    return replace(found, entries=tuple(entries))


def test_seeds_of_an_agent_are_one_policy_with_its_spread_and_each_by_itself(seeds):
    shown = content(seeds)
    assert [(p.name, p.family, p.seeds) for p in shown.policies] == [
        ("drum still", 0, [0]),
        ("agent, 2 seeds", 1, [2, 3]),
        ("agent, seed 0", 1, [2]),
        ("agent, seed 1", 1, [3]),
        ("law", 4, [4]),
    ]
    figures = [row.reduction for row in shown.subsets[0].figures]
    assert [f.value for f in figures] == pytest.approx([0.0, 0.85, 0.9, 0.8, 0.5], abs=1e-6)
    # Resampled seeds: both the first, or both the second.
    assert (figures[1].low, figures[1].high) == pytest.approx((0.8, 0.9), abs=1e-6)
    assert shown.reference == 1
    assert [len(p.x) for p in shown.subsets[0].profiles] == [40, 80, 40, 40, 40]
    assert shown.clouds[1].left == pytest.approx([0.15] * 40, rel=1e-3)
    # The geometric mean of 0.1 and 0.2 over 0.5.
    assert shown.pairs[4][1].ratio.value == pytest.approx(np.sqrt(0.02) / 0.5, rel=1e-5)
    assert shown.pairs[1][4].ratio.value == pytest.approx(0.5 / np.sqrt(0.02), rel=1e-5)
    assert {h.policy for h in shown.examples[0].histories} == {0, 2, 3, 4}
    assert [len(found) > 0 for found in shown.worst] == [False, False, True, True, True]


def test_a_row_of_seeds_opens(chromium, seeds, tmp_path):
    path = tmp_path / "report.html"
    write_report(path, seeds, COMMAND)
    context = chromium.new_context(offline=True, viewport={"width": 1400, "height": 900})
    opened = Browser(context, path)
    rows, button = opened.page.locator("#table tbody tr:not(.group):visible > th"), opened.page.locator("#table .open")
    closed = [name.strip() for name in rows.all_inner_texts()]
    assert closed == ["agent, 2 seeds", "law", "drum still"]
    for section in ("table", "profiles", "pairs", "dependence", "histories", "spectra"):
        assert opened.changes(section, button.click), section
    button.click()
    assert [name.strip() for name in rows.all_inner_texts()] == [
        closed[0],
        "agent, seed 0",
        "agent, seed 1",
        *closed[1:],
    ]
    assert button.get_attribute("aria-expanded") == "true"
    assert opened.wrong == []
    context.close()


@pytest.mark.parametrize("width", [1400, 1280])
def test_the_table_is_not_cut_on_a_screen(chromium, seeds, page, width, tmp_path):
    path = tmp_path / "report.html"
    write_report(path, seeds, COMMAND)
    context = chromium.new_context(offline=True, viewport={"width": width, "height": 900})
    for shown in (page, path):
        table = Browser(context, shown).page.locator("#table .scroll")
        assert table.evaluate("element => element.scrollWidth <= element.clientWidth")
    context.close()


def test_a_phone_needs_no_sideways_scrolling(chromium, page):
    context = chromium.new_context(
        offline=True, viewport={"width": 360, "height": 740}, is_mobile=True, has_touch=True, color_scheme="dark"
    )
    phone = Browser(context, page)
    assert phone.page.evaluate("document.documentElement.scrollWidth") <= 360
    assert phone.page.evaluate("document.documentElement.dataset.theme") == "dark"
    assert phone.wrong == []
    context.close()
