"""Opens a page in a headless Chromium, light and dark, over its DevTools port. Prints the text of the page, and
its table after a click on a column and with a filter. Fails if the page reports an error or loads a resource."""

import os
import sys

from browser import browsing


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
            ...(() => {
                const first = document.querySelector("table");
                const rows = () => [...first.tBodies[0].rows].filter(row => !row.hidden);
                const names = () => rows().map(row => row.cells[0].textContent);
                first.querySelector("button").click();
                const ascending = names();
                first.querySelector("button").click();
                const descending = names();
                const select = document.querySelector("select");
                select.value = "failed";
                select.dispatchEvent(new Event("change"));
                const filtered = [names(), [...document.querySelectorAll("details:not([hidden])")].length];
                return { ascending, descending, filtered, told: document.querySelector("output").textContent };
            })(),
        })"""
    )


with browsing(sys.argv[1]) as browser:
    print(shown(browser, "file://" + os.path.abspath(sys.argv[2])))
