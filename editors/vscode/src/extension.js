// @ts-check
"use strict";

// Starts `feedwave lsp` and connects the editor with it; everything about programs is in the server.

const { spawn } = require("node:child_process");
const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

/** @type {LanguageClient | undefined} */
let client;

/** @type {import("node:child_process").ChildProcess | undefined} */
let server;

/** Starts and stops happen one after the other. @type {Promise<void>} */
let turn = Promise.resolve();

/** @param {() => Promise<void>} step */
function inTurn(step) {
    turn = turn.then(step, step);
    return turn;
}

function settings() {
    return vscode.workspace.getConfiguration("feedwave");
}

function options() {
    return { options: settings().get("options") ?? {} };
}

/** @returns {Promise<import("node:child_process").ChildProcess>} */
function launch() {
    const cwd = vscode.workspace.workspaceFolders?.[0]?.uri.fsPath;
    return new Promise((resolve, reject) => {
        const child = spawn(settings().get("path", "feedwave"), ["lsp"], { cwd });
        server = child;
        child.once("error", reject);
        child.once("spawn", () => resolve(child));
    });
}

async function start() {
    const started = new LanguageClient(
        "feedwave",
        "feedwave",
        launch,
        { documentSelector: [{ scheme: "file", language: "gcode" }, { scheme: "untitled", language: "gcode" }], initializationOptions: options() },
    );
    client = started;
    try {
        await started.start();
        if (client !== started) {
            await started.stop();
        }
    } catch (error) {
        // Who ended it while it started knows why; nobody who starts it again waits for the answer.
        if (client === started) {
            void complain(error);
        }
    }
}

/** @param {unknown} error */
async function complain(error) {
    const reason = error instanceof Error ? error.message : String(error);
    const chosen = await vscode.window.showErrorMessage(
        `feedwave lsp did not start (${reason}). The setting feedwave.path says where the binary is.`,
        "Open settings",
    );
    if (chosen !== undefined) {
        await vscode.commands.executeCommand("workbench.action.openSettings", "feedwave.path");
    }
}

async function stop() {
    const former = client;
    client = undefined;
    if (former?.isRunning()) {
        await former.stop();
    }
}

/** Ends a server that has not answered yet, so that its start ends, too. */
function endStart() {
    if (client !== undefined && !client.isRunning()) {
        client = undefined;
        server?.kill();
    }
}

function restart() {
    endStart();
    return inTurn(async () => {
        await stop();
        await start();
    });
}

/** @param {vscode.ExtensionContext} context */
async function activate(context) {
    context.subscriptions.push(
        vscode.commands.registerCommand("feedwave.restart", restart),
        vscode.workspace.onDidChangeConfiguration(async (change) => {
            if (change.affectsConfiguration("feedwave.path")) {
                await restart();
            } else if (change.affectsConfiguration("feedwave.options") && client?.isRunning()) {
                await client.sendNotification("workspace/didChangeConfiguration", { settings: { feedwave: options() } });
            }
        }),
    );
    await inTurn(start);
}

function deactivate() {
    endStart();
    return inTurn(stop);
}

module.exports = { activate, deactivate };
