"""Looks at the verdict on the page of a run: verdict_client.py ADDRESS SUMMARY [PID], with the file of the run's summary.
Ends the run by its button, or kills that process of it. The run has a gate that is not ok, where the button ends it. Ends
with 0 if the page behaves as it should, with 77 and a text if this machine cannot show it."""
import asyncio
import json
import os
import re
import signal
import sys
import time

from browser import LIMIT_S, stops, visit

LEAST_CONTRAST = 4.5  # of text and background (WCAG 2.1, level AA)

COLOURS = """[...document.querySelectorAll('#banner, #banner *')].map(one => [getComputedStyle(one).color,
              getComputedStyle(document.getElementById('banner')).backgroundColor])"""


def luminance(colour):
    """Relative luminance of "rgb(1, 2, 3)", by WCAG."""
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
              for part in (int(number) / 255 for number in re.findall(r"\d+", colour)[:3])]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a, b):
    darker, lighter = sorted((luminance(a), luminance(b)))
    return (lighter + 0.05) / (darker + 0.05)


async def is_readable(page):
    for theme in ("light", "dark"):
        await page.theme(theme)
        end = time.monotonic() + LIMIT_S
        while await page.value("document.documentElement.dataset.theme === 'dark'") != (theme == "dark"):
            assert time.monotonic() < end, theme
        for text, background in await page.value(COLOURS):
            assert contrast(text, background) >= LEAST_CONTRAST, (theme, text, background)
        if folder := os.environ.get("PICTURES"):
            await page.picture(f"{folder}/verdict_{theme}.png")


async def is_reached_by_keyboard(page):
    for _ in range(40):
        await page.key("Tab")
        if await page.value("document.activeElement.matches('#banner ul')"):
            return
    assert False, "the list of gates cannot be scrolled by keyboard"


async def look(page):
    await page.until("some time has passed", lambda s: s["frames"] > 0 and s["time_s"] > 2 and s["programs"] == 4)
    assert await page.value("document.getElementById('banner').hidden")
    if len(sys.argv) > 3:
        os.kill(int(sys.argv[3]), signal.SIGKILL)
        await page.until("ended", lambda s: s["link"] == "ended")
    else:
        await stops(page)
    with open(sys.argv[2]) as file:
        summary = json.load(file)
    shown = await page.value("document.getElementById('banner').textContent")
    assert summary["verdict"] in shown, (summary["verdict"], shown)
    missed = [gate for gate in summary["gates"] if not gate["ok"]]
    assert bool(missed) == (len(sys.argv) <= 3), missed
    for gate in missed:
        assert gate["name"] in shown and gate["why"] in shown, (gate, shown)
    assert not missed or f"{len(summary['gates']) - len(missed)} of {len(summary['gates'])} quality gates ok" in shown, shown
    await is_readable(page)
    if missed:
        await is_reached_by_keyboard(page)


sys.exit(asyncio.run(visit(sys.argv[1], 1000, 640, look)))
