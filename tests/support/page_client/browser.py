"""A headless Chromium, driven by its DevTools protocol."""
import asyncio
import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

import websockets

LIMIT_S = 60  # exceeded only by a fault
SKIPPED = 77  # exit code where this machine cannot show a page
FLAGS = [
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage", "--disable-background-networking", "--disable-component-update", "--no-first-run",
    "--remote-debugging-port=0", "--remote-debugging-address=127.0.0.1", "--hide-scrollbars",
]


def program():
    """The path of Chromium; None: it is not installed."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


async def awaited(address):
    """Waits until a page is served. Returns why there is none in this build, or nothing."""
    end = time.monotonic() + LIMIT_S
    while True:
        try:
            with urllib.request.urlopen(address) as answer:
                assert answer.headers["Content-Type"].startswith("text/html")
                return None
        except urllib.error.HTTPError as refused:
            text = refused.read().decode()
            assert refused.code == 501 and "Node.js" in text, (refused.code, text)
            return text
        except OSError:
            assert time.monotonic() < end, "nothing is served"
            await asyncio.sleep(0.2)


class Page:
    """One page. `errors` are what its console reports as such, and exceptions that nothing caught."""

    def __init__(self, process, folder, socket):
        self.process, self.folder, self.socket = process, folder, socket
        self.number, self.answers, self.errors = 0, {}, []

    @staticmethod
    async def open(address, width=1280, height=800, script=None):
        """`script` runs in each document before those of the page."""
        folder = tempfile.mkdtemp()
        process = subprocess.Popen([program(), *FLAGS, f"--window-size={width},{height}", f"--user-data-dir={folder}",
                                    "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                   env={**os.environ, "HOME": folder})
        end = time.monotonic() + LIMIT_S
        while True:
            assert time.monotonic() < end and process.poll() is None, "Chromium does not start"
            try:
                with open(f"{folder}/DevToolsActivePort") as file:
                    port = file.readline().strip()
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                    targets = [one for one in json.load(answer) if one["type"] == "page"]
                if targets:
                    break
            except OSError:
                pass
            await asyncio.sleep(0.1)
        socket = await websockets.connect(targets[0]["webSocketDebuggerUrl"], max_size=None)
        page = Page(process, folder, socket)
        page.reader = asyncio.ensure_future(page.read())
        for domain in ("Runtime", "Log", "Page"):
            await page.call(f"{domain}.enable")
        await page.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        if script:
            await page.call("Page.addScriptToEvaluateOnNewDocument", source=script)
        await page.call("Page.navigate", url=address)
        return page

    async def read(self):
        async for text in self.socket:
            message = json.loads(text)
            if "id" in message:
                self.answers.pop(message["id"]).set_result(message)
            elif message["method"] == "Runtime.exceptionThrown":
                self.errors.append(json.dumps(message["params"]["exceptionDetails"])[:1000])
            elif message["method"] == "Log.entryAdded" and message["params"]["entry"]["level"] == "error":
                self.errors.append(message["params"]["entry"]["text"])
            elif message["method"] == "Runtime.consoleAPICalled" and message["params"]["type"] in ("error", "assert"):
                self.errors.append(json.dumps(message["params"]["args"])[:1000])

    async def call(self, method, **params):
        self.number += 1
        answer = self.answers[self.number] = asyncio.get_running_loop().create_future()
        await self.socket.send(json.dumps({"id": self.number, "method": method, "params": params}))
        message = await asyncio.wait_for(answer, LIMIT_S)
        assert "error" not in message, (method, message)
        return message["result"]

    async def value(self, expression):
        result = await self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, (expression, result["exceptionDetails"])
        return result["result"].get("value")

    async def state(self):
        return await self.value("window.subworld?.() ?? {}")

    async def until(self, what, condition):
        """Waits until the page's state fulfils a condition, and returns the state."""
        end = time.monotonic() + LIMIT_S
        while True:
            state = await self.state()
            if state and condition(state):
                return state
            assert time.monotonic() < end, (what, state, self.errors)
            await asyncio.sleep(0.1)

    async def click(self, selector):
        """As a user would: a press and a release of the mouse in the middle of an element."""
        x, y = await self.value(f"(() => {{ const r = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
                                " return [r.x + r.width / 2, r.y + r.height / 2]; })()")
        await self.click_at(x, y)

    async def click_at(self, x, y):
        for kind in ("mousePressed", "mouseReleased"):
            await self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    async def drag(self, start, *ends):
        """From one point over others, with the button pressed."""
        for kind, (x, y) in (("mousePressed", start), *(("mouseMoved", one) for one in ends), ("mouseReleased", ends[-1])):
            await self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    async def key(self, key, code=None):
        text = key if len(key) == 1 else ""
        for kind in ("keyDown", "keyUp"):
            await self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key,
                            text=text if kind == "keyDown" else "")

    async def mouse(self, kind, x, y, button="left", modifiers=0, **more):
        """"Pressed", "Moved", "Released" or "Wheel"."""
        await self.call("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, button=button, modifiers=modifiers,
                        buttons=1 if kind == "Moved" else 0, clickCount=0 if kind == "Moved" else 1, **more)

    async def theme(self, name):
        await self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": name}])

    async def picture(self, file=None):
        """A PNG of what is seen, also as a file."""
        png = base64.b64decode((await self.call("Page.captureScreenshot", format="png"))["data"])
        if file:
            with open(file, "wb") as out:
                out.write(png)
        return png

    async def close(self):
        try:
            await self.call("Browser.close")
        except (websockets.ConnectionClosed, asyncio.TimeoutError):
            pass
        self.reader.cancel()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


async def visit(address, width, height, look, script=None):
    """Looks at a page with `look(page)`. The exit code of a script: 0, or SKIPPED where this machine cannot show it."""
    why = await awaited(address) if program() else "no Chromium; as root: apt-get install chromium"
    if why:
        print("skipped:", why)
        return SKIPPED
    page = await Page.open(address, width, height, script)
    try:
        await look(page)
    finally:
        await page.close()
    return 0


async def stops(page):
    """Ends the run by its button; the first press asks."""
    for _ in range(2):
        await page.click("#stop")
    await page.until("ended", lambda s: s["link"] == "ended")
