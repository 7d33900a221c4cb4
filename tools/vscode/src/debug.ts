// Debugs scenarios: VS Code starts `commram dap` for each session. The status bar shows the emulated time of a stop.

import { spawn } from "node:child_process";
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
  constructor(private readonly program: () => string) {}

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

  /** VS Code reports nothing if an adapter does not start, so this method tries the program first. */
  async resolveDebugConfigurationWithSubstitutedVariables(
    folder: vscode.WorkspaceFolder | undefined,
    configuration: vscode.DebugConfiguration,
  ): Promise<vscode.DebugConfiguration | undefined> {
    const reason = await refusal(this.program());
    if (reason === undefined) {
      return configuration;
    }
    const text = `The debugger does not start: ${reason}. The setting commram.program names the program.`;
    void vscode.window.showErrorMessage(text, "Open Setting").then((choice) => {
      if (choice !== undefined) {
        void vscode.commands.executeCommand("workbench.action.openSettings", "commram.program");
      }
    });
    return undefined;
  }
}

/** The reason why a program does not start; `undefined` if it starts. */
function refusal(program: string): Promise<string | undefined> {
  return new Promise((resolve) => {
    const child = spawn(program, ["--version"], { stdio: "ignore" });
    child.on("error", (error) => resolve(error.message));
    child.on("close", () => resolve(undefined));
  });
}

/** Shows the emulated time at which a scenario has stopped. */
class Clock implements vscode.DebugAdapterTrackerFactory, vscode.Disposable {
  private readonly item = vscode.window.createStatusBarItem("commram.time", vscode.StatusBarAlignment.Left);

  constructor() {
    this.item.name = "Emulated time";
    this.item.tooltip = "Emulated time at which the scenario has stopped";
  }

  dispose(): void {
    this.item.dispose();
  }

  createDebugAdapterTracker(): vscode.DebugAdapterTracker {
    return {
      onDidSendMessage: ({ type, event, body }) => {
        if (type === "event" && event === "stopped" && typeof body?.emulatedTime === "string") {
          this.item.text = `$(watch) ${body.emulatedTime} emulated`;
          this.item.show();
        }
      },
      onWillStopSession: () => this.item.hide(),
    };
  }
}

/** The configuration for a scenario. */
export function configurationOf(uri: vscode.Uri): vscode.DebugConfiguration {
  return { type: TYPE, request: "launch", name: "Scenario", program: uri.fsPath };
}

/** Registers the debugger. */
export function registerDebugger(program: () => string): vscode.Disposable {
  const clock = new Clock();
  return vscode.Disposable.from(
    clock,
    vscode.debug.registerDebugAdapterDescriptorFactory(TYPE, new Adapter(program)),
    vscode.debug.registerDebugConfigurationProvider(TYPE, new OpenScenario(program)),
    vscode.debug.registerDebugAdapterTrackerFactory(TYPE, clock),
  );
}
