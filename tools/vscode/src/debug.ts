// Debugs scenarios: VS Code starts `commram dap` for each session.

import * as vscode from "vscode";

export const TYPE = "commram";

/** Makes the adapter of a session. */
class Adapter implements vscode.DebugAdapterDescriptorFactory {
  constructor(private readonly program: () => string) {}

  createDebugAdapterDescriptor(): vscode.DebugAdapterDescriptor {
    return new vscode.DebugAdapterExecutable(this.program(), ["dap"]);
  }
}

/** Debugs the open scenario if there is no `launch.json`. */
class OpenScenario implements vscode.DebugConfigurationProvider {
  resolveDebugConfiguration(
    folder: vscode.WorkspaceFolder | undefined,
    configuration: vscode.DebugConfiguration,
  ): vscode.DebugConfiguration | undefined {
    if (configuration.type) {
      return configuration;
    }
    const document = vscode.window.activeTextEditor?.document;
    return document?.languageId === "rhai" ? configurationOf(document.uri) : undefined;
  }
}

/** The configuration for a scenario. */
export function configurationOf(uri: vscode.Uri): vscode.DebugConfiguration {
  return { type: TYPE, request: "launch", name: "Scenario", program: uri.fsPath };
}

/** Registers the debugger. */
export function registerDebugger(program: () => string): vscode.Disposable {
  return vscode.Disposable.from(
    vscode.debug.registerDebugAdapterDescriptorFactory(TYPE, new Adapter(program)),
    vscode.debug.registerDebugConfigurationProvider(TYPE, new OpenScenario()),
  );
}
