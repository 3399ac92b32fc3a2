// A service in a directory of its own, and a live run on a simulated machine.

import { execFile, spawn } from "node:child_process";
import { createHash, randomBytes } from "node:crypto";
import { existsSync, readFileSync, rmSync, writeFileSync, openSync } from "node:fs";
import { join } from "node:path";
import { setTimeout as pause } from "node:timers/promises";
import { promisify } from "node:util";

const binary = process.env.FEEDWAVE_BINARY;
const PATIENCE_MS = 60_000;

/** Waits until something is there; never for a time. */
export const until = async (what, look) => {
  const end = Date.now() + PATIENCE_MS;
  for (;;) {
    const found = await look();
    if (found) return found;
    if (Date.now() > end) throw new Error(`waited in vain: ${what}`);
    await pause(20);
  }
};

export class Service {
  /** With `clients`, lines of TOML by name, it knows these alone, and `tokens` has what each shows. */
  constructor(folder, clients = {}) {
    this.folder = folder;
    this.tokens = {};
    this.clients = Object.entries(clients).map(([name, lines]) => {
      this.tokens[name] = randomBytes(32).toString("hex");
      const hash = createHash("sha256").update(this.tokens[name]).digest("hex");
      return `[[client]]\nname = "${name}"\ntoken_sha256 = "${hash}"\n${lines}\n`;
    });
    /** Who asks, where it has to be said. */
    this.token = Object.values(this.tokens)[0];
    this.ports = { grpc: 0, http: 0, mtconnect: 0 };
    this.children = new Set();
  }

  /** Starts it; again on the same ports. */
  async start() {
    const [config, ready] = ["feedwave.toml", "ready.json"].map((name) => join(this.folder, name));
    const { grpc, http, mtconnect } = this.ports;
    const known = join(this.folder, "clients.toml");
    if (this.clients.length > 0) writeFileSync(known, this.clients.join("\n"));
    const auth = this.clients.length > 0 ? `[auth]\nclients = "${known}"\n` : "";
    writeFileSync(config, `${auth}[grpc]\nlisten = "127.0.0.1:${grpc}"\n[http]\nlisten = "127.0.0.1:${http}"\nheartbeat_s = 1\n[mtconnect]\nlisten = "127.0.0.1:${mtconnect}"\n[store]\nuri = "sqlite://${this.folder}/feedwave.db"\n`);
    rmSync(ready, { force: true });
    const log = openSync(join(this.folder, "log.txt"), "a");
    this.process = spawn(binary, ["serve", "--config", config, "--ready-file", ready], { stdio: ["ignore", "ignore", log] });
    this.children.add(this.process);
    const text = await until("the service is ready", () => {
      if (this.process.exitCode !== null) throw new Error(`the service ended: ${readFileSync(join(this.folder, "log.txt"))}`);
      const text = existsSync(ready) ? readFileSync(ready, "utf8") : "";
      return text.endsWith("}") || text.endsWith("}\n") ? text : null;
    });
    const addresses = JSON.parse(text);
    for (const name of Object.keys(this.ports)) this.ports[name] = addresses[name].split(":").at(-1);
    this.url = `http://127.0.0.1:${this.ports.http}`;
  }

  async kill() {
    const ended = new Promise((resolve) => this.process.once("exit", resolve));
    this.process.kill("SIGKILL");
    await ended;
  }

  async get(path) {
    const response = await fetch(this.url + path, { headers: this.token ? { authorization: `Bearer ${this.token}` } : {} });
    if (!response.ok) throw new Error(`${path}: ${response.status} ${await response.text()}`);
    return response.json();
  }

  /** A job from a program; as it is when its validation has ended, whatever came of it. */
  async submit(file, ...options) {
    const url = `http://127.0.0.1:${this.ports.grpc}`;
    const submitted = await promisify(execFile)(binary, ["submit", file, "--server", url, ...options], { env: { ...process.env, ...(this.token ? { FEEDWAVE_TOKEN: this.token } : {}) } });
    const [name] = submitted.stdout.match(/jobs\/[0-9a-f-]{36}/);
    // Another tenant's is not to be seen.
    if (options.includes("--tenant")) return { name };
    return until(`${name} is validated`, async () => {
      const job = await this.get(`/v1/${name}`);
      return ["JOB_STATE_READY", "JOB_STATE_REJECTED"].includes(job.state) ? job : null;
    });
  }

  /** A live run of a job on a simulated machine. */
  run(job, ...options) {
    const url = `http://127.0.0.1:${this.ports.grpc}`;
    const child = spawn(binary, ["run", job, "--simulate", "--server", url, ...options], { stdio: "ignore" });
    this.children.add(child);
    return child;
  }

  end() {
    for (const child of this.children) {
      child.kill("SIGCONT");
      child.kill("SIGKILL");
    }
  }
}
