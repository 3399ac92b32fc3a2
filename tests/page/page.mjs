// Every screen of the page in a real browser, and every kind of document of the MTConnect agent: see run.sh.

import assert from "node:assert/strict";
import { execFile, spawnSync } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { promisify } from "node:util";
import { chromium } from "playwright-core";

import * as programs from "./programs.mjs";
import { Service, until } from "./service.mjs";

const scratch = process.argv[2];
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const service = new Service(join(scratch, "service"));
const LARGE = { width: 1920, height: 1080 };
const SMALL = { width: 390, height: 844 };

let browser;
const problems = [];

/** A page that may ask nothing but the service, and whose console stays empty. */
const open = async (path, { isMissing = false, ...options } = {}, from = service) => {
  const context = await browser.newContext({ viewport: LARGE, locale: "en-GB", ...options });
  const page = await context.newPage();
  page.on("request", (request) => {
    if (!request.url().startsWith(`${from.url}/`)) problems.push(`asks ${request.url()}`);
  });
  page.on("console", (message) => {
    // A service that is away, and what is not there, are said so by the browser as well.
    const isAway = (page.isServiceAway || page.isUnknown || isMissing) && /401|404|ERR_CONNECTION|ERR_INCOMPLETE|net::/.test(message.text());
    // The test looks at what is drawn more often than a page does.
    const isOwn = message.text().startsWith("Canvas2D: Multiple readback");
    if (["error", "warning"].includes(message.type()) && !isAway && !isOwn) problems.push(`console: ${message.text()}`);
  });
  page.on("pageerror", (error) => problems.push(`error: ${error.stack}`));
  page.isUnknown = from.token !== undefined;
  await page.goto(from.url + path);
  return page;
};

const shot = (page, name) => page.screenshot({ path: join(scratch, "screenshots", `${name}.png`), animations: "disabled" });

/** What is laid out is as wide as the window, and nothing that a screen reader needs is missing. */
const isAccessible = async (page, name) => {
  const widths = await page.evaluate(() => [document.documentElement.scrollWidth, document.documentElement.clientWidth]);
  assert.ok(widths[0] <= widths[1], `${name} is wider than its window: ${widths}`);
  // As a script of the browser's owner: the page's own policy permits no foreign ones.
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document));
  const told = violations.map((one) => `${one.id}: ${one.help}: ${one.nodes.map((node) => node.html).slice(0, 3).join(" | ")}`);
  assert.deepEqual(told, [], `${name} has violations`);
};

const textOf = (page, selector) => page.locator(selector).innerText();
const percent = (ratio) => `${Math.round(ratio * 100)}`;

/** The state of a machine, once two answers in turn are the same: then nothing moves any more. */
const settled = (machine) => {
  let before = "";
  let same = 0;
  return until(`${machine} is at rest`, async () => {
    const state = await service.get(`/v1/machines/${machine}/state`);
    const text = JSON.stringify({ ...state, run: { ...state.run, updateTime: "" } });
    same = text === before ? same + 1 : 0;
    before = text;
    return same >= 15 ? state : null;
  });
};

const board = async (state) => {
  const page = await open("/");
  const card = page.locator(`a.card[href="/${state.run.run}"]`);
  await card.waitFor();
  assert.equal(await page.locator("a.card").count(), (await service.get("/v1/machines")).states.length);
  await until("the card shows the override", async () =>
    (await card.locator(".override .figure").innerText()).replace(/\D/g, "") === percent(state.run.overrides.feed));
  assert.match(await card.locator(".job").innerText(), new RegExp(`Pocket.* ${state.run.commanded.line}$`));
  assert.equal((await card.locator(".state").innerText()).toLowerCase(), "running");
  const alarm = await card.locator(".alarm").innerText();
  assert.equal(alarm !== "", (state.conditions ?? []).length > 0);
  // Why the feed is as it is, also while later decisions keep it, and how long ago the last one was made.
  const why = await card.innerText();
  assert.ok(state.run.feedDecision, JSON.stringify(state.run));
  assert.match(why, /decided (\d+ s|[\d:]+) ago/);
  assert.equal(await card.locator(".reason").innerText() !== "", alarm === "");
  await isAccessible(page, "board");
  await shot(page, "board");

  // In the other language, in the dark, on the wall, on a telephone, and at twice the size.
  await page.locator("#language").click();
  assert.equal(await page.evaluate(() => document.documentElement.lang), "de");
  assert.equal((await card.locator(".state").innerText()).toLowerCase(), "läuft");
  await page.locator("#theme").click();
  await page.locator("#theme").click();
  await isAccessible(page, "board, dark and German");
  await shot(page, "board-dark-german");
  await page.goto(`${service.url}/?view=wall`);
  await card.waitFor();
  const size = await card.locator(".override .figure").evaluate((node) => parseFloat(getComputedStyle(node).fontSize));
  assert.ok(size >= 56, `figures of the wall are ${size} px high`);
  const cut = await page.locator("a.card").evaluateAll((cards) => cards
    .filter((card) => card.scrollWidth > card.clientWidth || card.scrollHeight > card.clientHeight)
    .map((card) => card.innerText));
  assert.deepEqual(cut, [], "cards of the wall that are not wholly seen");
  // Few machines have large cards, and what is in them is as large as they are.
  const filled = await card.evaluate((node) => {
    const [first, last] = [node.firstElementChild, [...node.children].filter((child) => child.offsetHeight > 0).at(-1)].map((one) => one.getBoundingClientRect());
    return (last.bottom - first.top) / node.getBoundingClientRect().height;
  });
  assert.ok(filled > 0.7, `the card of the wall is filled by ${filled}`);
  await shot(page, "wall");
  await page.context().close();
  for (const [name, viewport] of [["telephone", SMALL], ["twice", { width: 960, height: 540 }]]) {
    const other = await open("/", { viewport });
    await other.locator("a.card").first().waitFor();
    await isAccessible(other, name);
    await shot(other, `board-${name}`);
    await other.context().close();
  }
};

const run = async (state) => {
  const page = await open("/");
  // From the board by the keyboard alone.
  const card = page.locator(`a.card[href="/${state.run.run}"]`);
  await card.waitFor();
  await until("the card has the focus", async () => {
    await page.keyboard.press("Tab");
    return card.evaluate((node) => node === document.activeElement);
  });
  await page.keyboard.press("Enter");
  await page.locator(".run .title").waitFor();
  assert.equal(new URL(page.url()).pathname, `/${state.run.run}`);
  assert.equal(await textOf(page, ".run .title"), "Pocket");
  const { decisions } = await service.get(`/v1/decisions?run=${state.run.run}&pageSize=500`);
  assert.ok(decisions.length > 0, "nothing was decided");
  await until("all decisions are drawn", async () => (await page.locator(".timeline .decision").count()) === decisions.length);
  const facts = await textOf(page, ".run-head .facts");
  for (const part of [state.run.overrides.feed * 100, state.run.commanded.feedMmPerMin]) {
    assert.ok(facts.replaceAll(",", "").includes(part.toFixed(1).replace(/\.0$/, "")), `${part} is not in ${facts}`);
  }
  // Each decision with what was seen.
  await page.locator(".timeline").focus();
  await page.keyboard.press("Home");
  assert.match(await textOf(page, ".detail h3"), new RegExp(` ${decisions[0].number}$`));
  await page.keyboard.press("End");
  assert.match(await textOf(page, ".detail h3"), new RegExp(` ${decisions.at(-1).number}$`));
  const after = percent(decisions.at(-1).outcome.after.feed);
  assert.ok((await textOf(page, ".detail .facts")).includes(after), `${after} is not in the detail`);
  // Now is on every axis.
  assert.equal(await page.locator(".chart-now").count(), 4);
  assert.equal(await page.locator(".timeline").getAttribute("data-open"), "true");
  await isAccessible(page, "run");
  await page.screenshot({ path: join(scratch, "screenshots", "run.png"), fullPage: true });
  await page.setViewportSize(SMALL);
  await until("the charts are as wide as they are shown", () => page.locator("svg.chart").evaluateAll((charts) =>
    charts.every((chart) => chart.viewBox.baseVal.width === chart.clientWidth)));
  await isAccessible(page, "run on a telephone");
  await page.screenshot({ path: join(scratch, "screenshots", "run-telephone.png"), fullPage: true });
  await page.context().close();
};

/** What the service says is in English, and marked so, on a page in German. */
const refusal = async () => {
  const page = await open("/runs/01900000-0000-7000-8000-000000000001", { isMissing: true });
  await page.locator("#language").click();
  const said = page.locator(".notice [lang=en]");
  await said.waitFor();
  assert.match(await page.locator(".notice").innerText(), /^Konnte nicht gelesen werden: /);
  assert.match(await said.innerText(), /does not exist$/);
  await page.context().close();
};

const jobs = async (wrong) => {
  const page = await open("/jobs");
  const listed = (await service.get("/v1/jobs")).jobs;
  await until("all jobs are listed", async () => (await page.locator("table.jobs tbody tr").count()) === listed.length);
  const row = page.locator("table.jobs tbody tr", { hasText: "Wrong" });
  assert.match(await row.innerText(), /rejected/i);
  assert.match(await row.innerText(), new RegExp(`errors: ${wrong.summary.errors}\\b`));
  const machine = await service.get(`/v1/${wrong.machine}/state`);
  const name = machine.displayName || wrong.machine.replace("machines/", "");
  await until("machines have their names", async () => (await row.locator("td").first().innerText()) === name);
  await isAccessible(page, "jobs");
  await shot(page, "jobs");
  await row.locator("a").click();

  // The program: every finding under its line, reached by a key.
  await page.locator(".source .finding").first().waitFor();
  const report = await service.get(`/v1/${wrong.name}/report`);
  const own = report.findings.filter((finding) => finding.line > 0);
  assert.ok(own.length > 0, JSON.stringify(report).slice(0, 500));
  assert.equal(await page.locator(".source .finding").count(), own.length);
  for (const finding of own) {
    assert.equal(await page.locator(".source .finding", { hasText: finding.message }).count() > 0, true, finding.message);
  }
  await page.keyboard.press("n");
  await page.locator(".source .finding[data-current]").waitFor();
  await isAccessible(page, "program");
  await shot(page, "program");
  await page.context().close();
};

/** A document of the MTConnect agent; of a stream the first one. */
const documentAt = async (path) => {
  const stop = new AbortController();
  const response = await fetch(`http://127.0.0.1:${service.ports.mtconnect}${path}`, { signal: stop.signal });
  if (!response.headers.get("content-type").startsWith("multipart/")) return response.text();
  let text = "";
  for await (const bytes of response.body.pipeThrough(new TextDecoderStream())) {
    text += bytes;
    const end = text.indexOf("</MTConnectStreams>");
    if (end >= 0) {
      stop.abort();
      return text.slice(text.indexOf("<?xml"), end + "</MTConnectStreams>".length);
    }
  }
  throw new Error(`${path} ended`);
};

/** A document, once the schema of the standard accepts it. */
const valid = async (kind, path) => {
  const text = await documentAt(path);
  const file = join(scratch, "service", "document.xml");
  writeFileSync(file, text);
  const schema = join(process.env.SCHEMAS, `MTConnect${kind}_2.5_1.0.xsd`);
  const checked = spawnSync("xmllint", ["--noout", "--nonet", "--schema", schema, file], { encoding: "utf8" });
  assert.equal(checked.status, 0, `${path}: ${checked.error ?? checked.stderr}`);
  return text;
};

/** Every kind of document of the MTConnect agent, held against the schema of the standard. */
const documents = async (state) => {
  const asked = [
    ["Devices", "/probe"], ["Devices", "/mill/probe"], ["Streams", "/current"], ["Streams", "/sample?count=10000"],
    ["Streams", "/current?path=//Linear"], ["Streams", "/current?at=20"], ["Streams", "/sample?count=-20"], ["Streams", "/mill/sample?from=1&to=30"],
    ["Streams", "/sample?interval=100&from=1&count=50"], ["Error", "/sample?from=999999999"], ["Error", "/sample?count=0"],
    ["Error", "/sample?from=first"], ["Error", "/nobody/current"], ["Error", "/asset/7"],
  ];
  for (const [kind, path] of asked) {
    const text = await valid(kind, path);
    if (path === "/mill/probe") {
      assert.match(text, /<ProcessSpecification [^>]*dataItemIdRef="mill_sdef"[^>]*>\s*<ControlLimits>/, "the limits of the run");
    }
    if (path === "/current") {
      assert.match(text, />ACTIVE<.*>Pocket</s);
      assert.ok(text.includes(`>${Math.round(state.run.overrides.feed * 1e4) / 100}<`), "the override of the run");
    }
  }
};

/** A client of the standard from PyPI, as data. */
const standardClient = async (...asked) => {
  const url = `http://127.0.0.1:${service.ports.mtconnect}`;
  const { stdout } = await promisify(execFile)(process.env.PYTHON, [join(scratch, "standard_client.py"), url, ...asked], { maxBuffer: 64 << 20, timeout: 60_000 });
  return JSON.parse(stdout);
};

/** What that client reads is what the agent and the service say. */
const standard = async (state, followed) => {
  const told = await standardClient("read");
  assert.deepEqual(told.devices.map((device) => device.uuid).sort(), ["feedwave.lathe", "feedwave.mill"]);
  const valueOf = (document, type) => document.events.filter((event) => event.type === type).map((event) => String(event.value ?? event.result));
  assert.ok(valueOf(told.current, "Execution").includes("ACTIVE"), JSON.stringify(told.current.events));
  assert.ok(valueOf(told.current, "Program").includes("Pocket"));
  assert.ok(valueOf(told.current, "LineNumber").includes(String(state.run.commanded.line)));
  assert.ok(told.current.conditions.length > 0);
  assert.ok(Number(told.sample.next) > Number(told.sample.first));
  // Each document of the stream goes on where the one before ended.
  const places = followed.map((document) => Number(document.next));
  assert.deepEqual(places, [...places].sort((a, b) => a - b));
  assert.ok(new Set(places).size > 1, `the stream went on: ${places}`);
};

/** The service goes and comes back under an open page, which says so, and since when. */
const interruption = async (state) => {
  const page = await open("/");
  const card = page.locator(`a.card[href="/${state.run.run}"]`);
  await card.waitFor();
  page.isServiceAway = true;
  await service.kill();
  await page.locator("#connection").waitFor({ state: "visible" });
  await shot(page, "lost");
  await service.start();
  await page.locator("#connection").waitFor({ state: "hidden", timeout: 60_000 });
  page.isServiceAway = false;
  await until("the run is shown as the log has it", async () =>
    (await card.locator(".state").innerText()).toLowerCase() === "interrupted");
  assert.equal((await card.locator(".override .figure").innerText()).trim(), "–", "what is not current is not shown");
  // The agent begins anew, with documents that are valid and devices that nobody is connected to.
  assert.match(await valid("Streams", "/current"), /<Availability [^>]*>UNAVAILABLE</);
  await shot(page, "interrupted");
  await page.context().close();
};

/** A service that says nothing any more, on a connection that stays: the page says so after a few heartbeats. */
const silence = async () => {
  const page = await open("/");
  await page.locator("a.card").first().waitFor();
  page.isServiceAway = true;
  service.process.kill("SIGSTOP");
  await page.locator("#connection").waitFor({ state: "visible", timeout: 60_000 });
  service.process.kill("SIGCONT");
  await page.locator("#connection").waitFor({ state: "hidden", timeout: 60_000 });
  page.isServiceAway = false;
  await page.context().close();
};

/** The page of a run follows its run while the machine shows another one. */
const hidden = async () => {
  const running = async (name, before) => {
    const job = await service.submit(join(scratch, "part.nc"), "--machine", "mill", "--display-name", name);
    const client = service.run(job.name, "--cut", "5-14:1.5");
    const state = await until(`${name} runs`, async () => {
      const state = await service.get("/v1/machines/mill/state");
      const isIt = state.run?.job === job.name && state.run.run !== before && state.run.commanded;
      return isIt && state.execution === "EXECUTION_RUNNING" ? state : null;
    });
    return { client, run: state.run.run };
  };
  const first = await running("First", "");
  const page = await open(`/${first.run}`);
  await page.locator(".run .title").waitFor();
  assert.equal(await textOf(page, ".run .title"), "First");
  const second = await running("Second", first.run);
  second.client.kill("SIGSTOP");
  assert.equal((await service.get("/v1/machines/mill/state")).otherRuns, 1);
  const board = await open("/");
  const card = board.locator(`a.card[href="/${second.run}"]`);
  await until("the card counts the other run", async () => (await card.locator(".age").innerText()).includes("+1"));
  await board.context().close();
  const facts = () => textOf(page, ".run-head .facts");
  const before = await facts();
  await until("the page goes on with its own run", async () => (await facts()) !== before);
  assert.equal(await textOf(page, ".run .title"), "First");
  assert.equal((await textOf(page, ".heading .state")).toLowerCase(), "running");
  first.client.kill("SIGKILL");
  await until("the page says that its client is gone", async () =>
    (await textOf(page, ".heading .state")).toLowerCase() === "interrupted");
  await page.context().close();
};

/** A service whose clients have to say who they are, and belong to tenants. */
const tenants = async (tools) => {
  const folder = join(scratch, "service", "tenants");
  mkdirSync(folder, { recursive: true });
  const other = new Service(folder, { all: 'roles = ["admin"]\ntenant = "*"', viewer: 'roles = ["viewer"]' });
  try {
    await other.start();
    await other.submit(join(scratch, "part.nc"), "--machine", "mill", "--display-name", "Ours");
    await other.submit(join(scratch, "part.nc"), "--machine", "mill", "--display-name", "Theirs", "--tenant", "north");
    await programs.tenants({ ...tools, service: other, open: (path, options) => open(path, options, other) });
  } finally {
    other.end();
  }
};

try {
  await service.start();
  const part = await service.submit(join(scratch, "part.nc"), "--machine", "mill", "--display-name", "Pocket");
  assert.equal(part.state, "JOB_STATE_READY", JSON.stringify(part));
  const wrong = await service.submit(join(scratch, "wrong.nc"), "--machine", "lathe", "--display-name", "Wrong");
  assert.equal(wrong.state, "JOB_STATE_REJECTED");
  const client = service.run(part.name, "--cut", "5-14:1.5");
  await until("the machine cuts, and something was decided", async () => {
    const state = await service.get("/v1/machines/mill/state");
    if (client.exitCode !== null) throw new Error(`the run ended too soon: ${client.exitCode}: ${JSON.stringify(state)}`);
    const changed = state.run?.lastDecision && state.run?.overrides?.feed !== 1;
    return state.execution === "EXECUTION_RUNNING" && state.run.commanded && changed;
  });
  const followed = await standardClient("follow");
  // From here on the machine stands still, so that the page and the service can be compared.
  client.kill("SIGSTOP");
  const state = await settled("mill");
  assert.equal(state.availability, "AVAILABILITY_AVAILABLE", JSON.stringify(state));

  browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"] });
  await documents(state);
  await standard(state, followed);
  await board(state);
  await run(state);
  await refusal();
  await jobs(wrong);
  const tools = { service, open, shot, isAccessible, scratch };
  await programs.check(tools);
  await programs.upload(tools);
  await interruption(state);
  await silence();
  await hidden();
  await tenants(tools);
  assert.deepEqual(problems, []);
  console.log(`page: every screen as the service says; screenshots in ${join(scratch, "screenshots")}`);
} finally {
  await browser?.close();
  service.end();
}
