"""The extension of tools/vscode in code-server, operated in a headless Chromium as a user operates it.

    vscode.py CODE_SERVER EXTENSION [--pictures DIRECTORY] [--chromium PROGRAM]

CODE_SERVER is the directory that `tests/editors/code-server` fills, EXTENSION the packaged extension. COMMRAM names the
program. Every step waits for a condition; the test ends after `LIMIT` seconds at the latest, and takes its processes
with it. With `--pictures` the pictures of docs/guide/editors.md are made."""

import argparse
import contextlib
import ctypes
import json
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import urllib.error
import urllib.parse
import urllib.request

from playwright.sync_api import Locator, Page, expect, sync_playwright

PROGRAM = os.environ.get("COMMRAM", "commram")
# Real time for one condition, and for the whole test, in seconds.
PATIENCE, LIMIT = 60, 600
SCENARIO = """// The master answers the handshake of the PLC.
section("handshake");
poke("node2.w_CPU_CONTRL", "handshake");
let us = wait("node2.w_OPTION_STATUS", "16#0002", "1ms");
expect("node2.w_OPTION_STATUS", "16#0003");
"""
# The extension runs in the server, so the path of the program is a setting of the server's machine. In the settings of
# the user, VS Code would ignore it when it reads these settings again.
MACHINE = {"commram.program": PROGRAM}
SETTINGS = {
    "chat.disableAIFeatures": True,
    "debug.internalConsoleOptions": "neverOpen",
    "editor.minimap.enabled": False,
    "editor.wordWrap": "on",
    "extensions.ignoreRecommendations": True,
    "git.enabled": False,
    "security.workspace.trust.enabled": False,
    "telemetry.telemetryLevel": "off",
    "testing.automaticallyOpenTestResults": "neverOpen",
    "window.menuBarVisibility": "hidden",
    "workbench.colorTheme": "Default Light Modern",
    "workbench.layoutControl.enabled": False,
    "workbench.secondarySideBar.defaultVisibility": "hidden",
    "workbench.startupEditor": "none",
}


def with_parent():
    """Runs in a child: its group ends with this process, also if it is killed."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)


def started(arguments, **options) -> subprocess.Popen:
    return subprocess.Popen(arguments, preexec_fn=with_parent, stdin=subprocess.DEVNULL, text=True, **options)


def ended(child: subprocess.Popen):
    child.terminate()
    try:
        child.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        child.kill()


@contextlib.contextmanager
def code_server(directory: pathlib.Path, extension: str, work: pathlib.Path):
    """Serves the editor with the extension; yields its address."""
    data = work / "data"
    (data / "User").mkdir(parents=True)
    (data / "User" / "settings.json").write_text(json.dumps(SETTINGS))
    set_machine(data, MACHINE)
    command = [directory / "node", directory / "code-server", "--config", work / "config.yaml"]
    command += ["--user-data-dir", data, "--extensions-dir", work / "extensions"]
    subprocess.run([*command, "--install-extension", extension], check=True, capture_output=True, timeout=PATIENCE)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    options = ["--auth", "none", "--bind-addr", address, "--disable-telemetry", "--disable-update-check"]
    log = work / "code-server.log"
    child = started([*command, *options], stdout=log.open("w"), stderr=subprocess.STDOUT)
    try:
        # The log names the address when the server accepts connections.
        waits_for(lambda: address in log.read_text() or child.poll() is not None)
        assert child.poll() is None, log.read_text()
        yield address
    finally:
        ended(child)


def set_machine(data: pathlib.Path, settings: dict):
    """Writes the settings of the machine, whole or not at all: the server watches the file."""
    file = data / "Machine" / "settings.json"
    file.parent.mkdir(exist_ok=True)
    new = file.with_suffix(".new")
    new.write_text(json.dumps(settings))
    new.rename(file)


def waits_for(condition):
    """Polls a condition of this machine, until it holds."""
    for _ in range(PATIENCE * 20):
        if condition():
            return
        signal.sigtimedwait([], 0.05)
    raise AssertionError("the condition did not hold in time")


class Instance:
    """A running emulator, which ends with this process."""

    def __init__(self, name: str):
        self.name = name
        command = [PROGRAM, "run", "-i", name, "--clock", "stepped"]
        self.child = started(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        peek = [PROGRAM, "peek", "-i", name, "--connect-timeout", f"{PATIENCE}s", "node2.w_CPU_CONTROL"]
        subprocess.run(peek, check=True, capture_output=True, timeout=PATIENCE)

    def stop(self):
        ended(self.child)


class Editor:
    """The window of the editor, with a few actions of a user."""

    def __init__(self, page: Page, pictures: str | None, data: pathlib.Path):
        self.page, self.pictures, self.data = page, pictures, data

    def open(self, address: str, folder: pathlib.Path, file: str):
        opened = json.dumps([["openFile", f"vscode-remote://{address}{folder / file}"]])
        query = urllib.parse.urlencode({"folder": folder, "payload": opened})
        self.page.goto(f"http://{address}/?{query}")
        expect(self.page.locator(".monaco-editor .view-lines").first).to_contain_text("handshake")

    def command(self, name: str):
        """Runs a command of the palette."""
        self.page.keyboard.press("F1")
        self.page.locator(".quick-input-widget input").first.fill(f">{name}")
        self.page.locator(".quick-input-list .monaco-list-row").filter(has_text=name).first.click()

    def go_to(self, line: int, column: int = 1):
        self.command("Go to Line/Column...")
        self.page.locator(".quick-input-widget input").first.fill(f":{line}:{column}")
        self.page.keyboard.press("Enter")
        expect(self.page.locator(".statusbar-item").filter(has_text=re.compile(rf"Ln {line}, Col {column}\b"))).to_be_visible()

    def picture(self, name: str):
        if self.pictures:
            self.page.screenshot(path=os.path.join(self.pictures, f"editor-{name}.png"), animations="disabled")

    def line(self, text: str) -> Locator:
        # The editor shows blanks as no-break spaces.
        return self.page.locator(".view-line").filter(has_text=re.compile(re.escape(text).replace(r"\ ", r"\s")))


def a_wrong_register_is_underlined_and_completed(editor: Editor):
    page = editor.page
    mistakes = page.locator(".squiggly-error")
    expect(mistakes).to_have_count(1)
    page.locator(".view-line span", has_text="node2.w_CPU_CONTRL").last.hover()
    about = page.locator(".monaco-hover").filter(has_text="did you mean")
    expect(about).to_contain_text("w_CPU_CONTROL")
    editor.picture("mistake")
    page.keyboard.press("Escape")
    # The user deletes six letters and completes the name.
    end = SCENARIO.splitlines()[2].index('",') + 1
    editor.go_to(3, end)
    for _ in "CONTRL":
        page.keyboard.press("Backspace")
    page.keyboard.press("Control+Space")
    proposal = page.locator(".suggest-widget.visible .monaco-list-row").filter(has_text="node2.w_CPU_CONTROL").first
    expect(proposal).to_be_visible()
    editor.picture("completion")
    proposal.click()
    expect(editor.line('poke("node2.w_CPU_CONTROL", "handshake");')).to_be_visible()
    expect(mistakes).to_have_count(0)
    page.keyboard.press("Control+S")
    expect(page.locator(".tab.dirty")).to_have_count(0)


def a_failing_test_shows_its_line(editor: Editor):
    page = editor.page
    editor.command("Testing: Focus on Test Explorer View")
    test = page.locator(".test-explorer .monaco-list-row").filter(has_text="handshake").last
    test.hover()
    test.locator(".codicon-testing-run-icon, .codicon-testing-run").first.click()
    expect(test.locator(".codicon-testing-failed-icon, .codicon-testing-error-icon").first).to_be_visible()
    # The message is at the failed line, with the value that the register has.
    expect(page.locator(".test-error-content-widget")).to_contain_text("16#0002")
    editor.picture("failure")


def stops_at(editor: Editor, text: str, time: str):
    """Waits until the debugger has stopped at a line, at an emulated time."""
    expect(editor.page.locator(".statusbar-item").filter(has_text=f"{time} s emulated")).to_be_visible()
    mark = editor.page.locator(".debug-top-stack-frame-line")
    expect(mark).to_have_count(1)
    line = editor.line(text)
    expect(line).to_be_visible()
    # The mark and the text of a line are in different layers of the editor.
    waits_for(lambda: abs(mark.bounding_box()["y"] - line.bounding_box()["y"]) < 5)


def row_of(editor: Editor, text: str) -> Locator:
    return editor.page.locator(".debug-variables .monaco-list-row").filter(has_text=text).first


def opened(row: Locator):
    row.locator(".monaco-tl-twistie").click()
    expect(row).to_have_attribute("aria-expanded", "true")


def a_breakpoint_stops_and_steps_lead_forward_and_back(editor: Editor):
    page = editor.page
    size = page.viewport_size
    page.set_viewport_size({"width": 1240, "height": 620})
    last = editor.line('expect("node2.w_OPTION_STATUS"')
    editor.go_to(5)
    # A click beside the line number sets the breakpoint; the editor shows a hint there as soon as it takes clicks.
    margin, box = page.locator(".editor-group-container .glyph-margin").first.bounding_box(), last.bounding_box()
    x, y = margin["x"] + margin["width"] / 2, box["y"] + box["height"] / 2

    def is_hinted():
        page.mouse.move(x, y - 40)
        page.mouse.move(x, y)
        return page.locator(".codicon-debug-hint").count()

    waits_for(is_hinted)
    page.mouse.click(x, y)
    expect(page.locator(".cgmr.codicon-debug-breakpoint")).to_have_count(1)
    page.keyboard.press("F5")
    stops_at(editor, 'expect("node2.w_OPTION_STATUS"', "0.000500")
    expect(row_of(editor, "us =")).to_contain_text("500")
    # Makes the list of registers wider and longer, so that all of them are visible.
    for other in ("Watch", "Call Stack"):
        page.locator(".debug-viewlet .pane-header").filter(has_text=other).click()
    side = page.locator(".part.sidebar").bounding_box()
    page.mouse.move(side["x"] + side["width"], 400)
    page.mouse.down()
    page.mouse.move(side["x"] + side["width"] + 200, 400, steps=4)
    page.mouse.up()
    opened(row_of(editor, "Registers"))
    opened(row_of(editor, "node2 ="))
    opened(row_of(editor, "[0..99]"))
    status = row_of(editor, "w_OPTION_STATUS")
    expect(status).to_contain_text("16#0002")
    expect(status).to_contain_text("take over initialization data")
    status.scroll_into_view_if_needed()
    editor.picture("debugger")
    # Steps back to the previous line. The registers and the emulated time have the values of that line.
    page.locator(".debug-toolbar .codicon-debug-step-back").click()
    stops_at(editor, "let us = wait", "0.000000")
    page.keyboard.press("F10")
    stops_at(editor, 'expect("node2.w_OPTION_STATUS"', "0.000500")
    # The editor keeps the list open. With another value of the register the scenario passes, so that the debugger does not stop again.
    row_of(editor, "w_OPTION_STATUS").locator(".value").dblclick()
    box = page.locator(".debug-variables .monaco-inputbox input")
    box.fill("16#0003")
    box.press("Enter")
    expect(row_of(editor, "w_OPTION_STATUS")).to_contain_text("16#0003")
    page.keyboard.press("F5")
    expect(page.locator(".debug-toolbar")).to_be_hidden()
    expect(page.locator(".statusbar-item").filter(has_text="emulated")).to_be_hidden()
    page.set_viewport_size(size)


def a_debugger_without_its_program_says_so(editor: Editor):
    set_machine(editor.data, {"commram.program": "/nonexistent/commram"})
    # The language server starts again with the setting, so the window has the setting when this message appears.
    refused = editor.page.locator(".notifications-toasts .notification-list-item")
    expect(refused.filter(has_text="couldn't create connection").first).to_be_visible()
    editor.command("Debug: Start Debugging")
    expect(refused.filter(has_text="The debugger does not start: spawn /nonexistent/commram ENOENT").first).to_be_visible()


def a_page_is_offered_and_a_refusal_is_shown(editor: Editor):
    page = editor.page
    first, second = (Instance(f"vscode{os.getpid()}{letter}") for letter in "ab")
    try:
        editor.command("commram: Open browser page")
        page.locator(".quick-input-list .monaco-list-row").filter(has_text=first.name).click()
        offer = page.locator(".notifications-toasts .notification-list-item").filter(has_text=first.name)
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        offer.get_by_text("Copy Address").click()
        expect(offer).to_have_count(0)
        address = page.evaluate("navigator.clipboard.readText()")
        with page.context.new_page() as tab:
            tab.goto(address)
            expect(tab).to_have_title(re.compile(first.name))
        # The instance ends while the user selects it.
        editor.command("commram: Open browser page")
        row = page.locator(".quick-input-list .monaco-list-row").filter(has_text=second.name)
        expect(row).to_be_visible()
        second.stop()
        row.click()
        refusal = page.locator(".notifications-toasts .notification-list-item")
        expect(refusal.first).to_contain_text(f"instance '{second.name}' is not running")
    finally:
        first.stop()
        second.stop()


STEPS = [
    a_wrong_register_is_underlined_and_completed,
    a_failing_test_shows_its_line,
    a_breakpoint_stops_and_steps_lead_forward_and_back,
    a_page_is_offered_and_a_refusal_is_shown,
    a_debugger_without_its_program_says_so,
]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("code_server", type=pathlib.Path)
    parser.add_argument("extension")
    parser.add_argument("--pictures")
    parser.add_argument("--chromium", default="chromium")
    options = parser.parse_args()

    def expired(number, _frame):
        raise SystemExit(f"ended by {signal.Signals(number).name}")

    for number in (signal.SIGALRM, signal.SIGTERM, signal.SIGINT):
        signal.signal(number, expired)
    signal.alarm(LIMIT)
    expect.set_options(timeout=PATIENCE * 1000)
    with contextlib.ExitStack() as stack:
        work = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="commram-vscode-")))
        project = work / "press"
        project.mkdir()
        (project / "handshake.rhai").write_text(SCENARIO)
        address = stack.enter_context(code_server(options.code_server.resolve(), options.extension, work))
        playwright = stack.enter_context(sync_playwright())
        browser = playwright.chromium.launch(executable_path=options.chromium, args=["--no-sandbox"])
        stack.callback(browser.close)
        page = browser.new_context(viewport={"width": 900, "height": 480}).new_page()
        page.set_default_timeout(PATIENCE * 1000)
        editor = Editor(page, options.pictures, work / "data")
        try:
            editor.open(address, project, "handshake.rhai")
            for step in STEPS:
                step(editor)
                print(f"passed  {step.__name__}", flush=True)
        except BaseException:
            picture = os.path.join(tempfile.gettempdir(), "commram-vscode-failure.png")
            page.screenshot(path=picture)
            print(f"the window at the failure: {picture}", file=sys.stderr)
            raise


if __name__ == "__main__":
    main()
