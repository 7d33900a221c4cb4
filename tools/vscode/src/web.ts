// Opens the page of a running instance in the browser. The page forbids frames, so no panel of the editor can show it (D-848).

import { type ChildProcess, spawn } from "node:child_process";
import * as readline from "node:readline";
import * as vscode from "vscode";

const ADDRESS = /http:\/\/\S+#token=[0-9a-f]+/;

/** An instance in the output of `commram list`. */
interface Instance {
  name: string;
  state: string;
}

/** A running `commram web`. */
interface Server {
  child: ChildProcess;
  address: string;
}

/**
 * Opens an address in the browser. An editor in a browser, such as code-server, would open the address of a proxy, which
 * loses the token: it offers the address instead.
 */
async function show(instance: string, address: string): Promise<void> {
  if (vscode.env.uiKind === vscode.UIKind.Desktop) {
    await vscode.env.openExternal(vscode.Uri.parse(address));
    return;
  }
  const [origin] = address.split("#");
  const text = `The page of instance '${instance}' is at ${origin}. The copied address contains the token.`;
  if ((await vscode.window.showInformationMessage(text, "Copy Address")) !== undefined) {
    await vscode.env.clipboard.writeText(address);
  }
}

/** The servers of pages that this window started, one for each instance. */
export class WebPages implements vscode.Disposable {
  private readonly servers = new Map<string, Server>();

  constructor(private readonly program: () => string) {}

  dispose(): void {
    this.servers.forEach(({ child }) => child.kill());
    this.servers.clear();
  }

  /** Opens the page of an instance; shows the message of the program if there is no page. */
  async open(): Promise<void> {
    try {
      const instance = await this.choose();
      if (instance === undefined) {
        return;
      }
      const server = this.servers.get(instance) ?? (await this.start(instance));
      await show(instance, server.address);
    } catch (error) {
      void vscode.window.showErrorMessage(error instanceof Error ? error.message : String(error));
    }
  }

  /** The only running instance, or the one that the user selects; `undefined` if the user cancels. */
  private async choose(): Promise<string | undefined> {
    const instances = JSON.parse(await this.output(["list", "--format", "json"])) as Instance[];
    const names = instances.filter(({ state }) => state === "ready").map(({ name }) => name);
    if (names.length > 1) {
      return vscode.window.showQuickPick(names, { placeHolder: "Instance whose page the browser opens" });
    }
    // Without an instance, `commram web` reports how to start the instance `default`.
    return names[0] ?? "default";
  }

  /** Returns the standard output of a command that ends by itself. Fails with its message if its exit code is not 0. */
  private output(args: string[]): Promise<string> {
    return new Promise((resolve, reject) => {
      const child = spawn(this.program(), args, { stdio: ["ignore", "pipe", "pipe"] });
      let [text, errors] = ["", ""];
      child.stdout.on("data", (data) => (text += data));
      child.stderr.on("data", (data) => (errors += data));
      child.on("error", reject);
      child.on("close", (code) => (code === 0 ? resolve(text) : reject(new Error(errors.trim()))));
    });
  }

  /** Starts the server of an instance and waits for its address. Fails with the message of the program. */
  private start(instance: string): Promise<Server> {
    return new Promise((resolve, reject) => {
      const args = ["web", "-i", instance, "--listen", "127.0.0.1:0"];
      const child = spawn(this.program(), args, { stdio: ["ignore", "pipe", "pipe"] });
      let errors = "";
      child.stderr.on("data", (data) => (errors += data));
      readline.createInterface({ input: child.stdout }).on("line", (line) => {
        const address = ADDRESS.exec(line)?.[0];
        if (address !== undefined) {
          const server = { child, address };
          this.servers.set(instance, server);
          resolve(server);
        }
      });
      child.on("error", reject);
      child.on("close", (code) => {
        // A new server of this instance may have taken the place.
        if (this.servers.get(instance)?.child === child) {
          this.servers.delete(instance);
        }
        reject(new Error(errors.trim() || `commram web ended with exit code ${code}`));
      });
    });
  }
}
