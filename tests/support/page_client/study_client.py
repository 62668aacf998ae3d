"""Takes part in a study of two trials as a person does: study_client.py ADDRESS. Ends with 0 if the page behaves as it should,
with 77 and a text if this machine cannot show it."""
import asyncio
import json
import os
import sys
import time
import urllib.request

from browser import LIMIT_S, visit


async def until(page, text):
    end = time.monotonic() + LIMIT_S
    while text not in (seen := await page.value("document.body?.innerText ?? ''")):
        assert time.monotonic() < end, (text, seen, page.errors)
        await asyncio.sleep(0.05)


def windows(page):
    with open(f"{page.folder}/DevToolsActivePort") as file:
        port = file.readline().strip()
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
        return [one for one in json.load(answer) if one["type"] == "page"]


async def look(page):
    await until(page, "Judge what you feel.")
    refused = await page.value("fetch('answer', {method: 'POST', body: '{\"number\": 1, \"value\": \"x\"}'}).then(r => r.status)")
    assert refused == 409, refused
    await page.click("button")
    for trial in (1, 2):
        await until(page, f"Trial {trial} of 2")
        await page.click("button")
        await until(page, "The trial runs.")
        end = time.monotonic() + LIMIT_S
        while not any(one["title"].startswith("Subworld") for one in windows(page)):
            assert time.monotonic() < end, windows(page)
            await asyncio.sleep(0.05)
        await until(page, "How hard?")
        if trial == 1 and (folder := os.environ.get("PICTURES")):
            await page.picture(f"{folder}/study.png")
        await page.key("2")
        await until(page, "Percent?")
        for value in (420, 42):  # the first is not on the scale
            await page.value(f"document.querySelector('input').value = {value}")
            await page.click("button")
            await until(page, "Percent?" if value == 420 else f"Trial {trial + 1} of 2" if trial == 1 else "Thank you.")
            await asyncio.sleep(0.2)
    assert len(windows(page)) == 1, "the window of a run is still open"


sys.exit(asyncio.run(visit(sys.argv[1], 900, 700, look)))
