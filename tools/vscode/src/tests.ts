// Shows scenarios in the list of tests. `commram test --format events` runs them; each line of its output is an event.

import { type ChildProcess, spawn } from "node:child_process";
import * as readline from "node:readline";
import * as vscode from "vscode";
import { configurationOf } from "./debug";

/** An event of `commram test`, with the keys that this extension uses. */
interface TestEvent {
  event: string;
  file?: string;
  name?: string;
  text?: string;
  message?: string;
  script?: string;
  line?: number;
  expected_text?: string;
  actual_text?: string;
  outcome?: string;
  real_us?: number;
  journal?: { text: string }[];
}

/** Longest message, in characters, that fits above two compared values; the editor cuts a longer one. */
const LONGEST_TITLE = 60;

const SCRIPTS = "**/*.rhai";

/** The scenarios of the open folders. */
export class ScenarioTests implements vscode.Disposable {
  private readonly controller = vscode.tests.createTestController("commram", "commram");
  private readonly watcher = vscode.workspace.createFileSystemWatcher(SCRIPTS);

  constructor(private readonly program: () => string) {
    const run = (request: vscode.TestRunRequest, token: vscode.CancellationToken) => this.run(request, token);
    this.controller.createRunProfile("Run", vscode.TestRunProfileKind.Run, run, true);
    const debug = (request: vscode.TestRunRequest, token: vscode.CancellationToken) => this.debug(request, token);
    this.controller.createRunProfile("Debug", vscode.TestRunProfileKind.Debug, debug, true);
    this.controller.refreshHandler = () => this.find();
    this.watcher.onDidCreate(() => this.find());
    this.watcher.onDidDelete(() => this.find());
    void this.find();
  }

  dispose(): void {
    this.watcher.dispose();
    this.controller.dispose();
  }

  /** Asks the program which scripts are scenarios: it leaves out scripts that only share functions. */
  private async find(): Promise<void> {
    const items: vscode.TestItem[] = [];
    for (const folder of vscode.workspace.workspaceFolders ?? []) {
      const list = await this.output(["test", "--list", "--format", "json", "--", "."], folder.uri.fsPath);
      for (const { scenario, file } of parsed<{ scenario: string; file: string }[]>(list) ?? []) {
        const uri = vscode.Uri.joinPath(folder.uri, file);
        items.push(this.controller.createTestItem(uri.fsPath, scenario, uri));
      }
    }
    this.controller.items.replace(items);
  }

  private output(args: string[], cwd: string): Promise<string> {
    return new Promise((resolve) => {
      const child = spawn(this.program(), args, { cwd, stdio: ["ignore", "pipe", "ignore"] });
      let text = "";
      child.stdout.on("data", (data) => (text += data));
      // Without the program there are no tests; the language server reports the reason.
      child.on("error", () => resolve(""));
      child.on("close", () => resolve(text));
    });
  }

  /** Starts a debug session for each scenario. The debug console shows the results. */
  private async debug(request: vscode.TestRunRequest, token: vscode.CancellationToken): Promise<void> {
    const wanted = request.include ?? [...this.controller.items].map(([, item]) => item);
    for (const item of wanted) {
      if (item.uri && !request.exclude?.includes(item) && !token.isCancellationRequested) {
        await vscode.debug.startDebugging(vscode.workspace.getWorkspaceFolder(item.uri), configurationOf(item.uri));
      }
    }
  }

  private async run(request: vscode.TestRunRequest, token: vscode.CancellationToken): Promise<void> {
    const wanted = request.include ?? [...this.controller.items].map(([, item]) => item);
    const items = new Map(wanted.filter((item) => !request.exclude?.includes(item)).map((item) => [item.id, item]));
    if (items.size === 0 || !vscode.workspace.isTrusted) {
      return;
    }
    const run = this.controller.createTestRun(request);
    const child = spawn(this.program(), ["test", "--format", "events", "--", ...items.keys()], {
      stdio: ["ignore", "pipe", "pipe"],
    });
    token.onCancellationRequested(() => child.kill("SIGINT"));
    child.stderr.on("data", (data) => run.appendOutput(String(data).replaceAll("\n", "\r\n")));
    const failures = new Map<string, vscode.TestMessage>();
    const ended = exited(child);
    try {
      for await (const line of readline.createInterface({ input: child.stdout })) {
        const event = parsed<TestEvent>(line);
        const item = event?.file === undefined ? undefined : items.get(event.file);
        if (event && item) {
          report(run, item, event, failures);
        }
      }
      const reason = await ended;
      if (reason) {
        items.forEach((item) => run.errored(item, new vscode.TestMessage(reason)));
      }
    } finally {
      run.end();
    }
  }
}

/** The reason why a program did not start; `undefined` if it ended. */
function exited(child: ChildProcess): Promise<string | undefined> {
  return new Promise((resolve) => {
    child.on("error", (error) => resolve(error.message));
    child.on("close", () => resolve(undefined));
  });
}

function parsed<T>(text: string): T | undefined {
  try {
    return JSON.parse(text) as T;
  } catch {
    return undefined;
  }
}

/** Shows an event of a scenario. */
function report(
  run: vscode.TestRun,
  item: vscode.TestItem,
  event: TestEvent,
  failures: Map<string, vscode.TestMessage>,
): void {
  switch (event.event) {
    case "begin":
      run.started(item);
      break;
    case "section":
      run.appendOutput(`section: ${event.name}\r\n`, undefined, item);
      break;
    case "output":
      run.appendOutput((event.text ?? "").replaceAll("\n", "\r\n"), undefined, item);
      break;
    case "failure":
      failures.set(item.id, message(item, event));
      run.appendOutput(details(event).join("\r\n") + "\r\n", undefined, item);
      break;
    case "end": {
      const took = event.real_us === undefined ? undefined : event.real_us / 1000;
      const failure = failures.get(item.id) ?? new vscode.TestMessage(event.outcome ?? "");
      if (event.outcome === "passed") {
        run.passed(item, took);
      } else if (event.outcome === "failed") {
        run.failed(item, failure, took);
      } else if (event.outcome === "skipped" || event.outcome === "not run") {
        run.skipped(item);
      } else {
        run.errored(item, failure, took);
      }
      break;
    }
  }
}

/** The whole failure: its message and the journal before it. */
function details({ message, journal }: TestEvent): string[] {
  const lines = (message ?? "").split("\n");
  return journal?.length ? [...lines, "journal:", ...journal.map(({ text }) => `  ${text}`)] : lines;
}

/** The failure at its line, with the expected and the actual value side by side if its message is short. */
function message(item: vscode.TestItem, event: TestEvent): vscode.TestMessage {
  const text = event.message ?? "";
  const { expected_text: expected, actual_text: actual } = event;
  const has = expected !== undefined && expected !== null && actual !== undefined && actual !== null;
  const fits = has && text.length <= LONGEST_TITLE;
  const shown = fits ? vscode.TestMessage.diff(text, expected, actual) : new vscode.TestMessage(details(event).join("\n"));
  const uri = event.script ? vscode.Uri.file(event.script) : item.uri;
  if (uri && event.line) {
    shown.location = new vscode.Location(uri, new vscode.Position(event.line - 1, 0));
  }
  return shown;
}
