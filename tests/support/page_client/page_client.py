"""Looks at the page of a run as a user does: page_client.py ADDRESS FOLDER, with the folder of the run's results. The
run goes on until the page stops it. Ends with 0 if the page behaves as it should, with
77 and a text if this machine cannot show it."""
import asyncio
import os
import signal
import struct
import subprocess
import sys
import time
import zlib

from browser import LIMIT_S, visit

EXPECTED = ("WebSocket connection to", "net::ERR_CONNECTION")  # while the display is away


def displays(folder):
    """The processes of this run's display."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                words = file.read().decode().split("\0")
        except OSError:
            continue
        if words[0].endswith("gui_headless") and folder in words:
            found.append(int(pid))
    return found


def colours_of(png):
    """The number of different pixels of a PNG with 8 bits a channel: few of them are an empty page."""
    at, data, channels = 8, b"", 0
    while at < len(png):
        size, kind = struct.unpack_from(">I4s", png, at)
        if kind == b"IHDR":
            width, _, depth, colour = struct.unpack_from(">IIBB", png, at + 8)
            assert depth == 8 and colour in (2, 6)
            channels = 3 if colour == 2 else 4
        if kind == b"IDAT":
            data += png[at + 8:at + 8 + size]
        at += 12 + size
    raw, row = zlib.decompress(data), 1 + width * channels
    return len({raw[i:i + channels] for start in range(0, len(raw), row) for i in range(start + 1, start + row, channels)})


async def stands(page):
    """The world's time does not advance: the last snapshots of a paused world have arrived once two readings agree."""
    end = time.monotonic() + LIMIT_S
    while True:
        before = (await page.state())["time_s"]
        await asyncio.sleep(0.5)
        if (await page.state())["time_s"] == before:
            return before
        assert time.monotonic() < end, "the world goes on"


async def draws(page):
    state = await page.until("the scene", lambda s: s["bodies"] > 250 and s["users"] == 1 and s["frames"] > 0)
    frames, points, time_s = state["frames"], state["points"], state["time_s"]
    await page.until("frames advance", lambda s: s["frames"] > frames + 3)
    await page.until("figures grow", lambda s: s["points"] > points + 3 and s["time_s"] > time_s)
    await page.until("the device beside its proxy", lambda s: s["devices"] == 1)
    await page.until("all programs", lambda s: s["programs"] == 4)
    assert colours_of(await page.picture()) > 500, "the picture is empty"
    assert await page.value("document.querySelectorAll('.uplot').length") >= 3
    wanted = ("World", "Fast DDS", os.uname().nodename, "deadline", "1 ms", "4 ms to 8 ms")
    end, cards = time.monotonic() + LIMIT_S, ""
    while not all(text in cards for text in wanted):
        assert time.monotonic() < end, cards
        cards = await page.value("document.getElementById('programs').innerText")


async def obeys(page):
    await page.click("#pause")
    await page.until("paused", lambda s: s["paused"] and s["answers"] > 0)
    time_s = await stands(page)
    answers = (await page.state())["answers"]
    frames = (await page.state())["frames"]
    await page.key("2")  # another camera draws anew, and moves no body
    await page.until("a frame of a world at rest", lambda s: s["frames"] > frames and s["placed"] == 0)
    await page.key("0")
    await page.click("#step")
    await page.until("a step", lambda s: s["answers"] > answers and s["time_s"] > time_s)
    assert await stands(page) - time_s < 0.1, "one cycle only"
    time_s = (await page.state())["time_s"]
    await page.value("document.activeElement.blur()")
    await page.key(" ", "Space")
    await page.until("resumed", lambda s: not s["paused"] and s["time_s"] > time_s + 0.2)
    await page.value("document.querySelector('#engine button').scrollIntoView()")
    await page.click("#engine button")
    await answered(page, "bullet")
    await page.value("document.querySelector('#ratio input').value = '5-8', document.getElementById('ratio').requestSubmit()")
    await answered(page, "ratio 5-8")


async def answered(page, text):
    """Waits until an answer has this text. An order may have several answers."""
    end, list_of = time.monotonic() + LIMIT_S, ""
    while text not in list_of:
        assert time.monotonic() < end, (text, list_of)
        list_of = await page.value("document.getElementById('answers').textContent")


async def finds(page):
    """A body by its name, and by a click in the view."""
    await page.value("document.getElementById('name').value = 'cube', document.getElementById('find').requestSubmit()")
    card = await page.value("document.getElementById('card').innerText")
    assert "0.2 kg" in card and "cube" in card, card
    await page.key("Escape")
    assert await page.value("document.getElementById('card').hidden")
    await page.key("2")  # from above: bodies are in the middle
    await page.until("a frame", lambda s: s["frames"] > 0)
    x, y = await page.value("(() => { const r = document.getElementById('view').getBoundingClientRect();"
                            " return [r.x + r.width / 2, r.y + r.height / 2]; })()")
    frames = (await page.state())["frames"]
    await page.until("the camera", lambda s: s["frames"] > frames + 2)
    await page.click_at(x, y)
    card = await page.value("document.getElementById('card').innerText")
    assert "mass" in card, card
    await page.key("0")


async def returns(page, folder):
    """A display that stands still shows at once; after its death the page finds the next one. Returns that."""
    [display] = displays(folder)
    with open(f"/proc/{display}/cmdline", "rb") as file:
        words = file.read().decode().split("\0")[:-1]
    os.kill(display, signal.SIGSTOP)
    try:
        await page.until("frozen", lambda s: s["link"] == "frozen")
        assert await page.value("!document.getElementById('banner').hidden")
    finally:
        os.kill(display, signal.SIGKILL)
    await page.until("lost", lambda s: s["link"] == "lost")
    with open(f"{folder}/logs/gui_headless.log", "ab") as log:
        follower = subprocess.Popen(words, stdout=log, stderr=log)
    state = await page.until("connected again", lambda s: s["link"] == "live" and s["time_s"] > 0)
    await page.until("the world again", lambda s: s["time_s"] > state["time_s"] + 0.3 and s["points"] > 3)
    assert await page.value("document.getElementById('banner').hidden")
    return follower


async def ends(page):
    await page.click("#stop")
    assert (await page.state())["link"] == "live", "the first press asks"
    await page.click("#stop")
    await page.until("ended", lambda s: s["link"] == "ended")
    assert "has ended" in await page.value("document.getElementById('banner').textContent")


async def look(page):
    await draws(page)
    await obeys(page)
    await finds(page)
    assert not page.errors, page.errors
    follower = await returns(page, sys.argv[2])
    await ends(page)
    assert follower.wait(LIMIT_S) == 0
    errors = [one for one in page.errors if not any(known in one for known in EXPECTED)]
    assert not errors, errors


sys.exit(asyncio.run(visit(sys.argv[1], 1000, 640, look)))
