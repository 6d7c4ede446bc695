"""The page in a real browser: keys pressed, robot moved."""

from pathlib import Path

import pytest

pytest.importorskip("websockets", minversion="13", reason='the view needs ".[view]"')

LOGS = Path(__file__).parents[2] / "examples" / "logs"
LOG = str(LOGS / "random_hold_a_1.csv")
OVERLAPS = """(() => {
  const shown = [...document.querySelectorAll("h1, h2, p, span, label, output, td, th, button, canvas, img")]
    .filter((e) => e.getClientRects().length && (e.children.length === 0));
  const boxes = shown.map((e) => [e, e.getBoundingClientRect()]).filter(([, b]) => b.width && b.height);
  const bad = [];
  boxes.forEach(([e, a], i) => boxes.slice(i + 1).forEach(([f, b]) => {
    const x = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const y = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (x > 1 && y > 1) bad.push(`${e.outerHTML.slice(0, 60)} over ${f.outerHTML.slice(0, 60)}`);
  }));
  return bad.join("; ");
})()"""
PUSH_THE_STICK = """navigator.getGamepads = () => [{ connected: true, axes: [0, -1, 0, 0], buttons: [] }]"""


@pytest.fixture(scope="module")
def driven(start_view, page):
    """Return the page of a live robot."""
    page.open(start_view().url)
    return page


@pytest.fixture
def at_start(driven):
    """Return the page with the robot at rest at the start, no key held, no effect on."""
    driven.run("document.querySelectorAll('#effects input:checked').forEach((box) => box.click())")
    driven.run("document.getElementById('reset').click()")
    driven.until("document.getElementById('x').textContent === '0.00 m'")
    return driven


def test_a_key_held_down_drives_ahead(at_start):
    at_start.key("KeyW", down=True)
    at_start.until("parseFloat(document.getElementById('x').textContent) > 0.3")
    at_start.key("KeyW", down=False)
    assert abs(at_start.number("y")) < 0.05


def test_the_robot_stops_when_the_key_is_let_go(at_start):
    at_start.key("KeyA", down=True)
    at_start.until("parseFloat(document.getElementById('vy').textContent) > 0.3")
    at_start.key("KeyA", down=False)
    at_start.until("parseFloat(document.getElementById('vy').textContent) === 0")


def test_two_keys_make_one_command(at_start):
    for code in ("ArrowUp", "ArrowLeft", "KeyE"):
        at_start.key(code, down=True)
    at_start.until("document.getElementById('theta').textContent === '45°'")
    turning = at_start.number("vc")
    for code in ("ArrowUp", "ArrowLeft", "KeyE"):
        at_start.key(code, down=False)
    assert turning < 0.0


def test_a_gamepad_drives(at_start):
    at_start.run(PUSH_THE_STICK)
    at_start.until("parseFloat(document.getElementById('x').textContent) > 0.1")
    at_start.run("navigator.getGamepads = () => []")


def test_an_effect_switched_on_while_driving_changes_the_motion(at_start):
    at_start.key("KeyW", down=True)
    at_start.until("parseFloat(document.getElementById('vx').textContent) > 0.6")
    straight = at_start.number("yaw")
    at_start.run("document.querySelector('#effects input[name=wheel_gain_mismatch]').click()")
    at_start.until("parseFloat(document.getElementById('yaw').textContent) > 3")
    at_start.key("KeyW", down=False)
    assert abs(straight) < 1.0


def test_pictures_arrive(at_start):
    at_start.until("document.getElementById('picture').naturalWidth === 640")


def test_the_curves_are_drawn(at_start):
    at_start.key("KeyD", down=True)
    blue = "document.querySelector('canvas').getContext('2d').getImageData(0, 0, 300, 90).data"
    at_start.until(f"[...{blue}].some((v, i, all) => i % 4 === 2 && v > 150 && all[i - 2] < 60)")
    at_start.key("KeyD", down=False)


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("args", [(), ("--log", LOG)], ids=["drive", "replay"])
def test_nothing_lies_over_anything_else(start_view, page, args, width):
    view = start_view(*args)
    page.open(view.url, width)
    assert page.run(OVERLAPS) == ""
    assert page.run("document.documentElement.scrollWidth") <= width
    page.call("Page.navigate", url="about:blank")
    view.interrupt()


def test_a_log_is_drawn_beside_its_simulation(start_view, page):
    page.open(start_view("--log", LOG).url)
    page.until("document.querySelectorAll('#plots canvas').length === 1")
    fits = page.run("parseFloat(document.querySelector('figcaption span + span').textContent.slice(4))")
    page.run("document.querySelector('#effects input[name=command_latency]').click()")
    page.until(
        f"parseFloat(document.querySelector('figcaption span + span').textContent.slice(4)) > {2 * fits}"
    )


def test_a_replay_plays_to_its_end(start_view, page):
    page.open(start_view("--log", str(LOGS / "step_080_1.csv")).url)
    page.run("document.getElementById('play').click()")
    page.until("document.getElementById('when').value === document.getElementById('when').max")
    page.until("document.getElementById('play').textContent === 'play'")
