"""Looks at the page of a paused replay as a user does: replay_client.py ADDRESS LENGTH, with the length of the recording
in seconds, from t = 0. Stops the replay at the end. Ends with 0 if the page behaves as it should, with 77 and a text if
this machine cannot show it."""
import asyncio
import sys
import time

from browser import stops, visit

NEAR_S = 0.1  # snapshots are 1/30 s apart


async def at(page, time_s):
    return await page.until(f"t = {time_s}", lambda s: abs(s["time_s"] - time_s) < NEAR_S)


async def shown(page, name):
    return await page.value(f"document.getElementById('{name}').textContent")


async def begins(page, length_s):
    await page.until("the scene", lambda s: s["bodies"] > 3 and s["frames"] > 0)
    await page.until("a snapshot for a viewer that has come late", lambda s: s["paused"] and s["placed"] == 0)
    assert await page.value("!document.getElementById('replay').hidden"), "the page does not notice the replay"
    most = float(await page.value("document.getElementById('moment').max"))
    assert abs(most - length_s) < NEAR_S, most
    assert await page.value("getComputedStyle(document.getElementById('engine')).display") == "none"
    await page.until("both joints", lambda s: s["joints"] == 2)
    assert await page.value("!document.getElementById('jointLayer').hidden"), "the legend has no joints"


async def plays(page):
    await page.click("#play")
    await page.until("it plays", lambda s: not s["paused"] and s["time_s"] > 0.3)
    await page.click("#play")
    await page.until("it is paused", lambda s: s["paused"])
    await asyncio.sleep(0.5)
    state = await page.state()
    await page.click("#stepReplay")
    after = await page.until("a step", lambda s: s["time_s"] > state["time_s"])
    assert after["paused"] and after["time_s"] < state["time_s"] + NEAR_S, (state, after)


async def moves(page, length_s):
    left, right, y = await page.value("(() => { const r = document.getElementById('moment').getBoundingClientRect();"
                                      " return [r.x + 8, r.right - 8, r.y + r.height / 2]; })()")
    point = lambda share: (left + share * (right - left), y)
    answers = (await page.state())["answers"]
    await page.drag(point(0.1), *(point(0.1 + 0.02 * i) for i in range(36)))
    await at(page, 0.8 * length_s)
    await page.until("one has broken", lambda s: s["joints"] == 1)
    state = await page.state()
    assert state["paused"], "a paused replay stays paused"
    assert state["answers"] - answers <= 37, state
    assert f"of {length_s:.2f} s" in await shown(page, "momentText")
    await page.drag(point(0.9), point(0.3))  # backwards
    await at(page, 0.3 * length_s)
    before_s = float(await page.value("document.getElementById('moment').value"))
    await page.key("ArrowRight")
    await at(page, before_s + 0.01 * length_s)
    await page.key("PageUp")
    await at(page, before_s + 0.11 * length_s)
    await page.key("Home")
    await at(page, 0.0)
    await page.until("it has not broken yet", lambda s: s["joints"] == 2)


async def times(page, length_s):
    """From the order to the picture, ms; printed, and no verdict."""
    spans = []
    for share in (0.93, 0.07, 0.99, 0.61, 0.32):
        begin = time.monotonic()
        await page.value(f"(() => {{ const m = document.getElementById('moment'); m.value = {share * length_s};"
                         " m.dispatchEvent(new Event('input')); m.dispatchEvent(new Event('change')); })()")
        while abs((await page.state())["time_s"] - share * length_s) > NEAR_S:
            assert time.monotonic() < begin + 60, "it does not arrive"
            await asyncio.sleep(0.005)
        spans.append(1e3 * (time.monotonic() - begin))
    print("seek, ms:", *(round(one) for one in spans))


async def hurries(page, length_s):
    await page.value("(() => { const s = document.getElementById('speed'); s.value = '2';"
                     " s.dispatchEvent(new Event('change')); })()")
    await page.until("an answer", lambda s: s["answers"] > 0)
    end = time.monotonic() + 60
    while "speed 2" not in await shown(page, "answers"):
        assert time.monotonic() < end, "no answer"
        await asyncio.sleep(0.1)
    await page.value("document.getElementById('moment').focus()")
    await page.key("End")
    await at(page, length_s)
    await page.click("#play")  # at the end: from the beginning
    await page.until("its beginning", lambda s: s["time_s"] < 0.9 * length_s)
    await page.until("its end", lambda s: s["paused"] and s["time_s"] > length_s - NEAR_S)


async def look(page):
    length_s = float(sys.argv[2])
    await begins(page, length_s)
    await plays(page)
    await moves(page, length_s)
    await times(page, length_s)
    await hurries(page, length_s)
    assert not page.errors, page.errors
    await stops(page)


sys.exit(asyncio.run(visit(sys.argv[1], 1000, 640, look)))
