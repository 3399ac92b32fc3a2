// @ts-check
"use strict";

// Starts `feedwave lsp` and connects the editor with it; everything about programs is in the server.

const vscode = require("vscode");
const { LanguageClient, TransportKind } = require("vscode-languageclient/node");

/** @type {LanguageClient | undefined} */
let client;

function settings() {
    return vscode.workspace.getConfiguration("feedwave");
}

function options() {
    return { options: settings().get("options") ?? {} };
}

async function start() {
    const run = {
        command: settings().get("path", "feedwave"),
        args: ["lsp"],
        transport: TransportKind.stdio,
    };
    client = new LanguageClient(
        "feedwave",
        "feedwave",
        { run, debug: run },
        { documentSelector: [{ scheme: "file", language: "gcode" }, { scheme: "untitled", language: "gcode" }], initializationOptions: options() },
    );
    try {
        await client.start();
    } catch (error) {
        const reason = error instanceof Error ? error.message : String(error);
        const chosen = await vscode.window.showErrorMessage(
            `feedwave lsp did not start (${reason}). The setting feedwave.path says where the binary is.`,
            "Open settings",
        );
        if (chosen !== undefined) {
            await vscode.commands.executeCommand("workbench.action.openSettings", "feedwave.path");
        }
    }
}

async function stop() {
    const former = client;
    client = undefined;
    if (former?.isRunning()) {
        await former.stop();
    }
}

async function restart() {
    await stop();
    await start();
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
    await start();
}

module.exports = { activate, deactivate: stop };
