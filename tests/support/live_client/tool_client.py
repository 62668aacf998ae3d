"""Pages that hold tools, without a browser: tool_client.py CASE ADDRESS. Ends with 0 if the server behaves as it should."""
import asyncio
import math
import struct
import sys
import time

import websockets

from viewer import LIMIT_S, PROTOCOLS, Viewer

CHANNEL = 7  # of a tool, by this client
RATE_HZ = 60


def pose_of(position=(0, 0, 0), orientation=(1, 0, 0, 0), buttons=0, held=True):
    """A subworld::msg::ToolPose."""
    return b"\0\1\0\0" + struct.pack("<7dI?", *position, *orientation, buttons, held)


class Page:
    """A connection that may hold the tool of one user. Its samples are the newest of each topic."""

    def __init__(self, viewer, user):
        self.viewer, self.user, self.newest = viewer, user, {}
        self.number = int(viewer.info["metadata"]["connection"])

    @staticmethod
    async def open(address, user=0, topics=("/tools", "/user_0/device_state")):
        page = Page(await Viewer.open(address), user)
        await page.viewer.subscribe(*topics)
        await page.viewer.send(op="advertise", channels=[{"id": CHANNEL, "topic": f"/user_{user}/tool", "encoding": "cdr"}])
        return page

    async def read(self):
        while True:
            sample = await self.viewer.receive()
            if sample:
                self.newest[sample[0]] = sample[2]

    async def send(self, cdr):
        await self.viewer.socket.send(struct.pack("<BI", 1, CHANNEL) + cdr)

    async def holder(self):
        """Waits for the next state of the tools; the connection that holds this one, None where it is not offered."""
        while True:
            sample = await self.viewer.receive()
            if sample and sample[0] == "/tools":
                return {one["user"]: one["holder"] for one in sample[2]["tools"]}.get(self.user)

    async def until_holder(self, wanted):
        end = time.monotonic() + LIMIT_S
        while await self.holder() != wanted:
            assert time.monotonic() < end, wanted

    async def refusal(self, cdr):
        self.viewer.statuses.clear()
        await self.send(cdr)
        return await refusal_of(self.viewer)


async def refusal_of(viewer):
    """Why the server refuses a message. A client that reads slowly gets other statuses too."""
    while True:
        status = await viewer.status()
        if status["level"] == 2:
            return status["message"]


async def nonsense(address):
    """Wrong messages are refused with a reason, and take no tool."""
    page, other = await Page.open(address), await Page.open(address)
    await page.until_holder(0)
    nan = float("nan")
    for wrong, why in ((pose_of((nan, 0, 0)), "not finite"), (pose_of((0, math.inf, 0)), "not finite"),
                       (pose_of(orientation=(nan, 0, 0, 0)), "not finite"),
                       (pose_of(orientation=(2, 0, 0, 0)), "unit quaternion"),
                       (pose_of(orientation=(0, 0, 0, 0)), "unit quaternion"), (pose_of((0, 0, 50)), "metres"),
                       (b"", "ToolPose"), (pose_of()[:-9], "ToolPose"), (pose_of() + bytes(200), "ToolPose"),
                       (b"\0\0" + pose_of()[2:], "ToolPose")):
        message = await page.refusal(wrong)
        assert why in message, (wrong, message)
    for topic, encoding in (("/user_1/tool", "cdr"), ("/user_-1/tool", "cdr"), ("/user_/tool", "cdr"),
                            ("/user_0/tool", "json"), ("/user_0x/tool", "cdr"), ("/user_99999999999/tool", "cdr")):
        page.viewer.statuses.clear()
        await page.viewer.send(op="advertise", channels=[{"id": 9, "topic": topic, "encoding": encoding}])
        assert "/user_N/tool" in await refusal_of(page.viewer), topic
    foreign = Viewer(await websockets.connect(address, subprotocols=PROTOCOLS, origin="https://app.foxglove.dev"))
    await foreign.socket.recv()
    await foreign.socket.recv()
    await foreign.send(op="advertise", channels=[{"id": 1, "topic": "/user_0/tool", "encoding": "cdr"}])
    assert "another site" in await refusal_of(foreign)
    await page.send(pose_of())
    await page.until_holder(page.number)
    assert "another page" in await other.refusal(pose_of())
    await other.send(pose_of(held=False))  # not its tool: without effect
    # It follows, from where it is, and is released by closing, in any state of the connection.
    reader = asyncio.ensure_future(page.read())
    end = time.monotonic() + LIMIT_S
    while abs(page.newest.get("/user_0/device_state", {"pose": {"position": {"x": 0}}})["pose"]["position"]["x"] - 0.05) > 1e-3:
        assert time.monotonic() < end and not reader.done(), page.newest
        await page.send(pose_of((0.05, 0, 0)))
        await asyncio.sleep(1 / RATE_HZ)
    reader.cancel()
    page.viewer.socket.transport.abort()
    await other.until_holder(0)
    await other.send(pose_of())
    await other.until_holder(other.number)
    await other.until_holder(0)  # it sends no more
    await other.viewer.socket.close()


async def hold(page, way):
    """Sends the pose `way(stamp_s)` of the world's time at 60 Hz until that is None, or the run ends."""
    reader = asyncio.ensure_future(page.read())
    while "/world_state" not in page.newest:
        assert not reader.done(), reader.exception()
        await asyncio.sleep(0.01)
    offset = -math.inf
    while True:
        # A state may arrive late: the one that was fastest has the time.
        offset = max(offset, page.newest["/world_state"]["stamp_s"] - time.monotonic())
        position = way(offset + time.monotonic())
        if position is None:
            break
        try:
            await page.send(pose_of(position))
        except websockets.ConnectionClosedOK:
            break
        await asyncio.sleep(1 / RATE_HZ)
    reader.cancel()
    # Where the run ends first, the page has one message for its user.
    errors = [one["message"] for one in page.viewer.statuses if one["level"] == 2]
    assert len(errors) <= 1 and all("has ended" in one for one in errors), errors
    page.viewer.socket.transport.abort()  # a tab that closes says nothing


def part(now_s, from_s, to_s):
    """Of a smooth motion, 0 to 1."""
    share = min(1, max(0, (now_s - from_s) / (to_s - from_s)))
    return share ** 3 * (10 - 15 * share + 6 * share ** 2)


async def lift(address):
    """Two pages and an emulated device lift a cube; the page that presses lightly closes."""
    def height(now_s):
        return 0.1 * part(now_s, 7.5, 9)

    def right(now_s):
        return (-0.03 * part(now_s, 6, 6.6), 0, height(now_s))

    def front(now_s):
        return None if now_s > 10 else (0, 0.023 * part(now_s, 6.7, 7.2), height(now_s))

    pages = [await Page.open(address, user, ["/world_state"]) for user in (1, 2)]
    other = asyncio.ensure_future(hold(pages[1], front))
    await hold(pages[0], right)
    await other


async def main():
    await globals()[sys.argv[1]](*sys.argv[2:])


asyncio.run(main())
