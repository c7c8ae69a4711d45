"""The widget in a real browser: drags, wheel and keys change its state, and its picture is that of the scene."""

import asyncio
import base64
import io
import subprocess
import sys

import numpy as np
import pytest
from browser import PageComm, find_browser, page_of
from conftest import FUNCTION, missing, small
from PIL import Image

import umbravox as uv

SIZE = 240, 200
SHIFT = 8
PICTURE = "(async () => btoa(String.fromCharCode(...new Uint8Array(await (await fetch({image}.src)).arrayBuffer()))))()"
PICTURE = PICTURE.format(image="document.querySelector('.ux-picture')")
#: All pictures have come, and the last is the full one.
#: Changes from Python have no request and an empty `id`.
AT_REST = "(() => { const a = model.get('_answer'); return a.drag === false && ['', model.get('_request').id].includes(a.id); })()"


@pytest.fixture
def browser():
    found = find_browser()
    return found or missing("UMBRAVOX_NO_BROWSER", "there is no chromium and no Chrome")


@pytest.fixture
def widget(monkeypatch, adapter):
    monkeypatch.setattr("comm.create_comm", PageComm)
    return uv.Widget(uv.Scene("phantom:thorax:32", size=SIZE, tf="bone", shadow="dsm:map=128"))


def shown(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


async def at_rest(page, widget):
    """Picture of the page once it is the full one, which has to be that of the scene in the state of the widget."""
    await page.until(AT_REST)
    png = base64.b64decode(await page.evaluate(PICTURE))
    expected = uv.srgb8(widget.scene.render())
    assert np.array_equal(shown(png), expected)
    assert np.array_equal(uv.srgb8(widget._base.render(**widget.arguments())), expected)
    return expected


async def after(page, widget, action):
    """Runs an action of the pointer or a key; returns the pictures before and after it."""
    before = await at_rest(page, widget)
    count = await page.evaluate("model.get('_request').id")
    await action
    await page.until(f"model.get('_request').id !== {count!r}")
    return before, await at_rest(page, widget)


def in_page(browser, widget, scenario, **options):
    async def run():
        async with page_of(browser, widget, **options) as page:
            await scenario(page)

    asyncio.run(run())


def test_the_page_shows_the_scene(browser, widget):
    async def scenario(page):
        assert np.array_equal(await at_rest(page, widget), uv.srgb8(widget._base.render()))
        assert widget.arguments() == {}

    in_page(browser, widget, scenario)


def test_a_drag_turns_the_volume(browser, widget):
    async def scenario(page):
        x, y = await page.centre(".ux-stage")
        before, turned = await after(page, widget, page.drag((x, y), (x + 60, y + 20)))
        assert not np.array_equal(before, turned)
        # 0.4 degrees a pixel.
        assert widget.azimuth_deg == pytest.approx(widget._home["azimuth_deg"] - 24)
        assert widget.elevation_deg == pytest.approx(widget._home["elevation_deg"] + 8)
        dragged = [request["_request"] for request in page.requests if "_request" in request]
        assert any(request["drag"] for request in dragged) and not dragged[-1]["drag"]
        # As far as the pole, and not beyond.
        await after(page, widget, page.drag((x, y - 90), (x, y + 290)))
        assert widget.elevation_deg == 89

    in_page(browser, widget, scenario)


def test_one_finger_turns_and_two_zoom(browser, widget):
    async def scenario(page):
        await page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
        x, y = await page.centre(".ux-stage")
        before, turned = await after(page, widget, page.touch([(x + 20 * i, y + 5 * i) for i in range(4)]))
        assert not np.array_equal(before, turned)
        # 0.4 degrees a pixel.
        assert widget.azimuth_deg == pytest.approx(widget._home["azimuth_deg"] - 24)
        assert widget.elevation_deg == pytest.approx(widget._home["elevation_deg"] + 6)
        angles = widget.azimuth_deg, widget.elevation_deg
        # Fingers at twice their distance halve that of the camera.
        apart = [[(x + side * (30 + 10 * i), y) for i in range(4)] for side in (-1, 1)]
        _, near = await after(page, widget, page.touch(*apart))
        assert widget.distance == pytest.approx(0.5) and not np.array_equal(turned, near)
        assert (widget.azimuth_deg, widget.elevation_deg) == angles

    in_page(browser, widget, scenario)


def test_shift_and_drag_move_the_light(browser, widget):
    async def scenario(page):
        x, y = await page.centre(".ux-stage")
        before, lit = await after(page, widget, page.drag((x, y), (x - 80, y + 10), modifiers=SHIFT))
        assert not np.array_equal(before, lit)
        assert np.linalg.norm(widget.light_direction) == pytest.approx(1)
        assert list(widget.arguments()) == ["light"]

    in_page(browser, widget, scenario)


def test_wheel_and_keys(browser, widget):
    async def scenario(page):
        x, y = await page.centre(".ux-stage")
        before, near = await after(page, widget, page.mouse("mouseWheel", x, y, deltaX=0, deltaY=-240))
        assert widget.distance == pytest.approx(np.exp(-0.24)) and not np.array_equal(before, near)
        await page.evaluate("document.querySelector('.ux-stage').focus()")
        before, turned = await after(page, widget, page.key("ArrowRight"))
        assert widget.azimuth_deg == pytest.approx(widget._home["azimuth_deg"] - 5) and not np.array_equal(before, turned)
        light = widget.light_direction
        await after(page, widget, page.key("ArrowDown", modifiers=SHIFT))
        angle = np.degrees(np.arccos(np.dot(light, widget.light_direction)))
        assert 0 < angle <= 5.001
        await after(page, widget, page.key("Home"))
        assert widget.arguments() == {}

    in_page(browser, widget, scenario)


def test_opacity_points_are_dragged_added_and_removed(browser, widget):
    async def scenario(page):
        points, home = len(widget.opacity_points), widget.opacity_points
        # 450 HU: bone of the volume.
        x, y = await page.centre(".ux-handle", 2)
        before, dragged = await after(page, widget, page.drag((x, y), (x + 12, y - 20)))
        assert not np.array_equal(before, dragged)
        (value, amount), (old_value, old_amount) = widget.opacity_points[2], home[2]
        assert value > old_value and amount > old_amount
        assert [point for i, point in enumerate(widget.opacity_points) if i != 2] == [home[i] for i in (0, 1, 3, 4)]
        colors = {point["value"]: point["color"] for point in widget.scene.transfer_function()["points"]}
        assert all(colors[point["value"]] == point["color"] for point in widget._function["points"])
        # Left of all points, where the curve is at its start.
        x, y = await page.centre(".ux-curve")
        twice = [page.mouse(kind, x - 150, y, button="left", clickCount=n) for n in (1, 2) for kind in ("mousePressed", "mouseReleased")]
        _, added = await after(page, widget, all_of(twice))
        assert len(widget.opacity_points) == points + 1
        at = await page.centre(".ux-handle", widget.opacity_points.index(min(widget.opacity_points, key=lambda p: p[0])))
        right = [page.mouse(kind, *at, button="right", clickCount=1) for kind in ("mousePressed", "mouseReleased")]
        _, removed = await after(page, widget, all_of(right))
        assert len(widget.opacity_points) == points and not np.array_equal(added, removed)
        await page.evaluate("document.querySelectorAll('.ux-handle')[0].focus()")
        before, moved = await after(page, widget, all_of([page.key("ArrowUp") for _ in range(5)]))
        assert widget.opacity_points[0][1] > 0 and not np.array_equal(before, moved)

    in_page(browser, widget, scenario)


async def all_of(actions):
    for action in actions:
        await action


def test_only_the_newest_of_many_moves_is_drawn(browser, widget):
    async def scenario(page):
        x, y = await page.centre(".ux-stage")
        await at_rest(page, widget)
        count = len(page.requests)
        script = f"""(() => {{
            const stage = document.querySelector(".ux-stage");
            stage.setPointerCapture = () => {{}};
            const send = (kind, i) => stage.dispatchEvent(new PointerEvent(kind, {{clientX: {x} + i, clientY: {y}, bubbles: true}}));
            send("pointerdown", 0);
            for (let i = 1; i <= 100; i++) send("pointermove", i);
            send("pointerup", 100);
        }})()"""
        await after(page, widget, page.evaluate(script))
        # The first of them, and the last; all others came while the first was drawn.
        assert len(page.requests) - count == 2
        assert widget.azimuth_deg == pytest.approx(widget._home["azimuth_deg"] - 40)

    in_page(browser, widget, scenario)


def test_no_move_is_lost_while_pictures_are_drawn(browser, widget):
    async def scenario(page):
        x, y = await page.centre(".ux-stage")
        await at_rest(page, widget)
        count = len(page.requests)
        # The page moves by itself, so that states of the kernel arrive between two moves.
        script = f"""(async () => {{
            const stage = document.querySelector(".ux-stage");
            stage.setPointerCapture = () => {{}};
            const send = (kind, i) => stage.dispatchEvent(new PointerEvent(kind, {{clientX: {x} + i, clientY: {y}, bubbles: true}}));
            send("pointerdown", 0);
            for (let i = 1; i <= 100; i++) {{
                await new Promise((done) => setTimeout(done, 10));
                send("pointermove", i);
            }}
            send("pointerup", 100);
        }})()"""
        await after(page, widget, page.evaluate(script))
        assert 2 <= len(page.requests) - count < 100
        assert widget.azimuth_deg == pytest.approx(widget._home["azimuth_deg"] - 40)

    in_page(browser, widget, scenario)


def test_python_moves_the_page_and_errors_are_text(browser, widget):
    async def scenario(page):
        before = await at_rest(page, widget)
        widget.azimuth_deg += 40
        # The picture follows the state.
        await page.until("model.get('_answer').id === ''")
        assert await page.evaluate("model.get('azimuth_deg')") == widget.azimuth_deg
        turned = await at_rest(page, widget)
        assert not np.array_equal(before, turned)
        text = "document.querySelector('.ux-error')"
        assert await page.evaluate(f"{text}.hidden")
        good = widget.opacity_points
        widget.opacity_points = [[1e31, 0.1]]
        await page.until(f"!{text}.hidden")
        assert "too large for 32-bit" in await page.evaluate(f"{text}.textContent")
        widget.opacity_points = good
        await page.until(f"{text}.hidden")

    in_page(browser, widget, scenario)


def test_states_that_mean_nothing_are_refused(widget):
    import traitlets

    for name, wrong in [
        ("azimuth_deg", np.nan),
        ("distance", np.inf),
        ("light_direction", [0, 0, 0]),
        ("light_direction", [0, 1]),
        ("opacity_points", []),
        ("opacity_points", [[1, 2, 3]]),
        ("opacity_points", [[0, 1.5]]),
    ]:
        before = getattr(widget, name)
        with pytest.raises(traitlets.TraitError):
            setattr(widget, name, wrong)
        assert getattr(widget, name) == before
    widget.distance = 1e9
    assert widget.distance == 20


def test_a_page_cannot_set_what_is_hidden_and_gets_errors_of_its_state(widget):
    size, home = widget._size, widget._home
    widget.set_state({"_size": [100_000, 100_000], "_home": {}})
    assert (widget._size, widget._home) == (size, home)
    widget.set_state({"opacity_points": [], "_request": {"id": "page-1", "drag": True}})
    assert widget._answer["id"] == "page-1" and widget._error


@pytest.mark.parametrize("light", ["dir:0,1,1", "point:90,40,30,color=#ff8040,intensity=0.5"])
def test_the_state_is_the_scene(light, adapter):
    voxels, affine = small()
    scene = uv.Scene(voxels, affine, tf=FUNCTION, size=(40, 30), light=[light, "dir:1,0,0"], opacity_scale=2.0)
    widget = uv.Widget(scene)
    settings = widget.scene.settings()
    assert {**settings, "tf": scene.transfer_function()} == {**scene.settings(), "tf": scene.transfer_function()}
    # The same points one by one are the same function: colours, jumps, and the factor that the scene has.
    widget.opacity_points = [*widget.opacity_points, [300, 0.01]]
    np.testing.assert_allclose(widget.scene.render(), scene.render(), atol=1e-6)
    widget.opacity_points = widget.opacity_points[:-1]
    widget.light_direction = (0, 0, 1)
    first, second = widget.scene.settings()["light"]
    assert second == "dir:1.0,0.0,0.0" and first.split(",")[3:] == light.split(",")[3:]
    if light.startswith("point"):
        place = np.array([float(x) for x in first[6:].split(",")[:3]])
        target = np.array(scene.camera()["target"])
        np.testing.assert_allclose(place - target, [0, 0, np.linalg.norm(np.array([90, 40, 30]) - target)], atol=1e-9)
    else:
        assert first.startswith("dir:0.0,0.0,1.0")


def test_without_anywidget_it_says_what_to_install():
    code = "import sys; sys.modules['anywidget'] = None\nimport umbravox as uv\nuv.Widget"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert told.returncode == 1 and "ImportError: umbravox.Widget needs anywidget: pip install" in told.stderr.splitlines()[-1]
    assert not hasattr(uv, "Widgets")
