"""Opens a page in a headless Chromium, light and dark, over its DevTools port. Prints the text of the page. Fails if the
page reports an error, runs a script or loads a resource."""

import os
import sys
import tempfile

from browser import PATIENCE, Browser


def shown(browser, address):
    for domain in ["Page", "Runtime", "Log", "Network", "Security"]:
        browser.ask(f"{domain}.enable")
    papers = []
    for scheme in ["light", "dark"]:
        browser.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        browser.events.clear()
        browser.ask("Page.navigate", url=address)
        browser.wait("Page.loadEventFired")
        papers.append(browser.value("getComputedStyle(document.body).backgroundColor"))
        wrong = [event for event in browser.events if event["method"] in ("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown")]
        assert not wrong, wrong
        loaded = [event["params"]["request"]["url"] for event in browser.events if event["method"] == "Network.requestWillBeSent"]
        outside = [url for url in loaded if url != address and not url.startswith("data:")]
        assert not outside, outside
    assert papers[0] != papers[1], papers
    return browser.value(
        """JSON.stringify({
            title: document.title,
            scripts: document.scripts.length + document.querySelectorAll("[onerror], [onload]").length,
            names: [...document.querySelectorAll("summary h2")].map(it => it.textContent),
            badges: [...document.querySelectorAll("tbody tr .badge")].map(it => it.textContent),
            sequences: [...document.querySelectorAll("svg.sequence")].map(it => it.getBoundingClientRect().height > 40),
            plots: [...document.querySelectorAll("figure img")].map(it => it.complete && it.naturalWidth > 500),
            wide: document.documentElement.scrollWidth > innerWidth,
        })"""
    )


with tempfile.TemporaryDirectory() as profile:
    browser = Browser(sys.argv[1], profile)
    try:
        print(shown(browser, "file://" + os.path.abspath(sys.argv[2])))
    finally:
        browser.process.terminate()
        browser.process.wait(PATIENCE)
