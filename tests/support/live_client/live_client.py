"""A viewer for tests: live_client.py CASE ADDRESS [PROTOCOL]. Ends with 0 if the server behaves as it should."""
import asyncio
import base64
import contextlib
import errno
import json
import os
import re
import socket
import struct
import sys
import time

import websockets

from viewer import LIMIT_S, PROTOCOLS, Viewer

RARE = ("/scene", "/joints", "/program_place", "/tools")  # sent where they change


def enough(topic, samples):
    """Some samples, and where they have stamps, time has passed: the world may just be starting."""
    if topic in RARE:
        return bool(samples)
    stamps = [sample.get("stamp_s", 1) for _, sample in samples[:1] + samples[-1:]]
    return len(samples) >= 5 and stamps[-1] > 0 and (topic != "/status" or {0, 1, 2} <= {
        sample["program"] for _, sample in samples})


async def read_all(address, protocol):
    """Every topic arrives, its bytes fit its schema, and stamps advance."""
    viewer = await Viewer.open(address, [protocol])
    assert viewer.socket.subprotocol == protocol
    wanted = [topic for topic in viewer.channels if not topic.startswith(("/control", "/verdict"))]
    assert len(wanted) == 12, wanted
    await viewer.subscribe(*wanted)
    seen = {topic: [] for topic in wanted}
    end = time.monotonic() + LIMIT_S
    while any(not enough(topic, samples) for topic, samples in seen.items()):
        assert time.monotonic() < end, {topic: len(samples) for topic, samples in seen.items()}
        sample = await viewer.receive()
        if sample:
            seen[sample[0]].append(sample[1:])
    for topic, samples in seen.items():
        times = [time_ns for time_ns, _ in samples]
        assert times == sorted(times), topic
        stamps = [sample["stamp_s"] for _, sample in samples if "stamp_s" in sample]
        assert stamps == sorted(stamps), (topic, stamps)
        assert not stamps or stamps[0] < stamps[-1], (topic, stamps)
        assert topic in (*RARE, "/scene_update", "/status") or len(stamps) > 4, topic
    scene = seen["/scene"][0][1]
    full, view = seen["/world_state"], {one["stamp_s"]: one for _, one in seen["/world_view"]}
    same = [(state, view[state["stamp_s"]]) for _, state in full if state["stamp_s"] in view]
    assert same, "no view has the stamp of a state"
    for state, short in same:
        placed = {one["body"]: one for one in short["placed"]}
        for moved in state["moved"]:
            one, at = placed[moved["body"]], moved["position"]
            assert all(abs(one[axis] - at[axis]) < 1e-5 for axis in "xyz"), (one, at)
        assert short["users"] == state["users"] and not short["moved"]
    update = seen["/scene_update"][-1][1]
    entities = {entity["id"]: entity for entity in update["entities"]}
    assert set(entities) == {"fixed", "bodies", "forces", "joints"}, set(entities)
    shown = sum(len(entities[id_][kind]) for id_ in ("fixed", "bodies") for kind in ("cubes", "spheres", "cylinders"))
    assert shown == len(scene["bodies"]) == len(scene["states"]), (shown, len(scene["bodies"]))
    hinges = len(entities["joints"]["cylinders"])
    assert hinges == len(scene["joints"]) == len(seen["/joints"][0][1]["marks"]), (hinges, scene["joints"])
    assert all(status.get("id") == "dropped" for status in viewer.statuses), viewer.statuses  # a busy machine
    # No sample comes after the end of a subscription; the answer to a wrong message marks the moment.
    await viewer.send(op="unsubscribe", subscriptionIds=list(viewer.topics))
    await viewer.send(op="marker")
    while "marker" not in (await viewer.status())["message"]:
        pass
    try:
        assert False, await asyncio.wait_for(viewer.socket.recv(), 0.5)
    except asyncio.TimeoutError:
        pass
    await viewer.socket.close()


async def arrows(address):
    """The arrows of the 3D panel show the force that the device is commanded, not that of the coupling."""
    viewer = await Viewer.open(address)
    await viewer.subscribe("/scene_update", "/user_0/device_command")
    end, equal, commanded, shown = time.monotonic() + LIMIT_S, 0, [], []
    while equal < 5:
        assert time.monotonic() < end, (equal, commanded[-5:], shown[-5:])
        sample = await viewer.receive()
        if sample and sample[0] == "/user_0/device_command":
            force = sample[2]["wrench"]["force"]
            commanded.append(sum(force[axis] ** 2 for axis in "xyz") ** 0.5)
        elif sample:
            entity = next(one for one in sample[2]["entities"] if one["id"] == "forces")
            shown += [(arrow["shaft_length"] + arrow["head_length"]) / 0.02 for arrow in entity["arrows"]]
        equal = sum(any(abs(one - force) < 1e-9 * force for force in commanded if force > 0.1) for one in set(shown))
    await viewer.socket.close()


async def rates(address):
    """A topic of 1 kHz comes at 60 Hz at most, and the newest sample each time."""
    viewer = await Viewer.open(address)
    await viewer.subscribe("/user_0/device_state")
    while not await viewer.receive():
        pass
    begin, count, stamps = time.monotonic(), 0, []
    while time.monotonic() < begin + 2.0:
        stamps.append((await viewer.receive())[2]["sequence_number"])
        count += 1
    assert 5 < count < 2.0 * 60 + 10, count
    assert stamps[-1] - stamps[0] > 2 * count, (stamps[0], stamps[-1], count)
    await viewer.socket.close()


async def garbage(address):
    """Wrong messages get an answer or end the connection; others are served all the same."""
    good = await Viewer.open(address)
    viewer = await Viewer.open(address)
    assert viewer.info["sessionId"] == good.info["sessionId"]
    ids = {key: viewer.channels["/world_state"]["id"] for key in ("id", "channelId")}
    wrong = [
        "no JSON", "[]", "17", "null", "{}", '{"op": 3}', '{"op": "launch"}', "[" * 60000, '{"op":"subscribe"}',
        '{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}',
        '{"op":"subscribe","subscriptions":[{"id":1,"channelId":999}]}',
        '{"op":"subscribe","subscriptions":[{"id":1e9,"channelId":{}}]}', '{"op":"unsubscribe","subscriptionIds":[5]}',
        '{"op":"unsubscribe","subscriptionIds":{"a":1}}', b"\1\0\0\0\0hello", b"",
        '{"op":"advertise"}', '{"op":"advertise","channels":[{"id":1}]}', '{"op":"unadvertise"}',
        '{"op":"advertise","channels":[{"id":1,"topic":"/status","encoding":"cdr"}]}',
    ]
    for message in wrong:
        await viewer.socket.send(message)
        status = await viewer.status()
        assert (status["op"], status["level"]) == ("status", 2) and status["message"], (message[:40], status)
    await viewer.send(op="subscribe", subscriptions=[ids, ids])
    assert "in use" in (await viewer.status())["message"]
    await viewer.socket.send("x" * 100_000)
    try:
        while True:
            await viewer.receive()
    except websockets.ConnectionClosed as closed:
        assert closed.code == 1009, closed
    raw_garbage(address)
    await good.subscribe("/world_state")
    while not await good.receive():
        pass
    await good.socket.close()


def place(address):
    host, port = re.fullmatch(r"ws://([^:/]+):(\d+)", address).groups()
    return host, int(port)


def answer_to(address, request, message=b""):
    """All that the server answers until it ends the connection. The message follows the answer to the request."""
    with socket.create_connection(place(address), LIMIT_S) as connection:
        answer = b""
        try:
            connection.sendall(request)
            if message:
                answer = connection.recv(65536)
                connection.sendall(message)
            while part := connection.recv(65536):
                answer += part
        except ConnectionError:
            pass
        return answer


def upgrade(protocol="foxglove.sdk.v1", more="", path="/"):
    key = base64.b64encode(os.urandom(16)).decode()
    return (f"GET {path} HTTP/1.1\r\nHost: here\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            f"Sec-WebSocket-Protocol: {protocol}\r\n{more}\r\n").encode()


def frame(payload, opcode=1, masked=True):
    size = len(payload)
    head = bytes([0x80 | opcode])
    flag = 0x80 if masked else 0
    head += bytes([flag | size]) if size < 126 else bytes([flag | 126]) + struct.pack(">H", size)
    return head + (b"\0\0\0\0" if masked else b"") + payload


def raw_garbage(address):
    assert b" 404 " in answer_to(address, b"GET /other HTTP/1.1\r\nHost: here\r\n\r\n")
    assert b" 405 " in answer_to(address, b"POST / HTTP/1.1\r\nHost: here\r\nContent-Length: 0\r\n\r\n")
    assert b" 400 " in answer_to(address, upgrade(protocol="chat"))
    for wrong in (b"\x16\x03\x01 no HTTP at all\r\n\r\n", b"GET / HTTP/1.1\r\n" + b"x: " + b"y" * 20000 + b"\r\n\r\n",
                  b"CONNECT / HTTP/1.1\r\nHost: here\r\n\r\n", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"):
        answer = answer_to(address, wrong)
        assert not answer or b" 40" in answer[:20], (wrong[:20], answer[:80])
    for other in (b"h2c", b"chat"):
        answer = answer_to(address, upgrade().replace(b"websocket", other))
        assert b" 101 " not in answer and answer.startswith(b"HTTP/1."), (other, answer[:80])
    leave = frame(b"", opcode=8)
    for wrong in (frame(b"{}", masked=False) + leave, frame(b"", opcode=11), frame(b"\xff\xfe"), b"\xff" * 200,
                  frame(b"x" * 200, opcode=9)):
        begin = time.monotonic()
        answer = answer_to(address, upgrade(), wrong)
        assert b" 101 " in answer, answer[:80]
        assert time.monotonic() - begin < 15, wrong  # an idle connection takes longer to end
    assert b"HTTP/1.1 " in answer_to(address, upgrade() + frame(b"{}") + leave)


async def churn(address):
    """Many clients come and go, in every state of a connection."""
    host = place(address)
    for turn in range(60):
        if turn % 3 == 0:
            socket.create_connection(host).close()
            continue
        viewer = await Viewer.open(address)
        await viewer.subscribe(*viewer.channels)
        if turn % 3 == 1:
            viewer.socket.transport.abort()
        else:
            await viewer.receive()
            await viewer.socket.close()
    viewers = [await Viewer.open(address) for _ in range(20)]
    for viewer in viewers:
        await viewer.subscribe("/world_state", "/user_0/device_state")
    for viewer in viewers:
        while not await viewer.receive():
            pass
        await viewer.socket.close()


def flooded(address, copies):
    """A client that subscribes to everything several times over and does not read."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    connection.settimeout(LIMIT_S)
    connection.connect(place(address))
    connection.sendall(upgrade())
    answer = connection.recv(64)
    assert b" 101 " in answer, answer
    wanted = [{"id": 100 * channel + copy, "channelId": channel} for channel in range(1, 11) for copy in range(copies)]
    connection.sendall(frame(json.dumps({"op": "subscribe", "subscriptions": wanted}).encode()))
    return connection


async def slow(address):
    """A client that pauses is sent the number of samples that it has missed."""
    connection = flooded(address, 90)
    time.sleep(5)
    begin, text = time.monotonic(), b""
    while b"messages were dropped" not in text:
        assert time.monotonic() < begin + LIMIT_S
        part = connection.recv(1 << 20)
        assert part, "the server ends the connection"
        text = text[-64:] + part


async def busy(address, display):
    """A client that does not read until the display's process has ended still learns that the run ended. Prints "ready"
    before."""
    connection = flooded(address, 90)
    time.sleep(2)
    print("ready", flush=True)
    end = time.monotonic() + LIMIT_S
    while os.path.exists(f"/proc/{display}"):
        assert time.monotonic() < end
        time.sleep(0.1)
    last = b""
    while part := connection.recv(1 << 20):
        last = (last + part)[-64:]
    assert last.endswith(frame(struct.pack(">H", 1001) + b"the run ended", opcode=8, masked=False)), last


async def stalled(address):
    """A client that never reads is disconnected. Meanwhile another one is served."""
    connection = flooded(address, 90)
    viewer = await Viewer.open(address)
    await viewer.subscribe("/user_0/device_state")
    begin, last = time.monotonic(), None
    while time.monotonic() < begin + 30:
        before, sample = time.monotonic(), await viewer.receive()
        if sample:
            last = time.monotonic()
        assert time.monotonic() - before < 5, "the other viewer waits"
        if connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) == errno.ECONNRESET:  # shows without reading
            break
    else:
        assert False, "not disconnected"
    assert last and time.monotonic() - begin > 5
    await viewer.socket.close()


def answer_of(address, origin="", host="here", more=""):
    """The HTTP status of a page of that origin, and its connection if it may read."""
    request = upgrade(more=(f"Origin: {origin}\r\n" if origin else "") + more).replace(b": here", f": {host}".encode())
    connection = socket.create_connection(place(address), LIMIT_S)
    connection.sendall(request)
    return int(connection.recv(65536).split()[1]), connection


async def origins(address):
    """A page of another site reads nothing, unless `--origin` has it. Own pages have places that others cannot take."""
    own = address.removeprefix("ws://")
    for status, origin, host, more in (
            (403, "http://elsewhere.example", own, ""), (403, "null", own, ""), (403, "http://127.0.0.1:1", own, ""),
            (403, "http://elsewhere.example", "elsewhere.example", ""),  # its name leads to this address
            (403, "https://elsewhere.example", own, "X-Forwarded-Host: lab.example\r\n"),
            (101, "", own, ""), (101, f"http://{own}", own, ""), (101, "https://app.foxglove.dev", own, ""),
            (101, "file://", own, ""), (101, "https://given.example", own, ""),
            (101, "https://lab.example", own, "X-Forwarded-Host: lab.example, inner\r\n")):
        answer, connection = answer_of(address, origin, host, more)
        assert answer == status, (answer, origin, host, more)
        connection.close()
    await asyncio.sleep(0.5)
    connections = [answer_of(address, "https://given.example") for _ in range(32)]
    assert {status for status, _ in connections} == {101, 503}, [status for status, _ in connections]
    assert answer_of(address, f"http://{own}", own)[0] == 101, "others have all places"


async def slow_requests(address):
    """Clients that do not finish their requests lock no viewer out."""
    unfinished = [socket.create_connection(place(address), LIMIT_S) for _ in range(200)]
    for connection in unfinished:
        with contextlib.suppress(ConnectionError):  # the server has ended it for a newer one
            connection.sendall(b"GET / HTTP/1.1\r\nHost: here\r\n")
    for _ in range(20):
        await (await Viewer.open(address)).socket.close()
    for connection in unfinished:
        connection.close()


async def token(address):
    """`TOKEN` of the environment is needed, in the address or in a header."""
    right = os.environ["TOKEN"]
    for more, path in (("", "/"), ("", "/?token=wrong"), (f"Authorization: Bearer {right}x\r\n", "/")):
        answer = answer_to(address, upgrade(more=more, path=path))
        assert b" 401 " in answer and b"token" in answer and right.encode() not in answer, answer[:200]
    await (await Viewer.open(f"{address}/?token={right}")).socket.close()
    is_old = int(websockets.version.version.split(".")[0]) < 14
    for scheme in ("Bearer", "bearer"):
        headers = {"extra_headers" if is_old else "additional_headers": {"Authorization": f"{scheme} {right}"}}
        await (await websockets.connect(address, subprotocols=PROTOCOLS, **headers)).close()


async def verdict(address):
    """Prints "ready" when the world advances and, when the display says that the run has ended, the verdicts."""
    viewer = await Viewer.open(address)
    await viewer.subscribe("/verdict", "/world_state", "/status")
    shown, seen = [], False
    try:
        while True:
            sample = await viewer.receive()
            if sample and sample[0] == "/verdict":
                shown.append(sample[2])
            elif sample and sample[0] == "/world_state" and sample[2]["stamp_s"] > 0 and not seen:
                seen = True
                print("ready", flush=True)
    except websockets.ConnectionClosed as closed:
        assert closed.code == 1001, closed
    print("verdict:", json.dumps(shown), flush=True)


async def main():
    case, rest = sys.argv[1], sys.argv[2:]
    await globals()[case](*rest)


asyncio.run(main())
