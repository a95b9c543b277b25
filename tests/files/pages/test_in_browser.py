"""The player and the figures driven in a real browser: what is on the canvas is where the result says.

The canvas is read back as pixels, so that nothing is taken from the player's own numbers but its scale and its clock.
"""

from __future__ import annotations

from time import monotonic, sleep

import numpy as np
import pytest

from tests.kit.browser import open_browser
from tests.kit.enriched import converted, made_enriched
from xosc_lateral.files.pages.chart import BLUE, GREEN, VERMILLION
from xosc_lateral.workflows.conversion.page import conversion_page

AHEAD, LANE_WIDTH = 1.4, 3.5  # of the made vehicles and road [m]


@pytest.fixture(scope="module")
def enriched(tmp_path_factory):
    return made_enriched(tmp_path_factory.mktemp("road"), amplitude=0.5)


@pytest.fixture(scope="module")
def browser(tmp_path_factory, enriched):
    folder = tmp_path_factory.mktemp("page")
    page = folder / "report.html"
    page.write_text(conversion_page(converted(enriched)), encoding="utf-8")
    with open_browser(folder / "profile") as one:
        one.get(page.as_uri())
        yield one


@pytest.fixture
def player(browser):
    """At time 0, following the ego vehicle, true to scale, nominal places hidden."""
    run(
        browser,
        "p.toggle(false); c.set(0); p.follow(p.vehicles[0]); p.setStretch(1); p.showGhosts = p.sideBySide = false; "
        "p.scale = 12",
    )
    yield browser
    assert [line["message"] for line in browser.get_log("browser") if line["level"] == "SEVERE"] == []


def run(browser, script: str):
    """Run a script (p: the player, c: the clock), then wait for the next picture."""
    browser.execute_script(f"const p = xoscLateral.players[0], c = xoscLateral.clock; {script}; p.changed();")
    drawn = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done));"
    browser.execute_async_script(drawn)


def box_centre(browser, color: str) -> np.ndarray:
    """Centre of the pixels of a colour, from the middle of the canvas, y up. [pixel of the page]"""
    found = browser.execute_script(
        """
        const canvas = xoscLateral.players[0].canvas, {width, height} = canvas;
        const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
        const wanted = [1, 3, 5].map((k) => parseInt(arguments[0].slice(k, k + 2), 16));
        let [x0, x1, y0, y1] = [1e9, -1, 1e9, -1];
        for (let i = 0; i < pixels.length; i += 4) {
          if (wanted.some((value, k) => Math.abs(value - pixels[i + k]) > 3)) continue;
          const x = (i / 4) % width, y = Math.floor(i / 4 / width);
          [x0, x1, y0, y1] = [Math.min(x0, x), Math.max(x1, x), Math.min(y0, y), Math.max(y1, y)];
        }
        return x1 < 0 ? null : [(x0 + x1 + 1) / 2 - width / 2, height / 2 - (y0 + y1 + 1) / 2];
        """,
        color,
    )
    assert found is not None, f"nothing is {color}"
    return np.array(found)


def metres(browser, color: str) -> np.ndarray:
    stretch = browser.execute_script("return xoscLateral.players[0].stretch")
    scale = browser.execute_script("return xoscLateral.players[0].scale")
    return box_centre(browser, color) / np.array([scale, scale * stretch])


def test_the_followed_car_is_off_the_middle_by_what_was_added(player, enriched):
    for time in (0.0, 2.5, 7.5, 12.0):
        run(player, f"c.set({time})")
        added = enriched.entity("Ego").deviation[round(time / 0.02)]
        along, left = metres(player, BLUE)
        assert left == pytest.approx(added, abs=0.1)  # a pixel is 0.083 m
        assert along == pytest.approx(0.0, abs=0.1)


def test_other_vehicles_are_where_the_result_says(player, enriched):
    run(player, "p.scale = 4; c.set(5)")
    ego, van = enriched.entity("Ego").motion, enriched.entity("Van").trajectory
    row = round(5.0 / 0.02)
    along, left = metres(player, VERMILLION)
    assert along == pytest.approx(van.x[row] - ego.x[row], abs=0.3)
    assert left == pytest.approx(van.y[row] - ego.y[row], abs=0.3)


def test_a_stretch_widens_across_alone(player, enriched):
    run(player, "p.scale = 4; p.setStretch(8); c.set(2.5)")
    along, left = metres(player, BLUE)
    assert left == pytest.approx(enriched.entity("Ego").deviation[125], abs=0.05)
    assert along == pytest.approx(0.0, abs=0.3)


def test_on_the_arc_a_stretch_is_across_the_lane_that_is_followed(player, enriched):
    """At 20 s both are on the arc; the view looks along the lane where the ego vehicle is."""
    run(player, "p.scale = 4; p.setStretch(4); c.set(20)")
    row = round(20.0 / 0.02)
    ego, van = enriched.entity("Ego").motion, enriched.entity("Van").trajectory

    def middle(path) -> complex:
        return path.x[row] + 1j * path.y[row] + AHEAD * np.exp(1j * path.heading[row])

    seen = (middle(van) - middle(ego)) * np.exp(-1j * ego.heading[row])
    along, left = metres(player, VERMILLION)
    assert (along, left) == pytest.approx((seen.real, seen.imag), abs=0.6)


def test_the_page_opens_stretched_and_side_by_side(browser):
    browser.refresh()
    first = browser.execute_script("const p = xoscLateral.players[0]; return [p.sideBySide, p.stretch, p.height]")
    assert first[0]
    assert first[1] > 1.0


def test_side_by_side_the_written_car_is_above_and_the_lifelike_one_below(player, enriched):
    """The two halves show the same place; the car is off the middle of the lower one alone."""
    run(player, "p.sideBySide = true; c.set(2.5)")
    added, high = enriched.entity("Ego").deviation[125], player.execute_script("return xoscLateral.players[0].height")
    scale = player.execute_script("return xoscLateral.players[0].scale")
    _, across = box_centre(player, BLUE)  # of both boxes together
    assert across == pytest.approx(0.5 * scale * added, abs=2.0)
    boxes = player.execute_script(
        "return xoscLateral.players[0].boxes.filter(b => b.vehicle.name === 'Ego').map(b => b.outline.map(p => p[1]))"
    )
    above, below = (np.mean(each) for each in boxes)
    assert (above, below) == pytest.approx((0.25 * high, 0.75 * high - scale * added), abs=0.5)


def test_a_figure_is_saved_as_picture_and_as_table(player):
    """What the buttons hand to the browser: a picture that needs no page, and the drawn lines as a table."""
    saved = player.execute_async_script(
        """
        const done = arguments[0], made = [], create = URL.createObjectURL;
        URL.createObjectURL = (blob) => (made.push(blob), create.call(URL, blob));
        const figure = [...document.querySelectorAll("figure.time")][0];
        for (const button of figure.querySelectorAll(".save button")) button.click();
        setTimeout(async () => {
          URL.createObjectURL = create;
          const content = (blob) => (blob.type === "image/png" ? blob.size : blob.text());
          done(await Promise.all(made.map(async (blob) => [blob.type, await content(blob)])));
        }, 1500);
        """
    )
    kinds = dict(saved)
    assert set(kinds) == {"image/svg+xml", "text/csv", "image/png"}
    assert "var(" not in kinds["image/svg+xml"]
    assert kinds["image/svg+xml"].startswith("<svg")
    assert kinds["image/png"] > 5000
    head, *rows = kinds["text/csv"].strip().split("\n")
    assert head == 'panel,line,"time [s]","added offset [m]"'
    assert {row.split(",")[0] for row in rows} >= {'"Ego"', '"Van"'}


def test_play_moves_time_and_pause_stops_it(player):
    player.find_element("css selector", ".player .controls button").click()
    deadline = monotonic() + 10.0
    while player.execute_script("return xoscLateral.clock.time") < 0.5 and monotonic() < deadline:
        sleep(0.05)
    player.find_element("css selector", ".player .controls button").click()
    stopped = player.execute_script("return xoscLateral.clock.time")
    assert stopped >= 0.5
    sleep(0.2)
    assert player.execute_script("return xoscLateral.clock.time") == stopped


def test_the_scrub_bar_sets_the_time_and_the_cursors_of_the_plots(player):
    player.execute_script(
        "const bar = document.querySelector('.player input[type=range]'); bar.value = 15;"
        "bar.dispatchEvent(new Event('input'));"
    )
    assert player.execute_script("return xoscLateral.clock.time") == pytest.approx(15.0)
    assert player.find_element("css selector", ".player .time").text.startswith("15.0") or run(player, "") is None
    places = player.execute_script(
        "return xoscLateral.panels.filter((one) => one.overTime)"
        ".map((one) => one.x.value(one.cursor.getAttribute('x1')))"
    )
    assert len(places) >= 4
    assert places == pytest.approx([15.0] * len(places), abs=0.05)


def test_a_chip_follows_that_vehicle(player, enriched):
    player.find_elements("css selector", ".player .chips button")[2].click()
    run(player, "c.set(3)")
    along, left = metres(player, GREEN)  # not enriched: exactly in the middle
    assert (along, left) == pytest.approx((0.0, 0.0), abs=0.1)


def test_keys_step_stretch_and_show_everything(player):
    canvas = player.find_element("css selector", ".player canvas")
    canvas.send_keys("\ue014\ue014\ue014")  # arrow right
    assert player.execute_script("return xoscLateral.clock.time") == pytest.approx(0.3)
    canvas.send_keys("\ue013")  # arrow up
    assert player.execute_script("return xoscLateral.players[0].stretch") == 2
    canvas.send_keys("0")
    run(player, "")
    for color in (BLUE, VERMILLION, GREEN):
        box_centre(player, color)  # all are in the picture


def test_pointing_at_a_vehicle_shows_its_values(player, enriched):
    from selenium.webdriver.common.action_chains import ActionChains

    run(player, "c.set(2.5)")
    canvas = player.find_element("css selector", ".player canvas")
    ActionChains(player).move_to_element(canvas).perform()
    tip = player.find_element("css selector", ".player .tip").text
    assert "Ego" in tip
    assert f"{enriched.entity('Ego').deviation[125]:.2f} m left" in tip
    assert "30.0 m/s (108 km/h)" in tip
    assert "-2 of road a" in tip


def test_a_figure_tells_its_values_and_a_click_takes_the_player_there(player, enriched):
    from selenium.webdriver.common.action_chains import ActionChains

    figure = player.find_element("xpath", "//figure[.//*[contains(., 'offset [m]')]][.//*[contains(., 'Van')]]")
    player.execute_script("arguments[0].scrollIntoView({block: 'center'})", figure)
    x, y = player.execute_script(
        """
        const panel = xoscLateral.panels.find((one) => arguments[0].contains(one.svg));
        const point = new DOMPoint(panel.x.place(12.5), panel.height / 2).matrixTransform(panel.svg.getScreenCTM());
        return [Math.round(point.x), Math.round(point.y)];
        """,
        figure,
    )
    body = ActionChains(player)
    body.w3c_actions.pointer_action.move_to_location(x, y)
    body.perform()
    tip = figure.find_element("css selector", ".tip").text
    assert float(tip.split()[-1]) == pytest.approx(enriched.entity("Ego").deviation[625], abs=0.02)
    body.w3c_actions.pointer_action.click()
    body.perform()
    assert player.execute_script("return xoscLateral.clock.time") == pytest.approx(12.5, abs=0.1)


def test_on_a_phone_nothing_is_cut_and_figures_scroll(player, enriched):
    size = {"width": 420, "height": 900, "deviceScaleFactor": 2, "mobile": True}
    player.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        run(player, "")
        assert player.execute_script("return document.documentElement.scrollWidth") <= 420
        inner, outer = player.execute_script(
            "const one = document.querySelector('figure .scroll'); return [one.scrollWidth, one.clientWidth]"
        )
        assert inner > outer  # a figure is wider than the screen, and scrolls by itself
        wide = player.execute_script(
            """
            return [...document.querySelectorAll('.player button, .player select, .player input')]
              .filter((one) => one.getBoundingClientRect().right > 420).length;
            """
        )
        assert wide == 0
        run(player, "c.set(2.5); p.scale = 12")
        left = metres(player, BLUE)[1] / 2.0  # two device pixels per pixel of the page
        assert left == pytest.approx(enriched.entity("Ego").deviation[125], abs=0.1)
    finally:
        player.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        run(player, "")


def test_a_swipe_looks_elsewhere_and_a_tap_follows(player):
    """Touch events of the browser itself."""
    canvas = player.find_element("css selector", ".player canvas")
    player.execute_script("arguments[0].scrollIntoView({block: 'center'})", canvas)
    place = player.execute_script(
        "const b = arguments[0].getBoundingClientRect(); return [b.x, b.y, b.width, b.height]", canvas
    )
    x, y = place[0] + place[2] / 2, place[1] + place[3] / 2

    def touch(kind: str, points: list[tuple[float, float]]) -> None:
        values = {"type": kind, "touchPoints": [{"x": a, "y": b} for a, b in points]}
        player.execute_cdp_cmd("Input.dispatchTouchEvent", values)

    touch("touchStart", [(x, y)])
    touch("touchEnd", [])
    assert player.execute_script("return xoscLateral.players[0].followed.name") == "Ego"
    touch("touchStart", [(x + 150, y + 40)])
    for step in range(1, 8):
        touch("touchMove", [(x + 150 - 20 * step, y + 40)])
    touch("touchEnd", [])
    assert player.execute_script("return xoscLateral.players[0].followed") is None
