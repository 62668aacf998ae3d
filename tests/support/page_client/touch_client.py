"""Touches the world of a run of the scene press as a person does: touch_client.py ADDRESS FOLDER. Takes the tool, presses the cube
with the mouse, and moves the tool by touch and keys. Writes pictures to the folder, and ends the run. Ends with 0 if the
page behaves as it should, with 77 and a text if this machine cannot show it."""
import asyncio
import sys
import time

from browser import LIMIT_S, stops, visit

FRAME_S = 1 / 60
SHIFT = 8


async def middle(page):
    return await page.value("(() => { const r = document.getElementById('view').getBoundingClientRect();"
                            " return [r.x + r.width / 2, r.y + r.height / 2]; })()")


async def drag_until(page, pointer, step, condition):
    """Moves the pressed pointer right (`step` > 0) or left in steps, in pixels, until the page's state fulfils a condition."""
    end = time.monotonic() + LIMIT_S
    while not condition(await page.state()):
        assert time.monotonic() < end, await page.state()
        pointer[0] += step
        await page.mouse("Moved", *pointer)
        await asyncio.sleep(FRAME_S)


async def presses(page, folder):
    """With the mouse: the cube against the wall, and back."""
    await page.click("#tools .row button")
    await page.until("the tool", lambda s: s["tool"]["holds"] and s["tool"]["sent"] > 3)
    assert "Release" in await page.value("document.querySelector('#tools .row button').textContent")
    await page.key("2")  # from above: right is x
    frames = (await page.state())["frames"]
    await page.until("the camera", lambda s: s["frames"] > frames + 2)
    pointer = await middle(page)
    await page.mouse("Pressed", *pointer)
    await drag_until(page, pointer, 1.5, lambda s: s["tool"]["force"]["x"] < -15)
    await asyncio.sleep(0.3)
    assert (await page.value("document.querySelector('#tools .value').textContent")).endswith(" N")
    for theme in ("dark", "light"):
        await page.theme(theme)
        await asyncio.sleep(0.5)
        await page.picture(f"{folder}/touch_{theme}.png")
    await drag_until(page, pointer, -1.5, lambda s: s["tool"]["offset"][0] <= 0)
    await page.mouse("Released", *pointer)
    await page.until("no force", lambda s: abs(s["tool"]["force"]["x"]) < 2)


async def until_moved(page, what, act, condition):
    """Acts again and again, until the tool is displaced so from where it was: a slow page may miss a single event."""
    before = (await page.state())["tool"]["offset"]
    end = time.monotonic() + LIMIT_S
    while not condition([now - then for now, then in zip((await page.state())["tool"]["offset"], before)]):
        assert time.monotonic() < end, (what, await page.state())
        await act()
        await asyncio.sleep(0.2)


async def moves(page):
    """Depth, keys and a finger."""
    pointer = await middle(page)
    await page.mouse("Pressed", *pointer)
    await until_moved(page, "away by the wheel", lambda: page.mouse("Wheel", *pointer, deltaX=0, deltaY=-100),
                      lambda way: way[2] < -1e-3)

    async def push():
        pointer[1] -= 4
        await page.mouse("Moved", *pointer, modifiers=SHIFT)

    await until_moved(page, "away by Shift", push, lambda way: way[2] < -1e-3)
    await page.mouse("Released", *pointer)
    before = (await page.state())["tool"]["offset"]
    await page.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowUp", code="ArrowUp")
    await page.until("along y by a key", lambda s: s["tool"]["offset"][1] > before[1] + 0.01)
    await page.call("Input.dispatchKeyEvent", type="keyUp", key="ArrowUp", code="ArrowUp")
    before = (await page.state())["tool"]["offset"]
    x, y = pointer
    await page.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    for i in range(1, 8):
        await page.call("Input.dispatchTouchEvent", type="touchMove", touchPoints=[{"x": x - 5 * i, "y": y}])
        await asyncio.sleep(FRAME_S)
    await page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    await page.until("left by a finger", lambda s: s["tool"]["offset"][0] < before[0] - 1e-3)


async def releases(page):
    await page.key("Escape")
    state = await page.until("released", lambda s: s["tool"]["user"] == -1)
    sent = state["tool"]["sent"]
    await asyncio.sleep(0.3)
    assert (await page.state())["tool"]["sent"] == sent, "it sends poses of a tool that it does not hold"
    assert "Take" in await page.value("document.querySelector('#tools .row button').textContent")


async def look(page):  # it is drawn without a graphics card: fewer pixels than usual
    await page.until("a tool", lambda s: s["tool"]["offered"] == 1 and s["frames"] > 0 and s["time_s"] > 0.5)
    await presses(page, sys.argv[2])
    await moves(page)
    await releases(page)
    assert not page.errors, page.errors
    await stops(page)


sys.exit(asyncio.run(visit(sys.argv[1], 920, 480, look)))
