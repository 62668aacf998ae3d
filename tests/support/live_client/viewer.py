"""A viewer of the display: a client of the Foxglove WebSocket protocol."""
import asyncio
import json
import struct

import websockets

from idl import decode, parse

PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]
LIMIT_S = 40  # exceeded only by a fault


class Viewer:
    """A connection by the library `websockets`."""

    def __init__(self, socket_):
        self.socket, self.channels, self.topics, self.statuses = socket_, {}, {}, []

    @staticmethod
    async def open(address, protocols=PROTOCOLS):
        viewer = Viewer(await websockets.connect(address, subprotocols=protocols, max_size=None))
        viewer.info = json.loads(await viewer.socket.recv())
        assert viewer.info["op"] == "serverInfo" and viewer.info["sessionId"], viewer.info
        advertise = json.loads(await viewer.socket.recv())
        assert advertise["op"] == "advertise", advertise
        for channel in advertise["channels"]:
            assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "omgidl"), channel
            for module in channel["schemaName"].split("::")[:-1]:
                assert f"module {module} {{" in channel["schema"], channel
            viewer.channels[channel["topic"]] = channel
            viewer.topics[channel["id"]] = channel["topic"]
            channel["types"] = parse(channel["schema"])
        return viewer

    async def send(self, **message):
        await self.socket.send(json.dumps(message))

    async def subscribe(self, *topics):
        """The id of a subscription is that of its channel."""
        ids = [self.channels[topic]["id"] for topic in topics]
        await self.send(op="subscribe", subscriptions=[{"id": id_, "channelId": id_} for id_ in ids])

    async def receive(self):
        """A sample as (topic, time, decoded), or None for a status."""
        message = await asyncio.wait_for(self.socket.recv(), LIMIT_S)
        if isinstance(message, str):
            self.statuses.append(json.loads(message))
            return None
        opcode, id_, time_ns = struct.unpack_from("<BIQ", message)
        assert opcode == 1
        channel = self.channels[self.topics[id_]]
        return channel["topic"], time_ns, decode(channel["types"], channel["schemaName"], message[13:])

    async def status(self):
        while not self.statuses:
            await self.receive()
        return self.statuses.pop(0)
