#!/usr/bin/python3
"""A stand-in of the Haply Inverse Service, and the checks of the driver `haply`: haply_service.py FAULT,... SUBWORLD WORDS...

It starts `SUBWORLD WORDS...`, a run of the scene press with this device, and is its Inverse3 and its handle. It presses, applies
each fault for a while, after which the force must be there again. `all`: all faults.
"""

import asyncio
import json
import math
import socket
import sys
from pathlib import Path

import websockets

OTHER = {"device_id": "0BAD", "state": {"cursor_position": {"x": 0.05, "y": 0, "z": 0}, "cursor_velocity": {"x": 0, "y": 0, "z": 0}}}
LIMIT_N = 8.0
# Faults that the driver does not feel; with all others the force must vanish, and return.
HARMLESS = {"none", "doubled", "huge", "fragmented", "binary", "late", "handle_lost", "handle_wrong"}
FAULTS = HARMLESS | {
    "silent", "nan", "infinite", "text", "no_state", "truncated", "closed", "aborted", "restarted", "gone", "other_device",
}


def expect(condition, text):
    if not condition:
        raise SystemExit(f"haply_service.py: {text}")


class Service:
    def __init__(self):
        self.fault = "none"
        self.force = [0.0, 0.0, 0.0]
        self.largest = 0.0
        self.commands = 0
        self.since_fault = 0  # commands with a force since the fault began
        self.x = 0.0
        self.speed = 0.0
        self.clients = set()
        self.buttons = {"a": False, "b": False, "c": False}
        self.names = []

    def state(self):
        position = {"x": self.x, "y": 0.0, "z": 0.0}
        inverse3 = {"device_id": "049D", "state": {"cursor_position": position,
                                                   "cursor_velocity": {"x": self.speed, "y": 0.0, "z": 0.0}}}
        handle = {"device_id": "61F1", "state": {"orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}, "buttons": self.buttons}}
        message = {"session_id": 7, "inverse3": [inverse3], "wireless_verse_grip": [handle]}
        fault = self.fault
        if fault == "nan":
            position["x"] = math.nan
        if fault == "infinite":
            return json.dumps(message).replace(f'"x": {self.x}', '"x": 1e999', 1)
        if fault == "text":
            position["x"] = "0.05"
        if fault == "no_state":
            del inverse3["state"]
        if fault == "gone":
            message["inverse3"] = []
        if fault == "other_device":
            message["inverse3"] = [OTHER]
        if fault == "huge":
            message["padding"] = "x" * 20_000
        if fault == "handle_lost":
            message["wireless_verse_grip"] = []
        if fault == "handle_wrong":
            handle["state"] = {"orientation": {"w": 0, "x": "?", "y": 0, "z": 0}, "buttons": [1]}
        text = json.dumps(message)
        return text[: len(text) // 2] if fault == "truncated" else text

    async def serve(self, client):
        self.clients.add(client)
        try:
            await client.send(self.state())
            async for text in client:
                self.take(json.loads(text))
                if self.fault == "silent":
                    continue
                state = self.state()
                if self.fault == "late":
                    await asyncio.sleep(0.003)
                if self.fault == "fragmented":
                    await client.send([state[:40], state[40:41], state[41:]])
                elif self.fault == "binary":
                    await client.send(state.encode())
                else:
                    await client.send(state)
                if self.fault == "doubled":
                    await client.send(state)
        except websockets.ConnectionClosed:
            pass
        finally:
            self.clients.discard(client)

    def take(self, message):
        device = message["inverse3"][0]
        expect(device["device_id"] == "049D", f"a command for {device['device_id']}")
        if "session" in message:
            self.names.append(message["session"]["configure"]["profile"]["name"])
        values = device["commands"]["set_cursor_force"]["values"]
        self.force = [values[axis] for axis in "xyz"]
        expect(all(math.isfinite(one) for one in self.force), f"a force of {self.force}")
        self.largest = max(self.largest, math.hypot(*self.force))
        self.commands += 1
        if self.force != [0.0, 0.0, 0.0]:
            self.since_fault += 1


async def until(condition, what, limit_s=60.0):
    for _ in range(int(limit_s * 200)):
        if condition():
            return
        await asyncio.sleep(0.005)
    expect(False, f"not within {limit_s} s: {what}")


async def move(service, to, during_s):
    begin, start = service.x, asyncio.get_running_loop().time()
    while True:
        passed = (asyncio.get_running_loop().time() - start) / during_s
        service.x = begin + (to - begin) * min(passed, 1.0)
        service.speed = (to - begin) / during_s if passed < 1 else 0.0
        if passed >= 1:
            return
        await asyncio.sleep(0.001)


async def suffer(fault, service, server, port):
    """The service has a fault for half a second. Returns the server, which may be another one then."""
    before = service.force[0]
    service.fault, service.since_fault = fault, 0
    if fault in HARMLESS:
        await asyncio.sleep(0.5)
        expect(service.force[0] < -5, f"{fault}: the force changed from {before} to {service.force[0]} N")
    else:
        clients = list(service.clients)
        if fault in ("aborted", "restarted"):
            for client in clients:
                client.transport.abort()
        if fault == "closed":
            for client in clients:
                await client.close(1001)
        if fault == "restarted":
            server.close()
            await server.wait_closed()
        await asyncio.sleep(0.5)
        if fault not in ("aborted", "restarted", "closed", "gone"):  # these have no commands meanwhile
            expect(service.force == [0.0, 0.0, 0.0], f"{fault}: a force of {service.force} N without readings")
            expect(service.since_fault <= 30, f"{fault}: {service.since_fault} commands with a force after the loss")
        if fault == "restarted":
            server = await websockets.serve(service.serve, "127.0.0.1", port, compression=None)
    service.fault = "none"
    await until(lambda: service.force[0] < -5, f"{fault}: the force does not return")
    await asyncio.sleep(0.2)
    return server


async def main(faults, words):
    service = Service()
    listener = socket.create_server(("127.0.0.1", 0))
    port = listener.getsockname()[1]
    server = await websockets.serve(service.serve, sock=listener, compression=None)
    settings = f"port={port} force_n={LIMIT_N}"
    words += ["--device-declutch", "1"]
    run = await asyncio.create_subprocess_exec(*words, "--device", "haply", "--device-settings", settings)
    try:
        # Where the device is at the start is its origin.
        log = Path(words[words.index("--out") + 1]) / "logs/world_sim.log"
        await until(lambda: log.exists() and "running at" in log.read_text(), "the run begins")
        await asyncio.sleep(0.5)
        await move(service, 0.05, 0.4)
        await until(lambda: service.force[0] < -5, "the force of the pressed cube")
        for fault in faults:
            expect(fault in FAULTS, f"{fault}: choose some of {', '.join(sorted(FAULTS))}")
            server = await suffer(fault, service, server, port)
        service.buttons["b"] = True  # the run declutches with button 1
        await until(lambda: service.force == [0.0, 0.0, 0.0], "no force while declutched")
        expect(service.largest <= LIMIT_N * (1 + 1e-5), f"a force of {service.largest} N")
        expect(set(service.names) == {"subworld"}, f"sessions {service.names}")
    finally:
        run.terminate()
        await run.wait()
    expect(run.returncode == 0, f"the run ended with {run.returncode}")


if __name__ == "__main__":
    asyncio.run(main(sorted(FAULTS) if sys.argv[1] == "all" else sys.argv[1].split(","), sys.argv[2:]))
