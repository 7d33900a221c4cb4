// The extension for VS Code: starts the language server, debugs scenarios, offers them as tests, and opens
// the page of a running instance.

import * as vscode from "vscode";
import { LanguageClient } from "vscode-languageclient/node";
import { registerDebugger } from "./debug";
import { ScenarioTests } from "./tests";
import { WebPages } from "./web";

let client: LanguageClient | undefined;

/** The program, as the settings name it. */
function program(): string {
  return vscode.workspace.getConfiguration("commram").get<string>("program") || "commram";
}

/** Starts the language server; the editor shows the reason if the program is missing. */
async function start(): Promise<void> {
  const options = { command: program(), args: ["lsp"] };
  client = new LanguageClient("commram", "commram", options, {
    documentSelector: [
      { scheme: "file", language: "rhai" },
      { scheme: "file", pattern: "**/*.toml" },
    ],
    synchronize: { fileEvents: vscode.workspace.createFileSystemWatcher("**/*.{toml,rhai}") },
  });
  await client.start();
}

/** Starts the language server anew, also after a start that has failed. */
async function restartServer(): Promise<void> {
  if (client?.isRunning()) {
    await client.stop();
  }
  await start();
}

export async function activate(context: vscode.ExtensionContext): Promise<void> {
  const restart = vscode.commands.registerCommand("commram.restart", restartServer);
  const changed = vscode.workspace.onDidChangeConfiguration(async (event) => {
    if (event.affectsConfiguration("commram.program")) {
      await restartServer();
    }
  });
  const pages = new WebPages(program);
  const page = vscode.commands.registerCommand("commram.openPage", () => pages.open());
  context.subscriptions.push(restart, changed, page, pages, new ScenarioTests(program), registerDebugger(program));
  await start();
}

export async function deactivate(): Promise<void> {
  if (client?.isRunning()) {
    await client.stop();
  }
}
