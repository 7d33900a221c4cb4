// `commram dap` as @vscode/debugadapter-testsupport, a client by other authors, uses it.
//
// Run with node in a directory with the package; the variable COMMRAM names the program.

import assert from "node:assert";
import * as fs from "node:fs";
import * as os from "node:os";
import * as path from "node:path";
import { createRequire } from "node:module";

const { DebugClient } = createRequire(path.join(process.cwd(), "package.json"))("@vscode/debugadapter-testsupport");

const directory = fs.mkdtempSync(path.join(os.tmpdir(), "commram-dap-"));
const program = path.join(directory, "own.rhai");
fs.writeFileSync(
  program,
  `fn begin(node) {
    poke(node + ".w_CPU_CONTROL", 1);
}
begin("node2");
step("2ms");
print("started");
expect("node2.w_CPU_CONTROL", 5);
`,
);

/** Calls `act` with a client, and ends it. */
async function session(act) {
  const client = new DebugClient(process.env.COMMRAM, "dap", "commram");
  await client.start();
  client.defaultTimeout = 20000;
  try {
    await act(client);
  } finally {
    await client.stop();
  }
}

try {
  await session((client) => client.hitBreakpoint({ program }, { path: program, line: 2 }));
  await session(async (client) => {
    await Promise.all([
      client.configurationSequence(),
      client.launch({ program, stopOnEntry: true }),
      client.assertStoppedLocation("entry", { path: program, line: 4 }),
    ]);
    await Promise.all([client.stepInRequest({ threadId: 1 }), client.assertStoppedLocation("step", { line: 2 })]);
    await Promise.all([client.stepOutRequest({ threadId: 1 }), client.assertStoppedLocation("step", { line: 5 })]);
    const { body } = await client.evaluateRequest({ expression: "node2.w_CPU_CONTROL", frameId: 0 });
    assert.match(body.result, /16#0001/);
    await Promise.all([client.stepBackRequest({ threadId: 1 }), client.assertStoppedLocation("step", { line: 4 })]);
    await Promise.all([client.nextRequest({ threadId: 1 }), client.assertStoppedLocation("step", { line: 5 })]);
    await Promise.all([
      client.continueRequest({ threadId: 1 }),
      client.assertOutput("stdout", "started"),
      client.assertStoppedLocation("exception", { path: program, line: 7 }),
    ]);
    await Promise.all([client.continueRequest({ threadId: 1 }), client.waitForEvent("terminated")]);
  });
  console.log("2 sessions passed");
} finally {
  fs.rmSync(directory, { recursive: true });
}
