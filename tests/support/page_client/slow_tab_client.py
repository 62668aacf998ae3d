"""A tab that stands still while its operator presses the cube of the scene press: slow_tab_client.py ADDRESS. Halts the renderers
of the browser for three seconds of simulated time, lets them go on, takes the tool again, and ends the run. Prints the
simulated times at both moments. Ends with 0, or with 77 and a text if this machine cannot show a page."""
import asyncio
import json
import os
import signal
import sys
import time

from browser import LIMIT_S, stops, visit

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "live_client"))
from viewer import Viewer  # noqa: E402

HALTED_S = 3.0
# An operator in the tab itself: presses along x with about 12 N, and sways along y all the time.
OPERATOR = """navigator.getGamepads = () => [{ id: "operator", connected: true, buttons: [],
  axes: [subworld().tool.force.x > -12 ? 0.3 : 0, Math.sin(performance.now() / 150), 0, 0] }], 0"""


def renderers(browser):
    """The processes of a browser that run its tabs."""
    parents, kinds = {}, {}
    for pid in map(int, filter(str.isdigit, os.listdir("/proc"))):
        try:
            with open(f"/proc/{pid}/stat") as file:
                parents[pid] = int(file.read().rpartition(")")[2].split()[1])
            with open(f"/proc/{pid}/cmdline") as file:
                kinds[pid] = "--type=renderer" in file.read()
        except OSError:
            continue  # it has ended

    def is_of_the_browser(pid):
        while pid in parents and pid != browser:
            pid = parents[pid]
        return pid == browser

    return [pid for pid, renders in kinds.items() if renders and is_of_the_browser(pid)]


class Clock:
    """The simulated time, as another viewer has it."""

    def __init__(self, viewer):
        self.viewer, self.now_s = viewer, 0.0
        self.reader = asyncio.ensure_future(self.read())

    @staticmethod
    async def open(page_address):
        viewer = await Viewer.open(page_address.replace("http://", "ws://"))
        await viewer.subscribe("/world_state")
        return Clock(viewer)

    async def read(self):
        while True:
            sample = await self.viewer.receive()
            if sample:
                self.now_s = sample[2]["stamp_s"]

    async def passes(self, time_s):
        """Waits until the clock has advanced so far, and returns it."""
        end_s = self.now_s + time_s
        while self.now_s < end_s:
            assert not self.reader.done(), self.reader.exception()
            await asyncio.sleep(0.01)
        return self.now_s

    async def close(self):
        self.reader.cancel()
        await self.viewer.socket.close()


async def takes(page):
    """As soon as the button offers it: the server answers to a release, too."""
    end = time.monotonic() + LIMIT_S
    while await page.value("document.querySelector('#tools .row button').disabled"):
        assert time.monotonic() < end, await page.state()
        await asyncio.sleep(0.05)
    await page.click("#tools .row button")
    await page.until("the tool", lambda s: s["tool"]["holds"])


async def presses(page):
    await page.until("the force", lambda s: s["tool"]["holds"] and s["tool"]["force"]["x"] < -8)


async def look(page):
    await page.until("a tool", lambda s: s["tool"]["offered"] == 1 and s["frames"] > 0 and s["time_s"] > 0.5)
    clock = await Clock.open(sys.argv[1])
    await page.key("2")  # from above: right is x, up is y
    await takes(page)
    await page.value(OPERATOR)
    await presses(page)
    await clock.passes(1.0)
    halted = renderers(page.process.pid)
    assert halted, "no renderer"
    halted_s = await clock.passes(0.01)
    try:
        for pid in halted:
            os.kill(pid, signal.SIGSTOP)
        resumed_s = await clock.passes(HALTED_S)
    finally:
        for pid in halted:
            os.kill(pid, signal.SIGCONT)
    print(json.dumps({"halted_s": halted_s, "resumed_s": resumed_s}))
    # Its operator goes on as if nothing had happened, releases the tool, and takes it by the button.
    await presses(page)
    await page.key("Escape")
    await page.until("released", lambda s: s["tool"]["user"] == -1)
    await takes(page)
    await presses(page)
    await clock.close()
    assert not page.errors, page.errors
    await stops(page)


sys.exit(asyncio.run(visit(sys.argv[1], 920, 480, look)))
