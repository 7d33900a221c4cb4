"""A headless Chromium, driven over its DevTools port, for tests of pages."""

import base64
import contextlib
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.request

import websocket

PATIENCE = 60


class Browser:
    def __init__(self, program, profile):
        # Runs without a sandbox: containers lack the needed privileges, and the page is trusted.
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


@contextlib.contextmanager
def browsing(program):
    """Runs a browser with a new profile, and removes the profile at the end."""
    profile = tempfile.mkdtemp()
    try:
        browser = Browser(program, profile)
        try:
            yield browser
        finally:
            browser.process.terminate()
            browser.process.wait(PATIENCE)
    finally:
        remove(profile)


def remove(profile):
    """Removes a profile. Processes of the browser can write into the profile after the first process has ended."""
    end = time.monotonic() + PATIENCE
    while os.path.exists(profile):
        assert time.monotonic() < end, f"{profile} cannot be removed"
        shutil.rmtree(profile, ignore_errors=True)
        time.sleep(0.05)


KEYS = {"Enter": 13, "Escape": 27, "ArrowDown": 40, "ArrowUp": 38, "End": 35, "Home": 36, "Tab": 9}

# Finds the first visible element of a selector, with this text if one is given.
FIND = """((selector, text) => [...document.querySelectorAll(selector)].find((it) =>
    it.getClientRects().length && (text === null || it.textContent.trim() === text || it.getAttribute("aria-label") === text)))"""


class Page:
    """What a user does on a page: looks, clicks and types."""

    def __init__(self, browser):
        self.browser = browser
        self.messages = []
        for domain in ["Page", "Runtime", "Log", "Network"]:
            browser.ask(f"{domain}.enable")

    def open(self, address):
        self.browser.events.clear()
        self.browser.ask("Page.navigate", url=address)
        self.browser.wait("Page.loadEventFired")

    def reload(self):
        self.browser.events.clear()
        self.browser.ask("Page.reload")
        self.browser.wait("Page.loadEventFired")

    def size(self, width, height):
        self.browser.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def colours(self, scheme):
        self.browser.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def value(self, expression):
        result = self.browser.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, (expression, result["exceptionDetails"])
        return result["result"].get("value")

    def until(self, expression, what=None):
        """Waits until an expression is true, and returns its value."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if value := self.value(expression):
                return value
            time.sleep(0.02)
        raise AssertionError(f"not in {PATIENCE} s: {what or expression}\n{self.value('document.body.innerText')}")

    def text(self, selector):
        return self.value(f"{FIND}({json.dumps(selector)}, null)?.textContent ?? ''")

    def click(self, selector, text=None):
        """Clicks in the middle of an element."""
        find = f"{FIND}({json.dumps(selector)}, {json.dumps(text)})"
        self.until(f"Boolean({find})", f"{selector} {text or ''}")
        place = self.value(
            f"""(() => {{ const it = {find}; it.scrollIntoView({{ block: "center", inline: "center" }});
            const box = it.getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2]; }})()"""
        )
        for kind in ["mousePressed", "mouseReleased"]:
            self.browser.ask("Input.dispatchMouseEvent", type=kind, x=place[0], y=place[1], button="left", clickCount=1)

    def key(self, name, modifiers=0):
        text = name if len(name) == 1 else "\r" if name == "Enter" else ""
        code = KEYS.get(name, ord(name[0].upper()))
        self.browser.ask("Input.dispatchKeyEvent", type="keyDown", key=name, text=text, windowsVirtualKeyCode=code, modifiers=modifiers)
        self.browser.ask("Input.dispatchKeyEvent", type="keyUp", key=name, windowsVirtualKeyCode=code, modifiers=modifiers)

    def enter(self, selector, text):
        """Replaces the content of a field."""
        self.click(selector)
        self.value(f"{FIND}({json.dumps(selector)}, null).select?.()")
        self.browser.ask("Input.insertText", text=text)

    def choose(self, selector, value):
        script = f"""(() => {{ const it = {FIND}({json.dumps(selector)}, null); it.value = {json.dumps(value)};
            it.dispatchEvent(new Event("change", {{ bubbles: true }})); return it.value; }})()"""
        assert self.value(script) == value, (selector, value)

    def picture(self, path):
        data = self.browser.ask("Page.captureScreenshot", format="png")["data"]
        with open(path, "wb") as file:
            file.write(base64.b64decode(data))

    def complaints(self):
        """Messages of the console, uncaught errors and failed requests since the last call."""
        self.value("1")
        kinds = ("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown")
        wrong = [event["params"] for event in self.browser.events if event["method"] in kinds]
        self.browser.events.clear()
        return wrong
