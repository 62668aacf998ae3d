"""Touches the world of a run of the scene press on the screen of a phone, below a sub-path of a proxy: phone_client.py ADDRESS
FOLDER. Ends the run. Ends with 0 if the page behaves as it should, with 77 and a text if this machine cannot show it."""
import asyncio
import contextlib
import math
import re
import socket
import sys
import threading

from browser import stops, visit

PATH = b"/runs/press"
FORCE = "document.querySelector('[data-plot=force] .u-series:last-child .u-value')?.textContent ?? ''"


async def proxy(address, listener):
    """Passes requests below PATH on, as nginx does: with its own name for the server."""
    host, port = re.fullmatch(r"http://([^:/]+):(\d+)/", address).groups()

    async def copy(reader, writer):
        try:
            while part := await reader.read(65536):
                writer.write(part)
                await writer.drain()
        except ConnectionError:
            pass
        writer.close()

    async def serve(reader, writer):
        with contextlib.suppress(OSError, asyncio.IncompleteReadError):  # as where the display is yet to come
            head = await reader.readuntil(b"\r\n\r\n")
            inner_reader, inner = await asyncio.open_connection(host, int(port))
            asked = re.search(rb"\r\nHost: ([^\r]+)", head)[1]
            assert PATH + b"/" in head.split(b"\r\n")[0], head
            head = head.replace(PATH, b"", 1).replace(b"Host: " + asked, f"Host: {host}:{port}".encode(), 1)
            inner.write(head[:-2] + b"X-Forwarded-Host: " + asked + b"\r\n\r\n")
            asyncio.ensure_future(copy(reader, inner))
            await copy(inner_reader, writer)
        writer.close()

    await (await asyncio.start_server(serve, sock=listener)).serve_forever()


async def box(page, selector):
    """Left, top, right and bottom of an element."""
    return await page.value(f"(() => {{ const r = document.querySelector('{selector}').getBoundingClientRect();"
                            " return [r.left, r.top, r.right, r.bottom]; })()")


async def presses(page):
    await page.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight", code="ArrowRight")
    await page.until("it presses", lambda s: s["tool"]["force"]["x"] < -12)
    await page.call("Input.dispatchKeyEvent", type="keyUp", key="ArrowRight", code="ArrowRight")


async def covers_nothing(page):
    tools, view = await box(page, "#tools"), await box(page, "#view")
    assert tools[1] >= view[3] - 1 and tools[3] <= 844, (tools, view)
    note = await box(page, "#tools .note")
    assert note[2] - note[0] > 200 and note[3] - note[1] > 10, f"the instructions vanish: {note}"


async def shows_force(page):
    """The arrow of a force has its value. After the release, the force is zero."""
    for _ in range(12):
        await page.key("+")
    near = "document.querySelector('.value-of-arrow')?.textContent ?? ''"
    # A busy machine draws the camera's way late, and where it halts the page, the force is off until the tool presses anew.
    for _ in range(100):
        shown = await page.value(FORCE)
        force = float(shown.split()[0]) if shown else math.inf
        if math.inf > force > 5 and re.fullmatch(r"\d+\.\d N", await page.value(near)):
            break
        if force < 5:
            await presses(page)
        await asyncio.sleep(0.1)
    else:
        assert False, (force, await page.value(near), await page.state())
    await page.key("Escape")
    time_s = (await page.until("released", lambda s: s["tool"]["user"] == -1))["time_s"]
    await page.until("a second later", lambda s: s["time_s"] > time_s + 1.0)
    assert float((await page.value(FORCE)).split()[0]) < 0.1, await page.value(FORCE)
    assert await page.value(near) == "", await page.value(near)


async def look(page):
    await page.until("a tool", lambda s: s["tool"]["offered"] == 1 and s["frames"] > 0 and s["time_s"] > 0.5)
    await page.click("#tools .row button")
    await page.until("the tool", lambda s: s["tool"]["holds"])
    await presses(page)
    await covers_nothing(page)
    await shows_force(page)
    assert not page.errors, page.errors
    await stops(page)


listener = socket.create_server(("127.0.0.1", 0))
threading.Thread(target=asyncio.run, args=(proxy(sys.argv[1], listener),), daemon=True).start()
sys.exit(asyncio.run(visit(f"http://127.0.0.1:{listener.getsockname()[1]}{PATH.decode()}/", 390, 844, look)))
