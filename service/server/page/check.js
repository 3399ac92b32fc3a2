// A program that nobody has stored: dropped or typed, validated and drawn with every key.

import { chips } from "./chip.js";
import { drawing } from "./drawing.js";
import { editor } from "./editor.js";
import { element, inEnglish, keep, setAttribute, setLines, setText } from "./dom.js";
import { call } from "./grpc.js";
import { Path } from "./path.js";
import { read, readBytes, reasonOf } from "./api.js";
import { findingsText } from "./jobs.js";
import { isLathe, machineName, readMachines, readTools } from "./resources.js";
import { createJob } from "./upload.js";
import { bytes, duration, findingName, number, t } from "./text.js";

/** What is being written, as long as the page is open. */
const draft = { text: "", name: "", machine: "", tools: new Set(), notice: "" };

const EXAMPLE_NAME = "program.nc";

/** Bytes as a text: what is not UTF-8 is of an older editor. */
const decoded = (data) => {
  try {
    return { text: new TextDecoder("utf-8", { fatal: true }).decode(data), isForeign: false };
  } catch {
    return { text: new TextDecoder("windows-1252").decode(data), isForeign: true };
  }
};

/** Takes a file over as what is being written; whether it could be. */
export const takeFile = async (file, limits) => {
  if (file.size > limits.inlineProgramBytes) {
    draft.notice = t("checkTooLarge", { name: file.name, size: bytes(file.size), limit: bytes(limits.inlineProgramBytes) });
    return false;
  }
  const { text, isForeign } = decoded(new Uint8Array(await file.arrayBuffer()));
  Object.assign(draft, { text, name: file.name, notice: isForeign ? t("checkForeign") : "" });
  return true;
};

export const check = (place, store, parameters) => {
  let machines = [];
  let tools = [];
  let report = null;
  let interpreted = null;
  let path = new Path();
  let failure = "";
  let state = "";
  /** What the drawing lacks, as a key of the words. */
  let drawingState = "";
  let running = new AbortController();
  const stop = new AbortController();

  const title = element("h1", { class: "title" });
  const notice = element("p", { class: "notice", role: "status" });
  const machineLabel = element("label", { for: "machine" });
  const machine = element("select", { id: "machine" });
  const toolSummary = element("summary");
  const toolList = element("fieldset", { class: "tool-list" });
  const toolChoice = element("details", { class: "tool-choice" }, toolSummary, toolList);
  const choose = element("input", { type: "file", id: "file", class: "unseen" });
  const chooseLabel = element("label", { class: "view", for: "file" });
  const create = element("button", { type: "button" });
  const bar = element("div", { class: "tools" }, machineLabel, machine, toolChoice, choose, chooseLabel, create);
  const previous = element("button", { type: "button", onclick: () => source.step(-1) });
  const next = element("button", { type: "button", onclick: () => source.step(1) });
  const count = element("span", { class: "count", role: "status" });
  const steps = element("div", { class: "tools" }, previous, next, count);
  const keys = element("p", { class: "keys" });
  const overview = element("dl", { class: "facts" });
  const chipPictures = chips();
  const picture = drawing({
    onPoint: (line) => source.point(line),
    onChoose: (line) => source.go(line),
  });
  const source = editor({
    onEdit: (text) => {
      draft.text = text;
      begin();
    },
    onLine: (line) => picture.mark(line),
  });
  const written = element("div", { class: "written" }, steps, source.root, keys);
  place.append(title, bar, notice, element("div", { class: "side-by-side" }, written, picture.root), overview, chipPictures.root);

  const chosenMachine = () => machines.find((one) => one.name === draft.machine);

  const drawFacts = () => {
    const summary = report?.summary;
    const facts = !summary ? [] : [
      [t("findings"), findingsText(summary)],
      [t("duration"), Number(summary.errors) > 0 ? "–" : duration(summary.durationS)],
      [t("cuttingTime"), Number(summary.errors) > 0 ? "–" : duration(summary.cuttingTimeS)],
      [t("path"), Number(summary.errors) > 0 ? "–" : `${number(summary.pathLengthMm, 1)} mm`],
      [t("sections"), number(summary.sectionCount)],
      [t("lines"), number(summary.lines)],
    ];
    keep(
      overview, facts, ([name]) => name, () => element("div", {}, element("dt"), element("dd")),
      (row, [name, value]) => {
        setText(row.firstChild, name);
        setText(row.lastChild, value);
      },
    );
  };

  const draw = () => {
    setText(title, t("checkTitle"));
    setText(machineLabel, t("machine"));
    const used = [...draft.tools].length;
    setText(toolSummary, used === 0 ? t("toolsAny") : t("toolsSome", { count: used }));
    setText(chooseLabel, t("choose"));
    setText(create, t("createJob"));
    setAttribute(create, "hidden", !store.mayPlan());
    setAttribute(create, "disabled", draft.text === "" || draft.machine === "");
    setText(previous, t("previous"));
    setText(next, t("next"));
    const found = source.count();
    for (const button of [previous, next]) setAttribute(button, "disabled", found === 0);
    setText(count, failure ? "" : draft.text.trim() === "" ? "" : state || (found === 0 ? t("noFindings") : t("foundCount", { count: number(found) })));
    const elsewhere = (report ?? interpreted)?.findings.filter((finding) => finding.file || !finding.line) ?? [];
    const words = [failure, draft.notice, draft.text === "" ? t("checkEmpty") : ""].filter(Boolean).map((line) => (typeof line === "function" ? line() : [line]));
    setLines(notice, [...words, ...elsewhere.map((finding) => [`${findingName(finding)}: `, inEnglish(finding.message)])]);
    setAttribute(notice, "hidden", notice.textContent === "");
    setText(keys, t("editorKeys"));
    source.draw();
    picture.draw(drawingState && t(drawingState));
    chipPictures.draw(report);
    drawFacts();
  };

  /** Reads what the program does, and draws it. */
  const interpret = async (request, signal) => {
    const drawn = new Path();
    const enough = new AbortController();
    signal.addEventListener("abort", () => enough.abort());
    let last = null;
    try {
      await call("Programs/Interpret", request, {
        signal: enough.signal,
        onMessage: (message) => {
          last = message;
          if (!message.actions.every((action) => drawn.add(action))) enough.abort();
        },
      });
    } catch (error) {
      if (!drawn.isCut) throw error;
    }
    return { drawn, findings: last?.findings ?? [] };
  };

  /** Validates and draws the text as it is; what was begun for an older one ends. */
  const begin = async () => {
    running.abort();
    running = new AbortController();
    const { signal } = running;
    if (draft.machine === "" || draft.text === "") {
      [report, interpreted, state, drawingState] = [null, null, "", ""];
      if (draft.machine !== "") failure = "";
      path = new Path();
      source.setFindings([]);
      picture.show(path, isLathe(chosenMachine()), "");
      draw();
      return;
    }
    state = t("checking");
    const inlineProgram = new TextEncoder().encode(draft.text);
    if (inlineProgram.length > store.limits().inlineProgramBytes) {
      failure = t("checkTooLarge", { name: draft.name || EXAMPLE_NAME, size: bytes(inlineProgram.length), limit: bytes(store.limits().inlineProgramBytes) });
      draw();
      return;
    }
    const request = { inlineProgram, machine: draft.machine, tools: [...draft.tools] };
    const drawn = interpret(request, signal);
    // Who may not have it validated is told what the interpreter found.
    const validated = store.mayPlan() ? call("Jobs/ValidateProgram", request, { signal }) : Promise.resolve(null);
    try {
      const [interpretation, validation] = await Promise.all([drawn, validated]);
      if (signal.aborted) return;
      path = interpretation.drawn;
      interpreted = interpretation;
      report = validation?.report ?? null;
      failure = validation || store.mayPlan() ? "" : t("checkViewer");
      const findings = (report ?? interpreted).findings.filter((finding) => finding.line && !finding.file);
      state = "";
      const hasErrors = findings.some((finding) => finding.severity === "SEVERITY_ERROR");
      source.setFindings(findings.sort((a, b) => a.line - b.line || a.column - b.column));
      drawingState = hasErrors ? "drawnToError" : "";
      picture.show(path, isLathe(chosenMachine()), drawingState && t(drawingState));
    } catch (error) {
      if (signal.aborted) return;
      running.abort();
      [failure, state] = [() => [t("checkFailed", { reason: "" }), reasonOf(error)], ""];
    }
    draw();
  };

  const drawChoices = () => {
    machine.replaceChildren(...machines.map((one) => element("option", { value: one.name }, machineName(one))));
    machine.value = draft.machine;
    toolList.replaceChildren(
      element("legend", { class: "unseen" }, t("tools")),
      ...tools.map((tool) => {
        const box = element("input", { type: "checkbox", value: tool.name, checked: draft.tools.has(tool.name) });
        box.addEventListener("change", () => {
          if (box.checked) draft.tools.add(tool.name);
          else draft.tools.delete(tool.name);
          begin();
          draw();
        });
        return element("label", {}, box, `T${tool.number} ${tool.displayName || tool.name.replace("tools/", "")}`);
      }),
    );
    setAttribute(toolChoice, "hidden", tools.length === 0);
  };

  const show = () => {
    source.setText(draft.text);
    begin();
    draw();
  };

  const readJob = async (name) => {
    const job = await read(`/v1/${name}`, stop.signal);
    const size = Number(job.programBytes);
    const limit = store.limits().inlineProgramBytes;
    if (size > limit) {
      draft.notice = t("checkTooLarge", { name: job.displayName, size: bytes(size), limit: bytes(limit) });
      return;
    }
    const { text, isForeign } = decoded(size > 0 ? await readBytes(`/v1/${job.program}`, stop.signal) : new Uint8Array(0));
    const used = (job.settings?.tools ?? []).map((tool) => tool.name).filter(Boolean);
    Object.assign(draft, { text, name: job.displayName, machine: job.machine, tools: new Set(used), notice: isForeign ? t("checkForeign") : "" });
  };

  const start = async () => {
    try {
      [machines, tools] = await Promise.all([readMachines(stop.signal), readTools(stop.signal), store.known]);
      const job = parameters.get("job");
      if (job) {
        await readJob(job);
        history.replaceState(null, "", "/check");
      }
      if (!chosenMachine()) draft.machine = machines[0]?.name ?? "";
    } catch (error) {
      if (stop.signal.aborted) return;
      failure = () => [t("failed", { reason: "" }), reasonOf(error)];
    }
    drawChoices();
    show();
  };

  machine.addEventListener("change", () => {
    draft.machine = machine.value;
    begin();
  });
  const take = async (file) => {
    if (await takeFile(file, store.limits())) show();
    else draw();
  };
  choose.addEventListener("change", () => {
    if (choose.files[0]) take(choose.files[0]);
    choose.value = "";
  });
  create.addEventListener("click", async () => {
    setAttribute(create, "disabled", true);
    try {
      const file = new File([draft.text], draft.name || EXAMPLE_NAME);
      const job = await createJob(file, { machine: draft.machine, tools: [...draft.tools], limits: store.limits(), signal: stop.signal });
      store.go(`/${job.name}`);
    } catch (error) {
      failure = () => [t("checkFailed", { reason: "" }), reasonOf(error)];
      draw();
    }
  });
  draw();
  start();
  return {
    draw,
    drop: (files) => take(files[0]),
    end: () => {
      stop.abort();
      running.abort();
      source.end();
      picture.end();
    },
  };
};
