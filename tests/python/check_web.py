"""Drives the page of `commram web` in a headless Chromium. Each page must show what the channel says, and each control must act.

    check_web.py CHROMIUM COMMRAM [--axe axe.min.js] [--pictures DIRECTORY] [--load]

With `--axe` each page is checked with axe-core, light and dark; with `--pictures` the pictures of the documentation are
made; with `--load` the speed is measured."""

import argparse
import contextlib
import json
import mmap
import os
import re
import subprocess
import tempfile
import threading
import time
from pathlib import Path

from browser import PATIENCE, Page, browsing

PAGES = ["plant", "registers", "followed", "bus", "panel", "drives", "canopen", "faults", "findings", "journal"]
EXAMPLE = Path(__file__).parents[2] / "tools" / "examples" / "wrong-order"
# Finds the violations of axe-core, each with its first elements.
AXE = """axe.run(document, { resultTypes: ["violations"] }).then((found) =>
    found.violations.map((it) => [it.id, it.help, it.nodes.slice(0, 3).map((node) => node.html.slice(0, 200))]))"""


CANOPEN = """
[[bus]]
name = "open"
kind = "can"
kbit_s = 125
[[device]]
kind = "cs0015"
name = "panel"
bus = "open"
node_id = 32
kbit_s = 125
[[device]]
kind = "cr201x"
name = "io"
module = "cr2011"
bus = "open"
node_id = 5
"""


class Emulator:
    """A running `commram run` with the server of its page."""

    def __init__(self, program, *arguments, web=(), listen="127.0.0.1:0"):
        self.program, self.name = program, f"web{os.getpid()}"
        self.run("run", *arguments, "--detach")
        command = [program, "web", "-i", self.name, "--listen", listen, *web]
        self.server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        line = self.server.stdout.readline()
        self.address = re.search(r"http://\S+#token=[0-9a-f]+", line).group()

    def run(self, name, *arguments):
        command = [self.program, name, *arguments, "-i", self.name]
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=PATIENCE).stdout

    def json(self, name, *arguments):
        return json.loads(self.run(name, *arguments, "--format", "json"))

    def peek(self, register):
        return self.json("peek", register)[0]

    def stop(self):
        self.server.terminate()
        self.server.wait(PATIENCE)
        self.server.stdout.close()
        subprocess.run([self.program, "stop", "--clean", "-i", self.name], capture_output=True, check=False)


class Check:
    def __init__(self, emulator, page):
        self.emulator, self.page = emulator, page
        self.origin = emulator.address.split("#")[0]

    def go(self, name):
        target = json.dumps(f"#/{self.emulator.name}/{name}")
        # If the address of the shown page has further parts, opening its plain address draws the page again.
        self.page.value(f"window.old = location.hash.startsWith({target} + '/') && document.getElementById('page-{name}'); location.hash = {target}; true")
        self.page.until(f"![null, window.old].includes(document.getElementById('page-{name}'))", name)

    def waits_for(self, read, wanted, what):
        end = time.monotonic() + PATIENCE
        while read() != wanted:
            assert time.monotonic() < end, (what, read(), wanted)
            time.sleep(0.05)

    def all(self):
        self.sign_in()
        for step in [self.broken_address, self.registers, self.poke, self.clock, self.bits, self.sources, self.force, self.front, self.faults, self.journal, self.drives, self.plant, self.bus, self.values, self.keyboard, self.narrow, self.record]:
            step()
            assert not (wrong := self.page.complaints()), (step.__name__, wrong)
        self.sizes()

    def sign_in(self):
        self.page.open(self.origin)
        self.page.until("document.querySelector('form input[type=password]') !== null")
        # The browser reports the refused request itself.
        self.page.complaints()
        # A user pastes the address into the tab that asks for the token.
        self.page.value(f"location.hash = {json.dumps(self.emulator.address.split('#')[1])}")
        self.page.until(f"document.title.includes({json.dumps(self.emulator.name)})")
        assert "token" not in self.page.value("location.href")

    def broken_address(self):
        self.page.value("""(() => {
            const send = window.fetch;
            window.requested = [];
            window.fetch = (path, ...rest) => { window.requested.push(path); return send(path, ...rest); };
            return true;
        })()""")
        self.page.value("location.hash = '#/%E0%A4%A/plant'; true")
        self.page.until("document.querySelector('main .error')?.textContent.includes('%E0%A4%A')")
        # No instance is chosen now, so the page sends no requests for one. It opens its event stream after a short delay.
        time.sleep(0.5)
        requests = json.loads(self.page.value("JSON.stringify(window.requested)"))
        assert requests and not [it for it in requests if "/null/" in it], requests
        self.page.value(f"location.hash = '#/{self.emulator.name}/registers/%E0%A4%A'; true")
        self.page.until("document.querySelectorAll('.rows-body .row').length > 0")
        # The browser reports the refused request for the unknown instance itself.
        self.page.complaints()

    def choose_block(self, area, structure):
        self.go("registers")
        self.page.click(f"[data-block='line:{area}:{structure}']")

    def choose_register(self, name):
        self.page.enter(".searchbar input", name)
        self.page.until(f"[...document.querySelectorAll('.rows-body .name')].some((it) => it.textContent.endsWith({json.dumps(name)}))")
        self.page.click(".rows-body .name", name)
        self.page.until(f"document.querySelector('.detail h2')?.textContent === {json.dumps(name)}")

    def row(self, name, part):
        script = f"""(() => {{ const row = [...document.querySelectorAll(".rows-body .row")].find((it) => it.parts.name.textContent === {json.dumps(name)});
            return row ? row.parts[{json.dumps(part)}].textContent : ""; }})()"""
        return self.page.value(script)

    def registers(self):
        self.choose_block("node2", "CANsync_INIT_BMSTRUCT")
        for name in ["w_OPTION_STATUS", "b_BT_0", "w_OMEGA_NR"]:
            known = self.emulator.peek(f"node2.{name}")
            self.waits_for(lambda: self.row(name, "value"), known["hex"], name)
            assert known["meaning"] in self.row(name, "meaning"), (known, self.row(name, "meaning"))

    def poke(self):
        self.choose_register("node2.w_CPU_CONTROL")
        self.page.enter(".detail input[name=value]", "handshake")
        self.page.click(".detail button", "Poke")
        self.waits_for(lambda: self.emulator.peek("node2.w_CPU_CONTROL")["value"], 1, "poke")
        self.page.until("document.querySelector('.now').textContent.startsWith('16#0001')")
        self.refuses("16#10000", "does not fit")
        # A digit that the base does not have is refused, not cut off.
        for wrong in ["2#12", "0b12", "8#19", "1e3", "0b101", "0o17", "1__0", "16#-1"]:
            self.refuses(wrong, f"'{wrong}' is not a value")
        assert self.emulator.peek("node2.w_CPU_CONTROL")["value"] == 1
        for right, value in [("2#1_0", 2), ("8#17", 15), ("0x1", 1)]:
            self.page.enter(".detail input[name=value]", right)
            self.page.click(".detail button", "Poke")
            self.waits_for(lambda: self.emulator.peek("node2.w_CPU_CONTROL")["value"], value, right)

    def says(self, text):
        self.page.until(f"document.getElementById('message').textContent.includes({json.dumps(text)})", text)

    def refuses(self, value, reason):
        self.page.enter(".detail input[name=value]", value)
        self.page.click(".detail button", "Poke")
        self.says(reason)

    def time_us(self):
        return self.emulator.json("status")[0]["time_us"]

    def clock(self):
        self.page.enter("#clock input", "3ms")
        self.page.click("#clock button", "Step")
        self.waits_for(self.time_us, 3_000, "step")
        self.page.until("document.querySelector('.time').textContent === '0.003000 s'")
        self.page.click("#clock button", "Back")
        self.waits_for(self.time_us, 0, "back")
        self.page.value("document.activeElement.blur()")
        self.page.key("s")
        self.waits_for(self.time_us, 3_000, "key s")
        self.page.key("w")
        self.page.until("document.querySelector('dialog[open] input[name=text]') !== null")
        self.page.enter("dialog input[name=text]", "node2.w_OPTION_STATUS==16#0002 and node2.w_CPU_CONTROL&1!=0")
        self.page.click("dialog button", "Wait")
        self.page.until("document.getElementById('message').textContent.includes('is true')")
        assert self.emulator.peek("node2.w_OPTION_STATUS")["value"] == 2
        self.page.key("?")
        self.page.until("document.querySelector('dialog[open]') !== null")
        self.page.key("Escape")
        self.page.until("document.querySelector('dialog[open]') === null")

    def bits(self):
        self.choose_register("node2.w_CPU_CONTROL")
        self.page.click(".detail [role=switch].switch", "Bit 6, enable")
        self.waits_for(lambda: self.emulator.peek("node2.w_CPU_CONTROL")["value"], 0x41, "bit 6")
        # The buttons stay where they are, however long the meaning is.
        place = "document.querySelector('.bitstrip').offsetTop"
        before = self.page.value(place)
        self.page.click(".detail .bit", "7")
        self.waits_for(lambda: self.emulator.peek("node2.w_CPU_CONTROL")["value"], 0xC1, "bit 7")
        self.page.until("document.querySelector('.now').textContent.startsWith('16#00C1')")
        assert self.page.value(place) == before
        self.page.click(".detail .bit", "7")
        self.page.until("document.querySelector('.switch[aria-label=\"Bit 6, enable\"]').ariaChecked === 'true'")
        self.page.click(".detail [role=switch].switch", "Bit 6, enable")
        self.waits_for(lambda: self.emulator.peek("node2.w_CPU_CONTROL")["value"], 1, "bit 6 off")

    def sources(self):
        """Inferred bits have the number of the decision."""
        self.choose_register("baps.w_CONTROLWORD")
        self.page.until("document.querySelector('.detail .bits')?.textContent.includes('(inferred D-87)')")
        # The search finds values as the page shows them.
        self.page.enter(".searchbar input", "16#0020")
        self.page.until("document.querySelectorAll('.rows-body .row').length > 0")

    def force(self):
        self.choose_register("node1.w_CPU_CONTROL")
        self.page.enter(".detail input[name=value]", "16#0001")
        self.page.click(".detail button", "Force")
        self.waits_for(lambda: self.emulator.peek("node1.w_CPU_CONTROL")["forced"], True, "force")
        self.page.until("!document.querySelector('.detail .write button:nth-of-type(3)').disabled")
        self.page.click(".detail button", "Unforce")
        self.waits_for(lambda: self.emulator.peek("node1.w_CPU_CONTROL")["forced"], False, "unforce")
        # The list has the name of the present phase, not the name of another phase at the same place.
        address = self.emulator.peek("node2.b_CTRLREG_WRC1")["address"]
        live = self.emulator.peek(address)["register"]
        self.emulator.run("force", f"{address}=4")
        self.go("faults")
        self.page.until(f"document.querySelector('[aria-label=\"Forced registers\"] tbody td')?.textContent === {json.dumps('line:' + live)}")
        self.page.click("#page-faults button", f"Unforce line:{live}")
        self.waits_for(lambda: self.emulator.peek(address)["forced"], False, "unforce in the list")

    def board(self):
        return json.loads(self.emulator.run("board", "get", "--format", "json"))[0]

    def front(self):
        self.go("panel")
        self.page.click("[role=slider][aria-label=SWITCH] text", "STOP")
        self.waits_for(lambda: self.board()["switch"], "stop", "switch")
        self.page.until("document.querySelector('[role=slider][aria-label=SWITCH]').ariaValueText === 'stop'")
        self.page.click("[role=slider][aria-label=SWITCH] text", "RUN")
        self.waits_for(lambda: self.board()["switch"], "run", "switch")
        # The arrow keys move the switch in the direction that the drawing shows. At its end positions, a key has no
        # effect.
        self.page.value("document.querySelector('[role=slider][aria-label=SWITCH]').focus()")
        for key, position in [("ArrowUp", "run"), ("ArrowDown", "stop"), ("ArrowUp", "run")]:
            self.page.key(key)
            self.page.until(f"document.querySelector('[role=slider][aria-label=SWITCH]').ariaValueText === '{position}'")
            self.waits_for(lambda: self.board()["switch"], position, key)
        self.page.click("[role=switch]", "DIP 1")
        self.waits_for(lambda: self.board()["dip"], 1, "DIP switch")
        self.page.until("document.querySelector('[role=switch][aria-label=\"DIP 1\"]').ariaChecked === 'true'")
        self.page.click("[role=switch]", "DIP 1")
        self.waits_for(lambda: self.board()["dip"], 0, "DIP switch")

    def faults_known(self):
        return [fault["kind"] for fault in json.loads(self.emulator.run("fault", "list", "--format", "json"))]

    def faults(self):
        self.go("faults")
        self.page.until("document.querySelectorAll('#page-faults select option').length > 5")
        self.page.choose("#page-faults select", "lose_frame")
        self.page.choose("#page-faults select[name=slot]", "WRC1")
        self.page.enter("#page-faults input[name=count]", "3")
        self.page.enter("#page-faults input[name=at_us]", "4s")
        self.page.click("button", "Add the fault")
        self.waits_for(self.faults_known, ["lose_frame"], "fault")
        self.page.until("document.querySelector('#page-faults table')?.textContent.includes('slot=WRC1')")
        self.page.click("#page-faults button", "Clear all")
        self.waits_for(self.faults_known, [], "clear")

    def journal(self):
        self.go("journal")
        self.page.until("document.querySelectorAll('.journal .rows-body .row').length > 3")
        self.page.enter("#page-journal input[type=search]", "w_CPU_CONTROL handshake")
        self.page.until("document.querySelector('.journal .rows-body .row')?.textContent.includes('w_CPU_CONTROL')")
        # A different filter changes the numbers of the rows, but not the selected record.
        self.page.enter("#page-journal input[type=search]", " ")
        row = """[...document.querySelectorAll('.journal .rows-body .row')].findLast((it) => it.parts[1].textContent === 'channel_write')"""
        self.page.until(f"{row}?.dataset.index > 1")
        index, text = self.page.value(f"(() => {{ const row = {row}; row.parts[2].click(); return [row.dataset.index, row.textContent]; }})()")
        self.page.enter("#page-journal input[type=search]", "channel_write")
        chosen = "document.querySelector('.journal .row[aria-selected=true]')"
        self.page.until(f"{chosen} && {chosen}.dataset.index < {index}")
        assert self.page.value(f"{chosen}.textContent") == text
        record = json.loads(self.page.text(".record-detail"))
        assert record["kind"] == "channel_write"
        self.page.enter("#page-journal input[type=search]", "nothing has this")
        self.page.until("document.querySelector('.journal .empty').textContent.includes('No record')")
        # The filter finds a record by its time, and its link shows this time on the bus.
        self.page.enter("#page-journal input[type=search]", f"{record['time_us'] / 1e6:.6f}")
        self.page.until("document.querySelectorAll('.journal .rows-body .row').length > 0")
        self.page.click("#page-journal a")
        self.page.until("document.querySelector('#page-bus .timeline') !== null")

    def drives(self):
        self.go("drives")
        for drive in json.loads(self.emulator.run("drive", "list", "--format", "json")):
            state = drive["state"].replace("_", " ")
            self.page.until(f"document.querySelector('#page-drives tbody')?.innerText.includes({json.dumps(drive['drive'])})")
            assert state in self.page.text("#page-drives tbody"), drive
        self.page.until("document.querySelector('#page-drives .parameters') !== null")
        for source in ["manual: 5.00005.03a p. 74", "inferred: parameter D-162"]:
            assert source in self.page.text("#page-drives .parameters"), source
        # The fields show the values of the parameters, and a refused entry disappears.
        field = "document.querySelector('#page-drives .parameters input')"
        name = self.page.until(f"{field}?.getAttribute('aria-label')")
        number, known = name.split()[0], int(self.page.until(f"{field}.value"))
        drive = json.loads(self.emulator.run("drive", "list", "--format", "json"))[0]["drive"]
        self.page.value(f"{field}.focus(); {field}.value = 'x'; {field}.dispatchEvent(new Event('change'))")
        self.says("'x' is not a value")
        self.page.until(f"{field}.value === '{known}'")
        self.page.value("document.activeElement.blur()")
        self.emulator.run("drive", "set", drive, f"{number}={known + 1}")
        self.page.key("s")
        self.page.until(f"{field}.value === '{known + 1}'")

    def plant(self):
        self.go("plant")
        status = self.emulator.json("status")[0]
        shown = self.page.until("document.querySelector('#page-plant table') && document.getElementById('page-plant').innerText")
        for name in [status["plcs"][0]["plc"], status["buses"][0]["bus"], *[node["text"] for node in status["nodes"] if node["text"]]]:
            assert name in shown, (name, shown)

    def bus(self):
        self.go("bus")
        self.page.until("document.querySelector('#page-bus .timeline') !== null")

    def values(self):
        """An element has its own address, and is found by it."""
        name = "node2.a_RD_BMARRAY[1][0]"
        known = self.emulator.peek(name)
        self.go("registers")
        for text in [name, known["address"]]:
            self.page.enter(".searchbar input", text)
            self.page.until(f"document.querySelector('.rows-body .name')?.textContent === {json.dumps(name)}", text)
            self.page.click(".rows-body .name", name)
            facts = "Object.fromEntries([...document.querySelectorAll('.detail .facts dt')].map((it) => [it.textContent, it.nextSibling.textContent]))"
            self.page.until(f"{facts}.Address === {json.dumps(known['address'])}")
            cpu = self.emulator.json("map", name)[0]["cpu_address"]
            assert self.page.value(f"{facts}['CPU address']") == cpu
        # The age is that of the last change, also if the change has restored the value.
        for pokes, age in [(["16#5"], "1 ms"), (["16#6", "16#5"], "2 ms")]:
            for value in pokes:
                self.emulator.run("poke", f"{name}={value}")
            self.emulator.run("step", age.replace(" ", ""))
            self.waits_for(lambda: (self.row(name, "value"), self.row(name, "age")), ("16#00000005", age), "age")
        # The plot refuses a text without a time.
        self.page.click(".detail .star")
        self.go("followed")
        for wrong in ["last abc", "-1ms", "0"]:
            self.page.value(f"(() => {{ const it = document.querySelector('#page-followed input.mono'); it.value = '{wrong}'; it.dispatchEvent(new Event('change')); }})()")
            self.page.until("document.querySelector('#page-followed input.mono').value === '100 ms'")
            self.page.until("document.querySelector('#message .bad') !== null")
            self.page.click("#message button")
        # The chart is drawn for the width of the window.
        for width in [900, 1280]:
            self.page.size(width, 800)
            self.page.until("[0, 1].includes(document.querySelector('canvas').width - document.querySelector('canvas').clientWidth)")

    def keyboard(self):
        self.go("registers")
        self.page.value("document.activeElement.blur()")
        self.page.key("/")
        self.page.enter(".searchbar input", "node2.w_CPU_CONTROL")
        self.page.key("ArrowDown")
        self.page.until("document.activeElement.matches('.rows') && document.querySelector('.detail h2')?.textContent === 'node2.w_CPU_CONTROL'")

    def narrow(self):
        """On a small screen the chosen register leaves the clock free, and Esc closes it; records have room for their values."""
        self.page.size(390, 844)
        self.choose_register("node2.w_CPU_CONTROL")
        detail = "document.querySelector('.detail').getBoundingClientRect()"
        self.page.until(f"{detail}.height > 0 && {detail}.top >= document.getElementById('clock').getBoundingClientRect().bottom")
        self.page.value("document.activeElement.blur()")
        self.page.key("Escape")
        self.page.until(f"{detail}.height === 0")
        self.go("journal")
        self.page.until("document.querySelector('.journal .rows-body .row')?.getBoundingClientRect().height === 68")
        self.page.size(1280, 800)

    def record(self):
        """The recording of a handshake is a scenario that passes."""
        self.emulator.run("step", "--back", f"{self.time_us()}us")
        self.page.until("document.querySelector('.time').textContent === '0.000000 s'")
        # The recording begins at power-on, before these pokes at the time 0. So they do not become part of it.
        self.emulator.run("poke", "node2.w_CPU_CONTROL=16#0001")
        self.page.click("button.record")
        self.page.click("dialog button", "Go back and record")
        self.waits_for(lambda: self.emulator.peek("node2.w_CPU_CONTROL")["value"], 0, "start")
        self.go("registers")
        self.choose_register("node2.w_CPU_CONTROL")
        self.page.enter(".detail input[name=value]", "16#0001")
        self.page.click(".detail button", "Poke")
        self.waits_for(lambda: self.emulator.peek("node2.w_CPU_CONTROL")["value"], 1, "poke")
        self.page.click("#clock button", "Step")
        self.waits_for(self.time_us, 3_000, "step")
        self.page.until("document.querySelector('button.record').textContent === 'Recording: 2'")
        # A reload of the page keeps the recording.
        self.page.open("about:blank")
        self.page.open(f"{self.origin}#/{self.emulator.name}/registers")
        self.page.until("document.querySelector('button.record')?.textContent === 'Recording: 2'")
        self.choose_register("node2.w_OPTION_STATUS")
        self.page.until("document.querySelector('.now').textContent.startsWith('16#0002')")
        self.page.click(".detail button", "Expect this value")
        self.passes(0, "w_OPTION_STATUS")
        self.copied()
        self.page.enter(".detail input[name=expected]", "16#0003")
        self.page.click(".detail button", "Expect this value")
        # The expectation does not hold now, so the page must not report success.
        self.page.until("document.querySelector('#message .warn')?.textContent.includes('has 16#0002 now')")
        self.passes(1, "16#0003", delete=4)
        self.page.value("document.activeElement.blur()")
        self.page.key("w")
        self.page.enter("dialog input[name=text]", "node2.w_OPTION_STATUS==16#0077 and node2.w_CPU_CONTROL&1!=0")
        self.page.enter("dialog input[name=within]", "4ms")
        self.page.click("dialog button", "Wait")
        self.says("did not become true in 4ms: node2.w_OPTION_STATUS is 16#0002")
        # The browser reports the refused request itself.
        self.page.complaints()
        self.passes(1, "wait_until", delete=4)
        self.undone()
        self.moved()
        self.foreign()
        self.page.click("button.record")
        self.page.until("document.querySelector('dialog .code')?.textContent.includes('w_CPU_CONTROL')")
        self.page.key("Escape")

    def copied(self):
        """The button "Copy" selects the text if the browser denies the clipboard, and a small screen has room while a recording runs."""
        self.page.click(".tools button", "Scenario")
        script = self.page.until("document.querySelector('dialog .code')?.textContent.includes('w_OPTION_STATUS') && document.querySelector('dialog .code').textContent")
        self.page.value("(window.copied = null, Object.defineProperty(navigator, 'clipboard', { configurable: true, value: { writeText: (text) => Promise.resolve(copied = text) } }), 0)")
        self.page.click("dialog button", "Copy")
        self.page.until(f"copied === {json.dumps(script)}")
        self.page.value("(Object.defineProperty(navigator, 'clipboard', { configurable: true, value: undefined }), 0)")
        self.page.click("dialog button", "Copy")
        self.page.until(f"getSelection().toString().trim() === {json.dumps(script.strip())}")
        self.page.key("Escape")
        self.page.size(390, 844)
        self.page.until("document.querySelector('.tools').getBoundingClientRect().top >= document.querySelector('.instance').getBoundingClientRect().bottom")
        self.page.until("document.documentElement.scrollWidth <= 390")
        self.page.size(1280, 800)

    def undone(self):
        """Going back to a condition removes the undone actions, and the next wait has only its own condition."""
        before = self.page.text("button.record")
        self.page.value("document.activeElement.blur()")
        self.page.key("s")
        self.page.until(f"document.querySelector('button.record').textContent !== {json.dumps(before)}")
        self.page.key("B")
        self.page.enter("dialog input[name=text]", "node2.w_OPTION_STATUS==2")
        self.page.click("dialog button", "Go back")
        self.says("The plant is back")
        self.page.key("w")
        self.page.enter("dialog input[name=text]", "node2.w_CPU_CONTROL==1")
        self.page.click("dialog button", "Wait")
        self.says("w_CPU_CONTROL==1 is true")
        self.passes(0, "w_CPU_CONTROL")

    def moved(self):
        """The buttons of a row swap two actions, and keep the focus."""
        rows = "[...document.querySelectorAll('.recorded li')].map((it) => it.textContent)"
        self.page.click("button", "Scenario")
        self.page.until("document.querySelector('dialog .code').textContent.includes('step')")
        before = self.page.value(rows)
        self.page.click("dialog button", "Move action 2 up")
        after = self.page.value(rows)
        assert "step" in before[1] and "step" in after[0] and "poke" in after[1], (before, after)
        assert self.page.value("document.activeElement.ariaLabel") == "Move action 1 down"
        self.page.key("Enter")
        assert self.page.value(rows) == before
        self.page.key("Escape")

    def foreign(self):
        """A store of another program is not recorded, and page and file say so."""
        self.emulator.run("poke", "node2.b_BT_0=9")
        self.page.until("document.getElementById('notice').textContent.includes('1 store of other programs')")
        self.page.click("button", "Scenario")
        self.page.until("document.querySelector('dialog .code').textContent.includes('// Not recorded: 1 store of other programs')")
        self.page.key("Escape")

    def passes(self, code, part, delete=None):
        """The scenario so far contains `part`, and `commram test` ends with `code`; then an action is deleted."""
        self.page.click(".tools button", "Scenario")
        script = self.page.until(f"document.querySelector('dialog .code')?.textContent.includes({json.dumps(part)}) && document.querySelector('dialog .code').textContent")
        if delete:
            self.page.click("dialog button", f"Delete action {delete}")
            self.page.until(f"!document.querySelector('dialog .code').textContent.includes({json.dumps(part)})")
        self.page.key("Escape")
        with tempfile.TemporaryDirectory() as directory:
            file = Path(directory) / "recorded.rhai"
            file.write_text(script)
            done = subprocess.run([self.emulator.program, "test", str(file)], capture_output=True, text=True, timeout=PATIENCE)
            assert done.returncode == code, (script, done.stdout, done.stderr)

    def sizes(self):
        for name in PAGES:
            self.go(name)
            for width, height in [(390, 844), (1280, 800), (2560, 1300)]:
                self.page.size(width, height)
                wide = self.page.value("document.documentElement.scrollWidth")
                assert wide <= width, (name, width, wide)
            assert not (wrong := self.page.complaints()), (name, wrong)


    def wrong_order(self):
        """The changes of the two registers show that the request precedes its data (docs/guide/debugging.md)."""
        names = ["node2.a_CONTROLWORD_SL[1]", "node2.a_STEUREG_CONTROLWORD[1]"]
        for name in names:
            self.go("registers")
            self.choose_register(name)
            self.page.key("Escape")
            self.page.click(".star", f"Follow {name}")
        self.go("followed")
        self.page.until("document.querySelectorAll('.changes .rows-body .row').length >= 9")
        rows = self.page.value("[...document.querySelectorAll('.changes .rows-body .row')].map((it) => [it.parts[2].textContent, it.parts[4].textContent])")
        first = next(at for at, (name, value) in enumerate(rows) if name == names[1] and "16#05" in value)
        assert rows[first + 1][0] == names[1] and rows[first + 2][0] == names[0], rows

    def back(self):
        """Going back only removes changes."""
        rows = "[...document.querySelectorAll('.changes .rows-body .row')].map((it) => it.parts.map((part) => part.textContent).join(' '))"
        before, shown = None, self.page.until(f"{rows}.length >= 9 && {rows}")
        # The list counts as complete when it has not changed for a second.
        while before != shown:
            time.sleep(1)
            before, shown = shown, self.page.value(rows)
        self.page.enter("#clock input", "25ms")
        self.page.click("#clock button", "Back")
        self.page.until(f"{rows}.length < {len(before)}")
        # The server reports the differences with the next values.
        time.sleep(0.3)
        after = self.page.value(rows)
        assert after and after == before[: len(after)], (before, after)

    def axe(self, source):
        """Checks each page, light and dark."""
        self.page.value(f"{source}; true")
        for scheme in ["light", "dark"]:
            self.page.colours(scheme)
            for name in PAGES:
                self.go(name)
                if name == "registers":
                    self.choose_register("node2.w_CPU_CONTROL")
                # A change of colours takes some time.
                time.sleep(0.5)
                assert not (wrong := self.page.value(AXE)), (scheme, name, wrong)

    def pictures(self, directory):
        self.page.size(1280, 800)
        self.page.colours("light")
        for name in ["followed", "bus", "panel"]:
            self.go(name)
            time.sleep(1)
            self.page.picture(Path(directory) / f"browser-{name}.png")
        self.go("registers")
        self.choose_register("node2.w_CPU_CONTROL")
        self.page.click("[data-block='line:node2:CANsync_MA_CTRL_BMSTRUCT']")
        time.sleep(1)
        self.page.picture(Path(directory) / "browser-registers.png")


# Counts the updates of the clock on the screen for five seconds.
LOAD = """new Promise((done) => {
    let updates = 0;
    const begin = performance.now();
    const observer = new MutationObserver(() => (updates += 1));
    observer.observe(document.querySelector(".rows-body .value"), { subtree: true, characterData: true, childList: true });
    setTimeout(() => done(updates / ((performance.now() - begin) / 1000)), 5_000);
})"""
FOLLOWED = [f"line:node2.a_RD_BMARRAY[{slave}][{word}]" for slave in range(4) for word in range(15)]
# Address of the first followed register, and the number of bytes up to the last one.
FIRST, BYTES = 200_832, 256
FIRST_PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"


@contextlib.contextmanager
def changing(instance):
    """Changes the followed registers 200 times a second, as a program with a mapped image."""
    image = os.open(f"/dev/shm/commram.{instance}.line", os.O_RDWR)
    ram, ended = mmap.mmap(image, 0), threading.Event()

    def store():
        number = 0
        while not ended.wait(1 / 200):
            number += 1
            ram[FIRST:FIRST + BYTES] = number.to_bytes(4, "little") * (BYTES // 4)

    writer = threading.Thread(target=store)
    writer.start()
    try:
        yield
    finally:
        ended.set()
        writer.join()


def load(program, browser):
    """With 60 followed registers of a plant in real time that change 200 times a second: updates of the page per second; and the first paint."""
    emulator = Emulator(program, str(EXAMPLE.with_suffix(".toml")))
    try:
        page = Page(browser)
        page.size(1280, 2200)
        page.open("about:blank")
        page.open(emulator.address)
        page.until("document.querySelectorAll('#nav a').length > 5")
        first_paint = page.until(FIRST_PAINT)
        page.value(f"localStorage.setItem('commram.followed.{emulator.name}', {json.dumps(json.dumps(FOLLOWED))})")
        page.value(f"location.hash = '#/{emulator.name}/registers/followed'")
        page.value("location.reload()")
        page.until("document.querySelectorAll('.rows-body .row').length >= 60")
        with changing(emulator.name):
            page.until("/^16#0*[1-9A-F]/.test(document.querySelector('.rows-body .value').textContent)")
            return {"first_paint_ms": round(first_paint), "updates_per_second": round(page.value(LOAD), 1)}
    finally:
        emulator.stop()


@contextlib.contextmanager
def opened(program, browser, *arguments, **options):
    """An emulator and its page after the page has loaded."""
    emulator = Emulator(program, *arguments, **options)
    try:
        page = Page(browser)
        page.open("about:blank")
        page.open(emulator.address)
        page.until("document.querySelectorAll('#nav a').length > 5")
        yield emulator, page
    finally:
        emulator.stop()


def read_only(program, browser):
    """The page of a server that only reads disables its controls and says why."""
    with opened(program, browser, "--clock", "stepped", web=["--read-only"]) as (emulator, page):
        page.until("document.querySelectorAll('[data-acts]').length > 5")
        page.until("[...document.querySelectorAll('[data-acts]')].every((it) => it.disabled && it.title.includes('--read-only'))")
        page.until("document.getElementById('notice').textContent.includes('Read-only')")
        assert not (wrong := page.complaints()), wrong


def real_time(program, browser):
    """The speed of a real-time clock, and its pause."""
    with opened(program, browser) as (emulator, page):
        check = Check(emulator, page)
        speed = lambda: emulator.json("status")[0]["speed"]
        page.click("#clock button", "Pause")
        check.waits_for(speed, 0, "pause")
        page.until("document.querySelector('#clock .run').ariaPressed === 'true' && document.querySelector('#clock .kind').textContent.includes('paused')")
        assert check.time_us() == check.time_us()
        page.click("#clock button", "10\u00d7")
        check.waits_for(speed, 10, "10")
        page.until("document.querySelector('#clock .run').ariaPressed !== 'true'")
        page.value("document.activeElement.blur()")
        page.key(" ")
        check.waits_for(speed, 0, "key")
        page.until("document.querySelector('#clock .run').ariaPressed === 'true'")
        page.key(" ")
        check.waits_for(speed, 10, "continued")
        assert not (wrong := page.complaints()), wrong


def restarted(program, browser):
    """A new server at the same port asks for its token."""
    emulator = Emulator(program, "--clock", "stepped")
    try:
        page = Page(browser)
        page.open("about:blank")
        page.open(emulator.address)
        page.until("document.querySelectorAll('#nav a').length > 5")
        emulator.run("stop")
        page.until("document.getElementById('notice').textContent.includes('has ended')")
        emulator.stop()
        emulator = Emulator(program, "--clock", "stepped", listen=re.search(r"//([^/]+)/", emulator.address).group(1))
        page.click("#notice button", "Try again")
        page.until("document.querySelector('form input[type=password]') !== null")
    finally:
        emulator.stop()


def frozen(program, browser):
    """A page that the browser has frozen shows the present state when it continues."""
    with opened(program, browser, "--clock", "stepped") as (emulator, page):
        shows = lambda time: page.until(f"document.querySelector('#clock .time')?.textContent === '{time} s'")
        shows("0.000000")
        other = browser.ask("Target.createTarget", url="about:blank")["targetId"]
        browser.ask("Target.activateTarget", targetId=other)
        page.until("document.hidden")
        browser.ask("Page.setWebLifecycleState", state="frozen")
        emulator.run("step", "1ms")
        browser.ask("Page.setWebLifecycleState", state="active")
        browser.ask("Page.bringToFront")
        browser.ask("Target.closeTarget", targetId=other)
        shows("0.001000")
        emulator.run("step", "1ms")
        shows("0.002000")
        assert not (wrong := page.complaints()), wrong


def other_plant(program, browser):
    """A register that the present plant does not have stops no other value."""
    with opened(program, browser, "--clock", "stepped") as (emulator, page):
        page.value(f"localStorage.setItem('commram.followed.{emulator.name}', JSON.stringify(['line:node2.w_CPU_CONTROL', 'gone:dp.w_X'])); location.hash = '#/{emulator.name}/followed'; location.reload(); true")
        page.until("document.querySelector('.chips')?.textContent.includes('(not in this plant)')")
        page.until("document.querySelectorAll('.chips .chip').length === 2")
        emulator.run("step", "1ms")
        page.until("document.querySelector('#clock .time')?.textContent === '0.001000 s'")
        # The page Registers shows a block if the plant has none of the followed registers.
        for rest in ["", "/followed"]:
            page.value(f"localStorage.setItem('commram.followed.{emulator.name}', JSON.stringify(['gone:dp.w_X'])); location.hash = '#/{emulator.name}/registers{rest}'; true")
            page.reload()
            page.until("document.querySelectorAll('.registers-page .rows-body .row').length > 1", rest)
        # The browser reports the refused request for the map of the unknown PLC itself.
        page.complaints()


def late_stream(program, browser):
    """The page CANopen shows frames that a node sends before the stream of the page is open."""
    with tempfile.TemporaryDirectory() as directory:
        plant = Path(directory, "plant.toml")
        plant.write_text(CANOPEN)
        with opened(program, browser, str(plant), "--clock", "stepped") as (emulator, page):
            # The first stream of the page begins after the emulated time in which the node sends frames. A slow browser may open
            # a stream without the journal before, from which on the server keeps the records.
            late = """const send = window.fetch;
                let readAt = 0;
                window.fetch = async (path, options) => {
                    if (path.includes("/events?") && !path.includes("journal=1")) return new Promise(() => {});
                    if (path.includes("/events?")) {
                        // If the page reads the past before the stream, it has done so.
                        while (performance.now() - readAt < 500) await new Promise((resolve) => setTimeout(resolve, 20));
                        window.fetch = send;
                        const headers = { ...options.headers, Accept: "application/json", "Content-Type": "application/json" };
                        await send(path.replace(/events.*/, "advance"), { method: "POST", headers, body: '{"us": 5000000}' });
                    }
                    if (!path.includes("/journal?")) return send(path, options);
                    readAt = Infinity;
                    return send(path, options).finally(() => (readAt = performance.now()));
                };"""
            script = browser.ask("Page.addScriptToEvaluateOnNewDocument", source=late)
            page.value(f"location.hash = '#/{emulator.name}/canopen'; true")
            page.reload()
            row = "[...document.querySelectorAll('main table tr')].find((it) => it.textContent.includes('Node 5'))?.textContent"
            page.until(f"{row} && !{row}.includes('0.000000 s')")
            browser.ask("Page.removeScriptToEvaluateOnNewDocument", identifier=script["identifier"])
            assert not (wrong := page.complaints()), wrong


def objects(program, browser):
    """The object dictionary of a node marks inferred objects and default values."""
    with tempfile.TemporaryDirectory() as directory:
        plant = Path(directory, "plant.toml")
        plant.write_text(CANOPEN)
        with opened(program, browser, str(plant), "--clock", "stepped") as (emulator, page):
            # The page CANopen lists the nodes of the journal.
            emulator.run("step", "5s")
            page.value(f"location.hash = '#/{emulator.name}/canopen'; true")
            page.until("document.querySelector('main table')?.textContent.includes('Node 5')")
            page.until("document.querySelector('main').textContent.includes('device type (inferred D-451)')")
            page.click("main button", "Node 32")
            page.until("document.querySelector('main').textContent.includes('CS0015_G (inferred D-407)')")
            assert not (wrong := page.complaints()), wrong


def debugging(program, browser, given):
    """The faulty program of the debugging page, found on the page alone."""
    emulator = Emulator(program, str(EXAMPLE.with_suffix(".toml")), "--clock", "stepped", "--record", "node2")
    try:
        command = [program, "test", str(EXAMPLE.with_suffix(".rhai")), "--attach", emulator.name]
        assert subprocess.run(command, capture_output=True, check=False, timeout=PATIENCE).returncode == 1
        page = Page(browser)
        page.size(1280, 800)
        check = Check(emulator, page)
        page.open("about:blank")
        page.open(emulator.address)
        page.until("document.querySelectorAll('#nav a').length > 5")
        check.wrong_order()
        if given.axe:
            check.axe(Path(given.axe).read_text())
        if given.pictures:
            check.pictures(given.pictures)
        check.go("followed")
        check.back()
        assert not (wrong := page.complaints()), wrong
    finally:
        emulator.stop()


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("chromium")
    arguments.add_argument("commram")
    arguments.add_argument("--axe")
    arguments.add_argument("--pictures")
    arguments.add_argument("--load", action="store_true")
    given = arguments.parse_args()
    program = os.path.abspath(given.commram)
    result = {"passed": True}
    with browsing(given.chromium) as browser:
        emulator = Emulator(program, "--clock", "stepped")
        try:
            page = Page(browser)
            page.size(1280, 800)
            Check(emulator, page).all()
        finally:
            emulator.stop()
        read_only(program, browser)
        restarted(program, browser)
        frozen(program, browser)
        objects(program, browser)
        other_plant(program, browser)
        late_stream(program, browser)
        real_time(program, browser)
        debugging(program, browser, given)
        if given.load:
            result |= load(program, browser)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
