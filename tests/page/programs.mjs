// Programs on the page: what is typed, dropped or chosen is validated and drawn and not stored; what planners drop on the jobs
// becomes one; who sees all tenants chooses one.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";

import { until } from "./service.mjs";

const text = (page, selector) => page.locator(selector).innerText();

/** Lets a file fall on something, as from a folder of the desktop. */
const drop = async (page, selector, name, content) => {
  const data = await page.evaluateHandle(([file, body]) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([body], file));
    return transfer;
  }, [name, content]);
  for (const event of ["dragover", "drop"]) await page.dispatchEvent(selector, event, { dataTransfer: data });
};

/** Colours that a part of the drawing has, as `r,g,b`, with how many points have them. */
const colors = (page) => page.locator(".path-canvas").evaluate((canvas) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const counts = {};
  for (let at = 0; at < data.length; at += 4) {
    if (data[at + 3] === 255) {
      const key = [data[at], data[at + 1], data[at + 2]].join(",");
      counts[key] = (counts[key] ?? 0) + 1;
    }
  }
  return counts;
});
/** A colour of the page as the canvas has it. */
const colorOf = (page, name) => page.evaluate((variable) => {
  const hex = getComputedStyle(document.documentElement).getPropertyValue(variable).trim();
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16)).join(",");
}, name);

/** What the page reads by gRPC-Web is to the last bit what the command says, and its chips are those of the report. */
const messages = async (page, scratch) => {
  for (const [file, machine] of [["shaft.nc", "lathe"], ["thread.nc", "lathe"], ["part.nc", "mill"], ["wrong.nc", "lathe"]]) {
    const path = join(scratch, file);
    const command = spawnSync(process.env.FEEDWAVE_BINARY, ["validate", path, "--format", "json", "--machine-kind", machine], { maxBuffer: 64 << 20 });
    const [report, chips] = await page.evaluate(async ([program, name]) => {
      const { call } = await import("/page/grpc.js");
      const { cutsOf, thickness } = await import("/page/chip.js");
      const request = { inlineProgram: new TextEncoder().encode(program), machine: `machines/${name}` };
      const { report: read } = await call("Jobs/ValidateProgram", request);
      const largest = (cut) => Math.max(...Array.from({ length: 20_000 }, (_, step) => thickness(cut, step / 1000)));
      const cuts = read.sections.map((section) => [largest(cutsOf(section)[0]), section.chip.largestThicknessMm]);
      return [JSON.stringify(read), cuts];
    }, [readFileSync(path, "utf8"), machine]);
    assert.deepEqual(JSON.parse(report), JSON.parse(command.stdout), file);
    for (const [drawn, said] of chips) assert.ok(Math.abs(drawn - said) < 1e-4 * said, `${file}: ${drawn} is not ${said}`);
  }
};

/** What is dropped or typed is validated and drawn. */
export const check = async ({ service, open, shot, isAccessible, scratch }) => {
  const before = (await service.get("/v1/jobs")).jobs.length;
  const shaft = readFileSync(join(scratch, "shaft.nc"), "utf8");
  const page = await open("/");
  // A program that is dropped anywhere is checked.
  await drop(page, "main", "shaft.nc", shaft);
  await page.locator(".editor-text").waitFor();
  assert.equal(new URL(page.url()).pathname, "/check");
  await page.locator("#machine").selectOption("machines/lathe");
  const line = shaft.split("\n").findIndex((one) => one.startsWith("G200")) + 1;
  await page.locator(`.editor-line[data-line="${line}"] .editor-note`).waitFor();
  assert.match(await text(page, `.editor-line[data-line="${line}"] .editor-note`), /VIB-CHIP-UNBROKEN/);
  // Arcs are drawn as arcs, and what vibrates in a colour of its own.
  const seen = await colors(page);
  for (const name of ["--trace", "--vibrating"]) assert.ok(seen[await colorOf(page, name)] > 100, `${name} is not in the drawing`);
  assert.match(await text(page, ".legend"), /cut with vibration: \d/);
  assert.equal(await page.locator(".chip figure").count(), 2, "the programmed chip, and the suggested one");
  assert.match(await text(page, ".chip figure:nth-of-type(1)"), /no amplitude breaks the chip/);
  assert.match(await text(page, ".chip figure:nth-of-type(2)"), /the chip breaks/);
  // The line of the cursor is marked in both.
  const marked = await colorOf(page, "--marked");
  assert.equal(seen[marked] ?? 0, 0, "the first line moves nothing");
  const area = page.locator(".editor-text");
  await area.focus();
  await page.keyboard.press("F8");
  await page.locator(".editor-finding .cure").first().waitFor();
  await page.keyboard.press("ArrowDown");
  await until("the move of the line is marked", async () => (await colors(page))[marked] > 20);
  await page.keyboard.press("ArrowUp");
  await isAccessible(page, "check");
  await page.screenshot({ path: join(scratch, "screenshots", "check.png"), fullPage: true });
  // Its cure, by the keyboard, and taken back.
  await page.locator(".editor-finding .cure").first().waitFor();
  await page.keyboard.press("Alt+Enter");
  await page.locator(".editor-note").waitFor({ state: "detached" });
  assert.match(await area.inputValue(), /^G200 F41\.667 A0\.05$/m);
  await until("only the programmed chip is left", async () => (await page.locator(".chip figure").count()) === 1);
  assert.match(await text(page, ".chip"), /2\.500 vibrations per revolution: the chip breaks/);
  assert.equal(await page.locator(".editor-note").count(), 0);
  await page.keyboard.press("Control+z");
  await page.locator(`.editor-line[data-line="${line}"] .editor-note`).waitFor();
  assert.equal(await area.inputValue(), shaft);
  await messages(page, scratch);
  await page.locator(".path-canvas").focus();
  const drawn = JSON.stringify(await colors(page));
  await page.keyboard.press("2");
  await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("+");
  await until("the drawing has turned", async () => JSON.stringify(await colors(page)) !== drawn);
  // What takes long is cancelled by the next key, here and at the service: days of machining, by which it is busy until then.
  const long = `G21 G90 G94\nM3 S2000\nG0 X0 Z0\n${"G1 Z-40 F0.5\nG1 Z0\n".repeat(100)}M30\n`;
  const ended = [];
  page.on("requestfailed", (request) => ended.push(`${new URL(request.url()).pathname} ${request.failure().errorText}`));
  const active = async () => (await service.get("/v1/state")).activeValidations;
  await area.fill(long);
  await until("the service validates it", async () => (await active()) > 0);
  await area.fill("G21 G90 G94\nX1O.5\nM30\n");
  await page.locator('.editor-line[data-line="2"] .editor-note').waitFor();
  assert.ok(ended.includes("/feedwave.v1.Jobs/ValidateProgram net::ERR_ABORTED"), `${ended}`);
  await until("the service has ended what nobody waits for", async () => (await active()) === 0);
  assert.equal((await service.get("/v1/jobs")).jobs.length, before, "nothing is stored");
  await page.locator("#language").click();
  await page.locator("#theme").click();
  await page.locator("#theme").click();
  await isAccessible(page, "check, dark and German");
  await shot(page, "check-dark-german");
  await page.context().close();
};

/** Programs become jobs; a large one over the stream of uploads. */
export const upload = async ({ service, open, shot, isAccessible, scratch }) => {
  const page = await open("/jobs");
  await page.locator(".drop").waitFor();
  const large = `${"(A COMMENT THAT MAKES THE PROGRAM LONG)\n".repeat(40_000)}G21\nG0 X10\nM30\n`;
  await drop(page, ".drop", "part-1.nc", readFileSync(join(scratch, "part.nc"), "utf8"));
  await drop(page, ".drop", "large.nc", large);
  await page.locator("#drop-machine option").first().waitFor({ state: "attached" });
  await page.locator("#drop-machine").selectOption("machines/mill");
  await page.locator(".drop .tools:last-of-type button").click();
  await until("both are jobs", async () => (await page.locator(".drop-files a[href^='/jobs/']").count()) === 2);
  await isAccessible(page, "upload");
  await shot(page, "upload");
  const { jobs } = await service.get("/v1/jobs");
  const made = jobs.filter((job) => ["part-1.nc", "large.nc"].includes(job.displayName));
  assert.deepEqual(made.map((job) => job.machine), ["machines/mill", "machines/mill"]);
  assert.equal(Number(made.find((job) => job.displayName === "large.nc").programBytes), large.length);
  // From a job to a copy of its program.
  await page.goto(`${service.url}/${made.find((job) => job.displayName === "part-1.nc").name}`);
  await page.locator(".legend li").first().waitFor();
  assert.match(await text(page, ".legend"), /cut: 10/);
  await page.locator('.source-line[data-line="6"]').hover();
  await until("the line under the pointer is marked in the drawing", async () =>
    (await page.locator(".path-canvas").getAttribute("data-line")) === "6");
  await page.locator("a.view", { hasText: "Edit a copy" }).click();
  await until("the copy is there", async () => (await page.locator(".editor-text").inputValue()).includes("X60 F600"));
  await page.context().close();
};

/** A service with tenants: who sees all of them chooses one; a viewer validates nothing, and is told so. */
export const tenants = async ({ service, open, shot, isAccessible, scratch }) => {
  const page = await open("/jobs");
  await page.locator("#token").fill(service.tokens.all);
  await page.keyboard.press("Enter");
  await page.locator("#tenant").waitFor();
  const named = (job) => page.locator("table.jobs th a", { hasText: job });
  await named("Ours").waitFor();
  assert.equal(await named("Theirs").count(), 0);
  await page.locator("#tenant").fill("north");
  await page.keyboard.press("Enter");
  await named("Theirs").waitFor();
  assert.equal(await named("Ours").count(), 0);
  await isAccessible(page, "tenant");
  await shot(page, "tenant");
  await page.context().close();
  const viewer = await open("/check");
  await viewer.locator("#token").fill(service.tokens.viewer);
  await viewer.keyboard.press("Enter");
  await viewer.locator("#machine option").first().waitFor({ state: "attached" });
  assert.equal(await viewer.locator("#tenant").isVisible(), false);
  await viewer.locator(".editor-text").fill(readFileSync(join(scratch, "wrong.nc"), "utf8"));
  await viewer.locator(".editor-note").first().waitFor();
  assert.match(await text(viewer, ".notice"), /role planner/);
  assert.equal(await viewer.locator("button", { hasText: "Create job" }).isVisible(), false);
  await viewer.context().close();
};
