"""Moves a tool of the scene press by a SpaceMouse: space_mouse_client.py ADDRESS. The device is space_mouse.js. Ends the
run. Ends with 0 if the page behaves as it should, with 77 and a text if this machine cannot show it."""
import asyncio
import math
import os
import sys
import time

from browser import LIMIT_S, stops, visit

FULL = 350
SHIFT_M, TURN_RAD = 0.01, 0.15  # what a motion is followed for
RIGHT, NEAR, DOWN = range(3)  # axes of the cap
# From above, right is x, up is y and away is -z: which axis of the scene belongs to an axis of the cap, and its sign.
OF_THE_SCENE = {RIGHT: (0, 1), NEAR: (2, 1), DOWN: (1, -1)}


async def do(page, order):
    return await page.value(f"spaceMouse.{order}")


async def tool(page):
    return (await page.state())["tool"]


async def poses(page, count):
    """Waits until the page has sent so many more poses."""
    sent = (await tool(page))["sent"]
    return (await page.until("poses", lambda s: s["tool"]["sent"] >= sent + count))["tool"]


async def rests(page, what):
    """The tool has stopped; its offset."""
    before = await poses(page, 2)
    after = await poses(page, 4)
    assert after["offset"] == before["offset"] and after["orientation"] == before["orientation"], (what, before, after)
    return after["offset"]


async def moves(page, what, axis, sign, start):
    """The tool moves along one axis of the scene, and along no other."""
    tool_ = (await page.until(what, lambda s: sign * (s["tool"]["offset"][axis] - start[axis]) > SHIFT_M))["tool"]
    way = [now - then for now, then in zip(tool_["offset"], start)]
    assert all(abs(part) < 0.02 * abs(way[axis]) for i, part in enumerate(way) if i != axis), (what, way)


async def deflected(page, values, report=1):
    await do(page, f"hold({report}, {values})")


def only(axis, value):
    return [value if i == axis else 0 for i in range(3)]


async def said(page, text):
    end, shown = time.monotonic() + LIMIT_S, ""
    while text not in shown:
        assert time.monotonic() < end, (text, shown)
        await asyncio.sleep(0.05)
        shown = await page.value("document.querySelector('#tools .device').textContent")


async def chooser(page):
    """Whether the button is offered."""
    return await page.value("document.querySelector('#tools .chooser').checkVisibility()")


async def takes(page):
    await page.click("#tools .row button")
    await page.until("the tool", lambda s: s["tool"]["holds"] and s["tool"]["sent"] > 3)
    await page.key("2")  # from above
    frames = (await page.state())["frames"]
    await page.until("the camera", lambda s: s["frames"] > frames + 2)


async def is_chosen(page):
    """By its button only, and not where the user declines or the browser has no rights."""
    assert await chooser(page)
    await page.click("#tools .chooser")
    await said(page, "No SpaceMouse was chosen")
    assert {(one["vendorId"], one["usagePage"], one["usage"]) for one in await do(page, "filters")} == {
        (0x256F, 1, 8), (0x046D, 1, 8)}
    await page.value("spaceMouse.choice = spaceMouse.cap.refuses = true")
    await page.click("#tools .chooser")
    await said(page, "cannot be opened: Failed to open the device")
    assert await chooser(page)
    await page.value("spaceMouse.cap.refuses = false")
    await page.click("#tools .chooser")
    await said(page, "SpaceMouse Compact moves the tool")
    assert not await chooser(page)
    assert await page.value("document.activeElement.id") == "view", "keys are for the tool"


async def shifts(page):
    """Along each axis, both ways, with a speed that follows the deflection."""
    start = await rests(page, "before any report")
    for axis, (of_the_scene, sign) in OF_THE_SCENE.items():
        for way in (1, -1):
            await deflected(page, only(axis, way * FULL))
            await moves(page, f"axis {axis}, {way}", of_the_scene, way * sign, start)
            await do(page, "centre()")
            start = await rests(page, f"centred after axis {axis}")
    await deflected(page, [30, -30, 30])
    assert await rests(page, "in the dead zone") == start
    # A report of newer models holds the turn as well.
    await deflected(page, [0, 0, 0, 0, 0, FULL])
    await turns_about(page, (0, 0, -1), (0, -1, 0))
    assert (await tool(page))["offset"] == start
    await do(page, "centre()")
    await rests(page, "centred after a turn")


async def turns_about(page, cap_axis, axis):
    """The tool turns about an axis of the scene, right-handed, from the orientation that it has."""
    before = (await tool(page))["orientation"]

    def turn(after):
        """after = turn * before, as a vector."""
        ax, ay, az, aw = after
        bx, by, bz, bw = (-before[0], -before[1], -before[2], before[3])
        w = aw * bw - ax * bx - ay * by - az * bz
        vector = (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
                  aw * bz + ax * by - ay * bx + az * bw)
        return [2 * math.copysign(1, w) * part for part in vector]

    state = await page.until(cap_axis, lambda s: math.hypot(*turn(s["tool"]["orientation"])) > TURN_RAD)
    vector = turn(state["tool"]["orientation"])
    along = sum(part * way for part, way in zip(vector, axis))
    assert along > 0.98 * math.hypot(*vector), (cap_axis, vector)


async def turns(page):
    """By the second report of older models."""
    start = await rests(page, "before a turn")
    for axis, (of_the_scene, sign) in OF_THE_SCENE.items():
        await deflected(page, only(axis, FULL), report=2)
        await turns_about(page, axis, only(of_the_scene, sign))
        await do(page, "centre()")
        assert await rests(page, "centred after a turn") == start


async def speed(page, values):
    """Metres a second of the page's clock, along x."""
    await deflected(page, values)
    await poses(page, 2)
    at = []
    for _ in range(2):
        at.append(await page.value("[performance.now() / 1000, subworld().tool.offset[0]]"))
        await poses(page, 10)
    await do(page, "centre()")
    await rests(page, "centred")
    return abs(at[1][1] - at[0][1]) / (at[1][0] - at[0][0])


async def is_checked(page):
    """Wrong reports move nothing, large numbers do not move faster, half a deflection moves slower."""
    full = await speed(page, [-FULL, 0, 0])
    assert 0.6 < await speed(page, [32767, 0, 0]) / full < 1.6
    half = await speed(page, [-FULL / 2, 0, 0])
    assert 0.25 < half / full < 0.65, (half, full)
    start = await rests(page, "before wrong reports")
    for id_, count in ((1, 0), (1, 5), (2, 5), (0, 12), (4, 12), (23, 12), (3, 0)):
        await do(page, f"bytes({id_}, Array({count}).fill(100))")
    assert await rests(page, "wrong reports") == start
    assert (await tool(page))["holds"]


async def is_no_gamepad(page):
    """Where the browser offers it as a gamepad too, it counts once. Other gamepads count."""
    start = await rests(page, "before the pad")
    for name in ("SpaceMouse (Vendor: 256f Product: c635)", "046d-c626-SpaceNavigator"):
        await page.value(f"spaceMouse.pad.id = {name!r}, spaceMouse.pad.axes.fill(1)")
        assert await rests(page, name) == start
    await page.value("spaceMouse.pad.axes = [0, -1, 0, 0], spaceMouse.pad.id = 'Pad (Vendor: 046d Product: c21d)'")
    await moves(page, "the stick", 1, 1, start)
    await page.value("spaceMouse.pad.axes = [0, 0, 0, 0]")
    await rests(page, "the stick is released")


async def is_lost(page):
    """Unplugged while deflected, or out of reach: the tool stops, and does not jump when the device returns."""
    await deflected(page, [-FULL, 0, 0])
    await poses(page, 3)
    await do(page, "plug('disconnect')")
    await said(page, "was unplugged")
    start = await rests(page, "unplugged")
    assert await chooser(page)
    await do(page, "stopReports()")
    await do(page, "plug('connect')")
    await said(page, "moves the tool")
    assert await rests(page, "plugged in") == start
    await deflected(page, [FULL, 0, 0])
    await moves(page, "again", 0, 1, start)
    await do(page, "stopReports()")
    end = await page.value("performance.now() + 1000")
    while await page.value("performance.now()") < end:
        await poses(page, 1)
    await rests(page, "silent")


async def takes_and_releases(page):
    for _ in range(2):
        await do(page, "press(1)")
        await page.until("released", lambda s: s["tool"]["user"] == -1)
        await do(page, "press(2)")
        await asyncio.sleep(0.2)
        assert (await tool(page))["user"] == -1, "another button"
        await do(page, "press(1)")
        await page.until("taken", lambda s: s["tool"]["holds"])
        await do(page, "press(0)")
        await asyncio.sleep(0.2)


async def is_remembered(page):
    """The page finds it again by itself, and opens no other device."""
    await page.call("Page.reload")
    await page.until("the page again", lambda s: s["tool"]["offered"] == 1 and s["frames"] > 0 and s["tool"]["user"] == -1)
    await takes(page)
    assert not await chooser(page)
    await deflected(page, only(RIGHT, -FULL))
    await moves(page, "after a reload", 0, -1, [0, 0, 0])
    await do(page, "centre()")
    await rests(page, "after a reload")
    assert not any(await page.value("spaceMouse.others.map((one) => one.opened)"))


async def look(page):
    await page.until("a tool", lambda s: s["tool"]["offered"] == 1 and s["frames"] > 0 and s["time_s"] > 0.5)
    await takes(page)
    for act in (is_chosen, shifts, turns, is_checked, is_no_gamepad, is_lost, takes_and_releases, is_remembered):
        await act(page)
    assert not page.errors, page.errors
    await stops(page)


with open(os.path.join(os.path.dirname(__file__), "space_mouse.js")) as file:
    sys.exit(asyncio.run(visit(sys.argv[1], 920, 480, look, file.read())))
