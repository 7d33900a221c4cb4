"""Opens a page in a headless Chromium, light and dark, over its DevTools port. Prints the text of the page. Fails if the
page reports an error, runs a script or loads a resource."""

import json
import os
import subprocess
import sys
import tempfile
import time
import urllib.request

import websocket

PATIENCE = 60


class Browser:
    def __init__(self, program, profile):
        # No sandbox: containers lack the needed privileges, and the page is trusted.
        options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]
        options += ["--disable-background-networking", "--disable-component-update", "--disable-extensions"]
        options += ["--remote-debugging-port=0", "--remote-allow-origins=*", f"--user-data-dir={profile}"]
        quiet = subprocess.DEVNULL
        self.process = subprocess.Popen([program, *options, "about:blank"], stdout=quiet, stderr=quiet)
        port = self.port(os.path.join(profile, "DevToolsActivePort"))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=PATIENCE) as answer:
            pages = [target for target in json.load(answer) if target["type"] == "page"]
        self.socket = websocket.create_connection(pages[0]["webSocketDebuggerUrl"], timeout=PATIENCE)
        self.number, self.events = 0, []

    def port(self, file):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and self.process.poll() is None:
            if os.path.exists(file) and (lines := open(file).read().split("\n"))[0]:
                return lines[0]
            time.sleep(0.05)
        raise SystemExit("Chromium does not open its DevTools port")

    def ask(self, method, **parameters):
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self.socket.recv())
            if message.get("id") == self.number:
                assert "error" not in message, (method, message["error"])
                return message["result"]
            self.events.append(message)

    def wait(self, method):
        while not any(event["method"] == method for event in self.events):
            self.events.append(json.loads(self.socket.recv()))

    def value(self, expression):
        result = self.ask("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"]["value"]


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
